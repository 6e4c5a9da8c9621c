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
    """With pytest arguments: just those tests. Without: the checks, then all tests; the first failing exit code."""
    os.chdir(ROOT)
    pytest = [sys.executable, "-m", "pytest"]
    if arguments:
        return subprocess.run([*pytest, *arguments], check=False).returncode
    code = 0
    environment = {**os.environ, "MYPYPATH": os.pathsep.join(SOURCES)}
    for check in CHECKS:
        sys.stderr.write(f"== {' '.join(check[:3])}\n")
        code = subprocess.run(check, check=False, env=environment).returncode or code
    for tests in (["-n", "2", "-m", "not processes"], ["-n", "0", "-m", "processes"]):
        # whole chairs in real processes come last and alone: they need the machine's cores to be on time
        sys.stderr.write(f"== pytest {' '.join(tests)}\n")
        code = subprocess.run([*pytest, "-q", *tests], check=False).returncode or code
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
