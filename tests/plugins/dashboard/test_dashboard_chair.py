"""The simulated chair driven through its screen in a real browser: armed, a spoken word, Stop, and the page lost."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (uv sync)")
CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(CHROMIUM is None, reason="needs a browser: apt-get install chromium"),
    pytest.mark.timeout(420),
]
SCREENSHOTS = Path(__file__).resolve().parents[3] / "docs" / "screenshots"
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """A running chair: the screen's address, and how to end the run and get its summary."""
    options = ["--chair", "screen", "--headless", "--json", "--no-record", "--set", "dashboard.port=0"]
    process = subprocess.Popen(
        [sys.executable, "-m", "chairward", "run", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    end = time.monotonic() + 120.0
    while not (found := list(tmp_path.glob("chairward-*/screen.url"))):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < end, "the screen was not there within 120 s"
        time.sleep(0.1)

    def finish() -> dict[str, Any]:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        assert out, err
        return dict(json.loads(out))

    yield found[0].read_text().strip(), finish
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


def drive_until(tab: Any, condition: str, within_s: float = 150.0) -> None:
    """As a person would: reset and arm whenever the page offers it, until a JavaScript expression is true."""
    end = time.monotonic() + within_s
    while not tab.evaluate(condition):
        assert time.monotonic() < end, f"not true: {condition}; the page says: {tab.inner_text('main')}"
        for button in ("reset", "arm"):
            if tab.get_attribute(f"#{button}", "aria-disabled") == "false":
                tab.evaluate(f"document.getElementById('{button}').click()")
        tab.wait_for_timeout(200)


def keep(png: bytes, path: Path) -> None:
    """Write a screenshot with 32 steps a colour: camera pictures make PNG files large."""
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    few = np.where(image >= 0xF8, 255, (image & 0xF8) | 3).astype(np.uint8)
    cv2.imwrite(str(path), few, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert path.stat().st_size < 300_000


DRIVING = "/^\\u2066[1-9]\\d\\d /.test(document.getElementById('speed').textContent)"


def test_p1_stop_on_the_page_and_the_loss_of_the_page_stop_the_chair(
    run: tuple[str, Callable[[], dict[str, Any]]], page_at: Callable[..., Any]
) -> None:
    url, finish = run
    with playwright.sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=CHROMIUM, headless=True, args=QUIET)
        tab = browser.new_context(viewport={"width": 1180, "height": 900}).new_page()
        tab.goto(url)
        drive_until(tab, DRIVING)
        if os.environ.get("CHAIRWARD_SCREENSHOTS") == "1":
            keep(tab.screenshot(full_page=True), SCREENSHOTS / "drive.png")
        tab.keyboard.press("Space")
        stopped = "document.getElementById('reasons').textContent.includes('STOP was pressed (screen/dashboard)')"
        while not tab.evaluate(stopped.replace(" (screen/dashboard)", "")):
            tab.wait_for_timeout(50)
        drive_until(tab, DRIVING)
        watching = page_at(url.removeprefix("http://").removesuffix("/"))
        tab.close()
        state = watching.bundle_until(lambda head: head["state"]["standing"])["state"]
        assert any(row["name"] == "screen/dashboard" and row["state"] != "well" for row in state["sources"])
        state = watching.bundle_until(lambda head: bool(head["state"]["latch"]))["state"]
        assert not state["armed"]
        watching.close()
        browser.close()
    result = finish()
    assert "STOP was pressed (screen/dashboard)" in result["latched"]
    assert any(latch.startswith("screen/dashboard: ") for latch in result["latched"])
    assert result["driven_m"] > 0.0
    assert result["missed_records"] == 0
