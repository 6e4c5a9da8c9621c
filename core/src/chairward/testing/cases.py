"""Random chairs in random trouble: limits, states and facts for laws, and every way to make facts worse.

All choices come from one `random.Random`, so the same code serves hypothesis (which shrinks it) and plain millions.
Values are few and near the thresholds: that is where rules break.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from msgspec.structs import replace

from chairward.components import STILL, Motion
from chairward.facts import MS, NOT_ARMED, Facts, Limits, Near, Pressed, S, SourceLimits, State, Wish
from chairward.messages import Alive, Button, Command, DriveStatus, RangeReading, Veto, Way
from chairward.testing.ride import PANEL, START_NS, VOICE
from chairward.wishes import AT_REST, NO_MOTION

SENSORS = ("front/stereo", "front/colour", "rear/sonar")
TILT = "body/tilt"
DISTANCES = (None, 0, 200, 250, 251, 590, 600, 601, 640, 700, 750, 751, 800, 801, 900, 1_200, 2_000, 5_000)
AGES_MS = (5, 60, 199, 200, 201, 350, 499, 501, 900)
USUAL_AGES_MS = (5, 60, 60, 60, 120)
COVERS = (
    frozenset({Way.AHEAD, Way.LEFT, Way.RIGHT}),
    frozenset({Way.AHEAD}),
    frozenset({Way.BEHIND}),
    frozenset(Way),
)
OUTPUTS = (STILL, Motion(500.0, 0.0), Motion(200.0, 8.0), Motion(300.0, -20.0), Motion(-150.0, 0.0), Motion(0.0, 20.0))


def some_limits(rng: Random) -> Limits:
    """A chair with one to three sensors, steering and crawling or not."""
    names = SENSORS[: rng.choice((1, 2, 3))]
    return Limits(
        sensors={
            name: SourceLimits(freshness_ns=200 * MS, covers=rng.choice(COVERS if nth else COVERS[:2]))
            for nth, name in enumerate(names)
        },
        recognizers={VOICE: SourceLimits(freshness_ns=400 * MS)},
        stop_devices={PANEL: SourceLimits(freshness_ns=400 * MS)},
        vetoers={TILT: SourceLimits(freshness_ns=300 * MS)} if rng.random() < 0.5 else {},
        steer_deg_s=rng.choice((0.0, 8.0)),
        crawl_mm_s=rng.choice((0.0, 80.0)),
        stop_mm=rng.choice((600, 700)),
        near_loss_mm=rng.choice((0, 800)),
    )


def some_window(rng: Random, now_ns: int, *, trouble: float) -> tuple[RangeReading, ...]:
    """The last readings of a sensor; with `trouble` 0 it is well and sees nothing near."""
    odd = rng.random() < trouble
    at = now_ns - rng.choice(AGES_MS if odd else USUAL_AGES_MS) * MS
    readings = []
    for nth in range(rng.choice((0, 1, 2, 3, 3, 3)) if odd else 3):
        near = rng.random() < trouble
        readings.append(
            RangeReading(
                seq=3 - nth,
                captured_ns=at,
                can_see=not (near and rng.random() < 0.3),
                ahead_mm=rng.choice(DISTANCES) if near else 5_000,
                behind_mm=rng.choice(DISTANCES) if near else 5_000,
                left_mm=rng.choice(DISTANCES) if near else 5_000,
                right_mm=rng.choice(DISTANCES) if near else 5_000,
                closing_mm_s=rng.choice((0, 0, 300, 1_400)) if near else 0,
            )
        )
        at -= rng.choice((33, 67)) * MS
    return tuple(reversed(readings))


def some_facts(rng: Random, limits: Limits, now_ns: int, *, trouble: float = 0.3) -> Facts:
    """Facts of that chair, with much or little wrong."""

    def age_ns() -> int:
        return rng.choice(AGES_MS if rng.random() < trouble / 4 else USUAL_AGES_MS) * MS

    def well() -> bool:
        return rng.random() >= trouble / 8

    return Facts(
        now_ns=now_ns,
        ranges={name: some_window(rng, now_ns, trouble=trouble) for name in limits.sensors},
        vetoes={n: Veto(seq=1, captured_ns=now_ns - age_ns(), stop=not well()) for n in limits.vetoers},
        alive={n: Alive(seq=1, captured_ns=now_ns - age_ns(), well=well()) for n in (VOICE, PANEL)},
        lost={} if well() else {rng.choice(("front", "voice", "panel", "nowhere")): "gone"},
        drive=DriveStatus(
            at_ns=now_ns - age_ns(),
            linked=well(),
            armed=well(),
            fault="" if well() else "overheated",
            speed_mm_s=rng.choice((None, 0.0, 180.0, 500.0, -150.0)) if rng.random() < trouble else None,
            turn_deg_s=rng.choice((None, 0.0, 20.0)),
            stopped_by_user=not well(),
            charging=not well(),
        ),
        supervisor_ns=now_ns - age_ns(),
        gap_ns=0 if well() else rng.choice((90, 101, 2_000)) * MS,
    )


def some_wish(rng: Random, now_ns: int, seq: int = 1) -> Wish:
    """A word, a held switch or a stick."""
    kind = rng.choice(("word", "word", "word", "held", "stick"))
    stick = rng.choice(((1.0, 0.0), (0.5, -0.5), (-1.0, 0.2), (0.0, 1.0), (0.0, 0.0))) if kind == "stick" else None
    command = stick_command(*stick) if stick else rng.choice(tuple(Command))
    source = VOICE if kind == "word" else PANEL
    return Wish(source=source, seq=seq, at_ns=now_ns, command=command, held=kind != "word", stick=stick)


def stick_command(forward: float, left: float) -> Command:
    """The command that goes with a stick, as the border says it."""
    if forward:
        return Command.FRONT if forward > 0.0 else Command.BACK
    return Command.LEFT if left > 0.0 else Command.RIGHT


def some_state(rng: Random, limits: Limits, now_ns: int) -> State:
    """A state that decisions can lead to: mostly armed and driving."""
    latch = rng.choice(("",) * 10 + (NOT_ARMED, "a fault"))
    wish = some_wish(rng, now_ns)
    wish = replace(wish, at_ns=now_ns - rng.choice((20, 60, 100, 240, 251 if wish.held else 7_900, 8_001)) * MS)
    if latch or wish.command in (Command.STOP, *NO_MOTION) or wish.stick == AT_REST or rng.random() < 0.1:
        return State(latch=latch, needs_reset=latch == "a fault", output_ns=now_ns - 20 * MS)
    arc = wish.command in (Command.LEFT, Command.RIGHT) and not wish.held and rng.random() < 0.5
    step = wish.command is not Command.FRONT and wish.stick is None
    near = Near(distance_mm=700, seen_ns=now_ns - 200 * MS, gone=rng.random() < 0.5)
    return State(
        latch="",
        armed=True,
        wish=wish,
        base=replace(wish, command=Command.FRONT, at_ns=now_ns - S) if arc else None,
        step_left=rng.choice((0.2, 15.0, 300.0)) if step else 0.0,
        output=rng.choice(OUTPUTS),
        output_ns=now_ns - 20 * MS,
        near={rng.choice(tuple(limits.sensors)): near} if limits.near_loss_mm and rng.random() < 0.3 else {},
    )


def some_heard(rng: Random, facts: Facts) -> Facts:
    """The facts with words and presses, sometimes."""
    words = rng.choice((0,) * 6 + (1, 1, 2))
    presses = rng.choice((0,) * 8 + (1, 2))
    return replace(
        facts,
        heard=tuple(some_wish(rng, facts.now_ns, seq) for seq in range(words)),
        pressed=tuple(
            Pressed(
                source=PANEL,
                button=rng.choice(tuple(Button)),
                at_ns=facts.now_ns - rng.choice((0, 0, 0, 240, 251)) * MS,
            )
            for _ in range(presses)
        ),
    )


# ---- making it worse ------------------------------------------------------------------------------------------------
Worse = Callable[[Random, Facts, Limits], Facts]
"""Facts in which one source is more silent, more doubtful, or sees something nearer."""


def _on_window(change: Callable[[Random, tuple[RangeReading, ...]], tuple[RangeReading, ...]]) -> Worse:
    def worse(rng: Random, facts: Facts, limits: Limits) -> Facts:
        name = rng.choice(tuple(limits.sensors))
        return replace(facts, ranges={**facts.ranges, name: change(rng, facts.ranges[name])})

    return worse


def _each(change: Callable[[RangeReading], RangeReading]) -> Worse:
    """One reading of a sensor is changed."""

    def one(rng: Random, window: tuple[RangeReading, ...]) -> tuple[RangeReading, ...]:
        at = rng.choice(range(len(window))) if window else -1
        return tuple(change(r) if i == at else r for i, r in enumerate(window))

    return _on_window(one)


def _nearer(way: str) -> Worse:
    def worse(rng: Random, facts: Facts, limits: Limits) -> Facts:
        def pull(reading: RangeReading) -> RangeReading:
            said = getattr(reading, way)
            if said is None:  # saying nothing of a way is already the worst that can be said of it
                return reading
            closer = rng.choice([mm for mm in DISTANCES if mm is not None and mm <= said])
            return replace(reading, **{way: closer})

        return _each(pull)(rng, facts, limits)

    return worse


def _drive(**changes: object) -> Worse:
    return lambda _, facts, __: replace(facts, drive=replace(facts.drive, **changes))


def _heartbeat(rng: Random, facts: Facts, _: Limits) -> Facts:
    name = rng.choice((VOICE, PANEL))
    old = facts.alive[name]
    later = replace(old, captured_ns=old.captured_ns - 500 * MS)
    alive = {"dead": {}, "late": {name: later}, "ill": {name: replace(old, well=False)}}
    others = {n: a for n, a in facts.alive.items() if n != name}
    return replace(facts, alive=others | alive[rng.choice(tuple(alive))])


def _veto(rng: Random, facts: Facts, limits: Limits) -> Facts:
    """It falls silent, or what it said last was a stop: said later, it would be less silent than it was."""
    if not limits.vetoers:
        return facts
    said = replace(facts.vetoes[TILT], stop=True, reason="tilted")
    return replace(facts, vetoes=rng.choice(({}, {TILT: said})))


def _stranger(rng: Random, facts: Facts, _: Limits) -> Facts:
    return replace(facts, ranges={**facts.ranges, "new/sonar": some_window(rng, facts.now_ns, trouble=0.5)})


def _late(rng: Random, window: tuple[RangeReading, ...]) -> tuple[RangeReading, ...]:
    delay = rng.choice((30, 200, 600)) * MS
    return tuple(replace(r, captured_ns=r.captured_ns - delay) for r in window)


SILENCE: dict[str, Worse] = {
    "a sensor is removed": _on_window(lambda *_: ()),
    "its readings are older": _on_window(_late),
    "it has fewer readings": _on_window(lambda _, window: window[1:]),
    "a heartbeat dies, is late or is ill": _heartbeat,
    "a vetoing plugin dies or vetoes": _veto,
    "a lane is lost": lambda _, facts, __: replace(facts, lost={**facts.lost, "front": "its process died"}),
    "the controller is lost": _drive(linked=False),
    "the controller is faulty": _drive(fault="overheated"),
    "the controller accepts nothing": _drive(armed=False),
    "a charger is connected": _drive(charging=True),
    "the user's own stop": _drive(stopped_by_user=True),
    "the controller is silent": _drive(at_ns=START_NS - 10 * S),
    "the supervisor is silent": lambda _, facts, __: replace(facts, supervisor_ns=facts.now_ns - S),
    "the guard was stopped": lambda _, facts, __: replace(facts, gap_ns=S),
    "messages are refused": lambda _, facts, __: replace(facts, refused={"front/stereo": "not a number"}),
}
"""Removed, late, dead, malformed."""

DOUBT: dict[str, Worse] = {
    "it cannot see": _each(lambda r: replace(r, can_see=False)),
    "something comes closer": _each(lambda r: replace(r, closing_mm_s=min(5_000, r.closing_mm_s + 4_500))),
    "something is nearer ahead": _nearer("ahead_mm"),
    "something is nearer behind": _nearer("behind_mm"),
    "something is nearer on the left": _nearer("left_mm"),
    "something is nearer on the right": _nearer("right_mm"),
    "a plugin that the chair file does not know appears": _stranger,
}
"""Still talking, but says worse."""

WORSE = SILENCE | DOUBT
