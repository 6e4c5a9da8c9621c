"""Replay: decide again what was decided, from the recording alone, and compare bit for bit.

Each record holds state, facts and decision, and the file holds the plan with its limits, so nothing else is needed.
What is compared is the encoded record: there -0.0 is not 0.0, and a NaN is itself. Records do not depend on one another
but for the chain of states, so a long file is decided by all cores at once, each a run of its chunks.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from chairward.arbiter import decide
from chairward.facts import Decision, Facts, Limits, S, State
from chairward.recording import RECORDS
from chairward.recording.read import chunks, parts, unreadable, walk
from chairward.records import Record

CHUNKS_WORTH_A_CORE = 100


@dataclass(frozen=True, slots=True)
class Difference:
    """One decision that came out differently; what: the first field that differs, with both values."""

    tick: int
    what: str


@dataclass(frozen=True, slots=True)
class Gap:
    """Decisions that were made but are not in the recording: so many after that tick; at_s: since the first record."""

    after_tick: int
    count: int
    at_s: float


@dataclass(slots=True)
class Replayed:
    """What replay found, from the first record to the last; seconds: that the recording spans."""

    decisions: int = 0
    seconds: float = 0.0
    differences: list[Difference] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)

    @property
    def missing(self) -> int:
        """How many decisions the recording does not hold."""
        return sum(gap.count for gap in self.gaps)


class _Record(msgspec.Struct):
    """A record with only that decoded which has to be: results are compared as the bytes they are."""

    tick: int
    before: msgspec.Raw
    facts: Facts
    after: msgspec.Raw
    decision: msgspec.Raw


class _End(NamedTuple):
    """What a run of records began or ended with."""

    tick: int
    at_ns: int
    state: bytes


@dataclass(slots=True)
class _Run:
    """A run of records: what was found, and its two ends, by which runs are joined."""

    found: Replayed = field(default_factory=Replayed)
    first: _End | None = None
    last: _End | None = None


_record_decoder = msgspec.msgpack.Decoder(_Record)
_state_decoder = msgspec.msgpack.Decoder(State)
_encoder = msgspec.msgpack.Encoder()


def replay(path: Path, limits: Limits, cores: int | None = None) -> Replayed:
    """Decide every record again; and see whether each begins with the state that the one before it left.

    cores: at most so many processes; None: as many as there are. Raises OSError, McapError.
    """
    count = chunks(path)
    jobs = max(1, min(cores or os.cpu_count() or 1, count // CHUNKS_WORTH_A_CORE))
    bounds = [count * nth // jobs for nth in range(jobs)]
    topics: dict[int, str] = {}
    for part in parts(path, 0, 1):
        list(walk(part, topics))
    if jobs == 1:
        runs = [_replay_run(path, limits, topics, 0, None)]
    else:
        ends: list[int | None] = [*bounds[1:], None]
        with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
            work = [pool.submit(_replay_run, path, limits, topics, a, b) for a, b in zip(bounds, ends, strict=True)]
            runs = [one.result() for one in work]
    return _joined(runs)


def _replay_run(path: Path, limits: Limits, topics: dict[int, str], first: int, last: int | None) -> _Run:
    """The records of some chunks."""
    run, state, topics = _Run(), State(), dict(topics)
    for part in parts(path, first, last):
        # chunk by chunk: first all are decoded, then all decided, each by code that is warm
        for record, data in _decoded(path, part, topics, run.found.decisions):
            before, prior, what = bytes(record.before), run.last, ""
            if prior is None or before != prior.state or record.tick != prior.tick + 1:
                state = _state(path, before, run.found.decisions)
                begin = _End(record.tick, record.facts.now_ns, before)
                run.first = run.first or begin
                what = _linked(run.found, run.first, prior, begin)
            after, decision = decide(state, record.facts, limits)
            was, state = bytes(record.after), after
            if _encoder.encode(after) != was or _encoder.encode(decision) != bytes(record.decision):
                what = next(_differ(data, limits), what)
                state = _state_decoder.decode(was)
            if what:
                run.found.differences.append(Difference(record.tick, what))
            run.found.decisions += 1
            run.last = _End(record.tick, record.facts.now_ns, was)
    return run


def _decoded(path: Path, part: bytes, topics: dict[int, str], before: int) -> list[tuple[_Record, bytes]]:
    """The records of a chunk, each with its bytes; before: how many came before them."""
    found: list[tuple[_Record, bytes]] = []
    try:
        for entry in walk(part, topics, RECORDS):
            found.append((_record_decoder.decode(entry.data), entry.data))  # noqa: PERF401 - an error tells how many
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise unreadable(path, before + len(found), error) from error
    return found


def _state(path: Path, data: bytes, nth: int) -> State:
    try:
        return _state_decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise unreadable(path, nth, error) from error


def _linked(found: Replayed, first: _End, last: _End | None, begin: _End) -> str:
    """Count what is missing between two records; a sentence where they do not fit together."""
    if last is None:
        return ""
    if begin.tick <= last.tick:
        return f"tick {begin.tick} comes after tick {last.tick}"
    if begin.tick > last.tick + 1:
        found.gaps.append(Gap(last.tick, begin.tick - last.tick - 1, round((last.at_ns - first.at_ns) / S, 2)))
        return ""
    if begin.state == last.state:
        return ""
    left, began = _state_decoder.decode(last.state), _state_decoder.decode(begin.state)
    return next(_fields("state", left, began, f"was left, but tick {begin.tick} began with"), "")


def _differ(data: bytes, limits: Limits) -> Iterator[str]:
    """Sentences on what is not as it would be now: the decision, and the state it left."""
    record = msgspec.msgpack.decode(data, type=Record)
    after, decision = decide(record.before, record.facts, limits)
    # as if it had been recorded: 0 is then 0.0 where a float is due
    yield from _fields("decision", record.decision, msgspec.msgpack.decode(_encoder.encode(decision), type=Decision))
    yield from _fields("state", record.after, msgspec.msgpack.decode(_encoder.encode(after), type=State))


def _fields(name: str, was: Any, now: Any, but: str = "was recorded, would be") -> Iterator[str]:
    for one in msgspec.structs.fields(was):
        a, b = getattr(was, one.name), getattr(now, one.name)
        if _encoder.encode(a) != _encoder.encode(b):
            yield f"{name}.{one.name}: {a!r} {but} {b!r}"


def _joined(runs: list[_Run]) -> Replayed:
    """What all runs found, with what is wrong or missing between them."""
    whole, first, last = Replayed(), None, None
    for run in runs:
        if run.first is None or run.last is None:
            continue
        first = first or run.first
        if what := _linked(whole, first, last, run.first):
            whole.differences.append(Difference(run.first.tick, what))
        offset_s = (run.first.at_ns - first.at_ns) / S
        whole.gaps += [Gap(gap.after_tick, gap.count, round(gap.at_s + offset_s, 2)) for gap in run.found.gaps]
        whole.differences += run.found.differences
        whole.decisions += run.found.decisions
        last = run.last
    if first is not None and last is not None:
        whole.seconds = (last.at_ns - first.at_ns) / S
    return whole
