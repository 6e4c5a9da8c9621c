"""What everything promises that hears or feels what a person asks for: words, switches, sticks, gestures.

What asks as long as something is held (a switch, a stick) inherits `HeldDeviceContract`, what asks once (a word, a
gesture) `WordContract`; `RecognizerContract` is what both promise.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from typing import Any

from chairward.messages import Alive, Button, Command, Intent, Press, Stick
from chairward.testing.device_contract import DeviceContract
from chairward.testing.device_rig import MS, DeviceRig, Reader, S, opened

BEAT_S = 0.1
HELD_S = 0.1
"""A heartbeat, and what is held, repeat at least that often (messages.Alive, messages.Intent)."""


class RecognizerRig(DeviceRig):
    """A recognizer and the person before it.

    commands: what this device can ask for.
    settle_s: how long after a change what it says may still rest on what was before.
    """

    commands: Sequence[Command] = (Command.FRONT, Command.BACK, Command.LEFT, Command.RIGHT)
    settle_s: float = 0.5

    @abstractmethod
    def ask(self, command: Command) -> None:
        """The person asks for it now: says the word, presses and holds the switch, moves the stick."""

    @abstractmethod
    def let_go(self) -> None:
        """The person stops asking: lets go of switch or stick. Nothing, where a word has been said."""

    @abstractmethod
    def stop(self) -> None:
        """The person asks for a stop, in whatever way this device has for it."""

    @abstractmethod
    def babble(self) -> None:
        """Something else than a command: another word, a cough, a key that means nothing, a trembling stick."""

    def heard(self, message: object, command: Command) -> bool:
        """Whether a message asks for that command; a stick tells it by its direction."""
        if isinstance(message, Stick):
            return command in _directions(message)
        return isinstance(message, Intent) and message.command is command


class RecognizerContract(DeviceContract):
    """What a held device and a word have in common. The fixture `rig` is a `RecognizerRig`."""

    def test_it_says_that_it_lives_ten_times_a_second(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            start, first = time.monotonic(), len(reader.said)
            reader.during(2.0)
            beats = [m for m in reader.said[first:] if well(m)]
            wanted = (time.monotonic() - start) / BEAT_S
            assert len(beats) >= wanted / 4, f"{len(beats)} heartbeats where {wanted:.0f} were due: send Alive by time"

    def test_each_command_is_heard_as_itself(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            for command in rig.commands:
                reader.until(well, "Alive(well=True)")
                first = len(reader.said)
                rig.ask(command)
                reader.until(partial(rig.heard, command=command), f"'{command}'")
                rig.let_go()
                reader.during(rig.settle_s)
                others = [m for m in reader.said[first:] if asks(m) and not rig.heard(m, command)]
                assert not others, f"asked for {command}, heard {others[0]}"

    def test_a_stop_is_heard(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.stop()
            reader.until(stops, "a stop")

    def test_a_stop_is_heard_while_something_else_is_asked_for(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.ask(rig.commands[0])
            reader.until(lambda m: rig.heard(m, rig.commands[0]), f"'{rig.commands[0]}'")
            rig.stop()
            reader.until(stops, "a stop")

    def test_after_a_stop_nothing_goes_on_by_itself(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.ask(rig.commands[0])
            reader.until(lambda m: rig.heard(m, rig.commands[0]), f"'{rig.commands[0]}'")
            rig.stop()
            stopped_ns = reader.until(stops, "a stop").captured_ns
            rig.let_go()
            _nothing_asked_after(rig, reader, stopped_ns)

    def test_nothing_is_heard_while_nobody_asks(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.during(1.5)
            assert not [m for m in reader.said if asks(m)]

    def test_what_is_no_command_moves_nothing(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.babble()
            reader.during(1.5)
            assert not [m for m in reader.said if asks(m)]

    def test_a_dead_device_is_never_called_well(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.unplug()
            gone_ns = time.monotonic_ns()
            reader.during(1.5)
            late = [m for m in reader.said if well(m) and m.captured_ns > gone_ns + int(rig.settle_s * S)]
            assert not late, f"well {(late[0].captured_ns - gone_ns) / MS:.0f} ms after its device was gone"

    def test_what_was_asked_for_before_it_was_opened_is_not_heard(self, rig: RecognizerRig) -> None:
        rig.ask(rig.commands[0])
        rig.let_go()
        rig.wait(0.3)
        with opened(rig) as reader:
            reader.during(1.0)
            old = [m for m in reader.said if asks(m)]
            assert not old, f"{old[0]} was asked for before: drop what waits in the device when it is opened"

    def test_replugging_does_not_ask_for_anything_by_itself(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.ask(rig.commands[0])
            reader.until(asks, "the command")
            rig.let_go()
            rig.unplug()
            reader.loss()
            reader.thing.close()
            rig.plug()
            reader.thing.open()
            first = len(reader.said)
            reader.until(well, "Alive(well=True)")
            reader.during(0.5)
            assert not [m for m in reader.said[first:] if asks(m)]


class HeldDeviceContract(RecognizerContract):
    """All that a switch, a stick or whatever else must be held promises. The fixture `rig` is a `RecognizerRig`."""

    def test_what_is_held_is_repeated_and_says_that_it_is_held(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            first = _hold(rig, reader)
            reader.during(1.0)
            again = [m for m in reader.said if asks(m) and m.seq >= first.seq]
            assert all(m.held for m in again if isinstance(m, Intent)), "a switch is held: Intent(held=True)"
            gaps_s = sorted((b.captured_ns - a.captured_ns) / S for a, b in pairwise(again))
            assert gaps_s, "repeat what is held, with a new captured_ns"
            assert gaps_s[len(gaps_s) // 2] <= HELD_S, f"repeat at least every {HELD_S} s, not every {gaps_s}"

    def test_what_is_let_go_is_no_longer_asked_for(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            _hold(rig, reader)
            rig.let_go()
            _nothing_asked_after(rig, reader, time.monotonic_ns())

    def test_a_held_command_ends_with_its_device(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            _hold(rig, reader)
            rig.unplug()
            _nothing_asked_after(rig, reader, time.monotonic_ns())


class WordContract(RecognizerContract):
    """All that a word, a gesture or whatever else asks once promises. The fixture `rig` is a `RecognizerRig`."""

    def test_a_word_is_asked_for_once(self, rig: RecognizerRig) -> None:
        with opened(rig) as reader:
            reader.until(well, "Alive(well=True)")
            rig.ask(rig.commands[0])
            reader.until(asks, "the word")
            reader.during(1.5)
            heard = [m for m in reader.said if asks(m)]
            assert len(heard) == 1, f"one word, said once, became {heard}"
            assert not heard[0].held, "a word is a lease, not something held"
            assert heard[0].word, "tell the word that was heard: people read it"


def _hold(rig: RecognizerRig, reader: Reader) -> Any:
    """The first thing that is asked for, once the device is well and its switch is held."""
    reader.until(well, "Alive(well=True)")
    rig.ask(rig.commands[0])
    return reader.until(asks, "what is held")


def well(message: object) -> bool:
    """A heartbeat that says that all is well."""
    return isinstance(message, Alive) and message.well


def asks(message: Any) -> bool:
    """Asks for motion."""
    if isinstance(message, Stick):
        return bool(_directions(message))
    return isinstance(message, Intent) and message.command not in (Command.STOP, Command.HELP)


def stops(message: object) -> bool:
    """Asks for a stop; a stick at rest does."""
    if isinstance(message, Stick):
        return not _directions(message)
    if isinstance(message, Press):
        return message.button is Button.STOP
    return isinstance(message, Intent) and message.command is Command.STOP


def _directions(stick: Stick) -> set[Command]:
    ways = {Command.FRONT: stick.forward > 0, Command.BACK: stick.forward < 0}
    ways |= {Command.LEFT: stick.left > 0, Command.RIGHT: stick.left < 0}
    return {command for command, asked in ways.items() if asked}


def _nothing_asked_after(rig: RecognizerRig, reader: Reader, at_ns: int) -> None:
    reader.during(rig.settle_s + 0.5)
    late = [m for m in reader.said if asks(m) and m.captured_ns > at_ns + int(rig.settle_s * S)]
    assert not late, f"still asked for {(late[0].captured_ns - at_ns) / MS:.0f} ms later: {late[0]}"
