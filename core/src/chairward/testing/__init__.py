"""Contract tests for plugin authors. Needs pytest; nothing of the running chair imports this.

A drive plugin inherits `DriveContract` (and the optional contracts that fit it) and gives one fixture, `rig`.
"""

from __future__ import annotations

import pytest

for _module in ("rig", "moving", "stopping", "losing", "extras"):
    pytest.register_assert_rewrite(f"chairward.testing.drive_{_module}")

from chairward.testing.drive_contract import DriveContract  # noqa: E402 - asserts are rewritten first
from chairward.testing.drive_extras import (  # noqa: E402
    ExclusivePortContract,
    PowerContract,
    RampContract,
    SoftStartContract,
    StopInputContract,
    VersionContract,
)
from chairward.testing.drive_rig import DriveRig  # noqa: E402

__all__ = [
    "DriveContract",
    "DriveRig",
    "ExclusivePortContract",
    "PowerContract",
    "RampContract",
    "SoftStartContract",
    "StopInputContract",
    "VersionContract",
]
