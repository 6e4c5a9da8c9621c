"""The contracts of held devices and of words: a good device keeps them, and each fault breaks the test it should."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from chairward.components import Component, Context, DeviceLost, NoSettings
from chairward.messages import Alive, Command, Intent, Message
from chairward.testing import HeldDeviceContract, RecognizerRig, WordContract

PERIOD_S = 0.02


@dataclass
class Box:
    """A box with switches, or one that listens; fault: what is wrong with it."""

    holds: bool
    fault: str = ""
    asked: Command | None = None
    once: bool = False
    there: bool = True
    seq: int = 0
    clock: threading.Event = field(default_factory=threading.Event)

    def open(self) -> None:
        if not self.there:
            raise DeviceLost("box is not there: plug it in")
        self.once = False

    def read(self, timeout_s: float) -> list[Message]:
        del timeout_s
        self.clock.wait(PERIOD_S)
        if not self.there and self.fault != "outlives its device":
            raise DeviceLost("box was unplugged: plug it in again")
        said: list[Message] = [Alive(seq=self.next(), captured_ns=time.monotonic_ns())]
        if self.asked and ((self.holds and self.fault != "said once") or not self.once):
            self.once = True
            said += [self.intent(self.asked) for _ in range(2 if self.fault == "said twice" else 1)]
        return said

    def intent(self, command: Command) -> Intent:
        return Intent(
            seq=self.next(),
            captured_ns=time.monotonic_ns(),
            command=command,
            word="" if self.fault == "no word" else command,
            held=self.holds != (self.fault == "wrongly held"),
        )

    def next(self) -> int:
        self.seq += 1
        return self.seq

    def close(self) -> None:
        """Nothing is held."""


class BoxRig(RecognizerRig):
    """The box and the hand or voice before it."""

    name = "box"

    def __init__(self, box: Box) -> None:
        self.box, self.settings = box, {}
        self.component = Component(name="box", settings=NoSettings, make=self.make_box, summary="a box")

    def make_box(self, settings: NoSettings, context: Context) -> Box:
        del settings, context
        return self.box

    def ask(self, command: Command) -> None:
        self.box.asked, self.box.once = command, False

    def let_go(self) -> None:
        if self.box.fault != "sticks":
            self.box.asked = None

    def stop(self) -> None:
        self.box.asked = None

    def babble(self) -> None:
        """It hears nothing but commands."""

    def unplug(self) -> None:
        self.box.there = False

    def plug(self) -> None:
        self.box.there = True

    def close(self) -> None:
        """Nothing is held."""


def added_by(contract: type) -> Iterator[str]:
    """The tests that a contract itself adds to what all recognizers promise."""
    return (name for name in vars(contract) if name.startswith("test_"))


@pytest.mark.parametrize("name", [*added_by(HeldDeviceContract), *added_by(WordContract)])
def test_a_good_device_keeps_what_its_contract_adds(name: str) -> None:
    contract = HeldDeviceContract if name in vars(HeldDeviceContract) else WordContract
    getattr(contract(), name)(BoxRig(Box(holds=contract is HeldDeviceContract)))


@pytest.mark.parametrize(
    ("name", "fault", "says"),
    [
        ("test_what_is_held_is_repeated_and_says_that_it_is_held", "said once", "repeat what is held"),
        ("test_what_is_held_is_repeated_and_says_that_it_is_held", "wrongly held", "a switch is held"),
        ("test_what_is_let_go_is_no_longer_asked_for", "sticks", "still asked for"),
        ("test_a_held_command_ends_with_its_device", "outlives its device", "still asked for"),
        ("test_a_word_is_asked_for_once", "said twice", "one word, said once, became"),
        ("test_a_word_is_asked_for_once", "wrongly held", "a word is a lease"),
        ("test_a_word_is_asked_for_once", "no word", "tell the word that was heard"),
    ],
)
def test_each_fault_breaks_the_test_that_is_for_it(name: str, fault: str, says: str) -> None:
    contract = HeldDeviceContract if name in vars(HeldDeviceContract) else WordContract
    with pytest.raises(AssertionError, match=says):
        getattr(contract(), name)(BoxRig(Box(holds=contract is HeldDeviceContract, fault=fault)))
