"""The log of stops: when, why, how near; and, only where the profile says so, what the left camera saw."""

from __future__ import annotations

import json
import logging
import re
import time
from pathlib import Path
from typing import Any

import msgspec
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from chairward_dashboard.answers import Refused, answer, told

log = logging.getLogger(__name__)

NAME = re.compile(r"^\d{8}T\d{6}-\d{3}$")


class StopLog:
    """One small JSON file a stop, and a JPEG beside it where pictures may be kept; the oldest go."""

    def __init__(self, folder: Path, most: int) -> None:
        self._folder, self._most = folder, most

    def add(self, stop: dict[str, Any], picture: bytes | None) -> None:
        """Keep one; a disk that is full is told in the log and otherwise of no matter."""
        if not self._most:
            return
        now_s = time.time()
        name = time.strftime("%Y%m%dT%H%M%S", time.gmtime(now_s)) + f"-{int(now_s * 1000) % 1000:03d}"
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if picture is not None:
                (self._folder / f"{name}.jpg").write_bytes(picture)
            (self._folder / f"{name}.json").write_bytes(msgspec.json.encode({**stop, "at_s": round(now_s, 3)}))
            for old in sorted(self._folder.glob("*.json"))[: -self._most]:
                old.with_suffix(".jpg").unlink(missing_ok=True)
                old.unlink()
        except OSError as error:
            log.warning("a stop could not be kept in %s: %s", self._folder, error.strerror)

    def rows(self) -> list[dict[str, Any]]:
        """All that are kept, the newest first."""
        found = []
        for file in sorted(self._folder.glob("*.json"), reverse=True)[: self._most]:
            try:
                row = dict(json.loads(file.read_bytes()))
            except (OSError, ValueError) as error:
                log.warning("%s cannot be read (%s) and is left out", file, error)
                continue
            found.append({**row, "name": file.stem, "picture": file.with_suffix(".jpg").is_file()})
        return found

    def routes(self) -> list[Route]:
        """The list and the pictures."""
        return [Route("/api/stops", told(self._list)), Route("/api/stops/{name}.jpg", told(self._picture))]

    async def _list(self, request: Request) -> Response:
        del request
        return answer({"stops": self.rows()})

    async def _picture(self, request: Request) -> Response:
        name = request.path_params["name"]
        path = self._folder / f"{name}.jpg"
        if not NAME.match(name) or not path.is_file():
            raise Refused(404, "there is no such picture")
        return FileResponse(path, media_type="image/jpeg")
