"""The tour in simulated time: the chair file's own stages and rules, however slow the machine is.

What a run has and this has not: processes, wire, clock and firmware. Pictures and sound go through the real stages,
their facts arrive `delay_ms` after capture, the real arbiter decides every 20 ms, and its motion becomes pins with the
drive's stop deceleration. So it shows what perception and rules do with this world, and nothing about timing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chairward.arbiter import decide
from chairward.components import STILL, Bench, Context, Motion, Processor
from chairward.facts import MS, Decision, Facts, Limits, Pressed, S, State, Wish
from chairward.messages import Alive, Button, DriveStatus, Intent, RangeReading
from chairward.plan import LanePlan, Plan
from chairward.plugins import Registry
from chairward.stages import AudioBlock, StereoFrame
from chairward_simulator import speech
from chairward_simulator.body import Bridge, Pins
from chairward_simulator.home import load
from chairward_simulator.microphone import mix, room_noise
from chairward_simulator.scene import StereoCamera, person_cylinders
from chairward_simulator.settings import CameraSettings, MicrophoneSettings
from chairward_simulator.world import STEP_S, World

STEP_NS = int(STEP_S * S)
BLOCK_STEPS, TICK_STEPS, FRAME_STEPS = 2, 4, 13
"""Steps of the world between sound blocks (10 ms), decisions (20 ms) and pictures (65 ms)."""
PARKED_MM_S = 20.0


@dataclass(slots=True)
class Ears:
    """The recognizers of a lane and the room they listen to."""

    stages: list[tuple[str, Processor]]
    noise: Any
    bench: Bench = field(default_factory=Bench)
    said: tuple[int, str, int] = (0, "", 0)
    blocks: int = 0

    def listen(self, now_ns: int) -> Iterator[tuple[str, Intent]]:
        """What was understood of the last 10 ms."""
        begin_ns = now_ns - BLOCK_STEPS * STEP_NS
        samples = mix(self.noise, self.blocks, begin_ns, *self.said)
        self.blocks += 1
        self.bench.clear()
        self.bench.put(AudioBlock(samples=samples, rate_hz=speech.RATE_HZ, captured_ns=begin_ns, seq=self.blocks))
        for name, stage in self.stages:
            for message in stage.process(self.bench):
                if isinstance(message, Intent):
                    yield name, message


@dataclass(slots=True)
class Eyes:
    """The sensors of a lane and the camera they look through."""

    stages: list[tuple[str, Processor]]
    camera: StereoCamera
    bench: Bench = field(default_factory=Bench)
    frames: int = 0

    def look(self, now_ns: int, world: World) -> Iterator[tuple[str, RangeReading]]:
        """What was seen just now."""
        b, w = world.body, world.walker
        people = (
            [person_cylinders(self.camera.scene, w.x_mm, w.y_mm, w.facing_deg, w.walked_mm)] if w is not None else []
        )
        left, right = self.camera.pair(b.x_mm, b.y_mm, b.heading_deg, people)
        self.frames += 1
        self.bench.clear()
        self.bench.put(
            StereoFrame(left=left, right=right, captured_ns=now_ns, seq=self.frames, geometry=self.camera.geometry)
        )
        for name, stage in self.stages:
            for message in stage.process(self.bench):
                if isinstance(message, RangeReading):
                    yield name, message


@dataclass(slots=True)
class Chair:
    """The real arbiter in simulated time, and a drive that does as it is told."""

    limits: Limits
    state: State = field(default_factory=State)
    ranges: dict[str, tuple[RangeReading, ...]] = field(default_factory=dict)
    heard: list[Wish] = field(default_factory=list)
    wishes: int = 0
    armed: bool = False
    motion: Motion = STILL
    presses: tuple[int, int] = (0, 0)

    def hear(self, source: str, intent: Intent, now_ns: int) -> None:
        """A word was understood."""
        self.wishes += 1
        self.heard.append(Wish(source=source, seq=self.wishes, at_ns=now_ns, command=intent.command, word=intent.word))

    def see(self, source: str, reading: RangeReading) -> None:
        """A distance has arrived."""
        self.ranges[source] = (*self.ranges.get(source, ()), reading)[-3:]

    def tick(self, now_ns: int, presses: tuple[int, int]) -> Decision:
        """One decision; presses: how often RESET and ARM have been pressed so far."""
        buttons = [
            b for b, new, old in zip((Button.RESET, Button.ARM), presses, self.presses, strict=True) if new > old
        ]
        panel = next(iter(self.limits.stop_devices))
        speed, turn = self.motion
        facts = Facts(
            now_ns=now_ns,
            ranges=dict(self.ranges),
            alive={
                name: Alive(seq=now_ns, captured_ns=now_ns - 20 * MS)
                for name in (*self.limits.recognizers, *self.limits.stop_devices)
            },
            heard=tuple(self.heard),
            pressed=tuple(Pressed(source=panel, button=button, at_ns=now_ns) for button in buttons),
            drive=DriveStatus(at_ns=now_ns - 5 * MS, linked=True, armed=self.armed, speed_mm_s=speed, turn_deg_s=turn),
            supervisor_ns=now_ns - 50 * MS,
        )
        self.heard, self.presses = [], presses
        self.state, decision = decide(self.state, facts, self.limits)
        self.armed = (self.armed or decision.arm) and not decision.disarm
        self.motion = _slowed(self.motion, decision.motion, self.limits.decel_mm_s2)
        return decision


def ride(
    plan: Plan, registry: Registry, run_dir: Path, seconds: float, delay_ms: float = 60.0
) -> Iterator[str | dict[str, Any]]:
    """Sentences as things happen, at last the world's report. Raises ValueError for a chair without simulated lanes."""
    world, chair = World(load(), plan.footprint), Chair(plan.limits)
    eyes, ears = _eyes(plan, registry, run_dir), _ears(plan, registry, run_dir)
    coming: deque[tuple[int, str, RangeReading]] = deque()
    now_ns, count, pins = 1000 * S, 0, Pins(brake=True)
    while world.now_s < seconds and not world.rider.finished:
        word = world.step(pins)
        now_ns, count = now_ns + STEP_NS, count + 1
        if word is not None:
            ears.said = (world.rider.utterances, word, now_ns)
            yield f"{world.now_s:6.2f} s  says '{word}'"
        if count % BLOCK_STEPS == 0:
            for name, intent in ears.listen(now_ns):
                chair.hear(name, intent, now_ns)
        if count % FRAME_STEPS == 0:
            coming += [(now_ns + int(delay_ms * MS), *found) for found in eyes.look(now_ns, world)]
        while coming and coming[0][0] <= now_ns:
            chair.see(*coming.popleft()[1:])
        if count % TICK_STEPS == 0:
            decision = chair.tick(now_ns, (world.rider.reset_presses, world.rider.arm_presses))
            pins = _pins(chair.motion, world)
            if decision.protective_stop:
                why = "; ".join(f"{reason.rule} {reason.source}: {reason.detail}" for reason in decision.reasons[:1])
                ahead = f"{world.truth.ahead_mm:.0f} mm before {world.truth.ahead_of or 'nothing'}"
                yield f"{world.now_s:6.2f} s  protective stop {ahead} ({why})"
    yield world.report()


def _slowed(was: Motion, wanted: Motion, decel_mm_s2: float) -> Motion:
    """The drive's controlled stop: falling speed falls at its deceleration, everything else at once."""
    if abs(wanted.drive_mm_s) >= abs(was.drive_mm_s) and wanted.drive_mm_s * was.drive_mm_s >= 0.0:
        return wanted
    step = decel_mm_s2 * TICK_STEPS * STEP_S
    speed = was.drive_mm_s + max(-step, min(step, wanted.drive_mm_s - was.drive_mm_s))
    return Motion(speed, wanted.turn_deg_s)


def _pins(motion: Motion, world: World) -> Pins:
    drive = _bridge(motion.drive_mm_s / world.law.drive.full)
    steer = _bridge(motion.turn_deg_s / world.law.steer.full)
    return Pins(drive=drive, steer=steer, brake=motion == STILL and abs(world.body.speed_mm_s) < PARKED_MM_S)


def _bridge(share: float) -> Bridge:
    """Duty and direction for a share of full motion; none is short-brake."""
    return Bridge(duty=min(1.0, abs(share)), in1=share > 0.0, in2=share < 0.0) if share else Bridge(duty=1.0)


def _lane(plan: Plan, source: str) -> LanePlan:
    for lane in plan.lanes:
        if lane.source.component == source:
            return lane
    raise ValueError(f"{plan.chair_file}: no lane has source = '{source}': a ride needs the simulated chair")


def _stages(lane: LanePlan, context: Context, registry: Registry) -> list[tuple[str, Processor]]:
    found = []
    for part in lane.stages:
        _, component = registry.stage(part.component)
        found.append((f"{lane.name}/{part.component}", component.make(component.settings(**part.settings), context)))
    return found


def _eyes(plan: Plan, registry: Registry, run_dir: Path) -> Eyes:
    lane = _lane(plan, "sim_cameras")
    set_to = CameraSettings(**lane.source.settings)
    camera = StereoCamera(load(), lane.pose, set_to.noise, set_to.seed)
    return Eyes(_stages(lane, plan.context(lane.name, lane.pose, run_dir), registry), camera)


def _ears(plan: Plan, registry: Registry, run_dir: Path) -> Ears:
    lane = _lane(plan, "sim_microphone")
    set_to = MicrophoneSettings(**lane.source.settings)
    return Ears(_stages(lane, plan.context(lane.name, lane.pose, run_dir), registry), room_noise(set_to))
