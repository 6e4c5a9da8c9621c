"""Real devices: pseudo terminals, and a pipe that speaks struct input_event."""

from __future__ import annotations

import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from chairward.components import Context, DeviceLost
from chairward.messages import Alive, Button, Command, Intent, Message, Press
from chairward_keys.devices import terminal_of
from chairward_keys.plugin import make
from chairward_keys.settings import KeysSettings
from chairward_keys.source import Keys
from chairward_keys.switchboard import ALIVE_EVERY_NS

PATIENCE_S = 60.0
"""However busy the machine is."""


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """(the person's end, the path of the program's end)."""
    ours, theirs = pty.openpty()
    yield ours, os.ttyname(theirs)
    os.close(theirs)
    os.close(ours)


def opened(device: object, tmp_path: Path) -> Keys:
    source = make(KeysSettings(device=str(device)), Context(lane="panel", run_dir=tmp_path, chair_dir=tmp_path))
    assert isinstance(source, Keys)
    source.open()
    return source


def listen(source: Keys, for_s: float) -> list[Message]:
    messages: list[Message] = []
    end = time.monotonic() + for_s
    while (left := end - time.monotonic()) > 0:
        messages += source.read(left) or []
    return messages


def until(source: Keys, done: Callable[[list[Message]], object]) -> list[Message]:
    """All that is read until `done` is true of it."""
    messages: list[Message] = []
    end = time.monotonic() + PATIENCE_S
    while not done(messages):
        assert time.monotonic() < end, f"waited in vain; read: {messages}"
        messages += source.read(0.2) or []
    return messages


def intents(messages: list[Message]) -> list[Intent]:
    return [m for m in messages if isinstance(m, Intent)]


def local_flags(path: str) -> int:
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
    flags = termios.tcgetattr(fd)[3]
    os.close(fd)
    return int(flags)


def buttons(messages: list[Message]) -> list[Button]:
    return [m.button for m in messages if isinstance(m, Press)]


def test_keys_typed_in_a_terminal_become_presses(terminal: tuple[int, str], tmp_path: Path) -> None:
    ours, path = terminal
    source = opened(path, tmp_path)
    os.write(ours, b" ")
    assert buttons(until(source, buttons)) == [Button.STOP]
    os.write(ours, b"\rr")
    assert buttons(until(source, lambda heard: len(buttons(heard)) >= 2)) == [Button.ARM, Button.RESET]
    source.close()


def test_repeats_of_an_arrow_are_a_held_command_and_silence_ends_it(terminal: tuple[int, str], tmp_path: Path) -> None:
    ours, path = terminal
    source = opened(path, tmp_path)
    held: list[Intent] = []
    end = time.monotonic() + PATIENCE_S
    while len(held) < 4:
        assert time.monotonic() < end
        os.write(ours, b"\x1b[A")
        held += intents(listen(source, 0.03))
    assert all(m.held and m.command is Command.FRONT for m in held)
    while intents(listen(source, 0.3)):
        assert time.monotonic() < end, "nothing is typed any more, and still the arrow counts as held"
    source.close()


def test_heartbeats_come_at_the_pace_that_was_promised_and_never_faster(
    terminal: tuple[int, str], tmp_path: Path
) -> None:
    source = opened(terminal[1], tmp_path)
    heard = until(source, lambda heard: len(heard) >= 5)
    source.close()
    assert all(isinstance(m, Alive) for m in heard)
    assert all(b.captured_ns - a.captured_ns >= ALIVE_EVERY_NS for a, b in pairwise(heard))


def test_read_comes_back_with_nothing_when_nothing_is_due(terminal: tuple[int, str], tmp_path: Path) -> None:
    source = opened(terminal[1], tmp_path)
    until(source, len)
    end = time.monotonic() + PATIENCE_S
    while source.read(0.02) is not None:  # a heartbeat, where this process had to wait that long for its turn
        assert time.monotonic() < end
    source.close()


def test_a_terminal_is_left_as_it_was_found(terminal: tuple[int, str], tmp_path: Path) -> None:
    before = local_flags(terminal[1])
    source = opened(terminal[1], tmp_path)
    assert local_flags(terminal[1]) & (termios.ICANON | termios.ECHO) == 0
    assert local_flags(terminal[1]) & termios.ISIG, "Ctrl-C keeps its meaning"
    source.close()
    source.close()
    assert local_flags(terminal[1]) == before


SCRIPT = """
import os, sys
from pathlib import Path
from chairward_keys.settings import KeysSettings
from chairward_keys.source import Keys
if len(sys.argv) > 2:
    os.setpgid(0, 0)
source = Keys(KeysSettings(device=sys.argv[1]))
source.open()
print("open", flush=True)
while True:
    for message in source.read(1.0) or []:
        if type(message).__name__ != "Alive":
            print(message.button.value, flush=True)
"""


def test_a_terminal_is_restored_even_when_the_program_is_killed(terminal: tuple[int, str]) -> None:
    before = local_flags(terminal[1])
    child = subprocess.Popen([sys.executable, "-c", SCRIPT, terminal[1]], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "open\n"
    assert local_flags(terminal[1]) != before
    child.send_signal(signal.SIGKILL)
    child.wait(30)
    child.stdout.close()
    end = time.monotonic() + 30
    while local_flags(terminal[1]) != before and time.monotonic() < end:
        time.sleep(0.02)
    assert local_flags(terminal[1]) == before


SESSION = """
import os, subprocess, sys
terminal = os.open(sys.argv[1], os.O_RDWR)  # the first terminal that the leader of a session opens becomes its own
sys.exit(subprocess.call([sys.executable, "-c", sys.argv[2], "terminal", "own group"]))
"""


def test_a_lane_in_its_own_process_group_still_hears_the_terminal_it_was_started_in(
    terminal: tuple[int, str],
) -> None:
    command = [sys.executable, "-c", SESSION, terminal[1], SCRIPT]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert child.stdout is not None
    try:
        assert child.stdout.readline() == "open\n"
        os.write(terminal[0], b" ")
        assert child.stdout.readline() == "stop\n"
    finally:
        for member in Path("/proc").glob("[0-9]*/stat"):
            fields = member.read_text().rpartition(")")[2].split()
            if int(fields[3]) == child.pid:
                os.kill(int(member.parent.name), signal.SIGKILL)
        child.wait(30)
        child.stdout.close()


def test_a_process_without_a_terminal_says_so(tmp_path: Path) -> None:
    code = "import os; from chairward_keys.devices import terminal_of; print(terminal_of(os.getpid()))"
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, start_new_session=True
    )
    assert out.stdout.strip() == str(terminal_of(os.getpid())), "the parents' terminal, if they have one"
    assert terminal_of(0) is None


def test_a_terminal_that_hangs_up_is_lost(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    path = os.ttyname(theirs)
    source = opened(path, tmp_path)
    os.close(theirs)
    os.close(ours)
    with pytest.raises(DeviceLost, match=f"terminal {path}"):
        listen(source, PATIENCE_S)
    source.close()


def event(kind: int, code: int, value: int) -> bytes:
    return struct.pack("<qqHHi", 0, 0, kind, code, value) + struct.pack("<qqHHi", 0, 0, 0, 0, 0)


def test_a_switch_is_heard_while_it_is_down_and_lost_when_unplugged(tmp_path: Path) -> None:
    path = tmp_path / "event0"
    os.mkfifo(path)
    switch = os.open(path, os.O_RDWR)
    source = opened(path, tmp_path)
    os.write(switch, event(1, 17, 1))
    held = intents(until(source, lambda heard: len(intents(heard)) >= 6))
    assert all(m.held and m.command is Command.FRONT for m in held)
    os.write(switch, event(1, 17, 0))
    assert intents(listen(source, 0.2)) == []
    os.write(switch, event(1, 57, 1) + event(1, 57, 0))
    assert buttons(until(source, buttons)) == [Button.STOP]
    os.close(switch)
    with pytest.raises(DeviceLost, match=rf"input device {path} was closed at its other end"):
        listen(source, PATIENCE_S)
    source.close()


def test_a_missing_device_and_a_device_without_permission_are_told(tmp_path: Path) -> None:
    with pytest.raises(DeviceLost, match=r"event9 cannot be opened \(No such file or directory\): plug it in"):
        opened(tmp_path / "event9", tmp_path)
    with pytest.raises(DeviceLost, match=r"terminal /dev/null is no terminal"):
        opened("/dev/null", tmp_path)
    source = Keys(KeysSettings(device=str(tmp_path / "event9")))
    source.close()
    with pytest.raises(DeviceLost, match="not open"):
        source.read(0.0)


def test_a_plain_pipe_cannot_be_kept_from_other_programs(tmp_path: Path) -> None:
    path = tmp_path / "event0"
    os.mkfifo(path)
    source = Keys(KeysSettings(device=str(path), grab=True))
    with pytest.raises(DeviceLost, match=r"set keys\.grab = false"):
        source.open()
