"""What the person wants: words as leases and steps, held switches, sticks; STOP before everything else (rule 7).

A word lives for its lease, whatever happens; steps (turns, backing) also end when they are done; a held switch lives
until it should have repeated. A wish that is spent never comes back: only a new one moves the chair.
"""

from __future__ import annotations

from msgspec.structs import replace

from chairward.components import STILL, Motion
from chairward.facts import Facts, Limits, S, State, Wish
from chairward.messages import Button, Command
from chairward.scene import reported

TURNS = (Command.LEFT, Command.RIGHT)
NO_MOTION = (Command.HELP, Command.RESET, Command.CONFIRM)
"""Heard and told, never a wish; what RESET and CONFIRM press is the border's matter."""
AT_REST = (0.0, 0.0)


def travel(state: State, facts: Facts, limits: Limits, dt_s: float) -> State:
    """dt_s has passed: leases run out, steps come nearer to their end, an arc gives way to the drive it bent."""
    wish, base = state.wish, state.base
    if wish is None:
        return state
    if base and not live(base, facts, limits):
        return replace(state, wish=None, base=None)
    left = state.step_left - _moved(wish, state, facts) * dt_s
    if not live(wish, facts, limits) or (state.step_left and left <= 0.0):
        return replace(state, wish=base, base=None, step_left=0.0)
    return replace(state, step_left=left) if state.step_left else state


def live(wish: Wish, facts: Facts, limits: Limits) -> bool:
    """Within its lease, or for a held switch within the time in which it must repeat."""
    return facts.now_ns - wish.at_ns <= (limits.held_ns if wish.held else limits.lease_s * S)


def _moved(wish: Wish, state: State, facts: Facts) -> float:
    """The rate at which a step is used up: the larger of commanded and reported, so that every step ends."""
    told, does = state.output, reported(facts.drive)
    if wish.command in TURNS:
        return max(abs(told.turn_deg_s), abs(does.turn_deg_s))
    return max(abs(told.drive_mm_s), abs(does.drive_mm_s))


def listen(state: State, facts: Facts, limits: Limits) -> tuple[State, tuple[str, ...]]:
    """What was heard and pressed since the last decision, and what of it was not obeyed and why.

    A STOP among it beats all the rest: the word spends the wish, the button latches as well (ARM lifts it).
    """
    for pressed in facts.pressed:
        if pressed.button is Button.STOP:
            latch = state.latch if state.needs_reset else f"STOP was pressed ({pressed.source})"
            return replace(state, latch=latch, wish=None, base=None), ()
    if stops := [wish.source for wish in facts.heard if wish.command is Command.STOP]:
        return replace(state, wish=None, base=None), tuple(
            [f"{source}: 'stop' heard" for source in dict.fromkeys(stops)]
        )
    notes = []
    for wish in facts.heard:
        if wish.command is Command.RESET:
            notes.append(f"{wish.source}: '{wish.word}' heard: confirm it to reset")
        if wish.command in NO_MOTION:
            continue
        if lacks := lacking(wish, limits):
            notes.append(f"{wish.source}: '{lacks}' is not one of this person's commands")
            if wish.stick is not None:  # a stick that asks for too much is a stick let go
                state = hear(state, replace(wish, stick=AT_REST), limits)
        elif state.latch:
            notes.append(f"{wish.source}: '{wish.command}' is not obeyed: {state.latch}")
        else:
            state = hear(state, wish, limits)
    oldest_ns = facts.now_ns - limits.held_ns
    if held := [p.at_ns for p in facts.pressed if p.button is Button.HOLD and p.at_ns >= oldest_ns]:
        state = _hold(state, max(held))
    return state, tuple(notes)


def lacking(wish: Wish, limits: Limits) -> Command | None:
    """The command that this wish needs and the person does not have; a stick needs one for each of its directions."""
    if wish.stick is None:
        return None if wish.command in limits.commands else wish.command
    forward, left = wish.stick
    if forward < 0.0 and not {Command.BACK, Command.REVERSE} & limits.commands:
        return Command.BACK
    needed = ((forward > 0.0, Command.FRONT), (left > 0.0, Command.LEFT), (left < 0.0, Command.RIGHT))
    return next((command for asked, command in needed if asked and command not in limits.commands), None)


def hear(state: State, wish: Wish, limits: Limits) -> State:
    """One new wish takes the place of the old.

    Except: a word does not override a live held switch of another source, and a stick at rest ends only its own wish.
    A turn during a forward wish is an arc that returns to it; otherwise it is a step on the spot. Held, it is no step.
    """
    old = state.wish
    if old and old.held and not wish.held and old.source != wish.source:
        return state
    if wish.stick == AT_REST:
        return replace(state, wish=None, base=None) if old and old.source == wish.source else state
    if wish.held or wish.stick is not None:
        return replace(state, wish=wish, base=None, step_left=0.0)
    if wish.command in TURNS:
        forward = state.base or (old if old and old.command is Command.FRONT and old.stick is None else None)
        if forward:
            return replace(state, wish=wish, base=forward, step_left=limits.arc_step_deg)
        return replace(state, wish=wish, base=None, step_left=limits.turn_step_deg)
    step = {Command.BACK: limits.back_step_mm, Command.REVERSE: limits.reverse_step_mm}.get(wish.command, 0.0)
    return replace(state, wish=wish, base=None, step_left=step)


def _hold(state: State, at_ns: int) -> State:
    """HOLD turns a live forward word into a held one: it goes on while HOLD repeats, past its lease, until release.

    It counts from at_ns, when the switch was seen to be down: what comes late does not hold for longer, or not at all.
    A step is not held: it ends when it is done, and of an arc HOLD holds the drive under it.
    """
    if state.base:
        return replace(state, base=replace(state.base, held=True, at_ns=at_ns))
    if state.wish and state.wish.command is Command.FRONT and state.wish.stick is None:
        return replace(state, wish=replace(state.wish, held=True, at_ns=at_ns))
    return state


def motion_of(state: State, limits: Limits) -> Motion:
    """The motion that the live wish asks for, before any vote."""
    wish = state.wish
    if wish is None:
        return STILL
    if wish.stick is not None:
        forward, left = wish.stick
        speed = limits.forward_mm_s if forward > 0.0 else limits.backward_mm_s
        return Motion(forward * speed, left * limits.turn_deg_s)
    if wish.command in TURNS:
        turn = limits.turn_deg_s if wish.command is Command.LEFT else -limits.turn_deg_s
        return Motion(limits.arc_mm_s if state.base else 0.0, turn)
    if wish.command in (Command.BACK, Command.REVERSE):
        return Motion(-limits.backward_mm_s, 0.0)
    return Motion(limits.forward_mm_s, 0.0)


def wants_forward(state: State) -> bool:
    """A forward wish is live, bent by an arc or not."""
    wish = state.base or state.wish
    if wish is None:
        return False
    return wish.command is Command.FRONT if wish.stick is None else wish.stick[0] > 0.0


def lease_left_s(state: State, facts: Facts, limits: Limits) -> float:
    """Seconds until the forward word runs out; 0 for steps and held switches."""
    wish = state.base or state.wish
    if wish is None or wish.held or wish.command is not Command.FRONT:
        return 0.0
    return max(0.0, limits.lease_s - (facts.now_ns - wish.at_ns) / S)
