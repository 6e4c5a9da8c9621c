"""What every drive backend promises, whatever wire it speaks: inherited by each backend's tests.

class TestMyDrive(DriveContract):
    @pytest.fixture
    def rig(self) -> Iterator[DriveRig]: ...
"""

from __future__ import annotations

from chairward.testing.drive_losing import Losing
from chairward.testing.drive_moving import Connecting, Moving
from chairward.testing.drive_stopping import Stopping


class DriveContract(Connecting, Moving, Stopping, Losing):
    """All of it. A backend's test class inherits this and gives the fixture `rig`, a `DriveRig`."""
