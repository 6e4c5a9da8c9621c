"""Promises of drives that `chairward check drive` can measure: every one with wheels that a rig can see."""

from __future__ import annotations

from chairward.check.drive import DriveCheck, Finding
from chairward.check.drive_bench import DriveBench
from chairward.check.drive_eyes import Instruments
from chairward.components import SILENCE_LIMIT_MS, Motion
from chairward.testing.drive_rig import DriveRig

LATE_MS = 5.0
"""What the instruments may add: two looks."""


class RigClock:
    """The rig's time as a `chairward.check.drive_bench.Clock`."""

    def __init__(self, rig: DriveRig) -> None:
        self._rig = rig

    def now_ns(self) -> int:
        """The clock that the drive is told."""
        return self._rig.now_ns()

    def wait(self, seconds: float, _fd: int) -> None:
        """Let it pass."""
        self._rig.run(seconds)


def measured(rig: DriveRig, *, mirrored: bool = False, until: str = "") -> dict[str, Finding]:
    """The findings by step, of wheels as they are or as if both motors were wired the other way round."""
    sign = -1.0 if mirrored else 1.0

    def look() -> Motion:
        wheels = rig.wheels()
        return Motion(sign * wheels.drive_mm_s, sign * wheels.turn_deg_s)

    full = rig.full
    settings = {"full_speed_mm_s": full.drive_mm_s, "full_turn_deg_s": full.turn_deg_s, "drive_sign": 1, "turn_sign": 1}
    bench = DriveBench(rig.drive, RigClock(rig))
    found: dict[str, Finding] = {}
    eyes = Instruments("the rig", full, look, look)
    eyes.silences = 2
    for finding in DriveCheck(bench, eyes, settings, 100.0).run():
        found[finding.step] = finding
        if finding.step == until:
            break
    return found


class MeasurableContract:
    """Backends that `chairward check drive` measures without help."""

    def test_check_drive_measures_signs_scale_stopping_and_stop_on_silence(self, rig: DriveRig) -> None:
        found = measured(rig)
        assert all(finding.ok for finding in found.values()), found
        values = {key: value for finding in found.values() for key, value in finding.values.items()}
        assert (values["drive_sign"], values["turn_sign"]) == (1, 1)
        assert abs(values["full_speed_mm_s"] / rig.full.drive_mm_s - 1.0) <= rig.scale_error
        assert abs(values["full_turn_deg_s"] / rig.full.turn_deg_s - 1.0) <= rig.scale_error
        assert 0 < values["silence_stop_ms"] <= min(SILENCE_LIMIT_MS, rig.silence_s * 1000.0 + LATE_MS)
        assert values["hard_stop_ms"] <= rig.hard_s * 1000.0 + LATE_MS
        assert rig.braked()

    def test_check_drive_finds_motors_that_are_wired_the_other_way_round(self, rig: DriveRig) -> None:
        assert measured(rig, mirrored=True, until="signs")["signs"].values == {"drive_sign": -1, "turn_sign": -1}
