"""The guard: the one process that owns the arbiter and the drive. It ticks for ever and always emits.

Its tick is the drive's period. A message that may take something away is decided upon at once, so a stop does not wait
for the tick; what leaves only one answer is answered by `reflex` even before. A message that only says that all is well
waits for the tick, and so delays no stop. Each lane has a budget of messages a tick: who spends it is not listened to
until the next tick, and so goes stale. When the supervisor's end closes, the guard stops the chair and leaves; when the
guard dies, the controller's own watchdog stops the chair.
"""

from __future__ import annotations

import gc
import os
import selectors
import signal
import socket
import sys
import time
from collections.abc import Sequence
from enum import Enum
from pathlib import Path

import msgspec

from chairward import arbiter, plan, wire
from chairward.border import Border
from chairward.components import STILL, Drive
from chairward.copies import Copies
from chairward.drive_line import DriveLine
from chairward.facts import Limits, S, State
from chairward.options import GuardOptions
from chairward.plan import Plan
from chairward.plugins import discover_only
from chairward.realtime import claim, suspended_ns
from chairward.records import Record
from chairward.reflex import reflex

MESSAGES_A_TICK = 8
LEAVE_WITHIN_NS = 2 * S
COLLECT_EVERY_TICKS = 256


class Line(Enum):
    """What a readable descriptor is, beside the lanes (which are known by name)."""

    CONTROL = 1
    DRIVE = 2


class Guard:
    """State of the running guard; `run` returns its exit code."""

    def __init__(
        self,
        the_plan: Plan,
        drive: Drive,
        lanes: dict[str, socket.socket],
        control: socket.socket,
        observers: Sequence[socket.socket],
    ) -> None:
        self.limits: Limits = the_plan.limits
        self.border = Border({lane.name: lane for lane in the_plan.lanes}, the_plan.limits)
        self.lanes = dict(lanes)
        self.control = control
        self.copies = Copies(observers)
        self.state = State()
        self.supervisor_ns = 0
        self.tick = 0
        self.periods = 0
        self.leaving_since_ns = 0
        self.leaving_because = ""
        self.selector = selectors.SelectSelector()  # epoll and poll round the time-out up to whole milliseconds
        self.drive = DriveLine(drive, self.selector, Line.DRIVE)
        self.budget: dict[str, int] = {}
        self.muted: dict[str, socket.socket] = {}

    def run(self) -> int:
        """Tick until told to quit or left alone. Always ends with a stop on the wire."""
        self.selector.register(self.control, selectors.EVENT_READ, Line.CONTROL)
        for name, end in self.lanes.items():
            self.selector.register(end, selectors.EVENT_READ, name)
        now = time.monotonic_ns()
        self.supervisor_ns = now
        due, last, asleep = now + self.drive.period_ns, now, suspended_ns()
        try:
            while not self._may_leave():
                urgent = self._wait(max(0, due - time.monotonic_ns()) / S)
                now = time.monotonic_ns()
                slept = suspended_ns()
                gap = max(now - last - self.drive.period_ns, slept - asleep)
                gap = gap if gap > self.limits.gap_limit_ns else 0
                last, asleep = now, slept
                periodic = now >= due
                if periodic or urgent or gap:
                    self._act(now, due if periodic else now, gap, periodic=periodic)
                if periodic:
                    due += self.drive.period_ns * (1 + (now - due) // self.drive.period_ns)
                    self._new_tick()
        finally:
            self.drive.close()
            self.copies.close()
            for end in (*self.lanes.values(), self.control):
                end.close()
            self.selector.close()
        return 0

    def _wait(self, timeout_s: float) -> bool:
        """Sleep until the next tick or a message; drain what came. True when some of it cannot wait for the tick."""
        urgent = False
        for key, _ in self.selector.select(timeout_s):
            if key.data is Line.CONTROL:
                self._drain_control()
            elif key.data is Line.DRIVE:
                urgent |= self.drive.woke(time.monotonic_ns())
            elif key.data in self.lanes:  # the control line may just have closed it
                urgent |= self._drain_lane(key.data)
        return urgent

    def _drain_lane(self, name: str) -> bool:
        end = self.lanes[name]
        urgent = False
        while True:
            left = self.budget.get(name, MESSAGES_A_TICK)
            if left <= 0:
                self.selector.unregister(end)
                self.muted[name] = end
                return urgent
            data = wire.receive(end)
            if data is None:
                return urgent
            if not data:
                self._close_lane(name, "its process has closed the line")
                return True
            self.budget[name] = left - 1
            urgent |= self.border.take(name, data, time.monotonic_ns())

    def _close_lane(self, name: str, reason: str) -> None:
        end = self.lanes.pop(name, None)
        if end is None:
            return
        if self.muted.pop(name, None) is None:
            self.selector.unregister(end)
        end.close()
        self.border.lane_lost(name, reason)

    def _drain_control(self) -> None:
        try:
            while (received := wire.receive_control(self.control)) is not None:
                message, fds = received
                match message:
                    case wire.Heartbeat():
                        self.supervisor_ns = time.monotonic_ns()
                    case wire.Died(lane, reason):
                        self._close_lane(lane, reason)
                        self.border.lane_lost(lane, reason)
                    case wire.Attach(lane) if fds and lane in self.border.lanes:
                        self._close_lane(lane, "replaced")
                        self.lanes[lane] = wire.adopt(fds.pop())
                        self.selector.register(self.lanes[lane], selectors.EVENT_READ, lane)
                        self.border.lane_attached(lane)
                    case wire.Observe() if fds:
                        self.copies.add(wire.adopt(fds.pop()))
                    case wire.Quit():
                        self.leave()
                for fd in fds:  # nobody asked for these
                    os.close(fd)
        except EOFError:
            self.selector.unregister(self.control)
            self.supervisor_ns = 0
            self.leave("its process has ended")

    def leave(self, reason: str = "the run is ending") -> None:
        """Stop the chair, then end; the run's last decisions are recorded like all others."""
        if not self.leaving_since_ns:
            self.leaving_since_ns, self.leaving_because = time.monotonic_ns(), reason

    def _may_leave(self) -> bool:
        """Leaving, and the controller has said that it stands (or had its time)."""
        if not self.leaving_since_ns:
            return False
        status, waited = self.drive.status, time.monotonic_ns() - self.leaving_since_ns
        standing = status.linked and abs(status.speed_mm_s or 0.0) < 1.0 and waited > 5 * self.drive.period_ns
        return standing or not status.linked or waited > LEAVE_WITHIN_NS

    def _new_tick(self) -> None:
        self.budget.clear()
        self.drive.new_tick()
        self.periods += 1
        for name, end in self.muted.items():
            self.selector.register(end, selectors.EVENT_READ, name)
        self.muted.clear()
        if self.periods % COLLECT_EVERY_TICKS == 0:
            gc.collect()  # what there was at the start is frozen, so this takes microseconds

    def _act(self, now: int, due: int, gap_ns: int, *, periodic: bool) -> None:
        """Facts, decision, drive, record. A message of a lane need not wait for the port of a drive that is silent."""
        if periodic or gap_ns or self.drive.must_be_polled:
            self.drive.poll(now, connect=periodic)
        if self.leaving_since_ns:
            self.border.lane_lost("supervisor", self.leaving_because)
        facts = self.border.facts(now, self.drive.status, self.supervisor_ns, gap_ns)
        before = self.state
        stopped_ns = self.drive.stop(now) if reflex(before, facts, self.limits) else 0
        after, decision = arbiter.decide(before, facts, self.limits)
        motion, hard = decision.motion, decision.hard_stop
        if time.monotonic_ns() - now > self.limits.gap_limit_ns:
            motion, hard = STILL, True  # stopped between deciding and writing; the next decision latches the gap
        self.drive.command(now, motion, decision, hard=hard, periodic=periodic)
        wrote_ns = stopped_ns if stopped_ns and not hard else time.monotonic_ns()
        self.state = after
        record = Record(
            tick=self.tick,
            due_ns=due,
            woke_ns=now,
            wrote_ns=wrote_ns,
            periodic=periodic,
            before=before,
            facts=facts,
            after=after,
            decision=decision,
            newest_sent_ns=self.border.newest_sent_ns,
            told=self.drive.motion,
            told_hard=self.drive.hard,
            frame=self.drive.last_frame,
        )
        self.copies.publish(record)
        self.tick += 1


def main(argv: Sequence[str] | None = None) -> int:
    """The guard's process; it imports only the plugin of its drive."""
    options = msgspec.json.decode((argv or sys.argv[1:])[0], type=GuardOptions)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    the_plan = plan.read(Path(options.plan))
    control = wire.adopt(options.control)
    component = discover_only([the_plan.drive.plugin]).get("drive", the_plan.drive.component)
    run_dir = Path(options.run_dir)
    settings = component.settings.model_validate(plan.fill_run_dir(the_plan.drive.settings, run_dir))
    lane = the_plan.lanes[0]
    drive = component.make(settings, the_plan.context("drive", lane.pose, run_dir))
    guard = Guard(
        the_plan,
        drive,
        {name: wire.adopt(fd) for name, fd in options.lanes.items()},
        control,
        [wire.adopt(fd) for fd in options.observers],
    )
    signal.signal(signal.SIGTERM, lambda *_: guard.leave())
    granted = claim()
    up = wire.GuardIsUp(os.getpid(), granted.fifo, granted.memory_locked, granted.why)
    wire.send_control(control, up)
    return guard.run()


if __name__ == "__main__":
    sys.exit(main())
