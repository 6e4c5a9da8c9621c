"""From records to what pages show: nothing is better than it is."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from msgspec.structs import replace

from chairward.facts import MS, Facts, Limits, SourceLimits
from chairward.messages import Alive, RangeReading
from chairward_dashboard.doors import host_allowed, origin_allowed
from chairward_dashboard.settings import DashboardSettings
from chairward_dashboard.view import View, sources

NOW_NS = 100_000 * MS
LIMITS = Limits(
    sensors={"front/stereo": SourceLimits(freshness_ns=200 * MS)},
    recognizers={"voice/dtw": SourceLimits(freshness_ns=400 * MS)},
    stop_devices={"screen/dashboard": SourceLimits(freshness_ns=500 * MS)},
)


def reading(age_ms: int, *, can_see: bool = True) -> RangeReading:
    return RangeReading(seq=1, captured_ns=NOW_NS - age_ms * MS, can_see=can_see, ahead_mm=900, reason="plain wall")


def state_of(facts: Facts, name: str) -> tuple[str, str]:
    row = next(row for row in sources(facts, LIMITS, NOW_NS) if row["name"] == name)
    return row["state"], row["reason"]


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        (reading(150), ("well", "")),
        (reading(201), ("silent", "")),
        (reading(10, can_see=False), ("ill", "plain wall")),
    ],
)
def test_a_sensor_is_well_only_while_fresh_and_seeing(said: RangeReading, wanted: tuple[str, str]) -> None:
    assert state_of(Facts(now_ns=NOW_NS, ranges={"front/stereo": (said,)}), "front/stereo") == wanted


def test_what_has_said_nothing_or_is_lost_is_named() -> None:
    facts = Facts(now_ns=NOW_NS, lost={"front": "camera 0 was unplugged"})
    assert state_of(facts, "front/stereo") == ("silent", "camera 0 was unplugged")
    assert state_of(facts, "voice/dtw")[0] == "silent"
    ill = Alive(seq=1, captured_ns=NOW_NS, well=False, reason="muted")
    assert state_of(replace(facts, alive={"voice/dtw": ill}), "voice/dtw") == ("ill", "muted")


def test_before_the_first_record_the_screen_says_stop() -> None:
    state = View(LIMITS).state(NOW_NS)
    assert (state["instruction"], state["colour"], state["news"]) == ("stop_now", "stop", False)


def test_missed_records_and_protective_stops_are_counted(chair: Any) -> None:
    view = View(LIMITS)
    record = chair.decide(540)
    record = replace(record, missed=2, decision=replace(record.decision, protective_stop=True))
    for nth in range(30):
        view.add(record)
        assert len(view.state(time.monotonic_ns())["stops"]) == min(nth + 1, 20)
    assert view.state(time.monotonic_ns())["missed"] == 60


@pytest.mark.parametrize(
    ("header", "allowed"),
    [
        ("localhost:8765", True),
        ("127.0.0.1:8765", True),
        ("[::1]:8765", True),
        ("192.168.1.20", True),
        ("chair.local", True),
        ("evil.example", False),
        ("127.0.0.1.evil.example", False),
        ("", False),
        ("[::1", False),
    ],
)
def test_only_addresses_and_named_hosts_may_be_asked_for(header: str, allowed: bool) -> None:
    assert host_allowed(header, ("Chair.local",)) is allowed


def test_an_origin_must_be_this_very_host_and_port() -> None:
    assert origin_allowed("http://chair.local:8765", "chair.local:8765")
    for origin in (
        "http://chair.local",
        "http://chair.local:8766",
        "file://",
        "ftp://chair.local:8765",
        "",
        "http://[",
    ):
        assert not origin_allowed(origin, "chair.local:8765")


@pytest.mark.parametrize(
    ("host", "network"),
    [("127.0.0.1", False), ("::1", False), ("localhost", False), ("0.0.0.0", True), ("chair", True)],
)
def test_anything_but_loopback_counts_as_the_network(host: str, network: bool) -> None:
    assert DashboardSettings(host=host).open_to_network is network


def test_every_file_that_a_page_asks_for_is_served_by_the_chair(chair: Any) -> None:
    static = Path(__file__).resolve().parents[3] / "plugins/dashboard/src/chairward_dashboard/static"
    for file in static.rglob("*.*"):
        if file.suffix != ".html":
            assert httpx.get(f"{chair.source.url}static/{file.relative_to(static)}").status_code == 200
        assert "://" not in file.read_text().replace("http://www.w3.org/2000/svg", "").replace("://${", "")
