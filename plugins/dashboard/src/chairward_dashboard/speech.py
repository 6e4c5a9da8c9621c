"""Sentences as sound, offline, by espeak-ng where it is installed."""

from __future__ import annotations

import asyncio
import shutil
import struct
from collections import OrderedDict

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from chairward_dashboard.answers import Refused, told
from chairward_dashboard.commands import end

LONGEST = 240
KEPT = 64
WITHIN_S = 5.0
WORDS_A_MINUTE = 150
VOICES = {"en": "en", "de": "de", "fr": "fr", "hi": "hi", "ar": "ar"}


class Speech:
    """Speaks what a page asks for; says 404 where nothing can speak, and the page stays with its tones."""

    def __init__(self) -> None:
        self.program = shutil.which("espeak-ng")
        self._said: OrderedDict[tuple[str, str], bytes] = OrderedDict()
        self._turn = asyncio.Lock()

    def routes(self) -> list[Route]:
        """GET /api/say?language=..&text=.. gives wav."""
        return [Route("/api/say", told(self._say))]

    async def _say(self, request: Request) -> Response:
        language, text = request.query_params.get("language", "en"), request.query_params.get("text", "")
        if self.program is None:
            raise Refused(404, "espeak-ng is not installed on the chair")
        if language not in VOICES or not text.strip() or len(text) > LONGEST:
            raise Refused(400, f"a sentence of at most {LONGEST} characters in one of {', '.join(VOICES)}")
        async with self._turn:
            sound = self._said.get((language, text)) or await self._speak(self.program, VOICES[language], text)
            self._said[language, text] = sound
            self._said.move_to_end((language, text))
            if len(self._said) > KEPT:
                self._said.popitem(last=False)
        return Response(sound, media_type="audio/wav")

    async def _speak(self, program: str, voice: str, text: str) -> bytes:
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(
            *(program, "-v", voice, "-s", str(WORDS_A_MINUTE), "--stdin", "--stdout"),
            stdin=pipe,
            stdout=pipe,
            stderr=asyncio.subprocess.DEVNULL,
        )
        try:
            sound, _ = await asyncio.wait_for(process.communicate(text.encode()), WITHIN_S)
        except TimeoutError:
            raise Refused(503, "espeak-ng took too long") from None
        finally:
            await end(process)
        if len(sound) < 44 or sound[:4] != b"RIFF":
            raise Refused(503, "espeak-ng gave no sound")
        return sized(sound)


def sized(wav: bytes) -> bytes:
    """A wav file that was written to a pipe, with the sizes in its header put right."""
    return wav[:4] + struct.pack("<I", len(wav) - 8) + wav[8:40] + struct.pack("<I", len(wav) - 44) + wav[44:]
