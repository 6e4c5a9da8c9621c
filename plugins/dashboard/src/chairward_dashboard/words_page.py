"""The words page: whose words, what they mean, recording, looking, trying. The recognizer's own command answers."""

from __future__ import annotations

import asyncio
import io
import secrets
import time
import wave
from collections import OrderedDict
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from chairward import sound_pane
from chairward.messages import Command
from chairward_dashboard.answers import Refused, answer, asked, body, told
from chairward_dashboard.commands import Worker
from chairward_dashboard.pictures import Pictures
from chairward_dashboard.setup import Setup

WAV_BYTES = 2_000_000
MOST_TAKES = 40
OLDEST_SOUND_NS = 1_000_000_000

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=80)]
Seconds = Annotated[float, msgspec.Meta(gt=0.2, le=sound_pane.SECONDS - 0.5)]


class Save(msgspec.Struct, forbid_unknown_fields=True):
    """Make these takes the recordings of a word."""

    person: Name
    word: Name
    takes: Annotated[list[Name], msgspec.Meta(min_length=1, max_length=10)]
    force: bool = False


class OfPerson(msgspec.Struct, forbid_unknown_fields=True):
    """A word of a person; command "": it means nothing any more."""

    person: Name
    word: Name
    command: Annotated[str, msgspec.Meta(max_length=20)] = ""


class Try(msgspec.Struct, forbid_unknown_fields=True):
    """What would be heard in this take."""

    person: Name
    take: Name


class Listen(msgspec.Struct, forbid_unknown_fields=True):
    """Record through the chair's own microphone from now on."""

    seconds: Seconds = 2.5


class WordsPage:
    """Routes of the page. Takes lie in the run's folder and go with it; only what is saved is kept."""

    def __init__(self, setup: Setup, pictures: Pictures) -> None:
        self._setup, self._pictures = setup, pictures
        self._takes: OrderedDict[str, Path] = OrderedDict()
        self._stored: dict[str, Path] = {}
        self._worker: Worker | None = None
        self._listening = asyncio.Lock()

    def routes(self) -> list[Route]:
        """All of them begin with /api/words."""
        return [
            Route("/api/words", told(self.list)),
            Route("/api/words/take", told(self.take), methods=["POST"]),
            Route("/api/words/listen", told(self.listen), methods=["POST"]),
            Route("/api/words/sound/{name}", told(self.sound)),
            Route("/api/words/look/{name}", told(self.look)),
            Route("/api/words/save", told(self.save), methods=["POST"]),
            Route("/api/words/remove", told(self.remove), methods=["POST"]),
            Route("/api/words/try", told(self.try_), methods=["POST"]),
            Route("/api/words/means", told(self.means), methods=["POST"]),
        ]

    async def close(self) -> None:
        """End the recognizer's command."""
        if self._worker is not None:
            await self._worker.close()

    @property
    def worker(self) -> Worker:
        """The recognizer's command; started when it is first asked."""
        self._worker = self._worker or Worker("words", "serve", "--people", str(self._setup.people_dir))
        return self._worker

    async def list(self, request: Request) -> Response:
        """Everybody who may drive this chair; the words of one: what they mean, how often and how well recorded."""
        plan = self._setup.the_plan()
        person = self._setup.known(request.query_params.get("person") or plan.person)
        line = ("profile", "people", plan.chair_file, *self._setup.profiles, "--json")
        found, recorded = await asyncio.gather(
            self._setup.commands.json(*line), self.worker.ask({"do": "list", "person": person})
        )
        people = {row["name"]: row for row in found["people"]}
        if person not in people:
            raise Refused(404, f"there is no person '{person}' for this chair")
        by_word = {row["word"]: row for row in recorded["words"]}
        words = dict(people[person]["words"])
        rows: list[dict[str, Any]] = []
        for word in dict.fromkeys([*words, *by_word]):
            row = by_word.get(word, {})
            sounds = [self._name(Path(path)) for path in row.get("files", [])]
            about = {"nearest": row.get("nearest", ""), "apart": row.get("apart"), "sounds": sounds}
            rows.append({"word": word, "command": words.get(word, ""), **about})
        about_all = {key: recorded[key] for key in ("warnings", "fewest", "most")}
        told_people = [{key: row[key] for key in ("name", "about", "language", "why")} for row in people.values()]
        commands = [command.value for command in Command]
        return answer({"person": person, "people": told_people, "commands": commands, "words": rows, **about_all})

    def _name(self, path: Path) -> str:
        """The name under which a stored recording can be heard."""
        name = f"stored-{path.stem}"
        self._stored[name] = path
        return name

    async def take(self, request: Request) -> Response:
        """A recording that the browser made: wav, at most ten seconds."""
        self._setup.at_rest()
        data = await body(request, WAV_BYTES)
        if data[:4] != b"RIFF":
            raise Refused(400, "not a wav file")
        return await self._looked(self._keep(data))

    async def listen(self, request: Request) -> Response:
        """A recording of what the chair's own microphone hears from now on."""
        self._setup.at_rest()
        wanted = await asked(request, Listen)
        if self._listening.locked():
            raise Refused(409, "another screen is recording")
        async with self._listening:
            began_ns = time.monotonic_ns()
            await asyncio.sleep(wanted.seconds + 0.1)
            self._setup.at_rest()
            pane = self._pictures.newest(sound_pane.NAME)
            if pane is None:
                raise Refused(503, "words.no_microphone")
            samples, rate_hz = sound_pane.unpack(pane)
            ended_ns = pane.captured_ns + len(samples) * 1_000_000_000 // rate_hz
            if time.monotonic_ns() - ended_ns > OLDEST_SOUND_NS:
                raise Refused(503, "words.no_microphone")
            first = max(0, (began_ns - pane.captured_ns) * rate_hz // 1_000_000_000)
            samples = samples[first:]
        file = io.BytesIO()
        with wave.open(file, "wb") as wav:
            wav.setnchannels(1)
            wav.setsampwidth(2)
            wav.setframerate(rate_hz)
            wav.writeframes((samples * 32767.0).astype(np.dtype("<i2")).tobytes())
        return await self._looked(self._keep(file.getvalue()))

    def _keep(self, data: bytes) -> str:
        folder = self._setup.run_dir / "takes"
        folder.mkdir(mode=0o700, exist_ok=True)
        name = secrets.token_hex(8)
        self._takes[name] = folder / f"{name}.wav"
        self._takes[name].write_bytes(data)
        while len(self._takes) > MOST_TAKES:
            self._takes.popitem(last=False)[1].unlink(missing_ok=True)
        return name

    async def _looked(self, name: str) -> Response:
        look = await self.worker.ask({"do": "look", "path": str(self._takes[name])})
        return answer({"take": name, **look})

    def _path(self, name: str) -> Path:
        path = self._takes.get(name) or self._stored.get(name)
        if path is None or not path.is_file():
            raise Refused(404, "there is no such recording")
        return path

    async def sound(self, request: Request) -> Response:
        """A recording, to hear it."""
        return FileResponse(self._path(request.path_params["name"]), media_type="audio/wav")

    async def look(self, request: Request) -> Response:
        """Waveform and mel spectrum of a recording that is stored."""
        path = self._path(request.path_params["name"])
        return answer(await self.worker.ask({"do": "look", "path": str(path)}))

    async def save(self, request: Request) -> Response:
        """Keep takes as the recordings of a word, unless they are not good enough."""
        self._setup.at_rest()
        wanted = await asked(request, Save)
        paths = [str(self._path(name)) for name in wanted.takes]
        keep = {"do": "save", "person": self._setup.known(wanted.person), "word": wanted.word, "paths": paths}
        return answer(await self.worker.ask({**keep, "force": wanted.force}))

    async def remove(self, request: Request) -> Response:
        """Forget the recordings of a word; what it means stays in the person's profile."""
        self._setup.at_rest()
        wanted = await asked(request, OfPerson)
        person = self._setup.known(wanted.person)
        return answer(await self.worker.ask({"do": "remove", "person": person, "word": wanted.word}))

    async def try_(self, request: Request) -> Response:
        """What would be heard in a take, and how near every word is."""
        self._setup.at_rest()
        wanted = await asked(request, Try)
        plan = self._setup.the_plan()
        stops = [word for word, command in plan.words.items() if command == Command.STOP]
        stops = stops if wanted.person == plan.person else ["stop"]
        path = str(self._path(wanted.take))
        return answer(await self.worker.ask({"do": "try", "person": wanted.person, "path": path, "stop_words": stops}))

    async def means(self, request: Request) -> Response:
        """What a word means from the next start on: the person's profile, checked before it is written."""
        self._setup.at_rest()
        wanted = await asked(request, OfPerson)
        change = f"words.{wanted.word}={wanted.command}"
        person = self._setup.known(wanted.person)
        done = await self._setup.set(person, [change])
        return answer(done, 200 if done["ok"] else 422)
