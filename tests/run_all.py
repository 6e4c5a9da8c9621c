"""`./run test [pytest arguments]`: ruff, mypy, import contracts, then all tests. Without arguments everything runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ["core/src", *(str(p.relative_to(ROOT)) for p in sorted(ROOT.glob("plugins/*/src")))]
CHECKS = (
    ["ruff", "check", "."],
    ["ruff", "format", "--check", "."],
    ["mypy", *SOURCES],
    ["lint-imports"],
)


def main(arguments: list[str]) -> int:
    """Run the checks (only when no pytest arguments are given) and the tests; the first failing exit code."""
    os.chdir(ROOT)
    code = 0
    if not arguments:
        for check in CHECKS:
            sys.stderr.write(f"== {' '.join(check[:3])}\n")
            code = code or subprocess.run(check, check=False).returncode
    tests = [sys.executable, "-m", "pytest", *(arguments or ["-q"])]
    return subprocess.run(tests, check=False).returncode or code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
