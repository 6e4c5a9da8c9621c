"""The simulated chair driven through its screen in a real browser: armed, a spoken word, Stop, and the page lost."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
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
    pytest.mark.timeout(900),
]
SCREENSHOTS = Path(__file__).resolve().parents[3] / "docs" / "screenshots"
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


LOAD_MS = 120_000
HOME = Path(__file__).resolve().parents[3] / "plugins/simulator/src/chairward_simulator/home.toml"
TOUR = """
[[tour]]
do = "drive_until"
stopped_by = "cardboard box"

[[tour]]
do = "say"
word = "back"
"""


def short_home(folder: Path) -> Path:
    """The simulated flat, with a box 2 m ahead, nobody walking, and a person who drives to the box and backs off."""
    text = HOME.read_text(encoding="utf-8").partition("# What the person in the chair sets out to do")[0]
    text = re.sub(r"(?m)^x_mm = 2500$", "x_mm = 6900", text)
    text = re.sub(r"(?m)^walks_when_chair_beyond_x_mm = .*$", "walks_when_chair_beyond_x_mm = 11000", text)
    file = folder / "home.toml"
    file.write_text(text + 20 * TOUR, encoding="utf-8")
    return file


@pytest.fixture
def run(tmp_path: Path) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """A running chair: the screen's address, and how to end the run and get its summary."""
    home = short_home(tmp_path)
    with socket.socket() as free:  # the same port for the run that another person's profile begins
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = [f"dashboard.port={port}", f"sim_home.home={home}", f"sim_cameras.home={home}"]
    options = ["--chair", "screen", "--headless", "--json", "--no-record"]
    process = subprocess.Popen(
        [sys.executable, "-m", "chairward", "run", *options, *(part for s in settings for part in ("--set", s))],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )

    def finish() -> dict[str, Any]:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
        assert out, err
        return dict(json.loads(out))

    try:
        end = time.monotonic() + 300.0
        while not (found := list(tmp_path.glob("chairward-*/screen.url"))):
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < end, "the screen was not there within 300 s"
            time.sleep(0.1)
        yield found[0].read_text().strip(), finish
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=120)


def drive_until(tab: Any, condition: str, within_s: float = 200.0) -> None:
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


NEAR = "/Too near|Slower towards/.test(document.getElementById('stops').textContent)"
BACKING = "/^\\u2066-\\d+ /.test(document.getElementById('speed').textContent)"
DRIVING = "/^\\u2066[1-9]\\d\\d /.test(document.getElementById('speed').textContent)"


def test_the_demo_is_driven_through_the_page_to_a_stop_and_back_out_and_stops_with_the_page(
    run: tuple[str, Callable[[], dict[str, Any]]], page_at: Callable[..., Any]
) -> None:
    """P1: a Stop on the page and the loss of the page stop the chair."""
    url, finish = run
    with playwright.sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=CHROMIUM, headless=True, args=QUIET)
        tab = browser.new_context(viewport={"width": 1180, "height": 900}).new_page()
        tab.set_default_timeout(LOAD_MS)
        tab.goto(url)
        drive_until(tab, DRIVING)
        assert "front = front" in tab.inner_text("#heard").replace("\u2066", "").replace("\u2069", "")
        if os.environ.get("CHAIRWARD_SCREENSHOTS") == "1":
            keep(tab.screenshot(full_page=True), SCREENSHOTS / "drive.png")
        drive_until(tab, NEAR)
        drive_until(tab, BACKING)
        drive_until(tab, DRIVING)
        tab.keyboard.press("Space")
        drive_until(tab, "document.getElementById('stops').textContent.includes('STOP was pressed')")
        drive_until(tab, DRIVING)
        watching = page_at(url.removeprefix("http://").removesuffix("/"))
        tab.close()
        state = watching.bundle_until(lambda head: head["state"]["standing"], within_s=30.0)["state"]
        assert any(row["name"] == "screen/dashboard" and row["state"] != "well" for row in state["sources"])
        state = watching.bundle_until(lambda head: bool(head["state"]["latch"]), within_s=30.0)["state"]
        assert not state["armed"]
        watching.close()
        browser.close()
    result = finish()
    assert "STOP was pressed (screen/dashboard)" in result["latched"]
    assert any(latch.startswith("screen/dashboard: ") for latch in result["latched"])
    assert result["protective_stops"]
    assert {"front", "back"} <= {
        wish["command"] if isinstance(wish, dict) else wish for wish in result["commands_obeyed"]
    }
    assert result["driven_m"] > 0.0
    assert result["missed_records"] == 0


def test_another_person_is_chosen_on_the_page_and_the_chair_begins_again_with_that_profile(
    run: tuple[str, Callable[[], dict[str, Any]]],
) -> None:
    url, finish = run
    with playwright.sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=CHROMIUM, headless=True, args=QUIET)
        tab = browser.new_page()
        tab.set_default_timeout(LOAD_MS)
        tab.goto(f"{url}person")
        end = time.monotonic() + 150.0
        tab.click("#people label:has-text('careful')")
        while not tab.evaluate("document.getElementById('choose').getAttribute('aria-disabled') === 'false'"):
            assert time.monotonic() < end, tab.inner_text("main")
            tab.wait_for_timeout(100)
        with tab.expect_event("load", timeout=240_000):  # the page finds the new run, and loads itself again
            tab.click("#choose")
        browser.close()
    result = finish()
    assert [run["ended"] for run in result["before"]] == ["a screen asked for it"]
    assert [run["person"] for run in (*result["before"], result)] == ["demo", "careful"]
