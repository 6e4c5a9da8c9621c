"""The cameras page: live calibration with hints, by `chairward calibrate stereo --live`, with the lane's own cameras.

While it works the lane has lent its cameras, so the chair cannot move. The result is only shown; it is kept on demand.
"""

from __future__ import annotations

import asyncio
import json
import signal
from pathlib import Path
from typing import Annotated, Any

import msgspec
import platformdirs
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from chairward import lending
from chairward.plan import LanePlan
from chairward_dashboard.answers import Refused, answer, asked, told
from chairward_dashboard.commands import CommandError, start
from chairward_dashboard.setup import Setup

STAGE = "stereo_range"
"""The stage whose lane has the camera pair, and whose setting `calibration` names the file."""


class Begin(msgspec.Struct, forbid_unknown_fields=True):
    """The board that is held: inner corners, side of a square."""

    columns: Annotated[int, msgspec.Meta(ge=3, le=30)] = 9
    rows: Annotated[int, msgspec.Meta(ge=3, le=30)] = 6
    square_mm: Annotated[float, msgspec.Meta(ge=1.0, le=500.0)] = 25.0


class CalibratePage:
    """Routes of the page, and the one command that may be running."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._process: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task[None] | None = None
        self._newest: dict[str, Any] = {}
        self._result: dict[str, Any] | None = None
        self._error = ""

    def routes(self) -> list[Route]:
        """All of them begin with /api/calibrate."""
        return [
            Route("/api/calibrate", told(self.state)),
            Route("/api/calibrate/preview.jpg", told(self.preview)),
            Route("/api/calibrate/begin", told(self.begin), methods=["POST"]),
            Route("/api/calibrate/finish", told(self.finish), methods=["POST"]),
            Route("/api/calibrate/keep", told(self.keep), methods=["POST"]),
        ]

    async def close(self) -> None:
        """End the command, and give the cameras back."""
        if self._running and self._process is not None:
            self._process.kill()
        if self._reader is not None:
            await self._reader

    def _lane(self) -> LanePlan:
        """The lane with the camera pair. Raises Refused."""
        for lane in self._setup.the_plan().lanes:
            if any(stage.component == STAGE for stage in lane.stages):
                return lane
        raise Refused(404, "calibrate.no_cameras")

    @property
    def _running(self) -> bool:
        return self._process is not None and self._process.returncode is None

    @property
    def _out(self) -> Path:
        return self._setup.run_dir / "calibration.json"

    @property
    def _preview(self) -> Path:
        return self._setup.run_dir / "calibration.jpg"

    def _target(self) -> tuple[Path, bool]:
        """Where the result is kept, and whether the chair file names that file already."""
        lane, plan = self._lane(), self._setup.the_plan()
        named = next(stage.settings.get("calibration") for stage in lane.stages if stage.component == STAGE)
        if named:
            return Path(str(named)), True
        return Path(platformdirs.user_data_dir("chairward")) / "calibrations" / f"{plan.chair}-{lane.name}.json", False

    async def state(self, request: Request) -> Response:
        """What the newest picture came to, what to do next, and the result if there is one."""
        del request
        target, named = self._target()
        return answer(
            {
                "running": self._running,
                "newest": self._newest,
                "result": self._result,
                "error": self._error,
                "lane": self._lane().name,
                "file": str(target),
                "named": named,
            }
        )

    async def preview(self, request: Request) -> Response:
        """Both cameras' newest pictures, what is covered tinted, the board's corners marked."""
        del request
        if not self._preview.is_file():
            raise Refused(404, "no picture yet")
        return FileResponse(self._preview, media_type="image/jpeg")

    async def begin(self, request: Request) -> Response:
        """Borrow the lane's cameras and begin."""
        self._setup.at_rest()
        wanted = await asked(request, Begin)
        if self._running:
            raise Refused(409, "calibrate.running")
        lane = self._lane()
        self._newest, self._result, self._error = {}, None, ""
        for old in (self._out, self._preview):
            old.unlink(missing_ok=True)
        lending.lend(self._setup.run_dir, lane.name)
        line = ("calibrate", "stereo", "--live", "--json-lines", "--chair", self._setup.the_plan().chair_file)
        board = ("--board", f"{wanted.columns}x{wanted.rows}", "--square-mm", str(wanted.square_mm))
        files = ("--lane", lane.name, "--out", str(self._out), "--preview", str(self._preview))
        self._process = await start(
            (*line, *files, *board), environment=self._setup.environment, stderr=asyncio.subprocess.DEVNULL
        )
        self._reader = asyncio.create_task(self._read(self._process, lane.name))
        return answer({"ok": True}, 202)

    async def _read(self, process: asyncio.subprocess.Process, lane: str) -> None:
        """Until the command ends: its newest line; then the cameras are given back."""
        assert process.stdout is not None
        try:
            while line := await process.stdout.readline():
                try:
                    said = json.loads(line)
                except ValueError:
                    continue
                self._error = str(said["error"]) if "error" in said else self._error
                self._result = said.get("result", self._result)
                if "ask" in said:
                    self._newest = said
            await process.wait()
            if self._result is None and not self._error:
                self._error = "calibrate.nothing"
        finally:
            lending.take_back(self._setup.run_dir, lane)

    async def finish(self, request: Request) -> Response:
        """Enough seen: use what has been collected."""
        del request
        if self._process is not None and self._process.returncode is None:
            self._process.send_signal(signal.SIGINT)
        return answer({"ok": True})

    async def keep(self, request: Request) -> Response:
        """Put the result where the chair file looks for it; the old file stays beside it as .before."""
        del request
        self._setup.at_rest()
        if self._result is None or not self._out.is_file():
            raise Refused(409, "there is no result to keep")
        target, named = self._target()
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            if target.exists():
                target.replace(target.with_name(f"{target.name}.before"))
            part = target.with_name(f"{target.name}.part")
            part.write_bytes(self._out.read_bytes())
            part.replace(target)
        except OSError as error:
            raise CommandError(f"{target} cannot be written: {error.strerror}") from error
        return answer({"file": str(target), "named": named})
