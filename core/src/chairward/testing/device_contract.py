"""What every component that reads a device promises: opening, losing, closing, and its settings."""

from __future__ import annotations

import gc
import time
from itertools import pairwise

import pytest

from chairward.components import DeviceLost
from chairward.testing.device_rig import (
    PATIENCE_S,
    SLACK_S,
    DeviceRig,
    Reader,
    held_open,
    opened,
    says_who_and_what_to_do,
)


class DeviceContract:
    """Inherited by the contracts of sensors, recognizers and sources."""

    def test_every_setting_says_what_it_is(self, rig: DeviceRig) -> None:
        fields = rig.component.settings.model_fields
        assert [name for name, field in fields.items() if not field.description] == []
        assert rig.component.summary, "give the component a summary: `chairward plugins` shows it"

    def test_a_setting_that_nobody_knows_is_refused(self, rig: DeviceRig) -> None:
        with pytest.raises(ValueError, match="no_such_setting"):
            rig.component.settings.model_validate({**rig.settings, "no_such_setting": 1})

    def test_making_it_touches_no_device(self, rig: DeviceRig) -> None:
        rig.unplug()
        rig.make().close()

    def test_opening_takes_a_bounded_time(self, rig: DeviceRig) -> None:
        start = time.monotonic()
        with opened(rig):
            assert time.monotonic() - start < PATIENCE_S

    def test_closing_twice_and_before_opening_is_harmless(self, rig: DeviceRig) -> None:
        thing = rig.make()
        thing.close()
        thing.open()
        thing.close()
        thing.close()

    def test_reading_before_opening_is_a_lost_device_not_a_crash(self, rig: DeviceRig) -> None:
        thing = rig.make()
        with pytest.raises(DeviceLost):
            thing.read(0.0)

    def test_reading_after_closing_is_a_lost_device_not_a_crash(self, rig: DeviceRig) -> None:
        thing = rig.make()
        thing.open()
        thing.close()
        with pytest.raises(DeviceLost):
            thing.read(0.0)

    def test_a_missing_device_is_told_by_name_with_what_to_do(self, rig: DeviceRig) -> None:
        rig.unplug()
        thing = rig.make()
        with pytest.raises(DeviceLost) as lost:
            thing.open()
        says_who_and_what_to_do(str(lost.value), rig.name)
        thing.close()

    def test_an_unplugged_device_is_told_by_name_while_reading(self, rig: DeviceRig) -> None:
        with opened(rig) as reader:
            reader.during(0.2)
            rig.unplug()
            says_who_and_what_to_do(reader.loss(), rig.name)

    def test_reading_on_after_the_loss_tells_it_again_and_never_hangs(self, rig: DeviceRig) -> None:
        with opened(rig) as reader:
            rig.unplug()
            reader.loss()
            start = time.monotonic()
            with pytest.raises(DeviceLost):
                reader.thing.read(0.1)
            assert time.monotonic() - start < 0.1 + SLACK_S

    def test_it_works_again_after_replugging(self, rig: DeviceRig) -> None:
        with opened(rig) as reader:
            rig.unplug()
            reader.loss()
            reader.thing.close()
            rig.plug()
            reader.thing.open()
            reader.until(anything, "a message after replugging")

    def test_it_works_again_after_being_closed(self, rig: DeviceRig) -> None:
        with opened(rig) as reader:
            reader.until(anything, "a first message")
            reader.thing.close()
            reader.thing.open()
            reader.until(anything, "a message after opening again")

    def test_sequences_go_on_rising_over_close_and_open(self, rig: DeviceRig) -> None:
        with opened(rig) as reader:
            for _ in range(3):
                reader.until(anything, "a message")
                reader.thing.close()
                reader.thing.open()
            reader.until(anything, "a message")
            rising(reader)

    def test_no_message_is_from_the_future_and_none_goes_back_in_time(self, rig: DeviceRig) -> None:
        with opened(rig) as reader:
            end, newest_ns = time.monotonic() + 1.0, 0
            while time.monotonic() < end:
                for message in reader.step():
                    assert message.captured_ns <= time.monotonic_ns(), "captured in the future: CLOCK_MONOTONIC, please"
                    assert message.captured_ns >= newest_ns, "an older capture after a newer one"
                    newest_ns = message.captured_ns
            rising(reader)

    @pytest.mark.parametrize("timeout_s", [0.0, 0.05, 0.2])
    def test_read_never_outstays_its_time_out(self, rig: DeviceRig, timeout_s: float) -> None:
        with opened(rig) as reader:
            for _ in range(5):
                reader.step(timeout_s)

    def test_five_losses_leave_nothing_open(self, rig: DeviceRig) -> None:
        def once() -> None:
            with opened(rig) as reader:
                reader.during(0.05)
                rig.unplug()
                reader.loss()
            rig.plug()

        once()
        gc.collect()
        before = held_open()
        for _ in range(5):
            once()
        gc.collect()
        assert held_open() <= before, "(descriptors, threads) grow with every loss: close all in close()"


def anything(message: object) -> bool:
    """Any message at all."""
    del message
    return True


def rising(reader: Reader) -> None:
    """The sequence rises with every message."""
    sequence = [message.seq for message in reader.said]
    assert all(a < b for a, b in pairwise(sequence)), f"seq must rise: {sequence}"
