"""Is the model the firmware, and is a damaged frame ever obeyed? Both in firmware time, so load makes them only slower.

    python benchmarks/hands.py agreement [--sequences 2000]       writes benchmarks/results/hands_agreement.json
    python benchmarks/hands.py corruption --engine model|gpsim    writes benchmarks/results/hands_corruption_*.json

Each goes on where it was ended (--minutes), as long as the sources are the same.
"""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer
from report import machine, of_sources, save, saved

from chairward_drive_pic_serial.agreement import Pair, disagreement
from chairward_drive_pic_serial.corruption import Tally, corrupt
from chairward_drive_pic_serial.engine import ModelEngine
from chairward_drive_pic_serial.gpsim import Gpsim

SOURCES = ("firmware/drive.asm", "model.py", "motor.py", "uart.py", "wire.py", "agreement.py", "corruption.py")
SAVE_EVERY = 10
FRAMES = {"model": 100_000, "gpsim": 5_000}
BLOCK = {"model": 5_000, "gpsim": 250}
"""Frames between two looks at the clock."""

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__)
Minutes = Annotated[float, typer.Option(help="end after so long and go on the next time")]


@app.command()
def agreement(sequences: int = 2000, steps: int = 10, minutes: Minutes = 7.0) -> None:
    """Model against gpsim over random sequences: replies, state, fault, pins after every step."""
    sources = of_sources(*SOURCES)
    done = saved("hands_agreement", sources)
    result: dict[str, Any] = {
        "what": "random command sequences to the model and to the firmware in gpsim, compared after every step",
        "compared": "replies, state, fault, every pin",
        "steps_a_sequence": steps,
        "sequences": done.get("sequences", 0),
        "differ": done.get("differ", []),
        "seconds": done.get("seconds", 0.0),
        "sources": sources,
    }
    start, before = time.monotonic(), result["seconds"]
    pair = Pair()
    while result["sequences"] < sequences and time.monotonic() - start < minutes * 60:
        if differs := disagreement(pair, result["sequences"], steps):
            result["differ"].append(differs)
            pair.close()
            pair = Pair()
        result["sequences"] += 1
        result["seconds"] = round(before + time.monotonic() - start, 1)
        if result["sequences"] % SAVE_EVERY == 0:
            save("hands_agreement", result | machine())
    pair.close()
    save("hands_agreement", result | machine())
    print(f"agreement: {result['sequences']} of {sequences} sequences, {len(result['differ'])} differ")
    if result["differ"]:
        raise typer.Exit(1)


@app.command()
def corruption(engine: str = "model", frames: int = 0, minutes: Minutes = 7.0) -> None:
    """Damaged frames, each followed by a good one, to a driving controller."""
    sources, name, wanted = of_sources(*SOURCES), f"hands_corruption_{engine}", frames or FRAMES[engine]
    done = saved(name, sources)
    tally, seconds = Tally(**done.get("tally", {})), done.get("seconds", 0.0)
    start = time.monotonic()
    while tally.frames < wanted and time.monotonic() - start < minutes * 60:
        pic = Gpsim() if engine == "gpsim" else ModelEngine()
        block = corrupt(pic, min(BLOCK[engine], wanted - tally.frames), seed=tally.frames)
        pic.close()
        tally += block
        result = {
            "what": "damaged frames (bits flipped; bytes lost, added, exchanged; cut, spliced, noise) while driving",
            "engine": engine,
            "tally": tally.told(),
            "seconds": round(seconds + time.monotonic() - start, 1),
            "sources": sources,
        }
        save(name, result | machine())
    print(f"corruption {engine}: {tally}")
    if tally.accepted or tally.good_lost:
        raise typer.Exit(1)


if __name__ == "__main__":
    app()
