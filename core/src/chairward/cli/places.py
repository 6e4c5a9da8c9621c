"""Files and folders that people name: tried before the work begins, and what went wrong with one as a sentence."""

from __future__ import annotations

import tempfile
from pathlib import Path


class PlaceError(ValueError):
    """Where something is to be written, nothing can be: one sentence."""


def writable(option: str, folder: Path) -> None:
    """Make a folder, and see that something can be written into it. Raises PlaceError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        why = "is no folder" if isinstance(error, FileExistsError) else (error.strerror or str(error)).lower()
        raise PlaceError(f"{option}: {folder} cannot be written ({why}): choose another folder") from None


def told(error: Exception) -> str:
    """An error as a sentence with the file and what to do."""
    if not isinstance(error, OSError) or error.filename is None:
        return str(error)
    match error:
        case FileNotFoundError():
            return f"{error.filename}: there is no such file: check the path"
        case IsADirectoryError():
            return f"{error.filename}: is a folder: name a file in it"
        case PermissionError():
            return f"{error.filename}: no permission: change that, or choose another place"
    return f"{error.filename}: {error.strerror}: choose another place"
