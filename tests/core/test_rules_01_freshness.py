"""Rule 1, silence stops: late, missing, unwell, lost or unknown closes every way, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace

from chairward.components import STILL
from chairward.envelope import CLOSED, Envelope, Grip
from chairward.facts import MS, Facts, Limits, SourceLimits
from chairward.messages import Alive, Button, Command, DriveStatus, RangeReading, Veto
from chairward.rules import freshness, veto
from chairward.scene import look
from chairward.testing.ride import FRONT, PANEL, START_NS, VOICE, Ride, chair_limits, driving, healthy, readings

TILT = "body/tilt"
LIMITS = chair_limits(vetoers={TILT: SourceLimits(freshness_ns=300 * MS)})


def votes(facts: Facts, limits: Limits = LIMITS) -> list[Envelope]:
    return list(freshness(look(facts, driving(), limits)))


def said_at(name: str, at_ns: int) -> Facts:
    """A healthy chair, but `name` last spoke at at_ns."""
    facts = healthy(LIMITS)
    if name == FRONT:
        return replace(facts, ranges={FRONT: readings(START_NS, age_ns=START_NS - at_ns)})
    if name == TILT:
        return replace(facts, vetoes={TILT: Veto(seq=1, captured_ns=at_ns, stop=False)})
    if name == "drive":
        return replace(facts, drive=replace(facts.drive, at_ns=at_ns))
    if name == "supervisor":
        return replace(facts, supervisor_ns=at_ns)
    return replace(facts, alive={**facts.alive, name: Alive(seq=1, captured_ns=at_ns)})


FRESHNESS_MS = {FRONT: 200, TILT: 300, VOICE: 400, PANEL: 400, "drive": 200, "supervisor": 200}
every_source = pytest.mark.parametrize("name", FRESHNESS_MS)


def test_a_healthy_chair_has_no_vote_against_it() -> None:
    assert votes(healthy(LIMITS)) == []


@every_source
def test_exactly_at_its_limit_a_source_is_still_fresh(name: str) -> None:
    assert votes(said_at(name, START_NS - FRESHNESS_MS[name] * MS)) == []


@every_source
def test_a_moment_past_its_limit_all_ways_close_and_the_source_is_named(name: str) -> None:
    (vote,) = votes(said_at(name, START_NS - FRESHNESS_MS[name] * MS - 1))
    assert vote.caps == CLOSED
    assert (vote.rule, vote.source) == ("freshness", name)
    assert vote.detail == f"silent for {FRESHNESS_MS[name]} ms"


@every_source
def test_up_to_latch_after_the_wish_waits_and_beyond_it_latches(name: str) -> None:
    limits = replace(LIMITS, supervisor_freshness_ns=300 * MS)
    (short,) = votes(said_at(name, START_NS - 500 * MS), limits)
    (long,) = votes(said_at(name, START_NS - 500 * MS - 1), limits)
    at_once = name == "supervisor"  # without it nobody watches the other processes
    assert (short.grip, long.grip) == (Grip.LATCHES if at_once else Grip.WAITS, Grip.LATCHES)


@every_source
def test_a_source_that_never_spoke_is_silent(name: str) -> None:
    (vote,) = votes(said_at(name, 0)) if name != FRONT else votes(healthy(LIMITS, ranges={}))
    assert vote.caps == CLOSED
    assert vote.detail == "has said nothing yet"


@every_source
def test_a_time_in_the_future_is_silence_too(name: str) -> None:
    assert votes(said_at(name, START_NS + 5 * MS)) == []
    assert [vote.caps for vote in votes(said_at(name, START_NS + 5 * MS + 1))] == [CLOSED]


def test_a_missing_heartbeat_or_veto_is_silence() -> None:
    missing = votes(healthy(LIMITS, alive={}, vetoes={}))
    assert [vote.source for vote in missing] == [TILT, VOICE, PANEL]
    assert {vote.detail for vote in missing} == {"has said nothing yet"}


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_readings_close(count: int) -> None:
    (vote,) = votes(healthy(LIMITS, ranges={FRONT: readings(START_NS)[3 - count :]}))
    assert vote.caps == CLOSED
    assert vote.source == FRONT


def test_three_readings_of_which_two_are_from_before_a_long_gap_close() -> None:
    newest = readings(START_NS)[-1]
    before = readings(START_NS // 2)
    (vote,) = votes(healthy(LIMITS, ranges={FRONT: (*before[1:], newest)}))
    assert vote.detail == "fewer than three recent readings"
    assert vote.grip is Grip.WAITS


def test_three_readings_may_be_as_far_apart_as_the_limit_allows_and_no_farther() -> None:
    def window(oldest_age_ns: int) -> dict[str, tuple[RangeReading, ...]]:
        ages = (oldest_age_ns, 300 * MS, 100 * MS)
        return {FRONT: tuple(RangeReading(seq=i, captured_ns=START_NS - a, can_see=True) for i, a in enumerate(ages))}

    assert votes(healthy(LIMITS, ranges=window(600 * MS))) == []
    assert len(votes(healthy(LIMITS, ranges=window(600 * MS + 1)))) == 1


@pytest.mark.parametrize("name", [VOICE, PANEL])
def test_a_heartbeat_that_says_not_well_closes_with_its_own_reason(name: str) -> None:
    facts = healthy(LIMITS)
    for reason, told in (("muted", "muted"), ("", "is not well")):
        ill = Alive(seq=1, captured_ns=START_NS, well=False, reason=reason)
        (vote,) = votes(replace(facts, alive={**facts.alive, name: ill}))
        assert (vote.caps, vote.source, vote.detail, vote.grip) == (CLOSED, name, told, Grip.SPENDS)


@pytest.mark.parametrize("lost", [FRONT, "front", "voice", "panel/other", "body", "supervisor"])
def test_a_lost_lane_closes_at_once_before_its_readings_are_old(lost: str) -> None:
    (vote,) = votes(healthy(LIMITS, lost={lost: "camera 0 was unplugged"}))
    assert (vote.caps, vote.source, vote.detail) == (CLOSED, lost, "camera 0 was unplugged")
    assert vote.grip is Grip.WAITS


def test_a_lost_lane_that_no_vote_is_required_of_does_not_stop_the_chair() -> None:
    assert votes(healthy(LIMITS, lost={"scenery": "gone"})) == []


def test_refused_messages_do_not_close_while_the_source_is_fresh_but_name_it_when_it_is_not() -> None:
    refused = {FRONT: "distance -5 is not allowed"}
    assert votes(healthy(LIMITS, refused=refused)) == []
    (vote,) = votes(replace(said_at(FRONT, START_NS - 300 * MS), refused=refused))
    assert vote.detail == "silent for 300 ms; refused: distance -5 is not allowed"


def test_a_source_that_the_chair_file_does_not_know_can_only_close() -> None:
    facts = healthy(LIMITS)
    strangers = replace(
        facts,
        ranges={**facts.ranges, "x/range": readings(START_NS)},
        vetoes={**facts.vetoes, "x/tilt": Veto(seq=1, captured_ns=START_NS, stop=False)},
    )
    assert [(vote.caps, vote.source) for vote in votes(strangers)] == [(CLOSED, "x/range"), (CLOSED, "x/tilt")]


def test_a_gap_in_the_guards_own_clock_latches() -> None:
    assert votes(healthy(LIMITS, gap_ns=100 * MS)) == []
    (vote,) = votes(healthy(LIMITS, gap_ns=100 * MS + 1))
    assert (vote.caps, vote.source, vote.grip) == (CLOSED, "guard", Grip.LATCHES)
    assert vote.detail == "its clock jumped by 100 ms"


def test_a_veto_stops_with_its_reason_until_it_is_lifted() -> None:
    def ask(stop: bool) -> list[Envelope]:
        said = {TILT: Veto(seq=1, captured_ns=START_NS, stop=stop, reason="tilted by 14 degrees")}
        return list(veto(look(healthy(LIMITS, vetoes=said), driving(), LIMITS)))

    assert ask(False) == []
    (vote,) = ask(True)
    assert (vote.caps, vote.source, vote.detail, vote.grip) == (CLOSED, TILT, "tilted by 14 degrees", Grip.SPENDS)


# ---- over time ------------------------------------------------------------------------------------------------------
def silences() -> list[Callable[[Ride], None]]:
    def named(name: str) -> Callable[[Ride], None]:
        return lambda ride: ride.silent.add(name)

    return [named(name) for name in (FRONT, TILT, VOICE, PANEL, "drive", "supervisor")]


@pytest.mark.parametrize("fall_silent", silences())
def test_a_source_that_falls_silent_while_driving_stops_the_chair_and_latches(
    fall_silent: Callable[[Ride], None],
) -> None:
    ride = Ride(limits=LIMITS)
    assert ride.drive_off().motion.drive_mm_s == 500.0
    fall_silent(ride)
    longest_ms = 500
    assert ride.tick(times=longest_ms // 20 + 1).motion == STILL
    late = ride.tick(times=5)
    assert late.hard_stop
    assert late.latch
    ride.silent.clear()
    assert ride.tick(Command.FRONT, times=20).motion == STILL, "a new word is not enough after a latch"


def test_a_short_gap_stops_and_the_same_wish_goes_on_when_it_ends() -> None:
    ride = Ride(limits=LIMITS)
    ride.drive_off()
    ride.silent.add(FRONT)
    gap = ride.tick(times=15)  # 300 ms: past the 200 ms limit, before the latch
    assert gap.motion == STILL
    assert not gap.protective_stop
    assert not gap.hard_stop
    assert gap.command is Command.FRONT
    ride.silent.clear()
    again = ride.tick()
    assert 0.0 < again.motion.drive_mm_s <= 20.0, "it starts again gently"
    assert ride.tick(times=60).motion.drive_mm_s == 500.0


def test_a_gap_does_not_stop_the_lease_from_running_out() -> None:
    ride = Ride(limits=replace(LIMITS, lease_s=1.0))
    ride.drive_off(times=45)
    ride.silent.add(FRONT)
    ride.tick(times=12)
    ride.silent.clear()
    assert ride.tick(times=3).motion == STILL
    assert ride.decisions[-1].latch == ""


@pytest.mark.parametrize(
    "break_it",
    [
        {"lost": {"front": "its process died"}},
        {"gap_ns": 300 * MS},
        {"drive": DriveStatus(at_ns=0, linked=False, armed=False)},
    ],
)
def test_what_breaks_for_one_decision_stops_in_that_decision(break_it: dict[str, Any]) -> None:
    ride = Ride(limits=LIMITS)
    ride.drive_off()
    assert ride.tick(**break_it).motion == STILL


def test_readings_that_were_refused_are_noted_by_name() -> None:
    ride = Ride(limits=LIMITS)
    ride.arm()
    assert "front/range: refused: NaN" in ride.tick(refused={FRONT: "NaN"}).notes


def test_arming_is_refused_while_anything_is_silent_and_says_what() -> None:
    ride = Ride(limits=LIMITS)
    ride.tick()
    ride.silent.add(FRONT)
    ride.tick(times=20)
    refused = ride.tick(press=[Button.ARM])
    assert not refused.arm
    assert ride.state == replace(ride.state, latch="not armed yet", armed=False)
    assert any("ARM refused: front/range: silent" in note for note in refused.notes)


def test_more_than_three_readings_are_not_too_few() -> None:
    assert votes(healthy(LIMITS, ranges={FRONT: (*readings(START_NS), readings(START_NS)[-1])})) == []
