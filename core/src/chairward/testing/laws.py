"""The two promises as laws over decisions, judged by slow and obvious code of its own (none of the rules is asked)."""

from __future__ import annotations

from random import Random

from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.components import STILL, Motion
from chairward.facts import MS, Decision, Facts, Limits, Pressed, S, State
from chairward.messages import Button, Command, Way
from chairward.reflex import reflex
from chairward.testing import cases
from chairward.testing.ride import PANEL, START_NS

TINY = 1e-9


class BrokenLaw(AssertionError):
    """A promise does not hold, with all that is needed to see why."""


def must(holds: bool, law: str, *evidence: object) -> None:
    """Raises BrokenLaw with the evidence when the law does not hold."""
    if not holds:
        raise BrokenLaw("\n  ".join((law, *map(str, evidence))))


def every_vote_is_there(facts: Facts, limits: Limits) -> bool:
    """P1, said a second time and slowly: has every required source said something fresh, well and affirmative?"""

    def recent(at_ns: int, limit_ns: int) -> bool:
        return at_ns > 0 and facts.now_ns - at_ns <= limit_ns

    for name, need in limits.sensors.items():
        window = facts.ranges.get(name, ())
        if len(window) != 3 or not recent(window[2].captured_ns, need.freshness_ns):
            return False
    for name, need in limits.vetoers.items():
        said = facts.vetoes.get(name)
        if said is None or said.stop or not recent(said.captured_ns, need.freshness_ns):
            return False
    for name, need in {**limits.recognizers, **limits.stop_devices}.items():
        alive = facts.alive.get(name)
        if alive is None or not alive.well or not recent(alive.captured_ns, need.freshness_ns):
            return False
    lanes = {name.split("/")[0] for name in (*limits.sensors, *limits.vetoers, *limits.recognizers)}
    lanes |= {name.split("/")[0] for name in limits.stop_devices}
    drive = facts.drive
    return (
        not lanes & set(facts.lost)
        and drive.linked
        and drive.armed
        and not drive.fault
        and not drive.charging
        and not drive.stopped_by_user
        and recent(drive.at_ns, limits.drive_freshness_ns)
        and recent(facts.supervisor_ns, limits.supervisor_freshness_ns)
        and facts.gap_ns <= limits.gap_limit_ns
    )


def silence_stops(before: State, facts: Facts, limits: Limits, after: State, decision: Decision) -> None:
    """P1 for one decision: it moves only while every required vote is there, the chair is armed, and a wish lives."""
    if decision.motion == STILL:
        return
    evidence = (before, facts, decision)
    must(every_vote_is_there(facts, limits), "P1: it moves although a required vote is not there", *evidence)
    must(before.latch == after.latch == "", "P1: it moves although it is latched", *evidence)
    wish = after.base or after.wish
    must(wish is not None, "P1: it moves although nobody wants it to", *evidence)
    assert wish is not None
    limit = limits.held_ns if wish.held else int(limits.lease_s * S)
    must(facts.now_ns - wish.at_ns <= limit, "P1: it moves although the lease has run out", *evidence)


def stop_wins(facts: Facts, after: State, decision: Decision) -> None:
    """A STOP among what was heard or pressed: no motion, nothing left to resume, whatever else came with it."""
    spoken = any(wish.command is Command.STOP for wish in facts.heard)
    pressed = any(press.button is Button.STOP for press in facts.pressed)
    if spoken or pressed:
        must(decision.motion == STILL and not decision.arm, "STOP did not stop", facts, decision)
        must(after.wish is None and after.base is None, "STOP left a wish alive", facts, after)
    if pressed:
        must(bool(after.latch) and decision.hard_stop, "a pressed STOP did not latch", facts, after)


def within_what_the_chair_file_allows(facts: Facts, limits: Limits, decision: Decision) -> None:
    """P2: never above the caps, nor above what an unwatched way may do, nor towards what is too near.

    A way is watched while a sensor that the chair file says covers it says a distance there.
    """
    drive, turn = decision.motion
    covered = {
        way
        for name, need in limits.sensors.items()
        for way in need.covers
        if any(getattr(reading, f"{way}_mm") is not None for reading in facts.ranges.get(name, ()))
    }
    most = {
        way: min(cap, unseen if way not in covered else cap)
        for way, cap, unseen in zip(Way, limits.caps, limits.unseen, strict=True)
    }
    speeds = {Way.AHEAD: drive, Way.BEHIND: -drive, Way.LEFT: turn, Way.RIGHT: -turn}
    for way, speed in speeds.items():
        must(speed <= most[way] * (1 + TINY), f"P2: {way} at {speed}, allowed is {most[way]}", facts, decision)
    seen = [reading for window in facts.ranges.values() for reading in window]
    for field, way in (("ahead_mm", Way.AHEAD), ("behind_mm", Way.BEHIND)):
        near = [mm for reading in seen if (mm := getattr(reading, field)) is not None]
        if near and min(near) <= limits.stop_mm:
            must(speeds[way] <= 0.0, f"P2: {way} although {min(near)} mm away", facts, decision)


def rises_slowly(before: State, facts: Facts, limits: Limits, decision: Decision) -> None:
    """A speed rises by no more than the chair's acceleration allows since the last decision."""
    dt_s = min(0.1, max(0, facts.now_ns - before.output_ns) / S) if before.output_ns else 0.0
    for old, new, most in (
        (before.output.drive_mm_s, decision.motion.drive_mm_s, limits.accel_mm_s2),
        (before.output.turn_deg_s, decision.motion.turn_deg_s, limits.turn_accel_deg_s2),
    ):
        start = abs(old) if old * new > 0.0 else 0.0
        must(abs(new) <= start + most * dt_s + TINY, "a speed rises too fast", before, decision)


def judge(before: State, facts: Facts, limits: Limits) -> tuple[State, Decision]:
    """One decision, held against every law that needs no second decision."""
    after, decision = decide(before, facts, limits)
    silence_stops(before, facts, limits, after, decision)
    stop_wins(facts, after, decision)
    within_what_the_chair_file_allows(facts, limits, decision)
    rises_slowly(before, facts, limits, decision)
    if reflex(before, facts, limits):
        must(not decision.motion.drive_mm_s, "it drives after the reflex", before, facts, decision)
    must(not decision.arm or decision.motion == STILL, "arming moved the chair", before, facts, decision)
    must(after.output == decision.motion, "the state forgets what was commanded", after, decision)
    must(bool(after.latch) <= (after.wish is None), "a latched chair keeps a wish", after)
    return after, decision


def no_faster(worse: Motion, better: Motion, steer_deg_s: float) -> bool:
    """worse is nowhere above better; only rule 4's steering may add a turn, of at most steer_deg_s."""
    turn_limit = max(abs(better.turn_deg_s), steer_deg_s if better.drive_mm_s > 0.0 else 0.0)
    same_way = worse.drive_mm_s * better.drive_mm_s >= 0.0
    return (
        same_way
        and abs(worse.drive_mm_s) <= abs(better.drive_mm_s) * (1 + TINY)
        and abs(worse.turn_deg_s) <= turn_limit * (1 + TINY)
    )


def one_step(rng: Random) -> tuple[str, Motion, Motion]:
    """P2 for one decision: in the same state, facts that are worse in one thing never give a faster motion.

    Except rule 6's own second thoughts: a thing that has vanished closes the way, the same thing seen again is judged
    by its distance. So states that remember something near are made worse by silence only, not by nearer readings.
    """
    limits = cases.some_limits(rng)
    now_ns = START_NS
    before = cases.some_state(rng, limits, now_ns)
    facts = cases.some_heard(rng, cases.some_facts(rng, limits, now_ns, trouble=rng.choice((0.0, 0.0, 0.1, 0.4))))
    kinds = cases.SILENCE if before.near else cases.WORSE
    name = rng.choice(tuple(kinds))
    worse = kinds[name](rng, facts, limits)
    _, better_one = judge(before, facts, limits)
    _, worse_one = judge(before, worse, limits)
    must(
        no_faster(worse_one.motion, better_one.motion, limits.steer_deg_s),
        f"P2: {name}, and the chair goes {worse_one.motion} instead of {better_one.motion}",
        limits,
        before,
        facts,
        worse,
    )
    return name, worse_one.motion, better_one.motion


def twin_rides(rng: Random, ticks: int) -> float:
    """P2 over a whole ride: a twin that hears the same words, but whose facts are now and then worse, is never faster.

    For forward words and stops (a step that is slowed ends later, so its twin may already stand), and without rule 6
    (a source that was blind cannot remember what it would have seen). Worse means: with the same readings and more
    against them; what a reading that never came would have said, no decision can know (P1 bounds that in time).
    Returns the way that the worse twin made, mm.
    """
    limits = replace(cases.some_limits(rng), near_loss_mm=-1, latch_after_ns=500 * MS)
    twins = [State(latch="", armed=True, output_ns=START_NS)] * 2
    silence = {k: v for k, v in cases.SILENCE.items() if k not in ("a sensor is removed", "it has fewer readings")}
    kinds = silence | cases.DOUBT
    now_ns, way_mm = START_NS, 0.0
    for _ in range(ticks):
        now_ns += 20 * MS
        facts = cases.some_facts(rng, limits, now_ns, trouble=0.1 if rng.random() < 0.05 else 0.0)
        if rng.random() < 0.2:
            word = rng.choice((Command.FRONT,) * 5 + (Command.STOP,))
            wish = cases.some_wish(rng, now_ns)
            facts = replace(facts, heard=(replace(wish, command=word, held=False, stick=None),))
        worse = facts
        if rng.random() < 0.02:
            name = rng.choice(tuple(kinds))
            worse = kinds[name](rng, facts, limits)
        (better_state, better), (worse_state, slower) = (
            judge(twins[0], facts, limits),
            judge(twins[1], worse, limits),
        )
        must(
            no_faster(slower.motion, better.motion, limits.steer_deg_s),
            f"P2: the worse twin goes {slower.motion}, the other {better.motion}",
            limits,
            twins,
            facts,
            worse,
        )
        twins = [better_state, worse_state]
        way_mm += slower.motion.drive_mm_s * 0.02
    return way_mm


def random_ride(rng: Random, ticks: int) -> None:
    """Decision after decision in random trouble, with words, presses and the state that came of the last one."""
    limits = cases.some_limits(rng)
    state, now_ns, armed = State(), START_NS, False
    for tick in range(ticks):
        now_ns += rng.choice((1, 20, 20, 20, 300)) * MS
        facts = cases.some_facts(rng, limits, now_ns, trouble=rng.choice((0.0, 0.0, 0.0, 0.2)))
        facts = cases.some_heard(rng, facts)
        if tick < 2:
            facts = replace(facts, pressed=(Pressed(source=PANEL, button=Button.ARM, at_ns=now_ns),))
        facts = replace(facts, drive=replace(facts.drive, armed=armed))
        state, decision = judge(state, facts, limits)
        armed = (armed or decision.arm) and not decision.disarm
