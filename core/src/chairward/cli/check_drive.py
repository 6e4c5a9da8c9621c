"""`chairward check drive`: measures a drive wheels off the ground and writes what was found into the chair file."""

from __future__ import annotations

import json
import select
import shutil
import sys
import tempfile
import termios
import tty
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from chairward import companions, plan, realtime
from chairward.check.chair_file import write_drive
from chairward.check.drive import DriveCheck, Finding, full_motion
from chairward.check.drive_bench import BenchError, DriveBench, RealClock
from chairward.check.drive_eyes import Eyes, Instruments, from_pins, from_reports, from_world
from chairward.check.drive_person import PersonEyes
from chairward.components import SILENCE_LIMIT_MS, DriveError, DriveSettings, Pose
from chairward.plan import ChairKind, Plan
from chairward.plugins import PluginError, Registry, discover
from chairward.processes import Process, terminate, wait_all
from chairward.profile import files
from chairward.profile.load import load_chair, read_chair
from chairward.shared_state import SharedState

LEAVE_S = 5.0


class Observe(StrEnum):
    """Who sees the wheels."""

    AUTO = "auto"
    PINS = "pins"
    REPORT = "report"
    PERSON = "person"


def drive(
    chair: Annotated[str, typer.Option(help="chairs/NAME.toml or a path")],
    drive_name: Annotated[str | None, typer.Option("--drive", help="which of the chair's drives")] = None,
    observe: Annotated[
        Observe,
        typer.Option(
            help="pins: of a simulated controller; report: the controller's encoders; person: questions and a key; "
            "auto: pins where there are any, else person"
        ),
    ] = Observe.AUTO,
    pins: Annotated[Path | None, typer.Option(help="pins file of a simulator that is running already")] = None,
    wheel_mm: Annotated[float, typer.Option(help="person: diameter of the driven wheels, to time their turns")] = 0.0,
    track_mm: Annotated[float, typer.Option(help="person: distance between the driven wheels")] = 0.0,
    off_the_ground: Annotated[
        bool, typer.Option("--wheels-off-the-ground", help="do not ask whether they are")
    ] = False,
    write: Annotated[
        bool | None, typer.Option(help="write the chair file; default: unless nothing real is behind the drive")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="as JSON on standard output")] = False,
) -> None:
    """Measure signs, scale, stopping and stop on silence, WHEELS OFF THE GROUND; exit code 1 when a step fails."""
    run_dir = Path(tempfile.mkdtemp(prefix="chairward-"))
    try:
        registry = discover()
        file = files.read(files.find("chairs", chair, files.directory()))
        chosen = _chosen(list(read_chair(file).drive), drive_name)
        the_plan = load_chair(file, chosen, registry).plan
        simulated = the_plan.kind in (ChairKind.SIMULATOR, ChairKind.FILES)
        if not (simulated or off_the_ground):
            _confirm(the_plan)
        with _companions(the_plan, run_dir):
            method, findings = _measure(the_plan, registry, run_dir, observe, pins, (wheel_mm, track_mm), quiet=as_json)
        written = []
        if all(finding.ok for finding in findings) and (write if write is not None else not simulated):
            written = _write(file.path, chosen, method, findings)
    except (ValueError, PluginError, BenchError, DriveError, companions.RunError, OSError) as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo("stopped; nothing was written", err=True)
        raise typer.Exit(130) from None
    finally:
        shutil.rmtree(run_dir, ignore_errors=True)
    ok = all(finding.ok for finding in findings)
    if as_json:
        steps = [asdict(finding) for finding in findings]
        told = {"chair": the_plan.chair, "drive": chosen, "method": method, "ok": ok, "steps": steps}
        typer.echo(json.dumps({**told, "written": written}, indent=1))
    elif written:
        typer.echo(f"written to {file.path}: {', '.join(written)}")
    elif not ok:
        typer.echo("nothing was written", err=True)
    raise typer.Exit(0 if ok else 1)


def _chosen(offered: Sequence[str], wanted: str | None) -> str:
    """The drive to measure. Raises ValueError."""
    if wanted is None and len(offered) == 1:
        return offered[0]
    if wanted is None or wanted not in offered:
        raise ValueError(f"--drive {wanted or 'is missing'}: this chair offers {', '.join(offered)}")
    return wanted


def _confirm(the_plan: Plan) -> None:
    """Nobody in the seat, wheels in the air, the hardware stop at hand; refuses without a yes. Raises ValueError."""
    typer.echo(f"This turns the wheels of '{the_plan.chair}' at half their full speed, and lets them run on unwatched.")
    typer.echo("Nobody sits in it, nothing is near the wheels, and the hardware stop is in your hand.")
    if not typer.confirm("Are the driven wheels off the ground?", err=True):
        raise ValueError("nothing was moved: lift the chair so that its driven wheels turn freely")


@contextmanager
def _companions(the_plan: Plan, run_dir: Path) -> Iterator[None]:
    """The simulated controller, where the chair file has one."""
    plan.write(the_plan, companions.plan_file(run_dir))
    started: dict[str, Process] = {}
    try:
        companions.start(the_plan, run_dir, started, lambda: False)
        yield
    finally:
        for process in started.values():
            terminate(process)
        wait_all(started, LEAVE_S, lambda text: typer.echo(f"chairward: {text}", err=True))


def _measure(
    the_plan: Plan,
    registry: Registry,
    run_dir: Path,
    observe: Observe,
    pins: Path | None,
    wheels_mm: tuple[float, float],
    *,
    quiet: bool,
) -> tuple[str, list[Finding]]:
    """How it was seen, and every step. Raises BenchError, DriveError, ValueError."""
    component = registry.get("drive", the_plan.drive.component)
    settings = component.settings.model_validate(plan.fill_run_dir(the_plan.drive.settings, run_dir))
    if isinstance(settings, DriveSettings) and settings.silence_unproved():  # else it could not be armed to be measured
        assumed = {"silence_stop_ms": SILENCE_LIMIT_MS, "silence_stop_measured": datetime.now(UTC).date()}
        settings = settings.model_copy(update=assumed)
    bench = DriveBench(
        component.make(settings, the_plan.context("drive", Pose(), run_dir)),
        RealClock(),
    )
    with _eyes(bench, the_plan, run_dir, observe, pins, wheels_mm) as eyes:
        realtime.claim()
        check = DriveCheck(bench, eyes, the_plan.drive.settings, the_plan.limits.decel_mm_s2)
        findings = []
        with closing(check.run()) as steps:
            for finding in steps:
                findings.append(finding)
                if not quiet:
                    typer.echo(f"{'ok   ' if finding.ok else 'WRONG'}  {finding.step}: {finding.found}")
        return eyes.method, findings


@contextmanager
def _eyes(
    bench: DriveBench,
    the_plan: Plan,
    run_dir: Path,
    observe: Observe,
    pins: Path | None,
    wheels_mm: tuple[float, float],
) -> Iterator[Eyes]:
    """Who looks. Raises ValueError where nobody can."""
    full = full_motion(the_plan.drive.settings)
    pins_file = pins or run_dir / "pins"
    if observe is Observe.AUTO:
        observe = Observe.PINS if pins_file.exists() else Observe.PERSON
    if observe is Observe.PINS:
        state = SharedState.attach(pins_file, 5.0)
        world = SharedState.attach(run_dir / "world") if (run_dir / "world").exists() else None
        scale = from_world(world.read) if world else None
        yield Instruments("pins of the simulated controller", full, from_pins(state.read, full), scale)
        state.close()
        if world:
            world.close()
    elif observe is Observe.REPORT:
        look = from_reports(bench)
        yield Instruments("speed that the controller reports", full, look, look)
    else:
        with _keys() as person:
            yield PersonEyes(person, *wheels_mm)


class _Terminal:
    """A `chairward.check.drive_person.Person` at the keyboard; any key is the key."""

    def choose(self, question: str, answers: Sequence[str]) -> int:
        """By its number."""
        typer.echo(f"{question}  " + "  ".join(f"[{number}] {answer}" for number, answer in enumerate(answers, 1)))
        while True:
            key = sys.stdin.read(1)
            if key.isdigit() and 1 <= int(key) <= len(answers):
                return int(key) - 1

    def tell(self, text: str) -> None:
        """A line."""
        typer.echo(text)

    def pressed(self) -> bool:
        """Takes what has been typed."""
        found = False
        while select.select([sys.stdin], [], [], 0.0)[0]:
            sys.stdin.read(1)
            found = True
        return found


@contextmanager
def _keys() -> Iterator[_Terminal]:
    """Keys one by one, without Enter. Raises ValueError without a terminal."""
    if not sys.stdin.isatty():
        raise ValueError("a person has to answer, and there is no terminal: run it in one, or say --observe report")
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield _Terminal()
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _write(path: Path, chosen: str, method: str, findings: Sequence[Finding]) -> list[str]:
    """All values with date and method; the keys that were written."""
    today = datetime.now().astimezone().date()
    values: dict[str, Any] = {}
    for finding in findings:
        values |= finding.values
    values |= {"silence_stop_measured": today, "silence_stop_method": method}
    return write_drive(path, chosen, values, f"measured {today}: {method}")
