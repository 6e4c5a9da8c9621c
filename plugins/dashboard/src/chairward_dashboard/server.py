"""The web server: starlette and uvicorn in a thread of the lane's process, on a socket of its own.

The guard never talks to it: what pages cause leaves through the lane like any other source's messages.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from chairward import records, wire
from chairward_dashboard import said
from chairward_dashboard.doors import COOKIE, Pairing, host_allowed, origin_allowed
from chairward_dashboard.pages import Pages
from chairward_dashboard.settings import DashboardSettings

log = logging.getLogger(__name__)

STATIC = Path(__file__).parent / "static"
HEADERS = [
    (
        b"content-security-policy",
        b"default-src 'self'; img-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cache-control", b"no-cache"),
]
RECORDS_AT_ONCE = 64
UNASKED_S = 5.0
"""A connection that has not asked for anything for this long is closed; so are the oldest of too many."""
MOST_CONNECTIONS = 256
FORM_BYTES = 256
OPEN_PATHS = ("/pair", "/static/")

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Any, Any], Awaitable[None]]


class Doorman:
    """ASGI: checks host, origin and token before anything else, and puts the security headers on every answer."""

    def __init__(self, app: App, settings: DashboardSettings, pairing: Pairing | None) -> None:
        self.app, self.settings, self.pairing = app, settings, pairing

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        """Let it through, or answer 403, 421, or a redirect to the pairing page."""
        if scope["type"] == "websocket":
            await (self.app if not self._refusal(scope) else _refuse)(scope, receive, send)
        elif scope["type"] == "http":
            await self._http(scope, receive, send)

    async def _http(self, scope: Scope, receive: Any, send: Any) -> None:
        async def with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *HEADERS]
            await send(message)

        why = self._refusal(scope)
        if why == "pair" and scope["method"] == "GET":
            await RedirectResponse("/pair", 303)(scope, receive, with_headers)
        elif why:
            await PlainTextResponse(f"refused: {why}", 403)(scope, receive, with_headers)
        else:
            await self.app(scope, receive, with_headers)

    def _refusal(self, scope: Scope) -> str:
        """ "" or why this request is refused."""
        headers = {key: value.decode("latin-1") for key, value in scope["headers"]}
        host = headers.get(b"host", "")
        if not host_allowed(host, self.settings.names):
            return "this server does not go by that name (dashboard.names in the chair file)"
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if changes and not origin_allowed(headers.get(b"origin", ""), host):
            return "not asked from a page of this server"
        if self.pairing is None or scope["path"].startswith(OPEN_PATHS):
            return ""
        return "" if self.pairing.knows(_cookie(headers.get(b"cookie", ""))) else "pair"


async def _refuse(scope: Scope, receive: Any, send: Any) -> None:
    del scope, receive
    await send({"type": "websocket.close", "code": 1008})


def _cookie(header: str) -> str:
    for part in header.split(";"):
        name, _, value = part.strip().partition("=")
        if name == COOKIE:
            return value
    return ""


def make_app(settings: DashboardSettings, pages: Pages, pairing: Pairing | None) -> App:
    """All routes behind the doorman."""

    def page(name: str) -> Callable[[Request], Awaitable[Response]]:
        async def answer(request: Request) -> Response:
            del request
            return FileResponse(STATIC / name)

        return answer

    async def pair(request: Request) -> Response:
        if request.method == "GET" or pairing is None:
            return FileResponse(STATIC / "pair.html")
        body = b""
        async for chunk in request.stream():
            body += chunk
            if len(body) > FORM_BYTES:
                return PlainTextResponse("refused: too long", 413)
        code = body.decode("latin-1").removeprefix("code=").strip()
        token = pairing.pair(code, time.monotonic_ns())
        if token is None:
            return RedirectResponse("/pair?wrong", 303)
        answer = RedirectResponse("/", 303)
        answer.set_cookie(COOKIE, token, httponly=True, samesite="strict", path="/")
        return answer

    async def talk(websocket: WebSocket) -> None:
        await pages.serve(websocket)

    app = Starlette(
        routes=[
            Route("/", page("index.html")),
            Route("/live", page("live.html")),
            Route("/pair", pair, methods=["GET", "POST"]),
            WebSocketRoute("/ws", talk),
            Mount("/static", StaticFiles(directory=STATIC)),
        ]
    )
    return Doorman(app, settings, pairing)


class Server:
    """The thread. `failed` tells why it ended, "" while it works."""

    def __init__(
        self, settings: DashboardSettings, listening: socket.socket, pages: Pages, pairing: Pairing | None, fd: int
    ) -> None:
        self.failed = ""
        self._pages, self._listening = pages, listening
        self._records = wire.adopt(fd) if fd >= 0 else None
        self._first_seen: dict[Any, float] = {}
        config = uvicorn.Config(
            make_app(settings, pages, pairing),
            loop="asyncio",
            http="h11",
            ws="websockets-sansio",
            ws_max_size=said.LONGEST_BYTES,
            ws_per_message_deflate=False,
            ws_ping_interval=None,
            lifespan="off",
            access_log=False,
            log_config=None,
            server_header=False,
            date_header=False,
            h11_max_incomplete_event_size=16_384,
            timeout_keep_alive=5,
            timeout_graceful_shutdown=1,
        )
        self._uvicorn = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, name="dashboard", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def stop(self) -> None:
        """End it, and wait for its end."""
        self._uvicorn.should_exit = True
        self._thread.join(10.0)
        self._pages.pictures.close()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
            self.failed = "its web server has ended"
        except (OSError, RuntimeError, ValueError) as error:
            self.failed = f"its web server has ended: {error}"
            log.exception("the web server has ended")

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        if self._records is not None:
            loop.add_reader(self._records.fileno(), self._read_records)
        tasks = [asyncio.create_task(self._pages.tick()), asyncio.create_task(self._reap())]
        for task in tasks:
            task.add_done_callback(self._ended)
        try:
            await self._uvicorn.serve(sockets=[self._listening])
            for task in tasks:
                if task.done():
                    task.result()
        finally:
            for task in tasks:
                task.cancel()
            if self._records is not None:
                loop.remove_reader(self._records.fileno())
                self._records.close()
            self._listening.close()

    def _ended(self, task: asyncio.Task[None]) -> None:
        """A task that should go on for ever has not: the whole server ends, and the lane opens it again."""
        del task
        self._uvicorn.should_exit = True

    def _read_records(self) -> None:
        assert self._records is not None
        for _ in range(RECORDS_AT_ONCE):
            data = wire.receive(self._records, wire.RECORD_BYTES)
            if data is None:
                return
            if not data:
                asyncio.get_running_loop().remove_reader(self._records.fileno())
                return
            try:
                self._pages.view.add(records.decode(data))
            except msgspec.DecodeError as error:
                log.warning("a record could not be read: %s", error)

    async def _reap(self) -> None:
        """For ever: close connections that never ask for anything."""
        while True:
            await asyncio.sleep(1.0)
            now = time.monotonic()
            idle = [c for c in self._uvicorn.server_state.connections if _unasked(c)]
            self._first_seen = {c: self._first_seen.get(c, now) for c in idle}
            oldest = sorted(self._first_seen.items(), key=lambda item: item[1])
            for nth, (connection, since) in enumerate(oldest):
                if now - since > UNASKED_S or len(oldest) - nth > MOST_CONNECTIONS:
                    connection.transport.close()


def _unasked(connection: Any) -> bool:
    """An HTTP connection on which no request is being answered (websockets and answers at work are left alone)."""
    if not hasattr(connection, "cycle"):
        return False
    return connection.cycle is None or bool(connection.cycle.response_complete)
