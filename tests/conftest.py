"""Shared by all tests: where the recordings are, that a skip is a failure where everything must run (CI=true), and how
laws are tried: judged by what they find, not by how busy the machine is; with CI=true always the same cases, so that
what lands can be told from what was found by chance.

HYPOTHESIS_PROFILE=quick: few cases, always the same, for benchmarks/mutation.py, which asks only whether a test fails.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

settings.register_profile("chairward", deadline=None, derandomize=os.environ.get("CI") == "true")
settings.register_profile(
    "quick",
    deadline=None,
    max_examples=20,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "chairward"))

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings beside the checkout; the test is skipped where there is none."""
    if not SHARED.is_dir():
        pytest.skip("needs ../shared/data beside the checkout (recordings that are not part of the project)")
    return SHARED


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """With CI=true a skipped test is a failed one: nothing may be left out unnoticed."""
    outcome = yield
    report = outcome.get_result()  # type: ignore[attr-defined]
    if os.environ.get("CI") == "true" and report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid}: skipped, and with CI=true nothing may be: {reason}"
