"""Opening and giving back the two kinds of device. A terminal is always left as it was found."""

from __future__ import annotations

import fcntl
import logging
import os
import signal
import stat
import subprocess
import termios
from pathlib import Path

from chairward.components import DeviceLost

log = logging.getLogger(__name__)

_EVIOCGRAB = 0x40044590
"""_IOW('E', 0x90, int) of linux/input.h."""


class InputDevice:
    """/dev/input/event*, or anything that speaks struct input_event."""

    def __init__(self, path: str, *, grab: bool) -> None:
        self.name = f"input device {path}"
        self.fd = _open(path, os.O_RDONLY)
        if grab:
            try:
                fcntl.ioctl(self.fd, _EVIOCGRAB, 1)
            except OSError as error:
                os.close(self.fd)
                raise DeviceLost(
                    f"{self.name} cannot be kept from other programs ({error.strerror}): set keys.grab = false"
                ) from error

    def close(self) -> None:
        """Close it (which also ends a grab)."""
        os.close(self.fd)


class Terminal:
    """A terminal that gives each key at once and does not echo it. Ctrl-C keeps its meaning.

    It is given back as found by `close`, and by a small watching shell if this process dies in any other way.
    """

    def __init__(self, path: str) -> None:
        self.name = f"terminal {path}"
        _leave_job_control(path)
        self.fd = _open(path, os.O_RDWR | os.O_NOCTTY)
        try:
            self._found = termios.tcgetattr(self.fd)
        except termios.error as error:
            os.close(self.fd)
            raise DeviceLost(f"{self.name} is no terminal ({error}): correct keys.device") from error
        self._watcher = _restore_when_this_process_ends(path)
        wanted = termios.tcgetattr(self.fd)
        wanted[3] &= ~(termios.ICANON | termios.ECHO)
        wanted[6][termios.VMIN], wanted[6][termios.VTIME] = 1, 0
        _set(self.fd, wanted)

    def close(self) -> None:
        """Put the terminal's settings back."""
        try:
            _set(self.fd, self._found)
        except (termios.error, OSError) as error:
            log.info("%s is gone, its settings need no restoring (%s)", self.name, error)
        os.close(self.fd)
        if self._watcher is not None:
            self._watcher.communicate(timeout=5)


def open_device(device: str, *, grab: bool) -> InputDevice | Terminal:
    """The device a setting names. Raises DeviceLost."""
    if device != "terminal":
        return Terminal(device) if _is_terminal(device) else InputDevice(device, grab=grab)
    path = terminal_of(os.getpid())
    if path is None:
        raise DeviceLost(
            "this program was not started in a terminal: give keys.device a path such as /dev/input/by-id/...-event-kbd"
        )
    return Terminal(path)


def terminal_of(pid: int) -> str | None:
    """The terminal in which a process, or the nearest of its parents that has one, was started; None if none was."""
    while pid > 0:
        try:
            text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            return None
        fields = text.rpartition(")")[2].split()
        pid, device = int(fields[1]), int(fields[4]) & 0xFFFFFFFF
        if device:
            major, minor = (device >> 8) & 0xFFF, (device & 0xFF) | ((device >> 12) & 0xFFF00)
            if 136 <= major <= 143:  # UNIX98 pseudo terminals
                return f"/dev/pts/{minor + 256 * (major - 136)}"
            return f"/dev/{Path(f'/sys/dev/char/{major}:{minor}').resolve().name}"
    return None


def _open(path: str, flags: int) -> int:
    try:
        return os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)
    except PermissionError as error:
        raise DeviceLost(f"{path}: no permission; add the user to the group 'input' and log in again") from error
    except OSError as error:
        raise DeviceLost(f"{path} cannot be opened ({error.strerror}): plug it in or correct keys.device") from error


def _is_terminal(path: str) -> bool:
    """Pseudo terminals and consoles; decided by name and kind so that nothing is opened twice."""
    try:
        mode = os.stat(path)
    except OSError:
        return False
    return stat.S_ISCHR(mode.st_mode) and not os.path.realpath(path).startswith("/dev/input/")


def _set(fd: int, attributes: list[object]) -> None:
    """tcsetattr that a process in the background survives (the kernel would stop it with SIGTTOU)."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
    try:
        termios.tcsetattr(fd, termios.TCSANOW, attributes)  # type: ignore[arg-type]
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _leave_job_control(path: str) -> None:
    """A lane runs in a process group of its own, so the kernel would refuse it its own terminal's keys.

    Giving up the *controlling* terminal (not the terminal) lifts that; a process that leads a session keeps it.
    """
    try:
        fd = os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC)
    except OSError:
        return
    try:
        if os.getsid(0) != os.getpid() and os.tcgetpgrp(fd) != os.getpgrp():
            fcntl.ioctl(fd, termios.TIOCNOTTY)
    except OSError as error:
        log.info("%s stays this process's controlling terminal (%s)", path, error)
    finally:
        os.close(fd)


def _restore_when_this_process_ends(path: str) -> subprocess.Popen[bytes] | None:
    """A shell that waits for our end of a pipe to close, however that happens, then puts the settings back."""
    try:
        found = subprocess.run(["stty", "-F", path, "-g"], capture_output=True, check=True, timeout=5).stdout
        return subprocess.Popen(
            ["sh", "-c", 'cat >/dev/null; exec stty -F "$1" "$2"', "sh", path, found.decode().strip()],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        log.warning("terminal %s will stay without echo if this process is killed (%s): then type `reset`", path, error)
        return None
