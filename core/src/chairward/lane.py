"""A lane: one worker process that runs a source, then its stages in the order the chair file gives.

Frames and sound stay in here; only facts leave. A lost device is named to the guard and opened again with back-off.
A stage that raises ends the process with a sentence: the supervisor starts it again.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from chairward import lending, plan, wire
from chairward.components import Bench, Component, Context, DeviceLost, EndOfInput, Processor, Source
from chairward.frames import FrameWriter
from chairward.messages import Ended, Lost, Message, Parcel
from chairward.options import LaneOptions
from chairward.plan import LanePlan, Part
from chairward.plugins import Registry, discover_only
from chairward.realtime import die_with_parent

READ_TIMEOUT_S = 0.1
BACK_OFF_S = (0.1, 0.2, 0.5, 1.0, 2.0)


class Lane:
    """The running lane. Nothing in it knows what it transports."""

    def __init__(self, options: LaneOptions, the_plan: plan.Plan, registry: Registry) -> None:
        self.plan: LanePlan = next(lane for lane in the_plan.lanes if lane.name == options.lane)
        self.guard = wire.adopt(options.guard)
        self.control = wire.adopt(options.control)
        self.frames = FrameWriter(options.frames) if options.frames >= 0 else None
        run_dir = Path(options.run_dir)
        context = replace(
            the_plan.context(options.lane, self.plan.pose, run_dir), records_fd=options.records, frames=options.rings
        )
        self.source_name = self.plan.source.component
        self.source: Source = _make(registry.get("source", self.source_name), self.plan.source, context)
        self.stages: list[tuple[str, Processor]] = [
            (part.component, _make(registry.stage(part.component)[1], part, context)) for part in self.plan.stages
        ]
        self.bench = Bench()
        self.own_seq = 0
        self.items = 0
        self.dropped = 0
        self.stopping = False
        self.wake = threading.Event()
        self.lost = False
        self.last_beat = 0.0
        self.lent = lending.file(run_dir, options.lane)

    def run(self) -> int:
        """Until stopped or the input ends: open, read, process, send; 0 at an orderly end."""
        failures = 0
        while not self.stopping:
            self.beat()
            try:
                self.not_lent()
                self.source.open()
                self.lost = False
                while not self.stopping:
                    self.step()
                    failures = 0
            except EndOfInput:
                self.send(self.source_name, [Ended(seq=self.next_seq(), captured_ns=time.monotonic_ns())])
                self.beat(ended=True)
                break
            except DeviceLost as lost:
                self.lost = True
                self.send_lost(str(lost))
                self.source.close()
                self.pause(BACK_OFF_S[min(failures, len(BACK_OFF_S) - 1)], str(lost))
                failures += 1
        self.close()
        return 0

    def step(self) -> None:
        """One item through all stages."""
        self.not_lent()
        item = self.source.read(READ_TIMEOUT_S)
        self.bench.clear()
        if isinstance(item, msgspec.Struct):
            self.send(self.source_name, [item])  # type: ignore[list-item]  # checked again at the border
        elif isinstance(item, list | tuple):
            self.send(self.source_name, item)
        elif item is not None:
            self.bench.put(item)
        self.items += item is not None
        for name, stage in self.stages:
            self.send(name, stage.process(self.bench))
        if self.frames is not None and self.bench.panes:
            self.frames.write(self.bench.panes)
        self.beat()

    def not_lent(self) -> None:
        """Raises DeviceLost while set-up has the device."""
        if self.lent.exists():
            raise DeviceLost(lending.REASON)

    def next_seq(self) -> int:
        """The lane's own sequence, for Lost and Ended; the border does not hold them against the source's."""
        self.own_seq += 1
        return self.own_seq

    def send_lost(self, reason: str) -> None:
        """Tell the guard, by name, that the device is gone."""
        now = time.monotonic_ns()
        self.send(self.source_name, [Lost(seq=self.next_seq(), captured_ns=now, reason=reason[:200])])

    def send(self, stage: str, messages: Iterable[Message]) -> None:
        """Send facts to the guard without waiting; what has no room is dropped and counted (and so goes stale)."""
        for message in messages:
            data = wire.encode_parcel(Parcel(stage=stage, body=message, sent_ns=time.monotonic_ns()))
            try:
                self.dropped += not wire.send(self.guard, data)
            except ConnectionError:
                self.stopping = True  # the guard has closed this line: end, and be started again

    def beat(self, *, ended: bool = False) -> None:
        """Ten times a second: tell the supervisor that this lane is working."""
        now = time.monotonic()
        if ended or now - self.last_beat >= READ_TIMEOUT_S:
            self.last_beat = now
            wire.send_control(self.control, wire.Beat(self.items, self.dropped, ended, self.lost))

    def pause(self, seconds: float, reason: str) -> None:
        """Wait before opening again, still beating and still naming what is lost."""
        end = time.monotonic() + seconds
        while not self.stopping and time.monotonic() < end:
            self.beat()
            self.send_lost(reason)
            self.wake.wait(min(0.1, max(0.0, end - time.monotonic())))

    def close(self) -> None:
        """Give devices back."""
        self.source.close()
        for _, stage in self.stages:
            stage.close()


def _make(component: Component, part: Part, context: Context) -> Any:
    settings = component.settings.model_validate(plan.fill_run_dir(part.settings, context.run_dir))
    return component.make(settings, context)


def main(argv: Sequence[str] | None = None) -> int:
    """A lane's process."""
    options = msgspec.json.decode((argv or sys.argv[1:])[0], type=LaneOptions)
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        the_plan = plan.read(Path(options.plan))
        mine = next(lane for lane in the_plan.lanes if lane.name == options.lane)
        lane = Lane(options, the_plan, discover_only([mine.source.plugin, *(stage.plugin for stage in mine.stages)]))
    except (DeviceLost, ValueError, OSError, ImportError) as error:
        wire.send_control(wire.adopt(options.control), wire.Note(f"lane '{options.lane}' cannot start: {error}"[:900]))
        return 2

    def stop(*_: object) -> None:
        lane.stopping = True
        lane.wake.set()

    signal.signal(signal.SIGTERM, stop)
    return lane.run()


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # everything is closed; the interpreter's own tear-down of compiled code takes seconds
