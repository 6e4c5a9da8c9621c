"""The guard: the one process that owns the arbiter and the drive. It ticks for ever and always emits.

Its tick is the drive's period; it also acts when a message arrives that may take something away, so a stop does not
wait for the tick; what only says that all is well does, and so is in nobody's way. Each lane has a budget of messages a
tick: who spends it is not listened to until the next tick, and so goes stale. When the supervisor's end closes, the
guard stops the chair and leaves; when the guard dies, the controller's own watchdog stops the chair.
"""

from __future__ import annotations

import gc
import os
import selectors
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path

import msgspec

from chairward import arbiter, plan, wire
from chairward.border import Border
from chairward.components import STILL, Drive, DriveError, Motion
from chairward.copies import Copies
from chairward.facts import Decision, Facts, Limits, S, State
from chairward.messages import DriveStatus
from chairward.options import GuardOptions
from chairward.plan import Plan
from chairward.plugins import discover_only
from chairward.realtime import claim, suspended_ns
from chairward.records import Record

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
        self.drive = drive
        self.border = Border({lane.name: lane for lane in the_plan.lanes}, the_plan.limits)
        self.lanes = dict(lanes)
        self.control = control
        self.copies = Copies(observers)
        self.state = State()
        self.status = DriveStatus(at_ns=0, linked=False, armed=False)
        self.drive_fault = ""
        self.supervisor_ns = 0
        self.tick = 0
        self.periods = 0
        self.leaving_since_ns = 0
        self.leaving_because = ""
        self.commanded = STILL
        self.hard = False
        self.selector = selectors.SelectSelector()  # epoll and poll round the time-out up to whole milliseconds
        self.budget: dict[str, int] = {}
        self.muted: dict[str, socket.socket] = {}
        self.drive_fd = -1
        self.drive_wakes = 0

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
                urgent |= self._drive_woke()
            elif key.data in self.lanes:  # the control line may just have closed it
                urgent |= self._drain_lane(key.data)
        return urgent

    def _drive_woke(self) -> bool:
        """Read what the drive says. How it moves can wait for the tick, that it will not move (or will again) cannot.

        One that never stops talking is not listened to until the tick.
        """
        self.drive_wakes += 1
        if self.drive_wakes > MESSAGES_A_TICK:
            self._follow_drive()
            return False
        before = _readiness(self.status)
        self._poll_drive(time.monotonic_ns(), periodic=False)
        return _readiness(self.status) != before

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
        waited = time.monotonic_ns() - self.leaving_since_ns
        standing = self.status.linked and abs(self.status.speed_mm_s or 0.0) < 1.0 and waited > 5 * self.drive.period_ns
        return standing or not self.status.linked or waited > LEAVE_WITHIN_NS

    def _new_tick(self) -> None:
        self.budget.clear()
        self.drive_wakes = 0
        self.periods += 1
        for name, end in self.muted.items():
            self.selector.register(end, selectors.EVENT_READ, name)
        self.muted.clear()
        if self.periods % COLLECT_EVERY_TICKS == 0:
            gc.collect()  # what there was at the start is frozen, so this takes microseconds

    def _act(self, now: int, due: int, gap_ns: int, *, periodic: bool) -> None:
        """Facts, decision, drive, record. A message of a lane need not wait for the port of a drive that is silent."""
        if periodic or gap_ns or self.drive_fault or self.drive_fd < 0:
            self._poll_drive(now, periodic=periodic)
        if self.leaving_since_ns:
            self.border.lane_lost("supervisor", self.leaving_because)
        facts = self.border.facts(now, self.status, self.supervisor_ns, gap_ns)
        before = self.state
        after, decision = arbiter.decide(before, facts, self.limits)
        self._command(now, decision, periodic=periodic)
        self.state = after
        self._publish(now, due, before, facts, after, decision, periodic=periodic)
        self.tick += 1

    def _poll_drive(self, now: int, *, periodic: bool) -> None:
        """The drive's status; whatever it raises or says that cannot be is a fault, and a fault latches."""
        fault, self.drive_fault = self.drive_fault, ""
        try:
            said = self.drive.poll(now)
            self.status = msgspec.convert(msgspec.to_builtins(said), DriveStatus)
            if not self.status.linked and periodic:
                self.drive.connect(now)
        except Exception as error:  # noqa: BLE001 - the guard outlives any drive: it stops, latches and connects again
            fault = _told(error)
            self.status = msgspec.structs.replace(self.status, linked=False, armed=False)
        if fault:
            self.status = msgspec.structs.replace(self.status, fault=fault[:200])
        self._follow_drive()

    def _follow_drive(self) -> None:
        """Listen where the drive listens now: it may have closed or opened its port in any call."""
        fd = self.drive.fileno() if self.drive_wakes <= MESSAGES_A_TICK else -1
        if fd == self.drive_fd:
            return
        if self.drive_fd >= 0:
            self.selector.unregister(self.drive_fd)
        if fd >= 0:
            self.selector.register(fd, selectors.EVENT_READ, Line.DRIVE)
        self.drive_fd = fd

    def _command(self, now: int, decision: Decision, *, periodic: bool) -> None:
        """Tell the drive: every tick, and at once when the motion falls; a rise waits for the tick."""
        motion, hard = decision.motion, decision.hard_stop
        if time.monotonic_ns() - now > self.limits.gap_limit_ns:
            motion, hard = STILL, True  # stopped between deciding and writing; the next decision latches the gap
        if periodic or (hard and not self.hard) or _falls(self.commanded, motion) or decision.arm or decision.disarm:
            self._tell(lambda: self.drive.command(now, motion, hard_stop=hard))
            if decision.disarm:
                self._tell(lambda: self.drive.disarm(now))
            elif decision.arm:
                self._tell(lambda: self.drive.arm(now))
            self.commanded, self.hard = motion, hard
            self._follow_drive()

    def _tell(self, act: Callable[[], None]) -> None:
        """One call of the drive; that it fails must not keep the next from being made."""
        try:
            act()
        except Exception as error:  # noqa: BLE001 - see _poll_drive
            self.drive_fault = self.drive_fault or _told(error)

    def _publish(
        self, now: int, due: int, before: State, facts: Facts, after: State, decision: Decision, *, periodic: bool
    ) -> None:
        """The whole cause of this decision, to everybody who looks on."""
        record = Record(
            tick=self.tick,
            due_ns=due,
            woke_ns=now,
            wrote_ns=time.monotonic_ns(),
            periodic=periodic,
            before=before,
            facts=facts,
            after=after,
            decision=decision,
            newest_sent_ns=self.border.newest_sent_ns,
            told=self.commanded,
            told_hard=self.hard,
            frame=getattr(self.drive, "last_frame", b""),
        )
        self.copies.publish(record)


def _told(error: Exception) -> str:
    """What a drive raised, as a sentence."""
    return str(error) if isinstance(error, DriveError) else f"the drive failed: {type(error).__name__}: {error}"


def _readiness(status: DriveStatus) -> tuple[bool, bool, str, bool, bool]:
    """All that rule 9 looks at."""
    return status.linked, status.armed, status.fault, status.stopped_by_user, status.charging


def _falls(old: Motion, new: Motion) -> bool:
    return abs(new.drive_mm_s) < abs(old.drive_mm_s) or abs(new.turn_deg_s) < abs(old.turn_deg_s)


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
