"""What set-up pages know of the run that serves them, and when they may do anything: only while the chair is not armed.

A word that is said to try it must not move the chair, and what set-up computes must not take time from the sensors.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chairward.plan import Plan
from chairward_dashboard.answers import Refused
from chairward_dashboard.commands import Commands
from chairward_dashboard.view import View

ARMED = "setup.armed"


@dataclass(slots=True)
class Setup:
    """The run's plan (None where it cannot be read: then there is no set-up), its folder, and the command line."""

    plan: Plan | None
    run_dir: Path
    view: View
    commands: Commands = field(default_factory=Commands)

    def the_plan(self) -> Plan:
        """The plan of the run. Raises Refused."""
        if self.plan is None:
            raise Refused(503, "the plan of this run cannot be read")
        return self.plan

    def at_rest(self) -> None:
        """Raises Refused while the chair is armed or moves."""
        state = self.view.state(time.monotonic_ns())
        if state.get("armed") or not state.get("standing", True):
            raise Refused(409, ARMED)

    @property
    def profiles(self) -> tuple[str, str]:
        """The option that names the folder of profiles from which this run was started."""
        return "--profiles", str(Path(self.the_plan().person_file).parent.parent)

    def known(self, person: str) -> str:
        """The name of a person who has a profile; never a path. Raises Refused."""
        file = Path(self.the_plan().person_file).parent / f"{person}.toml"
        if Path(person).name != person or not file.is_file():
            raise Refused(404, f"there is no person '{person}'")
        return person

    async def set(self, person: str, changes: Sequence[str], *, keep: bool = True) -> dict[str, Any]:
        """`chairward profile set`; keep False: only whether it would be allowed. Raises Refused, CommandError."""
        options = (*self.profiles, "--json", *([] if keep else ["--try"]))
        return dict(await self.commands.json("profile", "set", *options, "--", self.known(person), *changes))

    @property
    def environment(self) -> dict[str, str]:
        """The same for commands without that option."""
        return {"CHAIRWARD_PROFILES": self.profiles[1]}

    @property
    def people_dir(self) -> Path:
        """Where people's own recordings are kept, a folder each."""
        return Path(self.the_plan().person_dir).parent
