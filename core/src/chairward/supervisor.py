"""The supervisor: starts, watches and restarts the processes of a run, in an order that ends with a stop.

Companions first, then the lanes and the observers, the guard last. A lane that dies or hangs is named to the guard
and started again with back-off, in a process group of its own; so is an observer that dies. When the guard ends, the
run ends.
"""

from __future__ import annotations

import logging
import os
import select
import socket
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from chairward import companions, frames, next_run, plan, processes, records, wire
from chairward.companions import RunError as RunError
from chairward.components import STILL
from chairward.lane_process import LaneProcess
from chairward.options import GuardOptions
from chairward.plan import LanePlan, Plan
from chairward.processes import Process, Restarted, plain
from chairward.realtime import a_little_ahead
from chairward.starting import RECORD_BUFFER_BYTES, start_lane, start_observer

log = logging.getLogger(__name__)

HEARTBEAT_S = 0.025
GUARD_START_S = 30.0
GUARD_HANG_S = 2.0
COMPANIONS_OUTLIVE_S = 0.5
GUARD_LEAVES_S = 5.0
LOGS_S = 1.0
"""So often the processes' logs are held against their bound."""


@dataclass(slots=True)
class Supervisor:
    """One run. `on_record` is called with every record that the guard publishes, in the supervisor's own time."""

    plan: Plan
    run_dir: Path
    on_record: Callable[[records.Record], None]
    lanes: dict[str, LaneProcess] = field(default_factory=dict)
    companions: dict[str, Process] = field(default_factory=dict)
    observers: dict[str, Restarted] = field(default_factory=dict)
    rings: dict[str, int] = field(default_factory=dict)
    events: list[str] = field(default_factory=list)
    up: wire.GuardIsUp | None = None
    ended_reason: str = ""
    _guard: Process | None = None
    _control: socket.socket | None = None
    _records: socket.socket | None = None
    _stop: bool = False
    _record_s: float = 0.0
    _stands: bool = False
    _logs_s: float = 0.0

    def run(self, for_s: float | None = None) -> int:
        """Start everything, supervise, end everything. Returns the guard's exit code. Raises RunError."""
        plan.write(self.plan, companions.plan_file(self.run_dir))
        try:
            companions.start(self.plan, self.run_dir, self.companions, lambda: self._stop)
            if not self._stop:
                self._start_guard_and_lanes()
                with a_little_ahead():  # the heartbeat must not wait for busy neighbours
                    self._watch(for_s)
        finally:
            code = self._end()
        return code

    def stop(self, reason: str) -> None:
        """Ask for an orderly end: the chair first."""
        self.ended_reason = self.ended_reason or reason
        self._stop = True

    # ---- starting -------------------------------------------------------------------------------------------------

    def _start_guard_and_lanes(self) -> None:
        self.rings = {lane.name: frames.create() for lane in self.plan.lanes}
        guard_ends: dict[str, socket.socket] = {}
        outs = []
        for lane in self.plan.lanes:
            guard_ends[lane.name], records_end = self._start_lane(lane)
            outs += [records_end] if records_end is not None else []
        outs += [self._start_observer(name) for name in self.plan.observers]
        self._records, ours = wire.pair(RECORD_BUFFER_BYTES)
        outs.append(ours)
        self._control, control = wire.pair()
        options = GuardOptions(
            plan=str(companions.plan_file(self.run_dir)),
            run_dir=str(self.run_dir),
            control=control.fileno(),
            lanes={name: end.fileno() for name, end in guard_ends.items()},
            observers=[end.fileno() for end in outs],
        )
        passed = [control, *guard_ends.values(), *outs]
        fds = [end.fileno() for end in passed]
        self._guard = processes.spawn(self.run_dir, "chairward.guard", options, "guard", fds)
        for end in passed:
            end.close()  # or their end would never read as closed

    def _start_lane(self, lane: LanePlan) -> tuple[socket.socket, socket.socket | None]:
        """Start the lane's process; returns the guard's ends: of its line, and of its records if it observes."""
        process, ours, guard_end, records_end = start_lane(lane, self.run_dir, self.rings)
        if (old := self.lanes.get(lane.name)) is not None:
            old.started_again(process, ours)
        else:
            self.lanes[lane.name] = LaneProcess(process, lane, ours)
        return guard_end, records_end

    def _start_observer(self, name: str) -> socket.socket:
        """Start the observer's process; returns the guard's end of its line."""
        process, guard_end = start_observer(name, self.run_dir, self.rings)
        self.observers.setdefault(name, Restarted(process)).runs_as(process)
        return guard_end

    # ---- watching -------------------------------------------------------------------------------------------------

    def _watch(self, for_s: float | None) -> None:
        """Until told to stop; the time asked for runs from the moment when every lane has worked once."""
        end_s = None
        assert self._control is not None
        assert self._guard is not None
        heartbeat_s = 0.0
        self._record_s = time.monotonic() + GUARD_START_S
        while not self._stop:
            now = time.monotonic()
            if now - heartbeat_s >= HEARTBEAT_S:
                heartbeat_s = now
                wire.send_control(self._control, wire.Heartbeat())
            lines = [x.control for x in self.lanes.values() if x.process.poll() is None]
            ends = [end for end in (self._control, self._records, *lines) if end is not None]
            readable, _, _ = select.select(ends, [], [], HEARTBEAT_S)
            if self._records in readable:
                self._read_records()
            if self._control in readable:
                self._read_guard()
            for lane in self.lanes.values():
                self._watch_lane(lane, now)
            for name, process in self.companions.items():
                if process.poll() is not None:
                    self.stop(f"companion '{name}' ended: {processes.last_words(self.run_dir, name)}")
            for name, observer in self.observers.items():
                self._watch_observer(name, observer, now)
            if now - self._logs_s >= LOGS_S:
                self._logs_s = now
                for name in ("guard", *(f"lane-{lane}" for lane in self.lanes), *self.companions, *self.observers):
                    processes.bound_log(self.run_dir, name)
            self._look_for_next()
            if now - self._record_s > GUARD_HANG_S:
                self.stop(f"the guard has said nothing for {GUARD_HANG_S:.0f} s")
            if self._guard.poll() is not None:
                self.stop(f"the guard ended: {processes.last_words(self.run_dir, 'guard')}")
            if end_s is None and for_s is not None and all(x.items or x.deaths or x.lost for x in self.lanes.values()):
                end_s = now + for_s
            if end_s is not None and now >= end_s:
                self.stop("the time asked for is over")

    def _read_records(self, limit: int = 64) -> None:
        for _ in range(limit):
            data = None if self._records is None else wire.receive(self._records, wire.RECORD_BYTES)
            if data is None:
                return
            if not data:
                assert self._records is not None
                self._records.close()
                self._records = None
                self.stop("the guard's records have ended")
                return
            self._record_s = max(self._record_s, time.monotonic())
            try:
                record = records.decode(data)
            except (msgspec.DecodeError, UnicodeDecodeError) as error:
                self._note(f"a record that cannot be read: {error}")
                continue
            self._stands = record.decision.motion == STILL
            self.on_record(record)

    def _look_for_next(self) -> None:
        """End the run when a screen asks for another one; refused while the chair moves, not kept for later."""
        if (asked := next_run.asked(self.run_dir)) is None:
            return
        if self._stands:
            self.stop(next_run.REASON)
        else:
            next_run.forget(self.run_dir)
            self._note(f"another run ({asked.person or 'none'}) was asked for while the chair moved: refused")

    def _read_guard(self) -> None:
        assert self._control is not None
        try:
            received = wire.receive_control(self._control)
        except EOFError:
            return
        if received is None:
            return
        match received[0]:
            case wire.GuardIsUp() as up:
                self.up = up
                for sentence in up.why:
                    self._note(f"guard: {sentence}")
            case wire.Note(text):
                self._note(f"guard: {text}")

    def _watch_lane(self, lane: LaneProcess, now: float) -> None:
        """Take its beats; when it is dead or hangs: name it, end it, start it again after a pause."""
        for sentence in lane.listen(now):
            self._note(sentence)
        if lane.ended and lane.plan.ends_run:
            self.stop(f"the input of lane '{lane.plan.name}' has ended")
        if lane.restart_at_s:
            if lane.may_start(now):
                self._restart(lane)
            return
        if lane.ended:
            return
        reason = processes.end_of(lane.process, self.run_dir, f"lane-{lane.plan.name}") or lane.trouble(now)
        if not reason or (lane.process.returncode == 0 and self._stop):
            return
        self._end_for_a_restart(f"lane '{lane.plan.name}'", lane, reason, now)
        assert self._control is not None
        wire.send_control(self._control, wire.Died(lane.plan.name, reason[:500]))

    def _restart(self, lane: LaneProcess) -> None:
        assert self._control is not None
        guard_end, records_end = self._start_lane(lane.plan)
        if not wire.send_control(self._control, wire.Attach(lane.plan.name), [guard_end.fileno()]):
            processes.kill_group(lane.process)  # the guard does not know it: try again
        guard_end.close()
        if records_end is not None:
            wire.send_control(self._control, wire.Observe(), [records_end.fileno()])
            records_end.close()

    def _watch_observer(self, name: str, observer: Restarted, now: float) -> None:
        """When it is dead: name it, and start it again after a pause; what is decided meanwhile it does not get."""
        assert self._control is not None
        if observer.restart_at_s:
            if observer.may_start(now):
                try:
                    guard_end = self._start_observer(name)
                except OSError as error:  # no memory or descriptor for it is no reason to end a drive
                    observer.restart_at_s = now + processes.BACK_OFF_S[-1]
                    self._note(f"observer '{name}' cannot be started: {error}")
                    return
                wire.send_control(self._control, wire.Observe(), [guard_end.fileno()])
                guard_end.close()  # if it was not sent, its line is closed now: it ends, and is started again
        elif not self._stop and (reason := processes.end_of(observer.process, self.run_dir, name)):
            self._end_for_a_restart(f"observer '{name}'", observer, reason, now)

    def _end_for_a_restart(self, who: str, ended: Restarted, reason: str, now: float) -> None:
        pause_s = ended.end(now)
        self._note(f"{who}: {reason}; starting it again in {pause_s:g} s")

    def _note(self, text: str) -> None:
        self.events.append(plain(text))
        log.warning("%s", self.events[-1])

    # ---- ending ---------------------------------------------------------------------------------------------------

    def _end(self) -> int:
        """The chair first, then lanes, then companions; whoever does not leave in time is killed by its group."""
        code = self._end_guard()
        for lane in self.lanes.values():
            processes.terminate(lane.process)
        processes.wait_all({f"lane '{n}'": x.process for n, x in self.lanes.items()}, 2.0, self._note)
        if self.companions:
            time.sleep(COMPANIONS_OUTLIVE_S)  # a simulated controller must see the silence, as a real one would
        for process in self.companions.values():
            processes.terminate(process)
        processes.wait_all({f"companion '{n}'": p for n, p in self.companions.items()}, 5.0, self._note)
        processes.wait_all({f"observer '{n}'": x.process for n, x in self.observers.items()}, 5.0, self._note)
        for lane in self.lanes.values():
            lane.control.close()
        for fd in self.rings.values():
            os.close(fd)
        for end in (self._control, self._records):
            if end is not None:
                end.close()
        return code

    def _end_guard(self) -> int:
        if self._guard is None or self._control is None:
            return 0
        wire.send_control(self._control, wire.Quit())
        end_s = time.monotonic() + GUARD_LEAVES_S
        while self._guard.poll() is None and time.monotonic() < end_s:
            wire.send_control(self._control, wire.Heartbeat())
            select.select([self._records] if self._records is not None else [], [], [], HEARTBEAT_S)
            self._read_records()
        if self._guard.poll() is None:
            self._note(f"the guard did not leave within {GUARD_LEAVES_S:.0f} s and was killed")
            self._guard.kill()
        self._read_records(limit=100_000)
        try:
            return self._guard.wait(2.0)
        except subprocess.TimeoutExpired:
            return 1
