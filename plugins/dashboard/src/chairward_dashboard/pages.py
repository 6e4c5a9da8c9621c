"""The pages that are connected: one bundle (state and pictures) at a time to each, and what each of them says.

A page acknowledges every bundle; with two on their way it gets none, and then the newest: never a queue.
"""

from __future__ import annotations

import asyncio
import logging
import time
from dataclasses import dataclass, field

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from chairward.speaking import Speaker
from chairward_dashboard import said
from chairward_dashboard.desk import Desk
from chairward_dashboard.pictures import Pictures
from chairward_dashboard.settings import DashboardSettings
from chairward_dashboard.view import View

log = logging.getLogger(__name__)

S = 1_000_000_000
ON_THEIR_WAY = 2
WORDS_A_SECOND, WORDS_AT_ONCE = 60.0, 90.0
"""A page needs about 30 messages a second; one that says more is closed."""
SILENT_S = 10.0
SEND_WITHIN_S = 5.0
POLICY, TOO_MANY = 1008, 1013


@dataclass(eq=False, slots=True)
class Page:
    """One connected page."""

    number: int
    socket: WebSocket
    panes: tuple[str, ...] = ()
    large: bool = False
    sent: int = 0
    got: int = 0
    shown: dict[str, int] = field(default_factory=dict)
    refused: str = ""
    words_left: float = WORDS_AT_ONCE
    words_ns: int = 0
    wake: asyncio.Event = field(default_factory=asyncio.Event)

    def may_speak(self, now_ns: int) -> bool:
        """A bucket of words that fills with time."""
        since_s = (now_ns - self.words_ns) / S if self.words_ns else 0.0
        self.words_left = min(WORDS_AT_ONCE, self.words_left + since_s * WORDS_A_SECOND) - 1.0
        self.words_ns = now_ns
        return self.words_left >= 0.0


class Pages:
    """All connected pages; lives in the server's event loop."""

    def __init__(
        self, settings: DashboardSettings, desk: Desk, view: View, pictures: Pictures, speaker: Speaker
    ) -> None:
        self.settings, self.desk, self.view, self.pictures, self.speaker = settings, desk, view, pictures, speaker
        self.connected: set[Page] = set()
        self._numbers = 0
        self._state = msgspec.Raw(b"{}")

    async def serve(self, socket: WebSocket) -> None:
        """One page, from its acceptance to its end. Who may come in has been decided before."""
        await socket.accept()
        if len(self.connected) >= self.settings.pages:
            await socket.close(TOO_MANY, "too many screens are connected")
            return
        self._numbers += 1
        page = Page(self._numbers, socket)
        self.connected.add(page)
        sender = asyncio.create_task(self._send(page))
        try:
            why = await self._listen(page)
            await asyncio.wait_for(socket.close(POLICY, why), SEND_WITHIN_S)
        except (WebSocketDisconnect, RuntimeError, TimeoutError) as error:
            log.debug("page %d ended: %r", page.number, error)
        finally:
            sender.cancel()
            self.connected.discard(page)
            self.desk.leave(page.number, time.monotonic_ns())

    async def _listen(self, page: Page) -> str:
        """Hear the page out; returns why it must be closed."""
        while True:
            try:
                message = await asyncio.wait_for(page.socket.receive(), SILENT_S)
            except TimeoutError:
                return "nothing was heard from this page"
            if message["type"] != "websocket.receive":
                raise WebSocketDisconnect(message.get("code", 1005))
            now_ns = time.monotonic_ns()
            if not page.may_speak(now_ns):
                return "too many messages"
            try:
                self._obey(page, said.decode(message.get("text") or ""), now_ns)
            except ValueError:
                return "not a message of this page"

    def _obey(self, page: Page, word: said.Said, now_ns: int) -> None:
        match word:
            case said.Beat(at_ms):
                self.desk.beat(page.number, at_ms, now_ns)
            case said.Hidden():
                self.desk.hide(page.number, now_ns)
            case said.Got(n):
                page.got = max(page.got, min(n, page.sent))
                page.wake.set()
            case said.Push(button):
                page.refused = self.desk.push(page.number, button, now_ns)
            case said.Take():
                self.desk.take(page.number, now_ns)
            case said.Give():
                self.desk.give(page.number, now_ns, "the screen that controlled gave control away")
            case said.Look(panes, large):
                page.panes, page.large, page.shown = tuple(panes), large, {}
            case said.Speaks(ms):
                self.speaker.say(now_ns, now_ns + ms * 1_000_000)

    async def tick(self) -> None:
        """For ever: at the pictures' rate make the newest state, once, and wake every page's sender."""
        period_s = 1.0 / self.settings.pictures_hz
        while True:
            now_ns = time.monotonic_ns()
            self.desk.check(now_ns)
            if self.connected:
                self.pictures.look()
                self._state = msgspec.Raw(msgspec.json.encode(self.view.state(now_ns)))
            for page in self.connected:
                page.wake.set()
            await asyncio.sleep(period_s)

    async def _send(self, page: Page) -> None:
        """For ever: when the page has room and there is something new, the newest of it."""
        period_s = 1.0 / self.settings.pictures_hz
        try:
            while True:
                await page.wake.wait()
                page.wake.clear()
                if page.sent - page.got >= ON_THEIR_WAY:
                    continue
                page.sent += 1
                await asyncio.wait_for(page.socket.send_bytes(self._bundle(page)), SEND_WITHIN_S)
                await asyncio.sleep(period_s)
        except (WebSocketDisconnect, RuntimeError, TimeoutError) as error:
            log.debug("page %d takes nothing: %r", page.number, error)

    def _bundle(self, page: Page) -> bytes:
        """4 bytes: size of the head (big-endian); head: JSON; then the JPEG pictures that the head names, in order."""
        now_ns = time.monotonic_ns()
        width = self.settings.large_px if page.large else self.settings.picture_px
        blobs, heads = [], []
        for name in page.panes:
            found = self.pictures.jpeg(name, width)
            if found is not None and page.shown.get(name) != found[0]:
                page.shown[name] = found[0]
                blobs.append(found[1])
                heads.append({"name": name, "bytes": len(found[1]), "age_ms": (now_ns - found[0]) // 1_000_000})
        you = {
            "controls": self.desk.controller == page.number,
            "free": self.desk.controller is None,
            "alive": self.desk.is_alive(now_ns),
            "refused": page.refused,
        }
        head = msgspec.json.encode({"n": page.sent, "you": you, "state": self._state, "panes": heads})
        return b"".join([len(head).to_bytes(4, "big"), head, *blobs])
