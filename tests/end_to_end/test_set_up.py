"""Setting it up: what `./run` says when the checkout is not whole, and that each plugin stands on its own packages."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLUGINS = sorted(p.parent for p in ROOT.glob("plugins/*/pyproject.toml"))
UV = os.environ.get("UV") or shutil.which("uv") or shutil.which("uv", path=str(ROOT / ".tools" / "bin"))

# run in an environment that holds one plugin and what it says it needs
EVERY_MODULE = """
import importlib, json, pkgutil, sys
package = importlib.import_module(sys.argv[1])
names = [m.name for m in pkgutil.walk_packages(package.__path__, package.__name__ + ".") if "__main__" not in m.name]
for name in names:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name not in ("pytest", "hypothesis"):  # what helps to test a drive comes with chairward[testing]
            raise
from chairward.plugins import discover
found = discover()
offered = sorted(set(found.origin.values()) | {name for name, _ in found.manager.list_name_plugin()})
print(json.dumps({"modules": names, "plugins": offered, "refused": [str(r) for r in found.refused]}))
"""


def run_at(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The project's `run`, copied to a folder of its own."""
    shutil.copy(ROOT / "run", folder / "run")
    command = [sys.executable, str(folder / "run"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_a_plugin_folder_left_over_by_git_is_named_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "plugins" / "old_sonar" / "__pycache__").mkdir(parents=True)
    done = run_at(tmp_path, "test")
    assert done.returncode == 2
    assert done.stderr.strip() == (
        "chairward: plugins/old_sonar has no pyproject.toml (left over from another version?): delete that folder."
    )


@pytest.mark.skipif(UV is None, reason="needs uv: start the tests with ./run test")
@pytest.mark.parametrize("folder", PLUGINS, ids=lambda p: p.name)
def test_each_plugin_works_with_nothing_but_core_and_its_own_packages(folder: Path) -> None:
    name = tomllib.loads((folder / "pyproject.toml").read_text())["project"]["name"]
    module = next((folder / "src").iterdir()).name
    command = [
        str(UV),
        "run",
        "--quiet",
        "--isolated",
        "--exact",
        "--no-dev",
        "--project",
        str(ROOT),
        "--package",
        name,
    ]
    environment = {k: v for k, v in os.environ.items() if k not in ("UV_COMPILE_BYTECODE", "VIRTUAL_ENV")}
    done = subprocess.run(
        [*command, "--python", sys.executable, "python", "-c", EVERY_MODULE, module],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert f"{module}.plugin" in found["modules"]
    assert found["plugins"] == sorted(["core", folder.name])
    assert found["refused"] == []
