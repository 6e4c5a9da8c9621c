"""gpsim on a pty of its own, in real time: a small C++ module in gpsim does what Python is too late for.

Built once by g++ against gpsim's headers (Debian packages gpsim-dev, libglib2.0-dev) and kept in the user's cache.
"""

from __future__ import annotations

import hashlib
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

import platformdirs

from chairward_drive_pic_serial import gpsim, wire
from chairward_drive_pic_serial.firmware import FirmwareError

SOURCE = Path(__file__).parent / "pty_bridge.cc"
HEADERS = Path("/usr/include/gpsim")
INSTALL = "sudo apt-get install gpsim-dev libglib2.0-dev g++"
_UART = """module library {library}
module load pty_bridge U1
node ntx
node nrx
attach ntx portc6 U1.RX
attach nrx portc7 U1.TX
""" + "\n".join(f"node nd{bit}\nattach nd{bit} portd{bit} U1.D{bit}" for bit in range(8))


def available() -> bool:
    """Whether it is built or can be built here."""
    return _built().exists() or (shutil.which("g++") is not None and HEADERS.is_dir() and _glib() != [])


def library() -> Path:
    """The module, built if need be. Raises FirmwareError with what to install."""
    path = _built()
    if path.exists():
        return path
    if not available():
        raise FirmwareError(f"the pty bridge for gpsim cannot be built here: {INSTALL}")
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        part = Path(folder) / path.name
        includes = [f"-isystem{where}" for where in (HEADERS, *_glib())]
        done = subprocess.run(
            ["g++", "-std=c++17", "-O2", "-shared", "-fPIC", *includes, str(SOURCE), "-o", str(part), "-lgpsim"],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise FirmwareError(f"g++ refuses {SOURCE}: {done.stderr.strip()[:300]}: {INSTALL}")
        part.replace(path)
    return path


class GpsimOnPty:
    """A gpsim that runs by itself in real time: `link` is its serial port, `pins` the file of its pins.

    log: a file that gets `byte CYCLE VALUE` for each byte that arrived and `pins CYCLE VALUES...` for each change.
    """

    def __init__(
        self, link: Path, pins: Path, *, defines: Sequence[str] = (), battery: int = 255, log: Path | None = None
    ) -> None:
        uart = _UART.format(library=library())
        self._folder = tempfile.TemporaryDirectory(prefix="chairward-gpsim-")
        self._link = link
        environment = {
            "CHAIRWARD_BAUD": str(wire.BAUD),
            "CHAIRWARD_LINK": str(link),
            "CHAIRWARD_PINS": str(pins),
            "CHAIRWARD_STATE": hex(gpsim.STATE),
            "CHAIRWARD_FAULT": hex(gpsim.FAULT),
            **({"CHAIRWARD_LOG": str(log)} if log else {}),
        }
        link.unlink(missing_ok=True)
        folder = Path(self._folder.name)
        try:
            self.process = gpsim.start(folder, uart, defines=defines, battery=battery, environment=environment)
        except FirmwareError:
            self._folder.cleanup()
            raise
        assert self.process.stdin is not None
        self.process.stdin.write(b"run\n")
        self._said = bytearray()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def ready(self) -> bool:
        """The port is there. Raises FirmwareError when gpsim has ended."""
        if self.process.poll() is not None:
            self._reader.join(1.0)
            raise FirmwareError(f"gpsim has ended: {self._said[-300:].decode(errors='replace')}")
        return self._link.is_symlink()

    def unplug(self) -> None:
        """Pull the cable out: the port vanishes."""
        self.process.send_signal(signal.SIGUSR1)

    def plug(self) -> None:
        """Plug it in again: a new port takes its name, soon."""
        self.process.send_signal(signal.SIGUSR2)

    def close(self) -> None:
        """End it; may be called twice."""
        if self.process.poll() is None:
            self.process.kill()
        self._reader.join()
        gpsim.kill(self.process)
        self._link.unlink(missing_ok=True)
        self._folder.cleanup()

    def _read(self) -> None:
        """Take what gpsim says, so that it never waits for somebody to read; the end of it is kept."""
        assert self.process.stdout is not None
        while data := self.process.stdout.read(4096):
            self._said = self._said[-2000:] + data


def _built() -> Path:
    """Where this source's module is kept."""
    name = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    return Path(platformdirs.user_cache_dir("chairward")) / f"pty_bridge-{name}.so"


def _glib() -> list[Path]:
    """glib's two folders of headers; [] when they are not there."""
    general = Path("/usr/include/glib-2.0")
    own = sorted(Path("/usr/lib").glob("**/glib-2.0/include"))
    return [general, *own] if general.is_dir() and own else []
