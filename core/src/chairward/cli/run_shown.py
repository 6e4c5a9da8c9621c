"""What people see of a run: the live status line, and the summary at its end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table
from rich.text import Text

from chairward.facts import Decision, Instruction
from chairward.messages import Way
from chairward.processes import plain
from chairward.records import Record

_SIGN = {
    Instruction.WAY_CLEAR: ("●", "green"),
    Instruction.GO_STRAIGHT: ("▲", "green"),
    Instruction.TURN_LEFT: ("◀", "yellow"),
    Instruction.TURN_RIGHT: ("▶", "yellow"),
    Instruction.STOP: ("■", "red"),
}


def status_line(record: Record) -> Text:
    """Instruction (shape, colour and words), distance, reason, speed, open ways, word, lease."""
    decision = record.decision
    shape, colour = _SIGN.get(decision.instruction, ("?", "white"))
    text = Text()
    text.append(f" {shape} {decision.instruction:<20}", style=f"bold {colour}")
    near = "--" if decision.nearest_mm is None else f"{decision.nearest_mm}"
    text.append(f" {near:>5} mm ")
    text.append(f" {decision.motion.drive_mm_s:5.0f} mm/s {decision.motion.turn_deg_s:4.0f} deg/s ")
    text.append(" ".join("^v<>"[list(Way).index(w)] for w in decision.open_ways).ljust(8), style="cyan")
    word = decision.command.value if decision.command else "-"
    text.append(f" {word:<7} {'▮' * round(decision.lease_left_s):<8}")
    text.append(plain(_reason(decision)), style="dim")
    return text


def _reason(decision: Decision) -> str:
    if decision.latch:
        return decision.latch
    if not decision.reasons:
        return ""
    first = decision.reasons[0]
    return " ".join(filter(None, (first.rule, first.source, first.detail)))


def report(result: dict[str, Any]) -> Table:
    """The summary for people."""
    table = Table(title="Summary", show_header=False, title_justify="left")
    table.add_column()
    table.add_column(overflow="fold")
    for name, said in _rows(result):
        table.add_row(name, Text(plain(said)))  # as it is: a text may have [brackets]
    return table


def _rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """What is said of which figure. What is not known is "-"."""
    yield "ended", result["ended"]
    yield "driven", f"{result['driven_m']} m in {result['seconds']} s"
    heard = result["commands_heard"]
    yield "commands", f"{len(heard)} heard; obeyed: {', '.join(result['commands_obeyed']) or 'none'}"
    for stop in result["protective_stops"]:
        yield "protective stop", f"at {stop['at_s']} s, {_mm(stop['nearest_mm'])}: {'; '.join(stop['why'])}"
    for latch in result["latched"]:
        yield "latched", latch
    if not result["driven_m"]:
        for reason in result["reasons_at_end"]:
            yield "it stood because", reason
    yield "nearest while driving", _mm(result["nearest_while_driving_mm"])
    for name in ("tick_lateness_ms", "message_to_wire_ms", "reading_age_ms"):
        if figures := result[name]:
            yield name.replace("_", " "), f"p50 {figures['p50']}  p99 {figures['p99']}  max {figures['max']}"
    yield "late ticks (> 40 ms)", f"{result['late_ticks']} of {result['ticks']}"
    yield "missed records", str(result["missed_records"])
    for name, lane in result["lanes"].items():
        yield f"lane {name}", f"{lane['items']} items, {lane['dropped']} dropped, {lane['restarts']} restarts"
    for event in result["events"]:
        yield "event", event
    if result["recording"]:
        kept = result.get("recorder", {})
        missed = f", {kept['missed']} missed {kept['trouble']}".rstrip() if kept.get("missed") else ""
        yield "recording", f"{result['recording']}{missed}"


def _mm(distance_mm: int | None) -> str:
    return "-" if distance_mm is None else f"{distance_mm} mm"
