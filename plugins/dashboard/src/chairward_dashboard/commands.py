"""What set-up pages do, they do through the command line: nothing that a person could not type as well.

Other plugins are never imported here; their commands (`chairward words serve`, `chairward calibrate ...`) are asked.
All work at a low priority and, but for the one that is asked line by line, one after the other.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import Mapping
from typing import Any

NICENESS = 5
MOST_WAITING = 4
LINE_BYTES = 2**20
IDLE_S = 120.0


class CommandError(Exception):
    """A command did not do what was asked: its own sentence."""


class Commands:
    """Runs `chairward ... --json`, one at a time."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()
        self._waiting = 0

    async def json(self, *arguments: str, within_s: float = 120.0) -> Any:
        """What the command prints, also when it ends badly but says so in JSON. Raises CommandError."""
        if self._waiting >= MOST_WAITING:
            raise CommandError("the chair is busy with what other screens have asked for: try again in a moment")
        self._waiting += 1
        try:
            async with self._turn:
                return await _run(arguments, within_s)
        finally:
            self._waiting -= 1


async def _run(arguments: tuple[str, ...], within_s: float) -> Any:
    process = await start(arguments)
    try:
        out, err = await asyncio.wait_for(process.communicate(), within_s)
    except TimeoutError:
        raise CommandError(f"'chairward {arguments[0]}' took more than {within_s:.0f} s and was ended") from None
    finally:
        await end(process)
    if out.strip():
        with contextlib.suppress(ValueError):
            return json.loads(out)
    lines = [line.strip(" │╭╮╰╯─") for line in err.decode(errors="replace").splitlines()]
    said = [line for line in lines if line] or [f"'chairward {' '.join(arguments[:2])}' said nothing"]
    raise CommandError(said[-1].removeprefix("chairward: "))


async def start(
    arguments: tuple[str, ...], environment: Mapping[str, str] | None = None, **more: Any
) -> asyncio.subprocess.Process:
    """`chairward` with these arguments, its standard output and errors to be read here."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "chairward", *arguments),
        env={**os.environ, **(environment or {})},
        **{"stdin": asyncio.subprocess.DEVNULL, "stdout": pipe, "stderr": pipe, "limit": LINE_BYTES, **more},
    )
    with contextlib.suppress(ProcessLookupError):
        os.setpriority(os.PRIO_PROCESS, process.pid, NICENESS)
    return process


async def end(process: asyncio.subprocess.Process | None) -> None:
    """Kill what still runs, and see it gone."""
    if process is not None and process.returncode is None:
        process.kill()
        if process.stdin is not None:
            process.stdin.close()
        await process.wait()


class Worker:
    """A command that answers JSON lines; started at the first question, ended when nobody has asked for a while."""

    def __init__(self, *arguments: str) -> None:
        self._arguments = arguments
        self._turn = asyncio.Lock()
        self._process: asyncio.subprocess.Process | None = None
        self._rest: asyncio.Task[None] | None = None

    async def ask(self, request: Mapping[str, Any], within_s: float = 120.0) -> dict[str, Any]:
        """One answer. Raises CommandError with the command's own sentence."""
        if self._rest is not None:
            self._rest.cancel()
        async with self._turn:
            answer = await self._ask(json.dumps(request, ensure_ascii=False).encode() + b"\n", within_s)
            self._rest = asyncio.create_task(self._leave())
        if "error" in answer:
            raise CommandError(str(answer["error"]))
        return answer

    async def _ask(self, line: bytes, within_s: float) -> dict[str, Any]:
        if self._process is None or self._process.returncode is not None:
            self._process = await start(
                self._arguments, stdin=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(line)
            await self._process.stdin.drain()
            answer = json.loads(await asyncio.wait_for(self._process.stdout.readline(), within_s))
        except (TimeoutError, ValueError, ConnectionError) as error:
            await self.close()
            name = " ".join(self._arguments[:2])
            raise CommandError(
                f"'chairward {name}' does not answer: is the plugin that offers it installed?"
            ) from error
        return dict(answer)

    async def _leave(self) -> None:
        """Nobody has asked for a while: end it."""
        await asyncio.sleep(IDLE_S)
        async with self._turn:
            await end(self._process)
            self._process = None

    async def close(self) -> None:
        """End it; it is started again when asked."""
        if self._rest is not None:
            self._rest.cancel()
        await end(self._process)
        self._process = None
