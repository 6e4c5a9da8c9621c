"""A lane as the supervisor sees it: its process, what it says of itself, and what is wrong with it."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from dataclasses import dataclass

from chairward import wire
from chairward.plan import LanePlan
from chairward.processes import Process, Restarted

START_S = 90.0
HANG_S = 5.0
BEATS_AT_ONCE = 64
FLOOD_A_SECOND = 500
"""More messages than this are a flood. A line that nobody has read for long holds fewer."""
NOTES_A_PROCESS = 3
"""A lane has one sentence to say, when it cannot start; of one who says many, few are written down."""


@dataclass(slots=True)
class LaneProcess(Restarted):
    """One lane of a run, through all its processes."""

    plan: LanePlan
    control: socket.socket
    beat_s: float = 0.0
    items: int = 0
    dropped: int = 0
    dropped_before: int = 0
    ended: bool = False
    lost: bool = False
    _said: int = 0
    _said_since_s: float = 0.0
    _notes: int = 0
    _last_note: str = ""

    def started_again(self, process: Process, control: socket.socket) -> None:
        """A new process, of which nothing is known yet."""
        self.control.close()
        self.runs_as(process)
        self.control, self.beat_s, self.items = control, 0.0, 0
        self.dropped_before += self.dropped
        self.dropped = self._said = self._notes = 0

    def listen(self, now: float) -> Iterator[str]:
        """Take what it says of itself, without waiting; gives what people should be told of it."""
        if now - self._said_since_s >= 1.0:
            self._said, self._said_since_s = 0, now
        for _ in range(BEATS_AT_ONCE):
            try:
                received = wire.receive_control(self.control)
            except (EOFError, OSError):
                return
            if received is None:
                return
            self._said += 1
            message, fds = received
            for fd in fds:  # a lane has none to give
                os.close(fd)
            match message:
                case wire.Beat():
                    yield from self._beat(message, now)
                case wire.Note(text) if self._notes < NOTES_A_PROCESS and text != self._last_note:
                    self._notes, self._last_note = self._notes + 1, text
                    yield text

    def _beat(self, beat: wire.Beat, now: float) -> Iterator[str]:
        if beat.dropped and not self.dropped:
            yield f"lane '{self.plan.name}' says more than the guard listens to: what is over is lost"
        if beat.ended and not self.ended:
            self.ended = True
            yield f"lane '{self.plan.name}': its input has ended"
        self.beat_s, self.items, self.dropped, self.lost = now, beat.items, beat.dropped, beat.lost

    def trouble(self, now: float) -> str:
        """Why a process that still lives has to be ended, or ""."""
        if self.items and now - self.beat_s > HANG_S:
            return f"its process has not moved for {HANG_S:.0f} s"
        if not self.items and now - max(self.started_s, self.beat_s) > START_S:
            return f"its process was not ready within {START_S:.0f} s"
        return "its process floods its line to the supervisor" if self._said > FLOOD_A_SECOND else ""
