"""A check: a small function that looks at one part of a chair and yields what it finds.

Plugins offer the checks of their own devices through the hook `chairward_checks`; so what a third party's device needs
is known to the third party alone. A check runs in a process of its own place, after the chair's other checks there
and with a time limit: it may open its device, and must give it back.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from chairward.components import Component, Context, EndOfInput, Pose, Settings
from chairward.plan import LanePlan, Part, Plan, fill_run_dir

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Finding:
    """ok: nothing to do. what: one sentence. fix: what to do, empty when ok. needed: False for a mere advice.

    tried: False where the check could not look at all, and so found nothing wrong.
    """

    check: str
    ok: bool
    what: str
    fix: str = ""
    needed: bool = True
    tried: bool = True


def not_tried(check: str, why: str) -> Finding:
    """What a check says that could not look: why not."""
    return Finding(check, True, why, tried=False)


ADVICE = {
    "add",
    "calibrate",
    "change",
    "check",
    "choose",
    "close",
    "correct",
    "free",
    "give",
    "install",
    "make",
    "name",
}
ADVICE |= {"plug", "record", "replace", "run", "say", "see", "set", "start", "switch", "unplug", "update", "use"}


def advised(text: str, otherwise: str) -> tuple[str, str]:
    """A sentence that ends with what to do ("...: plug it in") as (what, fix); `otherwise` where it does not."""
    what, _, fix = text.rpartition(": ")
    return (what, fix) if what and fix.split(" ", 1)[0].rstrip(",") in ADVICE else (text, otherwise)


class Offers(Protocol):
    """What a check may ask of the registry of plugins."""

    def get(self, kind: str, name: str) -> Component:
        """The component `name` of `kind`. Raises PluginError."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """Where a check looks: the whole plan, and in it the part that the check is for.

    settings: of the part, validated; None for a check of the machine. root: "/", or what a test puts in its place:
    below it are dev, sys, proc and run.
    """

    registry: Offers
    plan: Plan | None = None
    lane: LanePlan | None = None
    part: Part | None = None
    settings: Settings | None = None
    root: Path = Path("/")
    run_dir: Path = Path()

    def context(self) -> Context:
        """What the part would be told in a run."""
        assert self.plan is not None
        pose = self.lane.pose if self.lane else Pose()
        return self.plan.context(self.lane.name if self.lane else "drive", pose, self.run_dir)

    def take(self, kind: type[T], count: int, within_s: float) -> list[T]:
        """The first items of a kind that the lane's own source gives; fewer when the time is over or it ends.

        Raises DeviceLost, as the source does.
        """
        assert self.lane is not None
        part = self.lane.source
        component = self.registry.get("source", part.component)
        settings = component.settings.model_validate(fill_run_dir(part.settings, self.run_dir))
        source = component.make(settings, self.context())
        items: list[T] = []
        end = time.monotonic() + within_s
        try:
            source.open()
            while len(items) < count and time.monotonic() < end:
                item: Any = source.read(0.2)
                if isinstance(item, kind):
                    items.append(item)
        except EndOfInput:
            return items
        finally:
            source.close()
        return items


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check. component: the part of a chair that it is for; "" for the machine itself.

    look: what it does; a check that yields nothing has found nothing wrong. timeout_s: an answer that takes longer is
    a finding by itself.
    """

    name: str
    look: Callable[[Site], Iterable[Finding]]
    component: str = ""
    timeout_s: float = 4.0
