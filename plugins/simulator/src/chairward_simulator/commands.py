"""`chairward sim home`: look at the home without driving in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

File = Annotated[Path | None, typer.Argument(help="home file (TOML); default: the flat that comes along")]
Picture = Annotated[Path | None, typer.Option(help="write plan, tour and a stereo pair to this .png")]


def home(file: File = None, picture: Picture = None) -> None:
    """Check a home file, say what is in it, and draw it with the tour as an undisturbed chair would drive it."""
    from chairward.components import Footprint
    from chairward_simulator.home import HOME_FILE, HomeError, load, obstacles

    try:
        flat = load(file or HOME_FILE)
    except HomeError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from None
    typer.echo(f"home '{flat.name}': {len(obstacles(flat))} things, {len(flat.doorway)} doorways")
    typer.echo(
        f"starts at x {flat.start.x_mm:.0f} y {flat.start.y_mm:.0f} mm, heading {flat.start.heading_deg:.0f} deg"
    )
    for number, leg in enumerate(flat.tour, 1):
        wants = " ".join(str(value) for key, value in leg.model_dump().items() if key != "do")
        typer.echo(f"  {number}. {leg.do} {wants}")
    if picture is None:
        return
    import cv2

    from chairward_simulator.picture import draw

    if not cv2.imwrite(str(picture), draw(flat, Footprint(front_mm=450.0, rear_mm=450.0, half_width_mm=320.0))):
        typer.echo(f"chairward: {picture}: cannot be written: name a .png in a folder that exists", err=True)
        raise typer.Exit(2)
    typer.echo(f"wrote {picture}")


def ride(
    chair: Annotated[str, typer.Option(help="chair file whose stages, rules and limits are used")] = "sim",
    person: Annotated[str | None, typer.Option(help="who drives; default: the chair file's own")] = None,
    sets: Annotated[list[str] | None, typer.Option("--set", help="component.key=value")] = None,
    seconds: Annotated[float, typer.Option(min=1.0, help="simulated seconds at most")] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="only the report, as JSON")] = False,
) -> None:
    """Drive the tour in simulated time: real stages and rules, no processes, wire or firmware; for tuning a home."""
    import json
    import tempfile

    from chairward import profile
    from chairward.plugins import PluginError, discover
    from chairward_simulator.ride import ride as rides

    registry = discover()
    with tempfile.TemporaryDirectory(prefix="chairward-ride-") as folder:
        try:
            plan = profile.load(chair, person, sets or [], registry)
            for said in rides(plan, registry, Path(folder), seconds):
                if isinstance(said, dict):
                    typer.echo(json.dumps(said, indent=1))
                elif not as_json:
                    typer.echo(said)
        except (ValueError, PluginError) as error:
            typer.echo(f"chairward: {error}", err=True)
            raise typer.Exit(2) from None
