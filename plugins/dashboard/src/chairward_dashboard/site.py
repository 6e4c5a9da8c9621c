"""The whole site: which address gives what, behind the doorman."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from chairward_dashboard.answers import Refused, body
from chairward_dashboard.doorman import Doorman
from chairward_dashboard.doors import COOKIE, Pairing
from chairward_dashboard.pages import Pages
from chairward_dashboard.settings import DashboardSettings

STATIC = Path(__file__).parent / "static"
PAGES = {"/": "index.html", "/live": "live.html"}
SETUP = ("words", "person", "plugins", "stops", "calibrate")
"""Pages with the same frame, setup.html; what is theirs alone is in setup/NAME.html."""
FORM_BYTES = 256


def make_site(settings: DashboardSettings, pages: Pages, pairing: Pairing | None, more: list[Route]) -> Doorman:
    """All routes behind the doorman; more: those of the set-up pages."""

    async def talk(websocket: WebSocket) -> None:
        await pages.serve(websocket)

    routes: list[BaseRoute] = [
        *(Route(path, _file(name)) for path, name in PAGES.items()),
        *(Route(f"/{name}", _set_up(name)) for name in SETUP),
        Route("/pair", _pair(pairing), methods=["GET", "POST"]),
        WebSocketRoute("/ws", talk),
        *more,
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Doorman(Starlette(routes=routes), settings, pairing)


def _file(name: str) -> Callable[[Request], Awaitable[Response]]:
    async def page(request: Request) -> Response:
        del request
        return FileResponse(STATIC / name)

    return page


def _set_up(name: str) -> Callable[[Request], Awaitable[Response]]:
    async def page(request: Request) -> Response:
        del request
        frame, own = ((STATIC / file).read_text(encoding="utf-8") for file in ("setup.html", f"setup/{name}.html"))
        return HTMLResponse(frame.replace("{page}", name).replace("{body}", own.rstrip("\n")))

    return page


def _pair(pairing: Pairing | None) -> Callable[[Request], Awaitable[Response]]:
    async def pair(request: Request) -> Response:
        if request.method == "GET" or pairing is None:
            return FileResponse(STATIC / "pair.html")
        try:
            form = await body(request, FORM_BYTES)
        except Refused as refused:
            return PlainTextResponse(f"refused: {refused.why}", refused.status)
        token = pairing.pair(form.decode("latin-1").removeprefix("code=").strip(), time.monotonic_ns())
        if token is None:
            return RedirectResponse("/pair?wrong", 303)
        answer = RedirectResponse("/", 303)
        answer.set_cookie(COOKIE, token, httponly=True, samesite="strict", path="/")
        return answer

    return pair
