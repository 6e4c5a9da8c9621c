"""Shared by all tests: where the recordings are, that a skip is a failure where everything must run (CI=true), and how
laws are tried: judged by what they find, not by how busy the machine is; with CI=true always the same cases, so that
what lands can be told from what was found by chance.

Real processes in real time say nothing on a machine that did not run them: a test that failed while this very process
was kept waiting is tried again, from nothing. So is, once, a test of whole chairs (marked `processes`), whose processes
are other ones than this, but no more than three in a run: what is broken fails again. The end of the run tells each
such test with how it had failed, for a failure that comes now and then is a defect to be found.

HYPOTHESIS_PROFILE=quick: few cases, always the same, for benchmarks/mutation.py, which asks only whether a test fails.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol
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

ATTEMPTS = 3
GAP_S = 0.1
"""Kept waiting so long, a process of the chair misses its bounds: a guard ticks every 20 ms."""
AWAY_S = 0.3
"""Gaps of so much together count as a machine that was away."""
WHOLE_CHAIRS = 3
"""So many tests of whole chairs may be tried again in a run."""
AGAIN = "tried again"

CHAIRS_AGAIN = pytest.StashKey[int]()

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


class Away:
    """How long this process asked for the processor and was kept waiting, in gaps of GAP_S and more."""

    def __enter__(self) -> Away:
        self.total_s = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        before = time.monotonic()
        while not self._over.wait(0.01):
            now = time.monotonic()
            self.total_s += now - before if now - before >= GAP_S else 0.0
            before = now


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Once; or again, where it failed while the machine was away, or a whole chair failed for the first time."""
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for attempt in range(1, ATTEMPTS + 1):
        with Away() as away:
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
        failed = next((report for report in reports if report.failed), None)
        if failed is None or attempt == ATTEMPTS or not (away.total_s >= AWAY_S or _whole_chair(item, attempt)):
            break
        item.user_properties.append((AGAIN, f"kept waiting {away.total_s:.1f} s\n{failed.longreprtext[-3000:]}"))
        item.session._setupstate.teardown_exact(None)  # nothing of the attempt is left, whatever its scope
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _whole_chair(item: pytest.Item, attempt: int) -> bool:
    """Whether this is the first failure of a test of whole chairs, and there were few of them before."""
    before = item.session.stash.get(CHAIRS_AGAIN, 0)
    if attempt > 1 or before >= WHOLE_CHAIRS or item.get_closest_marker("processes") is None:
        return False
    item.session.stash[CHAIRS_AGAIN] = before + 1
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests were tried again, and how they had failed."""
    ended = (report for reports in terminalreporter.stats.values() for report in reports)
    for report in ended:
        for name, value in getattr(report, "user_properties", []) if getattr(report, "when", "") == "teardown" else []:
            if name == AGAIN:
                terminalreporter.write_line(f"{AGAIN}: {report.nodeid}: {value}")
