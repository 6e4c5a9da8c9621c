"""What every range sensor promises, whatever it measures with: inherited by each sensor's tests.

class TestMySonar(SensorContract):
    @pytest.fixture
    def rig(self) -> Iterator[SensorRig]: ...
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from chairward.components import DeviceLost
from chairward.messages import RangeReading, Way
from chairward.testing.device_contract import DeviceContract
from chairward.testing.device_rig import MS, PATIENCE_S, DeviceRig, Reader, S, brief, opened


class SensorRig(DeviceRig):
    """A range sensor and what stands before it.

    way: where things are shown. tolerance_mm: allowed error. fresh_s: the freshness limit a chair file would give it:
    how old what it tells may be. near_mm, far_mm: two distances it can tell apart.
    """

    way: Way = Way.AHEAD
    tolerance_mm: int = 30
    fresh_s: float = 0.3
    distances_mm: Sequence[int] = (450, 600, 750, 1500)
    near_mm: int = 500
    far_mm: int = 2000

    @abstractmethod
    def show(self, distance_mm: int | None) -> None:
        """From now on something stands that far from the footprint; None: nothing within the sensor's range."""

    @abstractmethod
    def blind(self) -> None:
        """From now on the device itself cannot tell (covered, dark, no echo at all, error code)."""

    @abstractmethod
    def silence(self) -> None:
        """From now on the device says nothing, though it is plugged in."""

    @abstractmethod
    def noise(self) -> None:
        """From now on what comes is damaged: flipped bits, lost bytes, torn pictures."""

    @abstractmethod
    def half(self) -> None:
        """The device sends half a message, then nothing."""

    @abstractmethod
    def impossible(self) -> None:
        """From now on the device sends well-formed messages with figures that cannot be (negative, huge, NaN)."""

    @abstractmethod
    def flood(self) -> None:
        """From now on the device sends as fast as it can, still the truth."""

    def freeze(self) -> None:
        """From now on the device repeats its last message for ever (only for `FrozenContract`)."""
        raise NotImplementedError

    def distance(self, reading: RangeReading) -> int | None:
        """What a reading says about `way`."""
        return {
            Way.AHEAD: reading.ahead_mm,
            Way.BEHIND: reading.behind_mm,
            Way.LEFT: reading.left_mm,
            Way.RIGHT: reading.right_mm,
        }[self.way]

    def tells(self, distance_mm: int) -> Any:
        """A test of messages: a reading that tells this distance."""
        return lambda message: clear_of(message) and self._near(message, distance_mm)

    def _near(self, reading: RangeReading, distance_mm: int) -> bool:
        told = self.distance(reading)
        return told is not None and abs(told - distance_mm) <= self.tolerance_mm


def clear_of(message: object) -> bool:
    """A reading that claims to see."""
    return isinstance(message, RangeReading) and message.can_see


class SensorContract(DeviceContract):
    """All of it. A sensor's test class inherits this and gives the fixture `rig`, a `SensorRig`."""

    def test_it_tells_how_far_away_things_are(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            for distance_mm in rig.distances_mm:
                rig.show(distance_mm)
                reader.until(rig.tells(distance_mm), f"{distance_mm} mm {rig.way}")

    def test_nothing_near_is_a_large_distance_not_silence(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(None)
            reader.until(
                lambda m: clear_of(m) and (rig.distance(m) or 0) >= rig.far_mm,
                f"a reading that the way {rig.way} is free (rule 10 counts a way as watched only by a distance there)",
            )

    def test_it_speaks_all_the_time_also_when_nothing_changes(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            for _ in range(10):
                reader.until(rig.tells(rig.far_mm), "the next reading")

    def test_what_comes_near_is_told_within_the_freshness_limit(self, rig: SensorRig) -> None:
        changes(rig, rig.far_mm, rig.near_mm)

    def test_what_goes_away_is_told_within_the_freshness_limit(self, rig: SensorRig) -> None:
        changes(rig, rig.near_mm, rig.far_mm)

    def test_cannot_see_is_said_with_a_reason_and_is_never_clear(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            reader.until(rig.tells(rig.far_mm), "a first reading")
            blind_ns = now_ns()
            rig.blind()
            said = reader.until(
                lambda m: isinstance(m, RangeReading) and not m.can_see,
                "can_see=False (a sensor that cannot tell must say so: 'cannot see' is not 'clear')",
            )
            assert said.reason, "say in `reason` why it cannot see: people read it"
            assert rig.distance(said) is None, "a blind reading tells no distance"
            never_seen_after(rig, reader, blind_ns)

    def test_it_sees_again_when_it_can(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.blind()
            reader.until(lambda m: isinstance(m, RangeReading) and not m.can_see, "can_see=False")
            rig.show(rig.near_mm)
            reader.until(rig.tells(rig.near_mm), "seeing again")

    def test_a_silent_device_is_never_read_as_a_distance(self, rig: SensorRig) -> None:
        self._nothing_is_seen(rig, rig.silence)

    def test_noise_is_never_read_as_a_distance(self, rig: SensorRig) -> None:
        self._nothing_is_seen(rig, rig.noise)

    def test_half_a_message_is_never_read_as_a_distance(self, rig: SensorRig) -> None:
        self._nothing_is_seen(rig, rig.half)

    def test_an_impossible_figure_is_never_read_as_a_distance(self, rig: SensorRig) -> None:
        self._nothing_is_seen(rig, rig.impossible)

    def test_it_speaks_again_after_silence(self, rig: SensorRig) -> None:
        self._recovers_from(rig, rig.silence)

    def test_it_reads_on_after_noise(self, rig: SensorRig) -> None:
        self._recovers_from(rig, rig.noise)

    def test_half_a_message_does_not_spoil_the_next(self, rig: SensorRig) -> None:
        self._recovers_from(rig, rig.half)

    def test_half_a_message_does_not_hold_read_up(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.half()
            rig.wait(0.1)
            for timeout_s in (0.0, 0.1, 0.2):
                for _ in range(3):
                    try:
                        reader.step(timeout_s)
                    except DeviceLost:
                        return  # said: also an honest answer

    def test_old_data_that_waited_is_not_called_fresh(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            reader.until(rig.tells(rig.far_mm), "a first reading")
            rig.wait(rig.fresh_s)  # what nobody reads now waits in the device, the port, the driver
            near_ns = now_ns()
            rig.show(rig.near_mm)
            rig.wait(2 * rig.fresh_s)
            reader.until(rig.tells(rig.near_mm), "the near thing")
            honest(rig, reader, rig.far_mm, near_ns)

    def test_a_flooding_device_does_not_make_it_late(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            reader.until(rig.tells(rig.far_mm), "a first reading")
            rig.flood()
            rig.wait(rig.fresh_s)
            near_ns = now_ns()
            rig.show(rig.near_mm)
            rig.flood()
            reader.until(rig.tells(rig.near_mm), "the near thing, among the flood")
            honest(rig, reader, rig.far_mm, near_ns)

    def _nothing_is_seen(self, rig: SensorRig, happens: Any) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            reader.until(rig.tells(rig.far_mm), "a first reading")
            at_ns = now_ns()
            happens()
            never_seen_after(rig, reader, at_ns)

    def _recovers_from(self, rig: SensorRig, happens: Any) -> None:
        with opened(rig) as reader:
            happens()
            reader.during(0.3)
            rig.show(rig.near_mm)
            try:
                first = reader.until(clear_of, "a reading afterwards")
            except DeviceLost:  # also an honest answer: the lane closes it and opens it again
                reader.thing.close()
                reader.thing.open()
                first = reader.until(clear_of, "a reading after opening again")
            told_right = rig.tells(rig.near_mm)(first)
            assert told_right, f"what was left of the trouble was read as a distance: {brief(first)}"


class FrozenContract:
    """For sensors whose device shows that it lives (a counter, a changing picture): repeating is being blind."""

    def test_a_device_that_repeats_itself_for_ever_is_not_believed(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            reader.until(rig.tells(rig.far_mm), "a first reading")
            at_ns = now_ns()
            rig.freeze()
            never_seen_after(rig, reader, at_ns)

    def test_a_device_that_goes_on_is_believed_again(self, rig: SensorRig) -> None:
        with opened(rig) as reader:
            rig.show(rig.far_mm)
            reader.until(rig.tells(rig.far_mm), "a first reading")
            rig.freeze()
            reader.during(2 * rig.fresh_s)
            rig.show(rig.near_mm)
            reader.until(rig.tells(rig.near_mm), "the truth again")


def changes(rig: SensorRig, before_mm: int, after_mm: int) -> None:
    """What is shown changes; nothing captured more than fresh_s later still tells the old distance."""
    with opened(rig) as reader:
        rig.show(before_mm)
        reader.until(rig.tells(before_mm), f"{before_mm} mm")
        at_ns = now_ns()
        rig.show(after_mm)
        reader.until(rig.tells(after_mm), f"{after_mm} mm")
        honest(rig, reader, before_mm, at_ns)


def honest(rig: SensorRig, reader: Reader, old_mm: int, changed_ns: int) -> None:
    """Nothing that tells the old distance claims to be captured after the change."""
    limit_ns = changed_ns + int(rig.fresh_s * S)
    late = [m for m in reader.said if rig.tells(old_mm)(m) and m.captured_ns > limit_ns]
    assert not late, (
        f"{len(late)} readings still tell {old_mm} mm but claim to be captured up to "
        f"{(late[-1].captured_ns - changed_ns) / MS:.0f} ms after it changed: drop what waited in the device and "
        "the port (take the newest), and let captured_ns be when the data was measured, not when it was read"
    )


def never_seen_after(rig: SensorRig, reader: Reader, at_ns: int) -> None:
    """Whatever it says for a while: nothing captured more than fresh_s after at_ns claims to see."""
    reader.during(min(PATIENCE_S, 2 * rig.fresh_s + 0.3))
    limit_ns = at_ns + int(rig.fresh_s * S)
    seen = [m for m in reader.said if clear_of(m) and m.captured_ns > limit_ns]
    assert not seen, f"it claims to see {(seen[0].captured_ns - at_ns) / MS:.0f} ms later: {brief(seen[0])}"


def now_ns() -> int:
    """The clock of all messages."""
    return time.monotonic_ns()
