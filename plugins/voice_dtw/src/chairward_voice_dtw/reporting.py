"""The report of an evaluation: every figure with what it rests on, from what was heard of each utterance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from chairward_voice_dtw.embedding import network
from chairward_voice_dtw.engine import NEVER, Heard
from chairward_voice_dtw.figures import accepted_at, equal_error_rate_pct, percentiles, rate_per_hour, share
from chairward_voice_dtw.plan import DRIVEN, Plan, Strange, Trial
from chairward_voice_dtw.settings import VoiceSettings

LINES = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
STOP_LINES = (-1.0, -2.0, -2.5, -3.0, -3.5, -4.0, -5.0)
ARM_EVERY_S = 180.0


def known_score(trial: Trial) -> float:
    """The best score with which the right word was heard, NEVER when it was not."""
    return max((h.score for h in trial.heard if h.word == trial.placed.word), default=NEVER)


def correct(trial: Trial) -> bool:
    """Exactly the right word was accepted."""
    return {h.word for h in trial.heard if h.accepted} == {trial.placed.word}


def cell(found: Sequence[Trial], stop_word: str) -> dict[str, Any]:
    """The figures of one source at one SNR."""
    known = [t for t in found if t.placed.role == "test"]
    unknown = [t for t in found if t.placed.role == "unknown"]
    stops = [t for t in known if t.placed.word == stop_word]
    right = [(t, next(h for h in t.heard if h.accepted)) for t in known if correct(t)]
    closed = [max(t.heard, key=lambda h: h.score).word == t.placed.word for t in known if t.heard]
    # the hypothesis that decides: the accepted one, else the best
    deciding = [(t, max(t.heard, key=lambda h: (h.accepted, h.score))) for t in known if any(h.word for h in t.heard)]
    delays_ms = [1e3 * (h.decided_s - t.placed.end_s) for t, h in deciding]
    early = [(t, h) for t, h in deciding if h.decided_s < t.placed.end_s]
    known_scores = [known_score(t) for t in known]
    unknown_scores = [max((h.score for h in t.heard), default=NEVER) for t in unknown]
    accepted = [any(h.accepted for h in t.heard) for t in unknown]
    stopped = [any(h.accepted and h.word == stop_word for h in t.heard) for t in stops]
    return {
        "speakers": len({t.speaker for t in found}),
        "accuracy_pct": share(len(right), len(known)),
        "closed_set_accuracy_pct": share(sum(closed), len(known)),
        "wrong_word_pct": share(
            sum(any(h.accepted and h.word != t.placed.word for h in t.heard) for t in known), len(known)
        ),
        "stop_recall_pct": share(sum(stopped), len(stops)),
        "unknown_accepted_pct": share(sum(accepted), len(unknown)),
        "unknown_accepted_at_95_pct": accepted_at(known_scores, unknown_scores, 0.95),
        "equal_error_rate_pct": equal_error_rate_pct(known_scores, unknown_scores),
        "onset_to_intent_ms": percentiles([1e3 * (h.decided_s - t.placed.onset_s) for t, h in right], 50, 95),
        "stop_onset_to_intent_ms": percentiles(
            [1e3 * (h.decided_s - t.placed.onset_s) for t, h in right if t.placed.word == stop_word], 50, 95
        ),
        "end_to_intent_ms": percentiles([1e3 * (h.decided_s - t.placed.end_s) for t, h in right], 50, 95),
        "endpoint_delay_ms": percentiles([delay for delay in delays_ms if delay >= 0.0], 50, 95),
        "cut_early_pct": share(len(early), len(known)),
        "cut_in_loud_part_pct": share(sum(h.decided_s < t.placed.loud_end_s for t, h in deciding), len(known)),
        "cut_early_and_not_right_pct": share(sum(not correct(t) for t, _ in early), len(known)),
        "never_ended_pct": share(sum(bool(t.heard) and not any(h.word for h in t.heard) for t in known), len(known)),
        "undetected_pct": share(sum(not t.heard for t in known), len(known)),
    }


def false_accepts(plan: Plan, strange: Sequence[Strange]) -> dict[str, Any]:
    """Words that nobody said: always listening, and armed, each at its own threshold."""
    hours, armed_s = sum(stream.hours for stream in strange), VoiceSettings().armed_s
    always = [h.word for stream in strange for h in stream.always if h.accepted]
    stops = sum(word == plan.stop_word for word in always)
    motion = [h for stream in strange for h in stream.heard if h.accepted and h.word != plan.stop_word]
    opened = sum(h.end_s % ARM_EVERY_S < armed_s for h in motion)
    return {
        "hours": round(hours, 3),
        "motion": rate_per_hour(len(always) - stops, hours),
        "motion_note": "always listening, at the thresholds of always_listening",
        "stop": rate_per_hour(stops, hours),
        "motion_armed": rate_per_hour(opened, hours),
        "motion_armed_note": f"open for {armed_s:g} s every {ARM_EVERY_S:g} s, as if by a switch",
        "motion_armed_per_open_hour": rate_per_hour(len(motion), hours),
    }


def operating_point(
    found: Sequence[Trial], hours: float, strange: Sequence[Sequence[Heard]], line: float
) -> dict[str, Any]:
    """What one threshold for all words would give, over all sources: deafness against wrong motion."""
    best = [(t, max(t.heard, key=lambda h: h.score, default=None)) for t in found]
    passed = [(t, h is not None and h.score >= line, bool(h and h.word == t.placed.word)) for t, h in best]
    known = [over and right for t, over, right in passed if t.placed.role == "test"]
    unknown = [over for t, over, _ in passed if t.placed.role == "unknown"]
    count = 0
    for stream in strange:
        until = -1.0
        for heard in stream:
            if heard.score >= line:
                count += heard.onset_s > until
                until = heard.decided_s
    return {
        "threshold": line,
        "accuracy_pct": share(sum(known), len(known)),
        "unknown_accepted_pct": share(sum(unknown), len(unknown)),
        "false_accepts_per_hour": rate_per_hour(count, hours),
    }


def stop_point(
    found: Sequence[Trial], hours: float, strange: Sequence[Sequence[Heard]], stop_word: str, line: float
) -> dict[str, Any]:
    """What another threshold for the stop word would give, over all sources: stops missed against false stops."""
    stops = [t for t in found if t.placed.role == "test" and t.placed.word == stop_word]
    by_snr: dict[str, list[bool]] = {}
    for trial in stops:
        passed = any(h.word == stop_word and h.score >= line for h in trial.heard)
        by_snr.setdefault(snr_name(trial.snr), []).append(passed)
    false = sum(h.word == stop_word and h.score >= line for stream in strange for h in stream)
    heard = {name: share(sum(passed), len(passed)) for name, passed in by_snr.items()}
    return {"threshold": line, "stop_recall_pct": heard, "false_stops_per_hour": rate_per_hour(false, hours)}


def cells(plan: Plan, found: Sequence[Trial]) -> dict[str, dict[str, dict[str, Any]]]:
    """The figures by source and SNR."""
    return {
        source: {
            snr_name(snr): cell([t for t in found if t.source == source and t.snr == snr], plan.stop_word)
            for snr in plan.snrs
        }
        for source in dict.fromkeys(t.source for t in found)
    }


def snr_name(snr: float | None) -> str:
    """As it is written in options and reports."""
    return "clean" if snr is None else f"{snr:g}"


def report(
    plan: Plan,
    found: Sequence[Trial],
    strange: Sequence[Strange],
    measured: Sequence[tuple[float, list[float]]],
) -> dict[str, Any]:
    """Everything together: in the mode in which somebody is driven, and beside it always listening."""
    driven, always = plan.thresholds(DRIVEN), plan.thresholds("always")
    hours, heard = sum(stream.hours for stream in strange), [stream.heard for stream in strange]
    return {
        "manifest": plan.manifest.name,
        "engine": plan.engine,
        "speech_embedding": plan.engine == "default" and plan.embedding and network() is not None,
        "variant": plan.variant,
        "templates": plan.templates,
        "placements": plan.placements,
        "seed": plan.seed,
        "listening": DRIVEN,
        "thresholds": {"word": driven.word, "stop": driven.stop},
        "note": "n counts placements of the same recordings too; the number of speakers is the real sample size",
        "sources": cells(plan, found),
        "always_listening": {
            "thresholds": {"word": always.word, "stop": always.stop},
            "sources": cells(plan, [replace(trial, heard=trial.always) for trial in found]),
        },
        "false_accepts_per_hour": false_accepts(plan, strange),
        "operating_points": [operating_point(found, hours, heard, line) for line in LINES],
        "stop_points": [stop_point(found, hours, heard, plan.stop_word, line) for line in STOP_LINES],
        "cpu_ms_per_s": round(float(np.median([cpu for cpu, _ in measured])), 2),
        "deciding_ms": percentiles([ms for _, each in measured for ms in each], 50, 95),
    }
