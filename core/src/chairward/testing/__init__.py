"""Contract tests for plugin authors. Needs pytest; nothing of the running chair imports this.

A plugin's tests inherit the contract of what it offers (and the optional contracts that fit it) and give one fixture,
`rig`: the component and a device, real or simulated, that the contract can trouble.
"""

from __future__ import annotations

import pytest

for _module in (
    "drive_rig",
    "drive_moving",
    "drive_stopping",
    "drive_losing",
    "drive_extras",
    "drive_measured",
    "device_rig",
):
    pytest.register_assert_rewrite(f"chairward.testing.{_module}")
for _module in ("device", "sensor", "recognizer", "source", "observer"):
    pytest.register_assert_rewrite(f"chairward.testing.{_module}_contract")

from chairward.testing.device_contract import DeviceContract  # noqa: E402 - asserts are rewritten first
from chairward.testing.device_rig import DeviceRig, Piped  # noqa: E402
from chairward.testing.drive_contract import DriveContract  # noqa: E402
from chairward.testing.drive_extras import (  # noqa: E402
    ExclusivePortContract,
    PowerContract,
    RampContract,
    SoftStartContract,
    StopInputContract,
    VersionContract,
)
from chairward.testing.drive_measured import MeasurableContract  # noqa: E402
from chairward.testing.drive_rig import DriveRig  # noqa: E402
from chairward.testing.observer_contract import ObserverContract, ObserverRig  # noqa: E402
from chairward.testing.pty_device import PtyDevice  # noqa: E402
from chairward.testing.recognizer_contract import (  # noqa: E402
    HeldDeviceContract,
    RecognizerContract,
    RecognizerRig,
    WordContract,
)
from chairward.testing.sensor_contract import FrozenContract, SensorContract, SensorRig  # noqa: E402
from chairward.testing.source_contract import FiniteSourceContract, SourceContract, SourceRig  # noqa: E402

__all__ = [
    "DeviceContract",
    "DeviceRig",
    "DriveContract",
    "DriveRig",
    "ExclusivePortContract",
    "FiniteSourceContract",
    "FrozenContract",
    "HeldDeviceContract",
    "MeasurableContract",
    "ObserverContract",
    "ObserverRig",
    "Piped",
    "PowerContract",
    "PtyDevice",
    "RampContract",
    "RecognizerContract",
    "RecognizerRig",
    "SensorContract",
    "SensorRig",
    "SoftStartContract",
    "SourceContract",
    "SourceRig",
    "StopInputContract",
    "VersionContract",
    "WordContract",
]
