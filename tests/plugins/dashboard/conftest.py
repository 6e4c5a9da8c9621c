"""A real server on a loopback port, fed with real records and a real ring of pictures; pages as browsers have them."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from msgspec.structs import replace
from websockets.sync.client import ClientConnection, connect

from chairward import frames, plan, profile, records, wire
from chairward.components import Context
from chairward.facts import MS, Facts, Limits, SourceLimits, State
from chairward.messages import Alive, DriveStatus, Message, RangeReading, Way
from chairward.plan import Plan
from chairward.plugins import discover
from chairward.stages import Pane
from chairward.testing.ride import recorded
from chairward_dashboard.settings import DashboardSettings
from chairward_dashboard.source import Dashboard

WITHIN_S = 150.0
"""A command of the set-up pages starts a Python of its own; on a loaded machine that takes long."""
LIMITS = Limits(
    sensors={"front/stereo_range": SourceLimits(freshness_ns=200 * MS, covers=frozenset({Way.AHEAD}))},
    recognizers={"voice/voice_dtw": SourceLimits(freshness_ns=400 * MS)},
    stop_devices={"screen/dashboard": SourceLimits(freshness_ns=500 * MS)},
)


def facts_now(ahead_mm: int, now_ns: int, **changes: Any) -> Facts:
    """A chair at rest, all well, something at ahead_mm."""
    reading = RangeReading(seq=1, captured_ns=now_ns - 40 * MS, can_see=True, ahead_mm=ahead_mm, left_mm=900)
    voice = Alive(seq=1, captured_ns=now_ns - 20 * MS, level_dbfs=-31.0, noise_dbfs=-60.0)
    facts = Facts(
        now_ns=now_ns,
        ranges={"front/stereo_range": (reading,) * 3},
        alive={"voice/voice_dtw": voice, "screen/dashboard": Alive(seq=1, captured_ns=now_ns - 50 * MS)},
        drive=DriveStatus(at_ns=now_ns - 5 * MS, linked=True, armed=True, speed_mm_s=0.0, battery=0.8),
        supervisor_ns=now_ns - 10 * MS,
    )
    return replace(facts, **changes)


class Chair:
    """What the supervisor and the guard give the lane, and the lane's source with its server."""

    def __init__(self, run_dir: Path, settings: DashboardSettings, the_plan: Plan | None = None) -> None:
        if the_plan is not None:
            plan.write(the_plan, run_dir / "plan.json")
        ours, theirs = wire.pair(4 * 1024 * 1024)
        self.records, self._theirs = ours, theirs
        self._ring = frames.create()
        self.pictures = frames.FrameWriter(self._ring)
        self._ring_read = frames.read_only(self._ring)
        self.state = State(latch="", armed=True)
        self.context = Context(
            lane="screen",
            run_dir=run_dir,
            chair_dir=run_dir,
            records_fd=theirs.fileno(),
            frames={"front": self._ring_read},
        )
        self.source = Dashboard(settings, self.context)
        self.source.open()
        self.tick = 0

    @property
    def address(self) -> str:
        """host:port"""
        return self.source.url.removeprefix("http://").removesuffix("/")

    def decide(self, ahead_mm: int = 2_000, **changes: Any) -> records.Record:
        """One decision of the real arbiter, published as the guard does."""
        now_ns = time.monotonic_ns()
        self.tick += 1
        record = recorded(self.tick, self.state, facts_now(ahead_mm, now_ns, **changes), LIMITS)
        self.state = record.after
        wire.send(self.records, records.encode(record))
        return record

    def picture(self, grey: int = 128) -> None:
        """New pictures of all four names, 240 x 320, with something to see."""
        now_ns = time.monotonic_ns()
        ramp = np.tile(np.linspace(0, 255, 320, dtype=np.uint8), (240, 1))
        colour = np.dstack([ramp, np.full_like(ramp, grey), ramp[:, ::-1]])
        images = {"left": colour, "right": colour[:, ::-1], "obstacle": (ramp > grey).astype(np.uint8) * 255}
        images["disparity"] = ramp
        self.pictures.write({n: Pane(name=n, image=i, captured_ns=now_ns) for n, i in images.items()})

    def read_until(self, wanted: Callable[[Message], bool], within_s: float = 40.0) -> Message:
        """What the lane reads, until the wanted message."""
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            for message in self.source.read(0.05) or []:
                if wanted(message):
                    return message
        raise AssertionError(f"not read within {within_s} s")

    def alive_through(self, page: Page) -> None:
        """The page takes control (again, if it was silent) and beats like a real one until the lane reads it."""
        end = time.monotonic() + 40.0
        while time.monotonic() < end:
            page.take()
            if any(isinstance(m, Alive) and m.well for m in self.read_for(0.1)):
                return
        raise AssertionError("no heartbeat of the page was read within 40 s")

    def read_for(self, seconds: float) -> list[Message]:
        """All that the lane reads in that time."""
        end = time.monotonic() + seconds
        found: list[Message] = []
        while time.monotonic() < end:
            found += self.source.read(0.02) or []
        return found

    def close(self) -> None:
        """End everything."""
        self.source.close()
        self.pictures.close()
        self.records.close()
        self._theirs.close()
        os.close(self._ring)
        os.close(self._ring_read)


class Page:
    """A page as the server sees it: one WebSocket."""

    def __init__(self, address: str, **options: Any) -> None:
        options.setdefault("origin", f"http://{address}")
        self._stack = ExitStack()
        self.socket: ClientConnection = self._stack.enter_context(
            connect(f"ws://{address}/ws", compression=None, max_size=None, **options)
        )

    def say(self, **word: Any) -> None:
        """One message."""
        self.socket.send(json.dumps(word))

    def beat(self) -> None:
        """One heartbeat."""
        self.say(t="beat", at_ms=time.monotonic() * 1000.0)

    def bundle(self, within_s: float = 40.0) -> tuple[dict[str, Any], list[bytes]]:
        """The next bundle: its head and its pictures; acknowledged."""
        data = self.socket.recv(within_s)
        assert isinstance(data, bytes)
        size = int.from_bytes(data[:4], "big")
        head = json.loads(data[4 : 4 + size])
        blobs, at = [], 4 + size
        for pane in head["panes"]:
            blobs.append(data[at : at + pane["bytes"]])
            at += pane["bytes"]
        assert at == len(data)
        self.say(t="got", n=head["n"])
        return head, blobs

    def bundle_until(self, wanted: Callable[[dict[str, Any]], bool], within_s: float = 40.0) -> dict[str, Any]:
        """Bundles until one whose head is as wanted."""
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            head, _ = self.bundle()
            if wanted(head):
                return head
        raise AssertionError(f"no such bundle within {within_s} s")

    def take(self) -> None:
        """Take control, and be alive."""
        self.say(t="take")
        self.beat()

    def close(self) -> None:
        """Close the page; may be called twice."""
        self._stack.close()


@pytest.fixture
def settings() -> DashboardSettings:
    """A port of the system's choice on loopback."""
    return DashboardSettings(port=0)


@pytest.fixture(autouse=True)
def home(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user of our own: what is recorded and logged stays out of the real one's folders."""
    folder = tmp_path_factory.mktemp("home")
    monkeypatch.setenv("XDG_DATA_HOME", str(folder / "data"))
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
    return folder


@pytest.fixture
def profiles(tmp_path: Path) -> Path:
    """A copy of the shipped profiles to write to; what they point to stays where it is."""
    shipped = Path(__file__).resolve().parents[3] / "profiles"
    folder = tmp_path / "profiles"
    shutil.copytree(shipped, folder)
    for file in folder.glob("*/*.toml"):
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace('"../../', f'"{shipped.parent}/'), encoding="utf-8")
    careful = folder / "people" / "careful.toml"
    careful.write_text(
        careful.read_text(encoding="utf-8").replace('chair = ["sim"', 'chair = ["screen", "sim"'), "utf-8"
    )
    return folder


@pytest.fixture
def planned_chair(home: Path, tmp_path: Path, settings: DashboardSettings, profiles: Path) -> Iterator[Chair]:
    """A chair whose run has a plan, so that its set-up pages work."""
    del home
    run_dir = tmp_path / "run"
    run_dir.mkdir()
    one = Chair(run_dir, settings, profile.load("screen", "demo", [], discover(), profiles))
    yield one
    one.close()


@pytest.fixture
def chair(tmp_path: Path, settings: DashboardSettings) -> Iterator[Chair]:
    """A chair with its screen."""
    one = Chair(tmp_path, settings)
    yield one
    one.close()


@pytest.fixture
def page_at() -> Callable[..., Page]:
    """Opens a page at an address; the test closes it."""
    return Page


@pytest.fixture
def open_page(chair: Chair) -> Iterator[Callable[..., Page]]:
    """Opens pages, and closes them in the end."""
    pages: list[Page] = []

    def open_one(**options: Any) -> Page:
        pages.append(Page(chair.address, **options))
        return pages[-1]

    yield open_one
    for page in pages:
        page.close()


@pytest.fixture
def call(planned_chair: Chair) -> Iterator[Callable[..., httpx.Response]]:
    """A request as a page of this server makes it; a dict is sent as JSON."""
    with httpx.Client(base_url=planned_chair.source.url, timeout=WITHIN_S) as client:
        origin = {"origin": planned_chair.source.url.removesuffix("/")}

        def one(path: str, data: dict[str, Any] | bytes | None = None) -> httpx.Response:
            if data is None:
                return client.get(f"/api/{path}")
            more = {"content": data} if isinstance(data, bytes) else {"json": data}
            return client.post(f"/api/{path}", headers=origin, **more)

        yield one
