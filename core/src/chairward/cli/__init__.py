"""The command line: `chairward ...`."""

from __future__ import annotations

from chairward.cli.app import main

__all__ = ["main"]
