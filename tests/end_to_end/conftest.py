"""The command line as people start it, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """What it printed, as JSON; fails with what it said where it is none."""
        try:
            return json.loads(self.out)
        except json.JSONDecodeError as error:
            raise AssertionError(f"not JSON ({error}): {self.out[:500]}\n{self.err[-2000:]}") from error

    @property
    def sentence(self) -> str:
        """What it said on standard error, on one line."""
        return " ".join(self.err.split())


def chairward(*arguments: str, timeout_s: float = 150.0, **environment: str) -> Ended:
    """Run `chairward ARGUMENTS` in the project's folder."""
    done = subprocess.run(
        [sys.executable, "-m", "chairward", *arguments],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "400", "NO_COLOR": "1", **environment},
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )
    return Ended(done.returncode, done.stdout, done.stderr)


@pytest.fixture(scope="session")
def command() -> Any:
    """The function above."""
    return chairward
