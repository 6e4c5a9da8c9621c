"""A copy of a recording that can be given away: same facts, same decisions, but nothing in it that says whose it is.

Paths and names stand in texts that went into decisions (a fault, why a device was lost) and came out of them again
(reasons, latch, notes). They are hidden in what went in, and the decision is made again from that: so whatever the
rules do with a text, the copy replays bit for bit.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from chairward import records
from chairward.arbiter import decide
from chairward.facts import Decision, Facts, Limits, State
from chairward.plan import Plan
from chairward.recording.read import Entry, entries, read, read_plan
from chairward.recording.readable import Readable
from chairward.recording.topics import PLAN, RECORDS
from chairward.recording.write import Part
from chairward.records import Record

SOMEBODY = "somebody"
HIDDEN = "…"
"""Stands for what was hidden. One character: a text that just fits its limit still does."""
_PATH = r"(?<![\w/])/(?:[^\s'\"(),;:]|[,;:](?=\S))+"
_QUOTED = r"(?<!\w)(?:'[^']*'|\"[^\"]*\")(?!\w)"

Hide = Callable[[str], str]


def redact(path: Path, target: Path) -> int:
    """A copy without pictures, spoken words, the person's name, settings, paths, and what texts have in quotes.

    The names of the chair, its lanes and components stay. Returns the records kept. Raises OSError, McapError; a file
    that is there already is not overwritten.
    """
    if target.exists():
        raise FileExistsError(f"{target}: is there already and was not touched: choose another name")
    plan = read_plan(path)
    hide = hiding(plan)
    at = next((entry.at_ns for entry in entries(path, PLAN)), 0)
    part, readable, count = Part(target, msgspec.json.encode(_nameless(plan)), at), Readable(), 0
    try:
        for entry, record in _again(path, plan.limits, hide):
            part.add(RECORDS, entry.at_ns, records.encode(record), record.tick % 2**32)
            for topic, message in readable.of(record, entry.at_ns):
                part.add(topic, entry.at_ns, msgspec.json.encode(message), record.tick % 2**32)
            count += 1
    finally:
        part.close()
    return count


def hiding(plan: Plan) -> Hide:
    """What hides, in a text: the person's name and places, everything in quotes, and every absolute path."""
    places = {plan.person_file, plan.person_dir, plan.chair_file}
    places |= {value for part in _parts(plan) for value in part.settings.values() if isinstance(value, str)}
    spaced = [re.escape(place) for place in sorted(places, key=len, reverse=True) if place.startswith("/")]
    name = [rf"(?<!\w){re.escape(plan.person)}(?!\w)"] if plan.person else []
    pattern = re.compile("|".join([*spaced, _PATH, _QUOTED, *name]))
    return lambda text: pattern.sub(HIDDEN, text)


def _parts(plan: Plan) -> Iterator[Any]:
    yield plan.drive
    for lane in plan.lanes:
        yield from (lane.source, *lane.stages)
    yield from (*plan.companions.values(), *plan.observers.values())


def _again(path: Path, limits: Limits, hide: Hide) -> Iterator[tuple[Entry, Record]]:
    """Each record, its texts hidden, decided again; one that these rules do not reproduce stays as it was decided."""
    was, now = State(), State()
    for entry, record in zip(entries(path, RECORDS), read(path), strict=True):
        before = now if record.before == was else _state(record.before, hide)
        facts = _facts(record.facts, hide)
        if decide(record.before, record.facts, limits) == (record.after, record.decision):
            after, decision = decide(before, facts, limits)
        else:
            after, decision = _state(record.after, hide), _decision(record.decision, hide)
        was, now = record.after, after
        yield entry, replace(record, before=before, facts=facts, after=after, decision=decision)


def _facts(facts: Facts, hide: Hide) -> Facts:
    """Commands stay, the words for them go."""
    return replace(
        facts,
        ranges={
            name: tuple(replace(reading, reason=hide(reading.reason)) for reading in window)
            for name, window in facts.ranges.items()
        },
        vetoes={name: replace(veto, reason=hide(veto.reason)) for name, veto in facts.vetoes.items()},
        alive={name: replace(alive, reason=hide(alive.reason)) for name, alive in facts.alive.items()},
        lost={name: hide(sentence) for name, sentence in facts.lost.items()},
        refused={name: hide(sentence) for name, sentence in facts.refused.items()},
        heard=tuple(replace(wish, word="") for wish in facts.heard),
        drive=replace(facts.drive, fault=hide(facts.drive.fault)),
    )


def _state(state: State, hide: Hide) -> State:
    wordless = {key: replace(wish, word="") for key in ("wish", "base") if (wish := getattr(state, key)) is not None}
    return replace(state, latch=hide(state.latch), **wordless)


def _decision(decision: Decision, hide: Hide) -> Decision:
    return replace(
        decision,
        reasons=tuple(replace(why, detail=hide(why.detail)) for why in decision.reasons),
        latch=hide(decision.latch),
        notes=tuple(map(hide, decision.notes)),
    )


def _nameless(plan: Plan) -> Plan:
    """The plan with what replay needs, and nothing that says whose it is."""
    return dataclasses.replace(
        plan,
        person=SOMEBODY,
        person_file="",
        person_dir="",
        chair_file=Path(plan.chair_file).name,
        words={},
        lanes=tuple(
            dataclasses.replace(lane, source=_bare(lane.source), stages=tuple(map(_bare, lane.stages)))
            for lane in plan.lanes
        ),
        companions={},
        observers={},
        drive=_bare(plan.drive),
        recorder=_bare(plan.recorder),
    )


def _bare(part: Any) -> Any:
    """A component without its settings: they name devices and folders."""
    return dataclasses.replace(part, settings={})
