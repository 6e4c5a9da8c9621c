"""The tilt inhibit: leaning too far stops the chair with a reason, and so does an accelerometer that is gone."""

from __future__ import annotations

from math import cos, radians, sin
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.arbiter import decide
from chairward.components import STILL, DeviceLost
from chairward.facts import MS, SourceLimits
from chairward.messages import Veto
from chairward.plugins import discover
from chairward.testing.ride import chair_limits, driving, healthy
from chairward.tilt import AVERAGED, Tilt, TiltSettings, lean_deg

G = 9_810.0


def lean(folder: Path, degrees: float) -> None:
    """What the kernel's files say of a chair on such a slope."""
    for axis, raw in (("x", G * sin(radians(degrees))), ("y", 0.0), ("z", G * cos(radians(degrees)))):
        (folder / f"in_accel_{axis}_raw").write_text(f"{raw:.0f}\n")


def sensor(folder: Path) -> Tilt:
    tilt = Tilt(TiltSettings(device=folder, period_ms=10, limit_deg=12.0))
    tilt.open()
    return tilt


def reads(tilt: Tilt, times: int = AVERAGED) -> Veto:
    said = [veto for _ in range(times) if (veto := tilt.read(5.0)) is not None]
    return said[-1]


def test_a_level_chair_is_not_vetoed_and_a_leaning_one_is_with_the_angle(tmp_path: Path) -> None:
    lean(tmp_path, 3.0)
    tilt = sensor(tmp_path)
    assert not reads(tilt).stop
    lean(tmp_path, 14.0)
    veto = reads(tilt)
    assert veto.stop
    assert "14 degrees" in veto.reason
    lean(tmp_path, 5.0)
    assert not reads(tilt).stop


def test_one_jolt_is_no_slope(tmp_path: Path) -> None:
    lean(tmp_path, 0.0)
    tilt = sensor(tmp_path)
    reads(tilt)
    lean(tmp_path, 40.0)
    assert not reads(tilt, times=1).stop


def test_it_speaks_all_the_time_with_a_rising_sequence(tmp_path: Path) -> None:
    lean(tmp_path, 0.0)
    tilt = sensor(tmp_path)
    assert [reads(tilt, times=1).seq for _ in range(3)] == [1, 2, 3]


@pytest.mark.parametrize("raw", ["", "nonsense", None])
def test_an_accelerometer_that_is_gone_or_broken_is_named(tmp_path: Path, raw: str | None) -> None:
    lean(tmp_path, 0.0)
    tilt = sensor(tmp_path)
    file = tmp_path / "in_accel_y_raw"
    file.unlink() if raw is None else file.write_text(raw)
    with pytest.raises(DeviceLost, match=str(tmp_path)):
        reads(tilt)


def test_a_sensor_that_says_nothing_weighs_anything_is_broken(tmp_path: Path) -> None:
    for axis in "xyz":
        (tmp_path / f"in_accel_{axis}_raw").write_text("0\n")
    with pytest.raises(DeviceLost, match="weighs"):
        sensor(tmp_path)


def test_its_veto_stops_a_driving_chair_and_its_silence_does_too(tmp_path: Path) -> None:
    lean(tmp_path, 20.0)
    limits = chair_limits(vetoers={"body/tilt": SourceLimits(freshness_ns=200 * MS)})
    facts = healthy(limits, vetoes={"body/tilt": reads(sensor(tmp_path))})
    _, decision = decide(driving(), facts, limits)
    assert decision.motion == STILL
    assert any(why.source == "body/tilt" for why in decision.reasons)
    _, decision = decide(driving(), healthy(limits, vetoes={}), limits)
    assert decision.motion == STILL


@given(st.floats(-179.0, 179.0), st.floats(0.1, 1e6))
def test_the_lean_is_the_angle_to_gravity_however_strong_the_sensor_says_it_is(angle: float, strength: float) -> None:
    gravity = (strength * sin(radians(angle)), 0.0, strength * cos(radians(angle)))
    assert lean_deg(gravity, 2) == pytest.approx(abs(angle), abs=1e-3)


def test_it_is_installed_with_the_core_and_known_to_be_a_required_vote() -> None:
    component = discover().get("source", "tilt")
    assert component.gives == (Veto,)
