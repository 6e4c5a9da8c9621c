"""The face's figures: click on Stop to pins off in a real browser; what ten pages cost, and whether the guard notices.

    ./run python benchmarks/face.py stop [--clicks 100] [--seconds 200] [--add]
    ./run python benchmarks/face.py load [--pages 10] [--seconds 30]

A real guard, the real serial drive, a simulated PIC whose pins are read, the real dashboard; only eyes and voice are
made up (face_eyes.py, tests/safety/zoo). Results go to benchmarks/results/face_stop.json and face_load.json.
`--add` takes the clicks of the last result along, so that a long measurement can be made in pieces.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
sys.path[:0] = [str(ROOT / "tests" / "safety"), str(ROOT / "tests" / "safety" / "zoo")]

from websockets.sync.client import connect  # noqa: E402

from chairward.durations import percentiles_ms  # noqa: E402

CHAIR = """
name = "zoo"
kind = "simulator"
[footprint]
front_mm = 450
rear_mm = 450
half_width_mm = 300
[limits]
supervisor_freshness_ms = 500
[lane.front]
source = "face_ticks"
stages = ["face_eyes"]
freshness_ms = 250
covers = ["ahead", "left", "right"]
[lane.voice]
source = "voice_citizen"
freshness_ms = 400
settings.voice_citizen = { period_ms = 50, word_ms = 400 }
[lane.screen]
source = "dashboard"
stop_device = true
observes = true
may = ["stop", "arm", "reset"]
freshness_ms = 500
settings.dashboard = { port = 0 }
[drive.pic_serial]
port = "{run}/pic"
[companion.pic]
component = "sim_pic"
"""
PANES = ("left", "right", "obstacle", "disparity")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


def install(folder: Path) -> None:
    """Both made-up plugins, as installed distributions, here and for the processes of the run."""
    import chairward_zoo

    chairward_zoo.install(folder)
    info = folder / "face_eyes-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: face-eyes\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[chairward.plugins]\nface_eyes = face_eyes\n")
    shutil.copy(ROOT / "benchmarks" / "face_eyes.py", folder)
    os.environ["PYTHONPATH"] = str(folder)
    sys.path.insert(0, str(folder))


@contextmanager
def chair() -> Iterator[tuple[Any, str]]:
    """A running chair and the address of its screen."""
    from rig import load, running

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        install(folder / "plugins")
        with running(load(folder, CHAIR), folder / "run", until_driving=False) as rig:
            url = folder / "run" / "screen.url"
            rig.wait(url.exists, "the screen")
            rig.wait(lambda: len(rig.records) > 10, "the guard")
            yield rig, url.read_text().strip()


# ---- Stop -----------------------------------------------------------------------------------------------------------


def stops(clicks: int, seconds: float) -> list[int]:
    """Nanoseconds from the browser's pointerdown on Stop to the pins that no longer drive, one a click."""
    from playwright.sync_api import sync_playwright
    from rig import stamped_duty

    took: list[int] = []
    wall_ns = time.time_ns() - time.monotonic_ns()
    end = time.monotonic() + seconds
    with chair() as (rig, url), sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=shutil.which("chromium"), headless=True, args=QUIET)
        tab = browser.new_page()
        tab.goto(url)
        tab.evaluate("addEventListener('pointerdown', () => { window.pressedAt = Date.now(); }, { capture: true })")
        pins = rig.run_dir / "pins"
        while len(took) < clicks and time.monotonic() < end:
            while not rig.driving():
                for button in ("reset", "arm"):
                    if tab.get_attribute(f"#{button}", "aria-disabled") == "false":
                        tab.evaluate(f"document.getElementById('{button}').click()")
                tab.wait_for_timeout(30)
            off_ns, found = [0], threading.Event()

            def watch(off_ns: list[int] = off_ns, found: threading.Event = found) -> None:
                while not found.is_set():
                    at_ns, duty = stamped_duty(pins)
                    if duty == 0.0:
                        off_ns[0] = int(at_ns)
                        found.set()
                    time.sleep(0.0005)

            watcher = threading.Thread(target=watch)
            watcher.start()
            tab.click("#stop")
            pressed_ns = int(tab.evaluate("window.pressedAt") * 1e6)
            found.wait(5.0)
            found.set()
            watcher.join()
            if off_ns[0] + wall_ns >= pressed_ns:  # else the chair had stopped for another reason before the click
                took.append(off_ns[0] + wall_ns - pressed_ns)
        browser.close()
    return took


def measure_stops(options: argparse.Namespace) -> None:
    file = RESULTS / "face_stop.json"
    before = json.loads(file.read_text())["clicks_ns"] if options.add and file.exists() else []
    took = [*before, *stops(options.clicks, options.seconds)]
    write(file, {"click_to_pins_off_ms": percentiles_ms(took), "clicks_ns": took})


# ---- load -----------------------------------------------------------------------------------------------------------


def page(address: str, seconds: float, *, controls: bool) -> None:
    """One page: all four pictures at their rate, acknowledged; prints what it got."""
    end, bundles, pictures, size, beat = time.monotonic() + seconds, 0, 0, 0, 0.0
    with connect(f"ws://{address}/ws", origin=f"http://{address}", compression=None, max_size=None) as link:
        link.send(json.dumps({"t": "look", "panes": PANES}))
        if controls:
            link.send(json.dumps({"t": "take"}))
        while (now := time.monotonic()) < end:
            if now - beat > 0.1:
                beat = now
                link.send(json.dumps({"t": "beat", "at_ms": now * 1000.0}))
            data = link.recv(5.0)
            head = json.loads(data[4 : 4 + int.from_bytes(data[:4], "big")])
            link.send(json.dumps({"t": "got", "n": head["n"]}))
            bundles, pictures, size = bundles + 1, pictures + len(head["panes"]), size + len(data)
    print(json.dumps({"bundles": bundles, "pictures": pictures, "bytes": size}), flush=True)


def cpu_s(pid: int) -> float:
    """CPU time that a process has used, all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def phase(rig: Any, address: str, pages: int, seconds: float) -> dict[str, Any]:
    """With so many pages: the screen's lane as a share of a core, the guard's lateness, what the pages got."""
    command = [sys.executable, __file__, "page", "--address", address, "--seconds", str(seconds + 4.0)]
    clients = [
        subprocess.Popen([*command, *(["--controls"] if nth == 0 else [])], stdout=subprocess.PIPE, text=True)
        for nth in range(pages)
    ]
    time.sleep(4.0)
    pid = rig.pid("screen")
    began, before, since = rig.records[-1].facts.now_ns, cpu_s(pid), time.monotonic()
    time.sleep(seconds - 2.0)
    share = (cpu_s(pid) - before) / (time.monotonic() - since)
    records = [r for r in list(rig.records) if r.facts.now_ns > began]
    got = [json.loads(client.communicate()[0]) for client in clients]
    each = seconds + 4.0
    return {
        "pages": pages,
        "lane_percent_of_a_core": round(100.0 * share, 1),
        "guard_tick_lateness_ms": percentiles_ms([r.woke_ns - r.due_ns for r in records if r.periodic]),
        "records_missed": sum(r.missed for r in records),
        "bundles_a_second_each": round(sum(g["bundles"] for g in got) / max(1, len(got)) / each, 1),
        "pictures_a_second_each": round(sum(g["pictures"] for g in got) / max(1, len(got)) / each, 1),
        "bytes_a_second_each": round(sum(g["bytes"] for g in got) / max(1, len(got)) / each),
    }


def measure_load(options: argparse.Namespace) -> None:
    with chair() as (rig, url):
        address = url.removeprefix("http://").removesuffix("/")
        rows = [phase(rig, address, pages, options.seconds) for pages in (0, options.pages, 0, options.pages)]
    write(RESULTS / "face_load.json", {"picture_px": [320, 240], "pictures": 4, "phases": rows})


def write(file: Path, result: dict[str, Any]) -> None:
    machine = {"python": platform.python_version(), "cores": os.cpu_count(), "load_average": os.getloadavg()[0]}
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps({**result, **machine}, indent=1) + "\n")
    print(json.dumps({k: v for k, v in {**result, **machine}.items() if k != "clicks_ns"}, indent=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_subparsers(dest="what", required=True)
    stop = what.add_parser("stop")
    stop.add_argument("--clicks", type=int, default=100)
    stop.add_argument("--seconds", type=float, default=200.0)
    stop.add_argument("--add", action="store_true")
    load = what.add_parser("load")
    load.add_argument("--pages", type=int, default=10)
    load.add_argument("--seconds", type=float, default=30.0)
    one = what.add_parser("page")
    one.add_argument("--address", required=True)
    one.add_argument("--seconds", type=float, required=True)
    one.add_argument("--controls", action="store_true")
    options = parser.parse_args()
    if options.what == "stop":
        measure_stops(options)
    elif options.what == "load":
        measure_load(options)
    else:
        page(options.address, options.seconds, controls=options.controls)


if __name__ == "__main__":
    main()
