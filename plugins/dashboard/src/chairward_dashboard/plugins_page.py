"""The plugins page: what is installed, what of it this chair uses, and every setting, from the plugins' own schemas."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from chairward.plan import Part, Plan
from chairward_dashboard.answers import answer, told
from chairward_dashboard.setup import Setup


class PluginsPage:
    """Route of the page."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup

    def routes(self) -> list[Route]:
        """The list; what a person may choose is set through the person page's routes."""
        return [Route("/api/plugins", told(self.plugins))]

    async def plugins(self, request: Request) -> Response:
        """Every component with its schema; used: where it works in this chair, with the settings in force."""
        del request
        plan = self._setup.the_plan()
        found = await self._setup.commands.json("plugins", "--json")
        line = ("profile", "limits", plan.chair_file, plan.person, *self._setup.profiles, "--json")
        choices = (await self._setup.commands.json(*line))["choices"]
        used = in_use(plan)
        rows = [{**row, "used": used.get((row["kind"], row["name"]), [])} for row in found["components"]]
        told_choices = [{key: row[key] for key in ("component", "key", "choice", "own")} for row in choices]
        return answer({"person": plan.person, "components": rows, "refused": found["refused"], "choices": told_choices})


def in_use(plan: Plan) -> dict[tuple[str, str], list[dict[str, Any]]]:
    """Kind and component -> its places in the chair: the name of its vote ("lane/component") and its settings."""
    places: dict[tuple[str, str], list[dict[str, Any]]] = {}

    def put(kind: str, part: Part, where: str) -> None:
        places.setdefault((kind, part.component), []).append({"where": where, "settings": dict(part.settings)})

    for lane in plan.lanes:
        put("source", lane.source, f"{lane.name}/{lane.source.component}")
        for stage in lane.stages:
            for kind in ("sensor", "recognizer"):
                put(kind, stage, f"{lane.name}/{stage.component}")
    put("drive", plan.drive, "drive")
    for name, part in plan.companions.items():
        put("companion", part, name)
    for name, part in plan.observers.items():
        put("observer", part, name)
    return places
