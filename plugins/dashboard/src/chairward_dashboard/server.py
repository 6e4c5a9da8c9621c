"""The web server: starlette and uvicorn in a thread of the lane's process, on a socket of its own.

The guard never talks to it: what pages cause leaves through the lane like any other source's messages.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

import msgspec
import uvicorn

from chairward import records, wire
from chairward_dashboard import said
from chairward_dashboard.doorman import App
from chairward_dashboard.pages import Pages
from chairward_dashboard.stops import StopLog

log = logging.getLogger(__name__)

RECORDS_AT_ONCE = 64
UNASKED_S = 5.0
"""A connection that has not asked for anything for this long is closed; so are the oldest of too many."""
MOST_CONNECTIONS = 256


class Server:
    """The thread. `failed` tells why it ended, "" while it works."""

    def __init__(
        self,
        site: App,
        listening: socket.socket,
        pages: Pages,
        stops: StopLog,
        fd: int,
        at_end: Sequence[Callable[[], Awaitable[None]]] = (),
    ) -> None:
        self.failed = ""
        self._pages, self._listening, self._stops, self._at_end = pages, listening, stops, at_end
        self._records = wire.adopt(fd) if fd >= 0 else None
        self._first_seen: dict[Any, float] = {}
        config = uvicorn.Config(
            site,
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
        self._pages.speaker.close()

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
            for end in self._at_end:
                await end()
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
                stop = self._pages.view.add(records.decode(data))
            except msgspec.DecodeError as error:
                log.warning("a record could not be read: %s", error)
                continue
            if stop is not None:
                self._keep(stop)

    def _keep(self, stop: dict[str, Any]) -> None:
        """Into the log of stops, with what the left camera sees now where the profile lets pictures be kept."""
        pages, picture = self._pages, None
        if pages.settings.stop_pictures and pages.pictures.newest("left") is not None:
            found = pages.pictures.jpeg("left", pages.settings.picture_px)
            picture = None if found is None else found[1]
        self._stops.add(stop, picture)

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
