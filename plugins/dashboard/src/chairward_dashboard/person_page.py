"""The person page: who drives next, and what that person may set, checked by the loader before anything is written."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

import msgspec
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from chairward import next_run
from chairward.next_run import NextRun
from chairward_dashboard.answers import Refused, answer, asked, told
from chairward_dashboard.setup import Setup

Name = Annotated[str, msgspec.Meta(max_length=80)]


class Set(msgspec.Struct, forbid_unknown_fields=True):
    """Changes as `chairward profile set` takes them; keep False: only say whether they are allowed."""

    person: Name
    changes: Annotated[list[Annotated[str, msgspec.Meta(max_length=200)]], msgspec.Meta(min_length=1, max_length=60)]
    keep: bool = False


class Choose(msgspec.Struct, forbid_unknown_fields=True):
    """Who drives from now on; "": end the run."""

    person: Name


class PersonPage:
    """Routes of the page."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup

    def routes(self) -> list[Route]:
        """People, limits, set, choose."""
        return [
            Route("/api/people", told(self.people)),
            Route("/api/limits", told(self.limits)),
            Route("/api/set", told(self.set), methods=["POST"]),
            Route("/api/choose", told(self.choose), methods=["POST"]),
        ]

    async def people(self, request: Request) -> Response:
        """Who may drive this chair, and why somebody may not."""
        del request
        return answer({**await self._people(), "drives": self._setup.the_plan().person})

    async def _people(self) -> dict[str, Any]:
        plan = self._setup.the_plan()
        found = await self._setup.commands.json("profile", "people", plan.chair_file, *self._setup.profiles, "--json")
        return dict(found)

    async def limits(self, request: Request) -> Response:
        """What a person may set on this chair, the chair's bounds, and the proof of the distances."""
        plan = self._setup.the_plan()
        person = self._setup.known(request.query_params.get("person") or plan.person)
        line = ("profile", "limits", plan.chair_file, person, *self._setup.profiles, "--json")
        return answer(await self._setup.commands.json(*line))

    async def set(self, request: Request) -> Response:
        """Change the person's file, or only say whether the loader would allow it."""
        wanted = await asked(request, Set)
        if wanted.keep:
            self._setup.at_rest()
        done = await self._setup.set(wanted.person, wanted.changes, keep=wanted.keep)
        return answer(done, 200 if done["ok"] else 422)

    async def choose(self, request: Request) -> Response:
        """End this run, and begin another with that person's profile as it is on disk now; only standing."""
        wanted = await asked(request, Choose)
        self._setup.at_rest()
        if wanted.person:
            rows = {row["name"]: row for row in (await self._people())["people"]}
            if wanted.person not in rows:
                raise Refused(404, f"there is no person '{wanted.person}' for this chair")
            if rows[wanted.person]["why"]:
                raise Refused(422, rows[wanted.person]["why"])
            self._setup.at_rest()  # it may have been armed meanwhile
        run_dir, ask = self._setup.run_dir, NextRun(person=wanted.person)
        asyncio.get_running_loop().call_later(0.2, next_run.ask, run_dir, ask)  # the answer leaves first
        return answer({"ok": True}, 202)
