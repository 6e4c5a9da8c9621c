"""decide(state, facts, limits) -> (state, decision): the one place that turns facts into motion. Pure, without clock.

The order of a decision: listen (what does the person want), look, vote, steer, merge and scale, ramp what rises,
scale again. Rules take away; what is left of the wish is the motion.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

from chairward.components import STILL, Motion
from chairward.envelope import Caps, Envelope, Grip, binding, fit, meet
from chairward.facts import NOT_ARMED, Decision, Facts, Instruction, Limits, Near, S, State, Why, Wish
from chairward.messages import Button, Command
from chairward.rules import RULES, WAYS, Scene, Seen, freer_side, look

FORWARD = Motion(1.0, 0.0)
STANDING_MM_S = 20.0
STANDING_DEG_S = 2.0
LONGEST_STEP_S = 0.1
"""The most time that one decision may account for when it lets a speed rise."""
RECEDE_MM_S = 2_000.0
RECEDE_SLACK_MM = 150.0
BACKED_OFF_MM = 200.0
TURNED_AWAY_DEG = 0.5


def decide(state: State, facts: Facts, limits: Limits) -> tuple[State, Decision]:
    """What the chair does now, and what the next decision must know."""
    dt_s = max(0, facts.now_ns - state.output_ns) / S if state.output_ns else 0.0
    before = state.wish
    state, notes = listen(travel(state, facts, limits, dt_s), facts, limits)
    scene = look(facts, state, limits)
    state = replace(state, near=remember(scene, dt_s))
    scene = scene._replace(state=state)
    votes = [vote for rule in RULES for vote in rule(scene)]
    caps = meet(vote for vote in votes if vote.rule != "lease")

    wanted = wish_motion(state, limits)
    want = steer(wanted, caps, scene)
    target = fit(want, caps)
    motion = fit(ramp(state.output, target, min(dt_s, LONGEST_STEP_S), facts, limits), caps)
    reasons = binding(wanted if wanted != STILL else FORWARD, votes)

    fault = next((vote for vote in votes if vote.grip is Grip.LATCHES), None) if not state.latch else None
    spent = wanted != STILL and target == STILL and any(vote.grip is not Grip.WAITS for vote in reasons)
    if fault:
        state = replace(state, latch=say(fault), needs_reset=True)
    if fault or spent:
        state = replace(state, wish=None, base=None)
    state, arm, refusals = confirm(state, facts, votes)
    state = replace(
        state,
        armed=facts.drive.armed and not state.latch and not arm,
        output=motion,
        output_ns=facts.now_ns,
    )
    nearest = min((s.ahead_mm for s in scene.seen), default=inf)
    return state, Decision(
        motion=motion,
        hard_stop=state.latch not in ("", NOT_ARMED),
        arm=arm,
        disarm=bool(state.latch) and facts.drive.armed,
        instruction=instruct(state, scene, caps, nearest),
        nearest_mm=None if nearest == inf else int(nearest),
        caps=caps,
        reasons=tuple(Why(rule=v.rule, source=v.source, detail=v.detail) for v in reasons),
        open_ways=tuple(way for way, cap in zip(WAYS, caps, strict=True) if cap > 0.0),
        command=state.wish.command if state.wish else None,
        lease_left_s=lease_left_s(state, facts, limits),
        protective_stop=before is not None and (spent or fault is not None),
        help=any(wish.command is Command.HELP for wish in facts.heard),
        latch=state.latch,
        notes=(*notes, *refusals, *(f"{name}: {why}" for name, why in facts.refused.items())),
    )


# ---- the wish -------------------------------------------------------------------------------------------------------
def travel(state: State, facts: Facts, limits: Limits, dt_s: float) -> State:
    """Time has passed: steps come to their end, leases run out. Steps count the larger of commanded and reported."""
    wish, base, left = state.wish, state.base, state.step_left
    if wish is None:
        return state
    if base and not live(base, facts, limits):
        return replace(state, wish=None, base=None)
    if not live(wish, facts, limits):
        wish, base = base, None
    elif left > 0.0 and not wish.held:
        turning = wish.command in (Command.LEFT, Command.RIGHT)
        moved = (
            max(abs(state.output.turn_deg_s), abs(facts.drive.turn_deg_s or 0.0))
            if turning
            else max(abs(state.output.drive_mm_s), abs(facts.drive.speed_mm_s or 0.0))
        )
        left -= moved * dt_s
        if left <= 0.0:
            wish, base, left = base, None, 0.0
    return replace(state, wish=wish, base=base, step_left=left)


def live(wish: Wish, facts: Facts, limits: Limits) -> bool:
    """A word lives for its lease, a held switch until it should have repeated."""
    return facts.now_ns - wish.at_ns <= (limits.held_ns if wish.held else limits.lease_s * S)


def listen(state: State, facts: Facts, limits: Limits) -> tuple[State, tuple[str, ...]]:
    """What was heard and pressed since the last decision. A STOP among it beats everything else."""
    pressed = next((p for p in facts.pressed if p.button is Button.STOP), None)
    if pressed:
        latch = state.latch if state.needs_reset else f"STOP was pressed ({pressed.source})"
        return replace(state, latch=latch, wish=None, base=None), ()
    if any(wish.command is Command.STOP for wish in facts.heard):
        return replace(state, wish=None, base=None), ()
    notes = []
    for wish in facts.heard:
        if wish.command is Command.HELP:
            continue
        if wish.command not in limits.commands:
            notes.append(f"{wish.source}: '{wish.command}' is not one of this person's commands")
        elif state.latch:
            notes.append(f"{wish.source}: '{wish.command}' was not obeyed: {state.latch}")
        else:
            state = hear(state, wish, limits)
    hold = any(p.button is Button.HOLD for p in facts.pressed)
    if hold and state.wish and not state.latch:
        state = replace(state, wish=replace(state.wish, held=True, at_ns=facts.now_ns), base=None)
    return state, tuple(notes)


def hear(state: State, wish: Wish, limits: Limits) -> State:
    """One new wish. A live held switch is not overridden by a word; a stick at rest ends only its own wish."""
    old = state.wish
    if old and old.held and not wish.held:
        return state
    if wish.stick == (0.0, 0.0):
        return replace(state, wish=None, base=None) if old and old.source == wish.source else state
    match wish.command:
        case Command.LEFT | Command.RIGHT:
            forward = state.base or (old if old and old.command is Command.FRONT and not old.held else None)
            if forward and not wish.held:
                return replace(state, wish=wish, base=forward, step_left=limits.arc_step_deg)
            return replace(state, wish=wish, base=None, step_left=limits.turn_step_deg)
        case Command.BACK:
            return replace(state, wish=wish, base=None, step_left=limits.back_step_mm)
        case Command.REVERSE:
            return replace(state, wish=wish, base=None, step_left=limits.reverse_step_mm)
        case _:
            return replace(state, wish=wish, base=None, step_left=0.0)


def wish_motion(state: State, limits: Limits) -> Motion:
    """The motion that the live wish asks for, before any vote."""
    wish = state.wish
    if wish is None:
        return STILL
    if wish.stick is not None:
        forward, left = wish.stick
        speed = limits.forward_mm_s if forward > 0.0 else limits.backward_mm_s
        return Motion(forward * speed, left * limits.turn_deg_s)
    match wish.command:
        case Command.FRONT:
            return Motion(limits.forward_mm_s, 0.0)
        case Command.BACK | Command.REVERSE:
            return Motion(-limits.backward_mm_s, 0.0)
        case Command.LEFT:
            return Motion(limits.arc_mm_s if state.base else 0.0, limits.turn_deg_s)
        case Command.RIGHT:
            return Motion(limits.arc_mm_s if state.base else 0.0, -limits.turn_deg_s)
        case _:
            return STILL


def lease_left_s(state: State, facts: Facts, limits: Limits) -> float:
    """Seconds until the forward lease runs out; 0 for steps and held switches."""
    wish = state.base or state.wish
    if wish is None or wish.held or wish.command is not Command.FRONT:
        return 0.0
    return max(0.0, limits.lease_s - (facts.now_ns - wish.at_ns) / S)


# ---- the motion -----------------------------------------------------------------------------------------------------
def steer(want: Motion, caps: Caps, scene: Scene) -> Motion:
    """Rule 4's slight turn: the one thing that adds motion. Never alters the forward speed that the votes leave.

    Only during a forward word or switch, only towards the side that the avoiding readings sense clear, only if that
    turn is wholly allowed; off where the chair file says 0.
    """
    wish, rate = scene.state.wish, scene.limits.steer_deg_s
    if not rate or wish is None or wish.command is not Command.FRONT or wish.stick is not None:
        return want
    side = freer_side(scene)
    allowed = caps.left_deg_s if side > 0.0 else caps.right_deg_s
    return Motion(want.drive_mm_s, side * rate) if side and allowed >= rate else want


def ramp(old: Motion, new: Motion, dt_s: float, facts: Facts, limits: Limits) -> Motion:
    """Limits only rising magnitudes; falling is at once, and a reversal goes through standstill."""
    reported = facts.drive.speed_mm_s or 0.0
    drive = _rise(old.drive_mm_s, new.drive_mm_s, limits.accel_mm_s2 * dt_s)
    if reported * drive < 0.0 and abs(reported) > STANDING_MM_S:
        drive = 0.0
    return Motion(drive, _rise(old.turn_deg_s, new.turn_deg_s, limits.turn_accel_deg_s2 * dt_s))


def _rise(old: float, new: float, most: float) -> float:
    if old * new < 0.0:
        return 0.0
    return max(-abs(old) - most, min(abs(old) + most, new)) if new else 0.0


def standing(state: State, facts: Facts) -> bool:
    """Nothing is commanded, and the controller reports no motion (or does not tell)."""
    speed, turn = facts.drive.speed_mm_s or 0.0, facts.drive.turn_deg_s or 0.0
    return state.output == STILL and abs(speed) < STANDING_MM_S and abs(turn) < STANDING_DEG_S


# ---- latch, reset, arm ----------------------------------------------------------------------------------------------
def confirm(state: State, facts: Facts, votes: list[Envelope]) -> tuple[State, bool, tuple[str, ...]]:
    """RESET and ARM, after the votes: they take effect with the next decision, so arming itself never moves the chair.

    RESET acknowledges a fault that is over; ARM needs a standstill, no unacknowledged fault and every vote fresh.
    Whether ARM was accepted comes second; then why something was refused.
    """
    arm, refused = False, []
    if any(p.button is Button.STOP for p in facts.pressed):
        return state, False, ()
    fault = next((v for v in votes if v.grip is Grip.LATCHES or v.rule == "freshness"), None)
    for pressed in facts.pressed:
        if pressed.button not in (Button.RESET, Button.ARM):
            continue
        if not standing(state, facts):
            refused.append(f"{pressed.button.upper()} refused: the chair is moving")
        elif fault:
            refused.append(f"{pressed.button.upper()} refused: {say(fault)}")
        elif pressed.button is Button.RESET:
            state = replace(state, latch=NOT_ARMED if state.needs_reset else state.latch, needs_reset=False, near={})
        elif state.needs_reset:
            refused.append(f"ARM refused: RESET first ({state.latch})")
        elif state.latch or not facts.drive.armed:
            state, arm = replace(state, latch=""), True
    return state, arm, tuple(refused)


# ---- rule 6's memory ------------------------------------------------------------------------------------------------
def remember(scene: Scene, dt_s: float) -> dict[str, Near]:
    """What is near ahead of each sensor, and what was and has vanished."""
    facts, state, limits, seen = scene
    reported, turning = facts.drive.speed_mm_s, facts.drive.turn_deg_s
    back = max(0.0, -state.output.drive_mm_s if reported is None else min(-state.output.drive_mm_s, -reported)) * dt_s
    turn = abs(state.output.turn_deg_s) if turning is None else min(abs(state.output.turn_deg_s), abs(turning))
    kept: dict[str, Near] = {}
    for s in seen:
        near = _near(s, state.near.get(s.source), facts, limits, back, turn * dt_s)
        if near:
            kept[s.source] = near
    return kept


def _near(s: Seen, old: Near | None, facts: Facts, limits: Limits, back_mm: float, turn_deg: float) -> Near | None:
    window = facts.ranges[s.source]
    if s.ahead_mm <= limits.near_loss_mm:
        nearest = next(r for r in reversed(window) if r.ahead_mm == s.ahead_mm)
        newest = window[-1].ahead_mm
        if old is None or (newest is not None and newest <= limits.near_loss_mm):
            return Near(distance_mm=int(s.ahead_mm), seen_ns=nearest.captured_ns)
        return replace(
            old,
            distance_mm=int(s.ahead_mm),
            seen_ns=nearest.captured_ns,
            backed_mm=old.backed_mm + back_mm,
            turned_deg=old.turned_deg + turn_deg,
            gone=False,
        )
    if old is None:
        return None
    near = replace(old, backed_mm=old.backed_mm + back_mm, turned_deg=old.turned_deg + turn_deg)
    if near.backed_mm >= BACKED_OFF_MM or near.turned_deg >= TURNED_AWAY_DEG:
        return None
    if near.gone:
        return near
    first = window[0].ahead_mm
    passed_s = (window[0].captured_ns - near.seen_ns) / S
    if first is not None and first <= near.distance_mm + RECEDE_SLACK_MM + RECEDE_MM_S * passed_s:
        return None
    return replace(near, gone=True)


# ---- for people -----------------------------------------------------------------------------------------------------
def say(vote: Envelope) -> str:
    """A vote as one clause: "front/stereo_range: 540 mm ahead"."""
    return f"{vote.source}: {vote.detail}" if vote.source else vote.detail


def instruct(state: State, scene: Scene, caps: Caps, nearest_mm: float) -> str:
    """The thesis' instruction; Stop now also whenever nothing may move ahead."""
    limits = scene.limits
    if caps.forward_mm_s <= 0.0 or nearest_mm <= limits.stop_mm:
        return Instruction.STOP
    if nearest_mm <= limits.avoid_mm:
        s = min(scene.seen, key=lambda s: s.ahead_mm)
        left, right = (0.0 if d == inf else d for d in (s.left_mm, s.right_mm))
        return Instruction.TURN_LEFT if left >= right else Instruction.TURN_RIGHT
    wish = state.base or state.wish
    return Instruction.GO_STRAIGHT if wish and wish.command is Command.FRONT else Instruction.WAY_CLEAR
