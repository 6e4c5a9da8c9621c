"""`chairward run` and `chairward demo`: drive, with a live status line, and end with a summary."""

from __future__ import annotations

import json
import logging
import re
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import platformdirs
import typer
from rich.console import Console
from rich.live import Live
from rich.logging import RichHandler

from chairward import next_run, profile
from chairward.cli.places import PlaceError, told, writable
from chairward.cli.run_shown import report, status_line
from chairward.plan import ChairKind, Plan
from chairward.plugins import PluginError, discover
from chairward.records import Record
from chairward.summary import Summary, against_truth
from chairward.supervisor import RunError, Supervisor

KEEP_RECORDINGS = 20
KEEP_BYTES = 4_000_000_000
LIVE_S = 0.1

Person = Annotated[str | None, typer.Option(help="people/NAME.toml or a path; default: the chair file's own")]
Sets = Annotated[list[str] | None, typer.Option("--set", help="component.key=value, validated like the files")]
For = Annotated[str | None, typer.Option("--for", help="how long, e.g. 30s or 2m; default: until Ctrl-C")]
Headless = Annotated[bool, typer.Option(help="no live status line")]
Json = Annotated[bool, typer.Option("--json", help="the summary as JSON on standard output")]
Record_ = Annotated[Path | None, typer.Option("--record", help="where the recording goes (.mcap)")]
NoRecord = Annotated[bool, typer.Option("--no-record", help="keep no recording")]
Logs = Annotated[Path | None, typer.Option("--logs", help="keep what each process of the run says in this folder")]


def run(
    chair: Annotated[str, typer.Option(help="chairs/NAME.toml or a path")],
    person: Person = None,
    sets: Sets = None,
    for_: For = None,
    headless: Headless = False,
    as_json: Json = False,
    record: Record_ = None,
    no_record: NoRecord = False,
    logs: Logs = None,
) -> None:
    """Drive the chair that the chair file describes. Ctrl-C stops the chair first."""
    try:
        kept = None if no_record else recording_place(record)
        if logs is not None:
            writable("--logs", logs)
    except (OSError, PlaceError) as error:
        typer.echo(f"chairward: {told(error)}", err=True)
        raise typer.Exit(2) from None
    drive(
        chair,
        person,
        sets or [],
        for_,
        headless=headless or as_json,
        as_json=as_json,
        record=kept,
        logs=logs,
    )


def demo(
    person: Person = None,
    sets: Sets = None,
    for_: For = None,
    headless: Headless = False,
    as_json: Json = False,
    record: Record_ = None,
    no_record: NoRecord = False,
    logs: Logs = None,
) -> None:
    """Drive the simulated chair in a simulated home: no hardware is needed, and nothing bypasses the real path."""
    run("sim", person, sets, for_, headless, as_json, record, no_record, logs)


def drive(
    chair: str,
    person: str | None,
    sets: list[str],
    for_: str | None,
    *,
    headless: bool,
    as_json: bool,
    record: Path | None,
    logs: Path | None = None,
) -> None:
    """Load, run, sum up; errors are one sentence on standard error and exit code 2."""
    console = Console(stderr=True)
    logging.basicConfig(
        level=logging.WARNING, format="%(message)s", handlers=[RichHandler(console=console, show_path=False)]
    )
    registry = discover()
    try:
        seconds = None if for_ is None else parse_seconds(for_)
        plan = profile.load(chair, person, sets, registry)
    except (ValueError, PluginError) as error:
        console.print(f"chairward: {error}", style="red", markup=False, highlight=False)
        raise typer.Exit(2) from None
    before: list[dict[str, Any]] = []
    while True:
        file = (
            None if record is None else record.with_stem(f"{record.stem}-{len(before) + 1}" if before else record.stem)
        )
        run_dir = Path(tempfile.mkdtemp(prefix="chairward-"))
        try:
            code, result = _run(_recorded(plan, file), run_dir, seconds, console, headless=headless)
            following = next_run.asked(run_dir) if result["ended"] == next_run.REASON else None
        except RunError as error:
            console.print(f"chairward: {error}", style="red", markup=False, highlight=False)
            raise typer.Exit(2) from None
        finally:
            if logs is not None:
                _keep_logs(run_dir, logs, console)
            shutil.rmtree(run_dir, ignore_errors=True)
        result["recording"] = str(file) if file else None
        if not as_json:
            console.print(report(result))
        if following is None or not following.person:
            break
        before.append(result)
        try:
            plan = profile.load(chair, following.person, sets, registry)
        except ValueError as error:  # the file was changed since it was chosen: who drove before drives on
            console.print(f"chairward: {error}; {plan.person} drives on", style="red", markup=False, highlight=False)
    if as_json:
        typer.echo(json.dumps({**result, "before": before} if before else result, indent=1))
    raise typer.Exit(code)


def _keep_logs(run_dir: Path, logs: Path, console: Console) -> None:
    """What the processes said; that it cannot be kept takes nobody's summary away."""
    try:
        for log in run_dir.glob("*.log"):
            shutil.copy(log, logs)
    except OSError as error:
        console.print(f"chairward: the logs could not be kept: {error}", style="red", markup=False, highlight=False)


def _recorded(plan: Plan, file: Path | None) -> Plan:
    """The plan with a recorder that writes this file."""
    if file is None:
        return plan
    recorder = replace(plan.recorder, settings={**plan.recorder.settings, "path": str(file.resolve())})
    return replace(plan, observers={**plan.observers, "recorder": recorder})


def _run(
    plan: Plan, run_dir: Path, seconds: float | None, console: Console, *, headless: bool
) -> tuple[int, dict[str, Any]]:
    """One run under the supervisor; returns exit code and summary."""
    summary = Summary(plan.limits, keep_seen=plan.kind is ChairKind.FILES)
    shown = 0.0
    live = None if headless or not console.is_terminal else Live(console=console, auto_refresh=False, transient=True)

    def on_record(record: Record) -> None:
        nonlocal shown
        summary.add(record)
        if live is not None and time.monotonic() - shown > LIVE_S:
            shown = time.monotonic()
            live.update(status_line(record), refresh=True)

    supervisor = Supervisor(plan, run_dir, on_record)
    with _signals(supervisor):
        if not headless:
            console.print(
                f"{plan.person} drives '{plan.chair}' ({plan.kind.value}); Ctrl-C stops the chair.", highlight=False
            )
            console.print("Not a certified medical device: its stop is a protective stop.", style="dim")
        if live is not None:
            with live:
                code = supervisor.run(seconds)
        else:
            code = supervisor.run(seconds)
    result = {"chair": plan.chair, "person": plan.person, "drive": plan.drive.component, **summary.result()}
    result["ended"] = supervisor.ended_reason
    result["events"] = supervisor.events
    result["lanes"] = {
        name: {"items": lane.items, "dropped": lane.dropped + lane.dropped_before, "restarts": lane.deaths}
        for name, lane in supervisor.lanes.items()
    }
    if supervisor.up is not None:
        result["guard"] = {"fifo": supervisor.up.fifo, "memory_locked": supervisor.up.memory_locked}
    if seen := against_truth(summary.seen, run_dir, supervisor.events):
        result["seen_against_truth"] = seen
    return code, result | reports(run_dir, supervisor.events)


def reports(run_dir: Path, events: list[str]) -> dict[str, Any]:
    """What companions and lanes reported at their end, by name; one that cannot be read is told in `events`."""
    found = {}
    for path in sorted(run_dir.glob("report-*.json")):
        try:
            found[path.stem.removeprefix("report-")] = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            events.append(f"{path.name}: cannot be read ({error}) and is left out")
    return found


@contextmanager
def _signals(supervisor: Supervisor) -> Iterator[None]:
    """What a terminal or a service manager ends programs by asks for an orderly end: the chair first."""
    before = {
        number: signal.signal(number, lambda n, _: supervisor.stop(f"{signal.Signals(n).name} received"))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    }
    try:
        yield
    finally:
        by_signal = supervisor.ended_reason.endswith("received")
        for number, handler in before.items():  # who presses Ctrl-C twice still gets the summary
            signal.signal(number, signal.SIG_IGN if by_signal else handler)


def parse_seconds(text: str) -> float:
    """ "30s", "2m", "1.5h" or plain seconds. Raises ValueError."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([smh]?)", text.strip())
    if not found:
        raise ValueError(f"--for {text}: not a duration; write for example 30s, 2m or 1h")
    return float(found[1]) * {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}[found[2]]


def recording_place(record: Path | None) -> Path:
    """Where the recording goes: that file, or the default. Raises OSError, PlaceError."""
    if record is None:
        return default_recording()
    if record.is_dir():
        raise PlaceError(f"--record {record}: is a folder: name a file in it, such as {record / 'drive.mcap'}")
    writable("--record", record.parent)
    return record


def default_recording() -> Path:
    """A new file in the person's state folder; of the older ones the last few are kept, and not too much of them."""
    folder = Path(platformdirs.user_state_dir("chairward")) / "recordings"
    writable("the recording (choose its place by --record, or --no-record)", folder)
    left = KEEP_BYTES
    for nth, old in enumerate(sorted(folder.glob("*.mcap"), reverse=True), start=1):
        left -= old.stat().st_size
        if nth >= KEEP_RECORDINGS or left < 0:
            old.unlink()
    return folder / time.strftime("%Y-%m-%d-%H%M%S.mcap")
