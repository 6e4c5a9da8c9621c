"""What is done outside when a person calls for help: a program of the integrator's choice is started.

An observer, so it can never hold the guard up, and it works whatever state the chair is in. The screen's tone and
message do not depend on it.
"""

from __future__ import annotations

import logging
import shutil
import subprocess
from typing import Annotated

from pydantic import Field

from chairward import records
from chairward.components import Context, Settings

log = logging.getLogger(__name__)

S = 1_000_000_000
LAST_WAIT_S = 5.0
"""A program that still runs when the run ends may take so long; then it is left to itself."""


class CallHelpSettings(Settings):
    """Which program, and how often."""

    command: Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        description='program and arguments, such as ["notify-send", "{person} calls for help"]'
    )
    again_s: float = Field(default=20.0, ge=0, le=600, description="calls within this time of the last start no second")


class CallHelp:
    """A `chairward.components.Observer`."""

    def __init__(self, settings: CallHelpSettings, context: Context) -> None:
        self._command = [word.replace("{person}", context.person) for word in settings.command]
        self._again_ns = round(settings.again_s * S)
        self._running: list[subprocess.Popen[bytes]] = []
        self._next_ns = 0
        if shutil.which(self._command[0]) is None:
            log.warning("call_help: there is no program '%s': correct call_help.command", self._command[0])

    def observe(self, record: bytes) -> None:
        """Start the program when this decision told of a call for help. Raises msgspec.DecodeError."""
        self._running = [program for program in self._running if program.poll() is None]
        told = records.decode(record)
        if not told.decision.help or told.facts.now_ns < self._next_ns:
            return
        self._next_ns = told.facts.now_ns + self._again_ns
        try:
            nowhere = subprocess.DEVNULL
            self._running.append(subprocess.Popen(self._command, stdin=nowhere, stdout=nowhere, start_new_session=True))
        except OSError as error:
            log.error("call_help: '%s' cannot be started (%s): correct call_help.command", self._command[0], error)

    def close(self) -> None:
        """Let what was started end; may be called twice."""
        while self._running:
            program = self._running.pop()
            try:
                program.wait(LAST_WAIT_S)
            except subprocess.TimeoutExpired:
                log.warning("call_help: '%s' still runs and is left to itself", self._command[0])
