"""What all set-up pages' requests have in common: small bodies, read in time, typed; sentences as answers."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

import msgspec
from starlette.requests import Request
from starlette.responses import Response

from chairward_dashboard.commands import CommandError

JSON_BYTES = 4096
BODY_WITHIN_S = 15.0

T = TypeVar("T")
Handler = Callable[[Request], Awaitable[Response]]


class Refused(Exception):
    """A request that is not done: status and one sentence (or the key of one in the message files)."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status, self.why = status, why


def answer(data: Any, status: int = 200) -> Response:
    """Data as JSON."""
    return Response(msgspec.json.encode(data), status, media_type="application/json")


def told(handler: Handler) -> Handler:
    """The handler, with what it refuses and what a command says as {"why": sentence}."""

    async def wrapped(request: Request) -> Response:
        try:
            return await handler(request)
        except Refused as refused:
            return answer({"why": refused.why}, refused.status)
        except CommandError as error:
            return answer({"why": str(error)}, 422)

    return wrapped


async def body(request: Request, most_bytes: int) -> bytes:
    """The whole body. Raises Refused when it is too long or too slow."""
    data = bytearray()

    async def read() -> None:
        async for chunk in request.stream():
            data.extend(chunk)
            if len(data) > most_bytes:
                raise Refused(413, f"more than {most_bytes} bytes")

    try:
        await asyncio.wait_for(read(), BODY_WITHIN_S)
    except TimeoutError:
        raise Refused(408, f"not sent within {BODY_WITHIN_S:.0f} s") from None
    return bytes(data)


async def asked(request: Request, kind: type[T]) -> T:
    """The JSON body as a typed object. Raises Refused."""
    try:
        return msgspec.json.decode(await body(request, JSON_BYTES), type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise Refused(400, f"not a request of this page: {error}") from None
