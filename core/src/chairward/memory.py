"""Rule 6's memory: what was near ahead of a sensor, and whether it went away or only out of view.

Things that a camera loses just before contact (low, thin, under the picture's edge) do not recede: they vanish. People
and carried things recede, a few centimetres from picture to picture. The difference is all that is used here.
"""

from __future__ import annotations

from msgspec.structs import replace

from chairward.facts import Near, S
from chairward.messages import RangeReading
from chairward.scene import Scene, Seen

RECEDE_MM_S = 2_000.0
RECEDE_SLACK_MM = 150.0
BACKED_OFF_MM = 200.0
TURNED_AWAY_DEG = 0.5
"""Turning at all while a thing leaves the view explains that it left; driving straight does not turn by this much."""


def remember(scene: Scene, dt_s: float) -> dict[str, Near]:
    """The memory after this scene, by sensor; dt_s has passed since the last one."""
    facts, state, limits, seen = scene
    kept = dict(state.near)
    for s in seen:
        if s.ahead_mm <= limits.near_loss_mm:
            kept[s.source] = _sighted(scene, s, dt_s)
        elif s.source in kept:
            old = _moved(kept.pop(s.source), scene, dt_s)
            left = old.backed_mm >= BACKED_OFF_MM or old.turned_deg >= TURNED_AWAY_DEG
            if not left and (old.gone or not _receded(old, facts.ranges[s.source][0])):
                kept[s.source] = replace(old, gone=True)
    return kept


def _sighted(scene: Scene, s: Seen, dt_s: float) -> Near:
    """Near in one of the last readings. What the chair did since counts from the newest near one."""
    window, old = scene.facts.ranges[s.source], scene.state.near.get(s.source)
    seen_ns = next(reading.captured_ns for reading in reversed(window) if reading.ahead_mm == s.ahead_mm)
    newest_mm = window[-1].ahead_mm
    if old is None or (newest_mm is not None and newest_mm <= scene.limits.near_loss_mm):
        return Near(distance_mm=int(s.ahead_mm), seen_ns=seen_ns)
    return replace(_moved(old, scene, dt_s), distance_mm=int(s.ahead_mm), seen_ns=seen_ns, gone=False)


def _moved(near: Near, scene: Scene, dt_s: float) -> Near:
    """The memory with what the chair has backed and turned; it lifts a vote, so the smaller of command and report."""
    drive, turn = scene.state.output
    speed, turning = scene.facts.drive.speed_mm_s, scene.facts.drive.turn_deg_s
    backed = max(0.0, -drive if speed is None else min(-drive, -speed))
    turned = abs(turn) if turning is None else min(abs(turn), abs(turning))
    return replace(near, backed_mm=near.backed_mm + backed * dt_s, turned_deg=near.turned_deg + turned * dt_s)


def _receded(near: Near, first_far: RangeReading) -> bool:
    """Whether the first reading beyond the limit is where something walking away could have got to by then."""
    passed_s = max(0, first_far.captured_ns - near.seen_ns) / S
    reach_mm = near.distance_mm + RECEDE_SLACK_MM + RECEDE_MM_S * passed_s
    return first_far.ahead_mm is not None and first_far.ahead_mm <= reach_mm
