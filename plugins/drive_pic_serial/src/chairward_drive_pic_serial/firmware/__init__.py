"""The firmware's source, its prebuilt drive.hex, and how to assemble it (gpasm, package gputils)."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent
SOURCE = FOLDER / "drive.asm"
PREBUILT = FOLDER / "drive.hex"


class FirmwareError(RuntimeError):
    """The firmware cannot be assembled: one sentence with what to do."""


@dataclass(frozen=True, slots=True)
class Built:
    """What gpasm made: hex to program, cod for gpsim, words of program memory used (of 8192)."""

    hex: Path
    cod: Path
    words: int


def assemble(folder: Path, defines: Sequence[str] = ()) -> Built:
    """Assemble drive.asm into `folder`. defines: HANGTEST adds a frame 0x7E that hangs the loop (watchdog tests).

    Raises FirmwareError when gpasm is missing or refuses the source.
    """
    gpasm = shutil.which("gpasm")
    if gpasm is None:
        raise FirmwareError("gpasm is not installed: sudo apt-get install gputils")
    shutil.copyfile(SOURCE, folder / SOURCE.name)
    options = [part for define in defines for part in ("-D", define)]
    done = subprocess.run(
        [gpasm, *options, SOURCE.name, "-o", "drive.hex"], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise FirmwareError(f"gpasm refuses {SOURCE}: {(done.stdout + done.stderr).strip()}")
    listing = (folder / "drive.lst").read_text(encoding="latin-1")
    words = int(listing.split("Program Memory Words Used:")[1].split()[0])
    return Built(folder / "drive.hex", folder / "drive.cod", words)
