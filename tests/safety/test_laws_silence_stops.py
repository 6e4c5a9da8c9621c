"""P1 as laws: whichever source dies, at whatever moment, the chair stands within that source's limit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from random import Random
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from chairward.components import STILL
from chairward.facts import MS, NOT_ARMED, Facts, Pressed, SourceLimits, State, Wish
from chairward.messages import Alive, Button, Command, DriveStatus
from chairward.testing import laws
from chairward.testing.ride import FRONT, PANEL, START_NS, TICK_NS, VOICE, Ride, chair_limits, driving, readings

TILT = "body/tilt"
LIMITS = chair_limits(vetoers={TILT: SourceLimits(freshness_ns=300 * MS)})
LIMIT_MS = {FRONT: 200, TILT: 300, VOICE: 400, PANEL: 400, "drive": 200, "supervisor": 200}


@settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 2**48))
def test_whoever_falls_silent_whenever_the_chair_stands_within_that_sources_limit(seed: int) -> None:
    rng = Random(seed)
    ride = Ride(limits=LIMITS)
    ride.arm()
    for _ in range(rng.randrange(1, 40)):
        words = (rng.choice([Command.FRONT, Command.LEFT, Command.BACK]),) if rng.random() < 0.2 else ()
        ride.tick(*words)
    name = rng.choice(list(LIMIT_MS))
    ride.silent.add(name)
    already_ms = {VOICE: 50, PANEL: 50, TILT: 50, FRONT: 60, "drive": 10, "supervisor": 100}[name]
    ride.tick(Command.FRONT, times=(LIMIT_MS[name] - already_ms) // 20 + 1)
    for _ in range(40):
        spoken = (rng.choice(list(Command)),) if rng.random() < 0.3 else ()
        presses = (rng.choice([Button.ARM, Button.RESET, Button.HOLD]),) if rng.random() < 0.3 else ()
        assert ride.tick(*spoken, press=presses).motion == STILL


# ---- a small world, walked completely --------------------------------------------------------------------------------
NEAR = {
    "at the toes": {"ahead_mm": 240},
    "ahead": {"ahead_mm": 590},
    "to be avoided": {"ahead_mm": 740},
    "beside": {"left_mm": 240},
    "behind": {"behind_mm": 590},
    "nowhere": {},
}
SIGHT = {"well": {}, "late": {"age_ns": 201 * MS}, "blind": {"can_see": False}}
HEARD = (None, Command.FRONT, Command.BACK, Command.LEFT, Command.STOP)
PRESSED = (None, *Button)
CONTROLLERS: dict[str, dict[str, Any]] = {
    "well": {},
    "faulty": {"fault": "overheated"},
    "not armed": {"armed": False},
    "unplugged": {"linked": False, "armed": False},
}
STATES = {
    "off": State(latch=NOT_ARMED, output_ns=START_NS - TICK_NS),
    "stop pressed": State(latch="STOP was pressed", output_ns=START_NS - TICK_NS),
    "fault": State(latch="a fault", needs_reset=True, output_ns=START_NS - TICK_NS),
    "standing": driving(wish=None),
    "forward": driving(Command.FRONT),
    "arc": driving(Command.RIGHT, base=driving().wish, step_left=9.0),
    "turn": driving(Command.LEFT, step_left=9.0),
    "back": driving(Command.BACK, step_left=200.0),
    "held": driving(wish=Wish(source=PANEL, seq=1, at_ns=START_NS - 100 * MS, command=Command.FRONT, held=True)),
    "expired": driving(wish=Wish(source=VOICE, seq=1, at_ns=START_NS - 9_000 * MS, command=Command.FRONT)),
}


def small_world() -> Iterator[tuple[State, Facts]]:
    """Every combination of distance, way, sight, age, heartbeats, controller, state, word and press."""
    plain = Facts(now_ns=START_NS, supervisor_ns=START_NS - 100 * MS)
    fresh = Alive(seq=1, captured_ns=START_NS - 50 * MS)
    others: dict[str, dict[str, Any]] = {
        "all there": {"alive": {VOICE: fresh, PANEL: fresh}},
        "recognizer late": {"alive": {VOICE: replace(fresh, captured_ns=1), PANEL: fresh}},
        "stop device ill": {"alive": {VOICE: fresh, PANEL: replace(fresh, well=False)}},
        "supervisor late": {"alive": {VOICE: fresh, PANEL: fresh}, "supervisor_ns": START_NS - 201 * MS},
    }
    windows = [
        readings(START_NS, **{"left_mm": 2_000, **near, **sight}) for near in NEAR.values() for sight in SIGHT.values()
    ]
    status = DriveStatus(at_ns=START_NS - 10 * MS, linked=True, armed=True)
    drives = [replace(status, **changes) for changes in CONTROLLERS.values()]
    for window, votes, drive, word, button in product(windows, others.values(), drives, HEARD, PRESSED):
        wish = Wish(source=VOICE, seq=9, at_ns=START_NS, command=word) if word else None
        press = Pressed(source=PANEL, button=button, at_ns=START_NS) if button else None
        facts = replace(
            plain,
            ranges={FRONT: window},
            drive=drive,
            heard=(wish,) if wish else (),
            pressed=(press,) if press else (),
            **votes,
        )
        for state in STATES.values():
            yield state, facts


def test_every_combination_of_a_small_world_keeps_both_promises() -> None:
    limits = chair_limits(steer_deg_s=8.0)
    cases, moved = 0, set()
    for state, facts in small_world():
        cases += 1
        drive, turn = laws.judge(state, facts, limits)[1].motion
        moved |= {(drive > 0.0) - (drive < 0.0), "arc" if drive and turn else "turn" if turn else None}
    assert cases == 18 * 4 * 4 * 5 * 5 * 10
    assert moved == {1, 0, -1, "arc", "turn", None}, "there is something in it to forbid"


EVENTS: dict[str, dict[str, Any]] = {
    "nothing": {},
    "front": {"heard": Command.FRONT},
    "left": {"heard": Command.LEFT},
    "stop": {"heard": Command.STOP},
    "STOP": {"press": Button.STOP},
    "RESET": {"press": Button.RESET},
    "ARM": {"press": Button.ARM},
    "wall": {"ahead_mm": 500},
    "dark": {"can_see": False, "ahead_mm": None},
    "camera gone": {"lost": {"front": "unplugged"}},
    "clock jump": {"gap_ns": 300 * MS},
    "controller fault": {"fault": "overheated"},
}


@pytest.mark.parametrize("start", ["off", "forward"])
def test_every_path_of_four_events_keeps_both_promises_and_never_restarts_by_itself(start: str) -> None:
    """Motion after a stop needs a word after it, and after a latch an ARM before the word."""
    limits = chair_limits()

    def walk(state: State, armed: bool, now_ns: int, depth: int, may_move: bool) -> int:
        if depth == 0:
            return 1
        paths = 0
        for name, event in EVENTS.items():
            facts = facts_of(event, state, armed, now_ns)
            after, decision = laws.judge(state, facts, limits)
            heard = name in ("front", "left") and not state.latch
            may = may_move or heard
            if decision.motion != STILL:
                assert may, f"it moves at '{name}' though nobody has asked since the last stop"
            spent = after.wish is None
            next_armed = (armed or decision.arm) and not decision.disarm
            paths += walk(after, next_armed, now_ns + TICK_NS, depth - 1, may and not spent)
        return paths

    def facts_of(event: dict[str, Any], state: State, armed: bool, now_ns: int) -> Facts:
        said = {"ahead_mm": 3_000, **{k: v for k, v in event.items() if k in ("ahead_mm", "can_see")}}
        beat = Alive(seq=1, captured_ns=now_ns - 50 * MS)
        heard = (Wish(source=VOICE, seq=1, at_ns=now_ns, command=event["heard"]),) if "heard" in event else ()
        pressed = (Pressed(source=PANEL, button=event["press"], at_ns=now_ns),) if "press" in event else ()
        return Facts(
            now_ns=now_ns,
            ranges={FRONT: readings(now_ns, **said)},
            alive={VOICE: beat, PANEL: beat},
            lost=event.get("lost", {}),
            drive=DriveStatus(at_ns=now_ns - 5 * MS, linked=True, armed=armed, fault=event.get("fault", "")),
            supervisor_ns=now_ns - 50 * MS,
            gap_ns=event.get("gap_ns", 0),
            heard=heard,
            pressed=pressed,
        )

    first = STATES[start]
    assert walk(first, first.armed, START_NS, 4, first.wish is not None) == len(EVENTS) ** 4
