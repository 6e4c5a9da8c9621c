"""From limits as they stand in the files to limits as the rules use them: nanoseconds, caps, the toes' swing."""

from __future__ import annotations

from math import ceil, degrees, hypot

from chairward.envelope import Caps
from chairward.facts import MS, Limits
from chairward.profile.lanes import Votes
from chairward.profile.models import Chair, LimitsTable
from chairward.profile.proof import Proof


def resolve(limits: LimitsTable, chair: Chair, votes: Votes, proof: Proof) -> Limits:
    """What the rules work with."""
    toes_mm = hypot(max(chair.footprint.front_mm, chair.footprint.rear_mm), chair.footprint.half_width_mm)
    turn = float(limits.turn_deg_s)
    unseen_turn = min(turn, degrees(limits.unseen_toe_mm_s / toes_mm))
    forward, backward = float(limits.forward_mm_s), float(limits.backward_mm_s)
    return Limits(
        sensors=votes.sensors,
        recognizers=votes.recognizers,
        stop_devices=votes.stop_devices,
        vetoers=votes.vetoers,
        commands=limits.commands,
        caps=Caps(forward, backward, turn, turn),
        unseen=Caps(0.0, min(backward, float(limits.unseen_backward_mm_s)), unseen_turn, unseen_turn),
        forward_mm_s=forward,
        backward_mm_s=backward,
        turn_deg_s=turn,
        arc_mm_s=min(float(limits.arc_mm_s), forward),
        stop_mm=limits.stop_mm,
        turn_clear_mm=max(limits.turn_clear_mm, ceil(toes_mm - chair.footprint.half_width_mm)),
        avoid_mm=limits.avoid_mm,
        avoid_mm_s=min(float(limits.avoid_mm_s), forward),
        steer_deg_s=min(limits.steer_deg_s, turn),
        near_loss_mm=limits.near_loss_mm,
        crawl_mm_s=min(float(limits.crawl_mm_s), forward),
        reaction_s=proof.reaction_s,
        decel_mm_s2=proof.decel_mm_s2,
        accel_mm_s2=float(limits.accel_mm_s2),
        turn_accel_deg_s2=float(limits.turn_accel_deg_s2),
        lease_s=limits.lease_s,
        lease_warn_s=min(limits.lease_warn_s, limits.lease_s),
        turn_step_deg=limits.turn_step_deg,
        arc_step_deg=limits.arc_step_deg,
        back_step_mm=limits.back_step_mm,
        reverse_step_mm=limits.reverse_step_mm,
        held_ns=limits.held_ms * MS,
        drive_freshness_ns=limits.drive_freshness_ms * MS,
        supervisor_freshness_ns=limits.supervisor_freshness_ms * MS,
        latch_after_ns=limits.latch_after_ms * MS,
        gap_limit_ns=limits.gap_limit_ms * MS,
    )
