"""The zoo is found by all processes of a run like an installed plugin; its folder is on PYTHONPATH."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
for folder in (HERE, HERE / "zoo"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))


@pytest.fixture(scope="session", autouse=True)
def zoo_is_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Lay the zoo out as a distribution and let child processes find it."""
    import chairward_zoo

    folder = chairward_zoo.install(tmp_path_factory.mktemp("zoo"))
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(folder), before]))
    sys.path.insert(0, str(folder))
    yield
    sys.path.remove(str(folder))
    if before is None:
        del os.environ["PYTHONPATH"]
    else:
        os.environ["PYTHONPATH"] = before
