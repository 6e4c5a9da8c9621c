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
