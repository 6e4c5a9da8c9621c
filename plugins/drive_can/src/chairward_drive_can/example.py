"""The example DBC controller's table, as a chair file would give it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

EXAMPLE_DBC = Path(__file__).parent / "data" / "example.dbc"
EXAMPLE_TABLE: dict[str, Any] = {
    "file": str(EXAMPLE_DBC),
    "forward": "Drive.Forward",
    "turn": "Drive.Turn",
    "enable": "Drive.Mode",
    "enable_stop": 2,
    "counter": "Drive.Counter",
    "checksum": "Drive.Check",
    "speed": "Status.Speed",
    "turning": "Status.Turning",
    "fault": "Status.Fault",
    "stopped_by_user": "Status.UserStop",
    "armed": "Status.Armed",
    "battery": "Status.Battery",
    "charging": "Status.Charging",
}
