"""A pytest plugin for `chairward plugins grade`: writes down which contracts were kept, and for which component.

Named by `-p chairward.testing.kept`; the file's path comes in CHAIRWARD_KEPT.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

Kept = tuple[str, str]


class Book:
    """Per contract class and component of its rig, whether all tests passed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.all_well: dict[Kept, bool] = {}
        self.failed: list[str] = []

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        """Note each outcome; a skipped test is not a kept promise."""
        report: pytest.TestReport = yield  # type: ignore[assignment]  # the wrapped hook's result
        if report.when == "call" or not report.passed:
            if not report.passed:
                self.failed.append(item.name)
            for kept in _contracts(item):
                self.all_well[kept] = self.all_well.get(kept, True) and report.passed
        return report  # type: ignore[return-value]

    def pytest_sessionfinish(self) -> None:
        """Write it down."""
        kept = [key for key, well in self.all_well.items() if well]
        self.path.write_text(json.dumps({"kept": kept, "failed": self.failed}))


def pytest_configure(config: pytest.Config) -> None:
    """Begin."""
    config.pluginmanager.register(Book(Path(os.environ["CHAIRWARD_KEPT"])), "chairward-kept")


def _contracts(item: pytest.Item) -> list[Kept]:
    """The contracts that the test's class inherits, with the component of its rig ("" if it has none)."""
    cls = getattr(item, "cls", None)
    rig = getattr(item, "funcargs", {}).get("rig")
    component = getattr(getattr(rig, "component", None), "name", "")
    bases = [] if cls is None else cls.__mro__[1:]
    return [(base.__name__, component) for base in bases if base.__module__.startswith("chairward.testing")]
