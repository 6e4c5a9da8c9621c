"""The doorman: checks host, origin and token of everything that comes in, and puts the security headers on answers."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.responses import PlainTextResponse, RedirectResponse

from chairward_dashboard.doors import COOKIE, Pairing, host_allowed, origin_allowed
from chairward_dashboard.settings import DashboardSettings

HEADERS = [
    (
        b"content-security-policy",
        b"default-src 'self'; img-src 'self' blob:; media-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; "
        b"form-action 'self'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cache-control", b"no-cache"),
]
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
