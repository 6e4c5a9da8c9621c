"""Ten pages at 15 fps, four pictures of 320 x 240 each: the server's share of a core, and how long a Stop takes.

    python plugins/dashboard/benchmarks/load.py [--pages 10] [--seconds 20]

The pages run in a process of their own; the server's thread is measured alone (its own CPU time).
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np
from websockets.sync.client import connect

from chairward import frames, records, wire
from chairward.components import Context
from chairward.facts import Decision, Facts, State
from chairward.messages import Alive, Button, DriveStatus, Press, RangeReading
from chairward.stages import Pane
from chairward_dashboard.settings import DashboardSettings
from chairward_dashboard.source import Dashboard

PANES = ("left", "right", "obstacle", "disparity")


def page(address: str, seconds: float, *, stops: bool) -> None:
    """One page: looks at all four pictures, acknowledges, beats, prints what it got. stops: presses Stop as well."""
    end, bundles, pictures, size = time.monotonic() + seconds, 0, 0, 0
    beat = stop = 0.0
    with connect(f"ws://{address}/ws", origin=f"http://{address}", compression=None, max_size=None) as link:
        link.send(json.dumps({"t": "look", "panes": PANES}))
        if stops:
            link.send(json.dumps({"t": "take"}))
        while (now := time.monotonic()) < end:
            if now - beat > 0.1:
                beat = now
                link.send(json.dumps({"t": "beat", "at_ms": now * 1000.0}))
            if stops and now - stop > 0.25:
                stop = now
                print(json.dumps({"stop_ns": time.monotonic_ns()}), flush=True)  # noqa: T201
                link.send(json.dumps({"t": "push", "button": "stop"}))
            data = link.recv(5.0)
            head = json.loads(data[4 : 4 + int.from_bytes(data[:4], "big")])
            link.send(json.dumps({"t": "got", "n": head["n"]}))
            bundles, pictures, size = bundles + 1, pictures + len(head["panes"]), size + len(data)
    print(json.dumps({"bundles": bundles, "pictures": pictures, "bytes": size}), flush=True)  # noqa: T201


def cpu_s(thread: int) -> float:
    """CPU time that a thread of this process has used."""
    fields = Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def feed(end: float, writer: frames.FrameWriter, to: socket.socket) -> None:
    """A chair: 50 records and 15 sets of noisy pictures a second."""
    rng, tick = np.random.default_rng(1), 0
    noise = [rng.integers(0, 256, (30, 40, 3), np.uint8).repeat(8, 0).repeat(8, 1) for _ in range(8)]
    picture = 0.0
    while (now := time.monotonic()) < end:
        now_ns = time.monotonic_ns()
        reading = RangeReading(seq=tick, captured_ns=now_ns, can_see=True, ahead_mm=900)
        facts = Facts(
            now_ns=now_ns,
            ranges={"front/stereo_range": (reading,) * 3, "front/vision_obstacle": (reading,) * 3},
            alive={"voice/voice_dtw": Alive(seq=tick, captured_ns=now_ns, level_dbfs=-40.0)},
            drive=DriveStatus(at_ns=now_ns, linked=True, armed=True),
        )
        record = records.Record(
            tick=tick,
            due_ns=now_ns,
            woke_ns=now_ns,
            wrote_ns=now_ns,
            periodic=True,
            before=State(),
            facts=facts,
            after=State(),
            decision=Decision(nearest_mm=900),
        )
        wire.send(to, records.encode(record))
        if now - picture >= 1 / 15:
            picture = now
            images = {name: noise[(tick + nth) % 8] for nth, name in enumerate(PANES)}
            writer.write({n: Pane(name=n, image=image, captured_ns=now_ns) for n, image in images.items()})
        tick += 1
        time.sleep(0.02)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pages", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--client", default="")
    parser.add_argument("--stops", action="store_true")
    options = parser.parse_args()
    if options.client:
        page(options.client, options.seconds, stops=options.stops)
        return
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        ours, theirs = wire.pair(4 * 1024 * 1024)
        ring = frames.create()
        run_dir = Path(folder)
        rings = {"front": frames.read_only(ring)}
        context = Context(lane="screen", run_dir=run_dir, chair_dir=run_dir, records_fd=theirs.fileno(), frames=rings)
        source = Dashboard(DashboardSettings(port=0, pages=options.pages), context)
        source.open()
        stack.callback(source.close)
        address = source.url.removeprefix("http://").removesuffix("/")
        end = time.monotonic() + options.seconds + 6.0
        feeder = threading.Thread(target=feed, args=(end, frames.FrameWriter(ring), ours))
        feeder.start()
        command = [sys.executable, __file__, "--client", address, "--seconds", str(options.seconds)]
        pages = [
            subprocess.Popen([*command, *(["--stops"] if nth == 0 else [])], stdout=subprocess.PIPE, text=True)
            for nth in range(options.pages)
        ]
        server = next(t.native_id for t in threading.enumerate() if t.name == "dashboard")
        assert server is not None
        arrived: list[int] = []
        time.sleep(3.0)
        before, since = cpu_s(server), time.monotonic()
        while time.monotonic() - since < options.seconds - 4.0:
            arrived += [
                time.monotonic_ns() for m in source.read(0.1) or [] if isinstance(m, Press) and m.button is Button.STOP
            ]
        share = (cpu_s(server) - before) / (time.monotonic() - since)
        said = [json.loads(line) for p in pages for line in p.communicate()[0].splitlines()]
        feeder.join()
    sent = sorted(row["stop_ns"] for row in said if "stop_ns" in row)
    took = sorted((at - max(s for s in sent if s <= at)) / 1e6 for at in arrived if sent and at >= sent[0])
    done = [row for row in said if "bundles" in row]
    result = {
        "pages": options.pages,
        "server_percent_of_a_core": round(100.0 * share, 1),
        "bundles_a_second_each": round(sum(r["bundles"] for r in done) / len(done) / options.seconds, 1),
        "bytes_a_bundle": round(sum(r["bytes"] for r in done) / sum(r["bundles"] for r in done)),
        "stop_to_lane_ms": {"n": len(took), "p50": took[len(took) // 2], "max": took[-1]} if took else None,
        "load_average": os.getloadavg()[0],
    }
    print(msgspec.json.format(msgspec.json.encode(result), indent=1).decode())  # noqa: T201


if __name__ == "__main__":
    main()
