"""What keys say to the guard."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from chairward.messages import Alive, Button, Command, Intent, Press
from chairward_keys.events import KeyEvent, Stroke
from chairward_keys.settings import DEFAULT_KEYS
from chairward_keys.switchboard import Switchboard

MS = 1_000_000


def board(other: str = "stop") -> Switchboard:
    return Switchboard(DEFAULT_KEYS, other)  # type: ignore[arg-type]


def down(key: str) -> KeyEvent:
    return KeyEvent(key, Stroke.DOWN)


def up(key: str) -> KeyEvent:
    return KeyEvent(key, Stroke.UP)


def said(messages: list[object]) -> list[object]:
    """Buttons and commands, without heartbeats."""
    return [m.button if isinstance(m, Press) else m.command for m in messages if isinstance(m, Press | Intent)]


def test_each_button_is_pressed_once() -> None:
    for key, button in (("space", Button.STOP), ("enter", Button.ARM), ("r", Button.RESET)):
        assert said([*board().step(0, [down(key), up(key)])]) == [button]


def test_a_held_command_repeats_within_100_ms_until_it_is_let_go() -> None:
    keys, times = board(), []
    for now_ms in range(0, 1000, 10):
        events = [down("w")] if now_ms == 100 else [up("w")] if now_ms == 700 else []
        for message in keys.step(now_ms * MS, events):
            if isinstance(message, Intent):
                assert message.held
                assert message.command is Command.FRONT
                times.append(now_ms)
    assert times[0] == 100
    assert 650 <= times[-1] < 700
    assert all(b - a <= 60 for a, b in pairwise(times))


def test_hold_is_a_button_that_repeats() -> None:
    keys = board()
    assert said([*keys.step(0, [down("h")])]) == [Button.HOLD]
    assert said([*keys.step(60 * MS, [])]) == [Button.HOLD]
    assert said([*keys.step(120 * MS, [up("h")])]) == []


def test_of_several_held_keys_the_last_one_counts_and_the_earlier_comes_back() -> None:
    keys = board()
    keys.step(0, [down("up")])
    assert said([*keys.step(60 * MS, [down("left")])]) == [Command.LEFT]
    assert said([*keys.step(120 * MS, [up("left")])]) == [Command.FRONT]


def test_stop_lets_go_of_everything_until_pressed_anew() -> None:
    keys = board()
    keys.step(0, [down("w")])
    assert said([*keys.step(60 * MS, [down("space")])]) == [Button.STOP]
    assert said([*keys.step(200 * MS, [])]) == []
    assert said([*keys.step(300 * MS, [up("w"), down("w")])]) == [Command.FRONT]


def test_lost_events_let_go_of_everything() -> None:
    keys = board()
    keys.step(0, [down("w")])
    assert said([*keys.step(60 * MS, [KeyEvent("", Stroke.LOST)])]) == []


def test_any_other_key_stops_unless_it_is_told_to_be_ignored() -> None:
    assert said([*board().step(0, [down("x")])]) == [Button.STOP]
    assert said([*board("ignore").step(0, [down("x")])]) == []


def test_a_call_for_help_is_said_once() -> None:
    keys = Switchboard({"space": "stop", "f": "help"}, "ignore")
    (message, *_) = keys.step(0, [down("f"), up("f")])
    assert isinstance(message, Intent)
    assert (message.command, message.held) == (Command.HELP, False)


@given(st.lists(st.tuples(st.integers(1, 200), st.sampled_from("whx "), st.booleans()), max_size=40))
def test_heartbeats_come_at_most_100_ms_apart_and_numbers_rise(moves: list[tuple[int, str, bool]]) -> None:
    keys, now_ns, beats, numbers = board(), 0, [], []
    for wait_ms, key, is_down in moves:
        target_ns = now_ns + wait_ms * MS
        while (due_ns := max(now_ns, keys.next_due_ns())) < target_ns:
            now_ns = due_ns
            for message in keys.step(now_ns, []):
                beats += [now_ns] if isinstance(message, Alive) else []
                numbers.append(message.seq)
        now_ns = target_ns
        for message in keys.step(now_ns, [down(key) if is_down else up(key)]):
            beats += [now_ns] if isinstance(message, Alive) else []
            numbers.append(message.seq)
    assert all(b - a <= 100 * MS for a, b in pairwise(beats))
    assert all(a < b for a, b in pairwise(numbers))
