"""What the suite itself promises: a whole chair that failed is tried once more, and that is told."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = """
import pytest
tried = []

@pytest.mark.processes
def test_fails_once():
    tried.append(1)
    assert len(tried) == 2, "the first failure"

@pytest.mark.processes
@pytest.mark.parametrize("number", range(4))
def test_fails_always(number):
    assert False, "broken"

def test_plain():
    assert False, "not a chair"
"""


def test_a_whole_chair_is_tried_once_more_and_that_is_told(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text())
    (tmp_path / "test_some.py").write_text(TESTS)
    options = ["-n", "0", "-p", "no:cacheprovider", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(tmp_path)]
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", *options, str(tmp_path / "test_some.py")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=100.0,
    )
    told = [line.split(": ")[1] for line in ended.stdout.splitlines() if line.startswith("tried again: ")]
    assert [name.split("::")[1] for name in told] == ["test_fails_once", "test_fails_always[0]", "test_fails_always[1]"]
    assert "the first failure" in ended.stdout
    assert "5 failed, 1 passed" in ended.stdout, ended.stdout[-2000:]
