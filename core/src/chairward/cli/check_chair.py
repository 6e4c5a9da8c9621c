"""`chairward check chair` and `chairward check timing`: the acceptance run, and the reaction measured."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import distributions
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console
from rich.prompt import Prompt

from chairward import profile
from chairward.check.acceptance import Acceptance
from chairward.check.judges import Asked, Judge, simulated
from chairward.check.report import Head, html
from chairward.check.result import Result
from chairward.check.stimulus import FlashedScreen, Stimulus
from chairward.check.timing import Timing, measure, values, write
from chairward.check.trial import Trial, TrialError, trial
from chairward.plan import ChairKind, Plan
from chairward.plugins import PluginError, discover
from chairward.profile import files
from chairward.profile.load import read_chair
from chairward.supervisor import RunError

SIMULATED = ("sim_home.speaks=false", "sim_home.wheels_off=true")
"""Nobody speaks but the check, and the simulated chair stands on blocks."""
Chair = Annotated[str, typer.Option(help="chairs/NAME.toml or a path")]
Person = Annotated[str | None, typer.Option(help="people/NAME.toml or a path; default: the chair file's own")]
Json = Annotated[bool, typer.Option("--json", help="as JSON")]
Yes = Annotated[bool, typer.Option("--yes", help="the wheels are off the ground: do not ask")]


def chair(
    chair: Chair,
    person: Person = None,
    report: Annotated[Path, typer.Option(help="where the report goes (HTML)")] = Path("acceptance.html"),
    by: Annotated[str, typer.Option(help="who makes the run, for the report")] = "",
    at_mm: Annotated[list[float] | None, typer.Option(min=1.0, help="distances at which an obstacle is placed")] = None,
    times: Annotated[int, typer.Option(min=1, max=200, help="how often the reaction is measured")] = 10,
    only: Annotated[list[str] | None, typer.Option(help="only the steps whose names begin so")] = None,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Acceptance run, wheels off the ground: a pass/fail table, and a report to sign. Exit code 1 unless all pass.

    The simulated chair is tried by itself; on any other, what cannot be seen from here is asked.
    """
    console = Console(stderr=as_json)
    if not report.parent.is_dir():
        _fail(ValueError(f"--report {report}: there is no folder {report.parent}: make it first"))
    results: list[Result] = []
    timing: Timing | None = None
    with _on_trial(chair, person, yes=yes) as (it, plan, judge, stimulus, watchdog_ms):
        run = Acceptance(it, judge, stimulus, tuple(at_mm or (500.0, 700.0, 1000.0)), times, watchdog_ms)
        for result in run.run(only or ()):
            results.append(result)
            mark = "[green]pass[/]" if result.ok else "[bold red]FAIL[/]"
            console.print(
                f"{mark}  {result.step:24} {result.found}  (allowed: {result.allowed or '-'})", highlight=False
            )
        timing = run.timing
    versions = sorted(f"{d.name} {d.version}" for d in distributions() if d.name and d.name.startswith("chairward"))
    head = Head(time.strftime("%Y-%m-%d %H:%M %z"), by, versions)
    report.write_text(html(plan, results, timing, head), encoding="utf-8")
    passed = bool(results) and all(result.ok for result in results)
    if as_json:
        steps = [{"step": r.step, "ok": r.ok, "found": r.found, "allowed": r.allowed, "late": r.late} for r in results]
        typer.echo(json.dumps({"passed": passed, "steps": steps, "report": str(report)}, indent=1))
    else:
        typer.echo(f"{'passed' if passed else 'NOT passed'}; report: {report}")
    raise typer.Exit(0 if passed else 1)


def timing(
    chair: Chair,
    person: Person = None,
    times: Annotated[int, typer.Option(min=3, max=1000, help="how often it is measured")] = 20,
    keep: Annotated[
        bool, typer.Option("--write/--dry-run", help="write it into the chair file, or only say it")
    ] = True,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Measure the reaction, from light on the glass to the bytes that stop the drive, and write it into the chair file.

    The proof of distances reckons with the longest that was measured.
    """
    with _on_trial(chair, person, yes=yes) as (it, plan, _, stimulus, _watchdog):
        try:
            found = measure(it, stimulus, times, lambda text: typer.echo(text, err=True))
        except TrialError as error:
            _fail(error)
    path = Path(plan.chair_file)
    if keep:
        write(path, found)
    said = {key: str(value) if key.endswith("measured") else value for key, value in values(found).items()}
    refused = _refused(chair, person)
    if as_json:
        all_ms = [round(ms, 1) for ms in found.reactions_ms]
        typer.echo(json.dumps({**said, "reactions_ms": all_ms, "written": keep, "refused": refused}, indent=1))
    else:
        typer.echo(f"{found}\n{path}: {'written' if keep else 'not written'}: {said}")
        if refused:
            typer.echo(f"with that reaction the distances are no longer proven: {refused}", err=True)
    raise typer.Exit(1 if refused else 0)


def _refused(chair: str, person: str | None) -> str:
    """Why the profile is refused now, "" when it is proven."""
    try:
        profile.load_traced(chair, person, [], discover())
    except (ValueError, PluginError) as error:
        return str(error)
    return ""


def _fail(error: Exception) -> NoReturn:
    typer.echo(f"chairward: {error}", err=True)
    raise typer.Exit(2) from None


@contextmanager
def _on_trial(chair: str, person: str | None, *, yes: bool) -> Iterator[tuple[Trial, Plan, Judge, Stimulus, int]]:
    """The chair on trial, with a judge and something that can appear; errors are one sentence and exit code 2."""
    try:
        plan, watchdog_ms = _loaded(chair, person)
    except (ValueError, PluginError) as error:
        _fail(error)
    real = plan.kind is not ChairKind.SIMULATOR
    if real and not yes:
        if not sys.stdin.isatty():
            _fail(ValueError("this moves the wheels: say --yes once they are off the ground"))
        typer.confirm("This moves the wheels. Are they off the ground, and is the hardware stop in reach?", abort=True)
    try:
        with trial(plan, lambda text: typer.echo(text, err=True)) as it:
            judge: Judge
            stimulus: Stimulus
            if real:
                judge, stimulus = Asked(lambda text, answers: Prompt.ask(text, choices=list(answers))), FlashedScreen()
            else:
                judge, stimulus = simulated(it)
            try:
                yield it, plan, judge, stimulus, watchdog_ms
            finally:
                stimulus.close()
    except (TrialError, RunError) as error:
        _fail(error)


def _loaded(chair: str, person: str | None) -> tuple[Plan, int]:
    """The plan (a simulated chair on blocks, with nobody else who speaks), and its controller's watchdog, ms."""
    registry = discover()
    file = read_chair(files.read(files.find("chairs", chair, files.directory())))
    sets = SIMULATED if file.kind is ChairKind.SIMULATOR else ()
    return profile.load(chair, person, sets, registry), file.stopping.watchdog_ms
