"""The source `dashboard`: starts the web server, and reads from it what its pages caused."""

from __future__ import annotations

import logging
import os
import socket
from pathlib import Path

import msgspec
import platformdirs

from chairward import plan
from chairward.components import Context, DeviceLost
from chairward.messages import Message
from chairward.plan import Plan
from chairward.speaking import Speaker
from chairward_dashboard.calibrate_page import CalibratePage
from chairward_dashboard.desk import Desk, Outbox
from chairward_dashboard.doors import Pairing
from chairward_dashboard.pages import Pages
from chairward_dashboard.person_page import PersonPage
from chairward_dashboard.pictures import Pictures
from chairward_dashboard.plugins_page import PluginsPage
from chairward_dashboard.server import Server
from chairward_dashboard.settings import DashboardSettings
from chairward_dashboard.setup import Setup
from chairward_dashboard.site import make_site
from chairward_dashboard.speech import Speech
from chairward_dashboard.stops import StopLog
from chairward_dashboard.view import View
from chairward_dashboard.words_page import WordsPage

log = logging.getLogger(__name__)


class Dashboard:
    """Yields lists of Press, Intent (help) and Alive; Alive only while the page that controls is alive.

    run_dir/<lane>.url tells where it listens, run_dir/<lane>.code (readable by the owner only) the pairing code.
    """

    def __init__(self, settings: DashboardSettings, context: Context) -> None:
        self._settings, self._context = settings, context
        self._outbox = Outbox()
        self._server: Server | None = None
        self.url = ""

    def open(self) -> None:
        """Listen. Raises DeviceLost when the address cannot be used."""
        self.close()
        settings, context = self._settings, self._context
        listening = _listen(settings.host, settings.port)
        host = f"[{settings.host}]" if ":" in settings.host else settings.host
        self.url = f"http://{host}:{listening.getsockname()[1]}/"
        _write(context.run_dir / f"{context.lane}.url", self.url)
        pairing = Pairing(self._tell_code) if settings.open_to_network else None
        the_plan = self._plan()
        view = View.of(the_plan, context)
        pictures = Pictures(context.frames, settings.jpeg_quality)
        pages = Pages(settings, Desk(self._outbox), view, pictures, Speaker(context.run_dir))
        setup = Setup(the_plan, context.run_dir, view)
        stops = StopLog(Path(platformdirs.user_state_dir("chairward")) / "stops", settings.keep_stops)
        words = WordsPage(setup, pictures)
        cameras = CalibratePage(setup)
        parts = (words, cameras, PersonPage(setup), PluginsPage(setup), stops, Speech())
        site = make_site(settings, pages, pairing, [route for part in parts for route in part.routes()])
        fd = os.dup(context.records_fd) if context.records_fd >= 0 else -1
        self._server = Server(site, listening, pages, stops, fd, at_end=[words.close, cameras.close])
        self._server.start()
        log.warning("the screen is at %s", self.url)

    def read(self, timeout_s: float) -> list[Message] | None:
        """What pages caused, or None after timeout_s. Raises DeviceLost when the server has ended."""
        if self._server is None:
            raise DeviceLost("the screen is not open: open() comes first")
        if self._server.failed:
            raise DeviceLost(f"the screen at {self.url} is gone: {self._server.failed}; it is started again")
        return self._outbox.take(timeout_s)

    def close(self) -> None:
        """End the server; may be called twice."""
        if self._server is not None:
            self._server.stop()
            self._server = None

    def _plan(self) -> Plan | None:
        file = self._context.run_dir / "plan.json"
        try:
            return plan.read(file)
        except (OSError, msgspec.DecodeError) as error:
            log.warning(
                "%s cannot be read (%s): ages are shown without their limits, and there is no set-up", file, error
            )
            return None

    def _tell_code(self, code: str) -> None:
        _write(self._context.run_dir / f"{self._context.lane}.code", code)
        log.warning("pairing code for screens at %s: %s", self.url, code)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen(128)
    except OSError as error:
        listening.close()
        raise DeviceLost(
            f"dashboard cannot listen on {host}:{port} ({error.strerror}): "
            "choose another dashboard.port, or end the program that uses it"
        ) from error
    listening.setblocking(False)
    return listening


def _write(path: Path, text: str) -> None:
    """A file that only its owner can read."""
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(fd, "w") as file:
        file.write(text + "\n")
