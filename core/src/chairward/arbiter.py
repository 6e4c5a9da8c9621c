"""decide(state, facts, limits) -> (state, decision): the one place that turns facts into motion. Pure, without clock.

What does the person want (`wishes`), what do the rules leave of it (`rules`), how does it become motion: steer, merge
and scale, ramp what rises, scale again last. Then what the next decision must know, and what people should be told.
"""

from __future__ import annotations

from math import inf, isfinite, isinf
from operator import itemgetter

from msgspec.structs import replace

from chairward.components import STILL, Motion
from chairward.envelope import Caps, Envelope, Grip, binding, fit, meet
from chairward.facts import NOT_ARMED, Decision, Facts, Instruction, Limits, S, State, Why
from chairward.memory import remember
from chairward.messages import Button, Command
from chairward.rules import RULES, freer_side, lease
from chairward.scene import WAYS, Scene, look, reported
from chairward.wishes import lease_left_s, listen, motion_of, travel, wants_forward

FORWARD = Motion(1.0, 0.0)
STANDING_MM_S = 20.0
STANDING_DEG_S = 2.0
LONGEST_RISE_S = 0.1
"""The most time that one decision may use to let a speed rise."""


def decide(state: State, facts: Facts, limits: Limits) -> tuple[State, Decision]:
    """What the chair does now, and what the next decision must know. See DESIGN sections 0 and 3."""
    dt_s = max(0, facts.now_ns - state.output_ns) / S if state.output_ns else 0.0
    was_live = state.wish is not None
    state, notes = listen(travel(state, facts, limits, dt_s), facts, limits)
    scene = look(facts, state, limits)
    near = remember(scene, dt_s)
    if near != state.near:
        state = replace(state, near=near)
        scene = scene._replace(state=state)

    votes = [vote for rule in RULES for vote in rule(scene)]
    caps = meet(votes)
    wanted = motion_of(state, limits)
    target = fit(steer(wanted, caps, scene), caps)
    motion = fit(ramp(state.output, target, min(dt_s, LONGEST_RISE_S), scene), caps)

    reasons = binding(FORWARD if wanted == STILL else wanted, [*votes, *lease(scene)])
    faults = [vote for vote in votes if vote.grip is Grip.LATCHES and not state.latch]
    spent = wanted != STILL and target == STILL and any(vote.grip is not Grip.WAITS for vote in reasons)
    state, arm, refusals = confirm(state, facts, votes)
    latch = say(faults[0]) if faults else state.latch
    over = spent or arm or bool(latch)
    after = State(
        latch=latch,
        needs_reset=state.needs_reset or bool(faults),
        armed=facts.drive.armed and not latch and not arm,
        wish=None if over else state.wish,
        base=None if over else state.base,
        step_left=state.step_left,
        output=motion,
        output_ns=facts.now_ns,
        near=state.near,
    )
    nearest_mm = nearest_ahead_mm(scene, votes)
    return after, Decision(
        motion=motion,
        hard_stop=latch not in ("", NOT_ARMED),
        arm=arm,
        disarm=bool(latch) and facts.drive.armed,
        instruction=instruct(after, scene, caps, nearest_mm),
        nearest_mm=None if isinf(nearest_mm) else int(nearest_mm),
        caps=caps,
        reasons=tuple([Why(rule=vote.rule, source=vote.source, detail=vote.detail) for vote in reasons]),
        open_ways=tuple([way for way, cap in zip(WAYS, caps, strict=True) if cap]),
        command=after.wish.command if after.wish else None,
        lease_left_s=lease_left_s(after, facts, limits),
        protective_stop=was_live and (spent or bool(faults)),
        help=Command.HELP in [wish.command for wish in facts.heard],
        latch=latch,
        notes=(*notes, *refusals, *[f"{name}: refused: {why}" for name, why in facts.refused.items()]),
    )


def steer(want: Motion, caps: Caps, scene: Scene) -> Motion:
    """Rule 4's slight turn, the one thing that adds motion. It never changes the forward speed that the votes leave.

    Only during a forward command that may move, only towards the side that the avoiding readings sense clear, only
    when that whole turn is allowed; off where the chair file says 0.
    """
    wish, rate = scene.state.wish, scene.limits.steer_deg_s
    if not rate or wish is None or wish.command is not Command.FRONT or wish.stick is not None:
        return want
    side = freer_side(scene)
    allowed = caps.left_deg_s if side > 0.0 else caps.right_deg_s
    if not side or allowed < rate or caps.forward_mm_s <= 0.0:
        return want
    return Motion(min(want.drive_mm_s, caps.forward_mm_s), side * rate)


def ramp(old: Motion, new: Motion, dt_s: float, scene: Scene) -> Motion:
    """Only rising magnitudes are limited; falling is at once, and a reversal goes through standstill.

    A curve waits for that as a whole: turning alone would be another path, and a turn that nobody asked for.
    """
    limits, does = scene.limits, reported(scene.facts.drive)
    drive = _rise(old.drive_mm_s, new.drive_mm_s, limits.accel_mm_s2 * dt_s)
    reverses = does.drive_mm_s * drive < 0.0 and abs(does.drive_mm_s) > STANDING_MM_S
    if reverses or (new.drive_mm_s and not drive):
        return STILL
    return Motion(drive, _rise(old.turn_deg_s, new.turn_deg_s, limits.turn_accel_deg_s2 * dt_s))


def _rise(old: float, new: float, most: float) -> float:
    if old * new < 0.0:
        return 0.0
    return max(-abs(old) - most, min(abs(old) + most, new))


def confirm(state: State, facts: Facts, votes: list[Envelope]) -> tuple[State, bool, tuple[str, ...]]:
    """RESET and ARM: the state after them, whether the controller is to be armed, and why one was refused.

    RESET acknowledges a fault, and that nothing is where rule 6 remembers something. ARM needs that, and lifts the
    latch. Both need a standstill, a linked controller and every vote fresh; a STOP in the same drain, spoken or
    pressed, beats them.
    They act after the votes, and a latched chair has no wish: arming itself never moves the chair.
    """
    if not facts.pressed:
        return state, False, ()
    arm, refusals = False, []
    buttons = [pressed.button for pressed in facts.pressed]
    if Button.STOP in buttons or any(wish.command is Command.STOP for wish in facts.heard):
        return state, False, ()
    for button in buttons:
        if button not in (Button.RESET, Button.ARM):
            continue
        if why := _not_ready(state, facts, votes):
            refusals.append(f"{button.upper()} refused: {why}")
        elif button is Button.RESET:
            latch = NOT_ARMED if state.needs_reset else state.latch
            state = replace(state, latch=latch, needs_reset=False, near={})
        elif state.needs_reset:
            refusals.append(f"ARM refused: RESET first ({state.latch})")
        elif state.latch or not facts.drive.armed:
            state, arm = replace(state, latch=""), True
    return state, arm, tuple(refusals)


def _not_ready(state: State, facts: Facts, votes: list[Envelope]) -> str:
    does = reported(facts.drive)
    moving = abs(does.drive_mm_s) >= STANDING_MM_S or abs(does.turn_deg_s) >= STANDING_DEG_S
    if moving or state.output != STILL:
        return "the chair is moving"
    if not facts.drive.linked:
        return "the controller is not connected"
    return next((say(vote) for vote in votes if vote.rule == "freshness"), "")


def say(vote: Envelope) -> str:
    """A vote as one clause: "front/stereo_range: 540 mm ahead"."""
    return f"{vote.source}: {vote.detail}" if vote.source else vote.detail


def nearest_ahead_mm(scene: Scene, votes: list[Envelope]) -> float:
    """The least distance ahead that a fresh sensor reports; inf when none does."""
    silent = {vote.source for vote in votes if vote.rule == "freshness"}
    return min([s.ahead_mm for s in scene.seen if s.source not in silent], default=inf)


def instruct(state: State, scene: Scene, caps: Caps, nearest_mm: float) -> str:
    """The thesis' instruction (its section 5); "Stop now" also whenever nothing may move ahead."""
    limits = scene.limits
    if caps.forward_mm_s <= 0.0:
        return Instruction.STOP
    if nearest_mm <= limits.avoid_mm:
        return _which_side(scene)
    return Instruction.GO_STRAIGHT if wants_forward(state) else Instruction.WAY_CLEAR


def _which_side(scene: Scene) -> str:
    """Towards the side that rule 4 would steer to, else the freer (a tie: left) of the sides that any sensor senses.

    Where nobody senses a side there is none to recommend.
    """
    if side := freer_side(scene):
        return Instruction.TURN_LEFT if side > 0.0 else Instruction.TURN_RIGHT
    left, right = min(s.left_mm for s in scene.seen), min(s.right_mm for s in scene.seen)
    told = ((left, Instruction.TURN_LEFT), (right, Instruction.TURN_RIGHT))
    sensed = [one for one in told if isfinite(one[0])]
    return max(sensed, key=itemgetter(0))[1] if sensed else Instruction.STOP
