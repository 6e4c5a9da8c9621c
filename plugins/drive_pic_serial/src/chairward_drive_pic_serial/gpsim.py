"""The real firmware in gpsim, driven through its command line in lock-step slices (no C++, only Debian packages).

Each `advance` hands gpsim the bytes of the line, lets it run to an exact instruction cycle and reads back bytes, ports
and registers. Time stands still in between, so tests are exact and as fast as the machine (some 10x real time).
"""

from __future__ import annotations

import math
import os
import re
import select
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from chairward.realtime import die_with_parent
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.firmware import FirmwareError, assemble
from chairward_drive_pic_serial.motor import PWM_STEPS, Pins
from chairward_drive_pic_serial.uart import CYCLES_PER_US, RX_BYTE_CYCLES

STATE, FAULT = 0x2A, 0x2B
"""Addresses of `state` and `fault` in drive.asm's RAM (a test reads them from the listing)."""
HANG_S = 20.0
UART_ROOM = 10
"""Bytes that gpsim's UART module is given at once; it silently loses what is too much (16 and more)."""
_BYTE = re.compile(rb"<([0-9A-F]{2})>")
_LAST = re.compile(rb"fault\S* = \$([0-9a-f]{2})\b")
_SCRIPT = """load s drive.cod
frequency 20000000
p16f877a.BreakOnReset = false
module library libgpsim_modules
{uart}
module load pullup STOP
STOP.resistance = 100
STOP.voltage = 0
node nstop
attach nstop portb0 STOP.pin
module load pullup CHARGER
CHARGER.resistance = 100
CHARGER.voltage = 0
node ncharger
attach ncharger portb1 CHARGER.pin
module load pullup BATTERY
BATTERY.resistance = 100
BATTERY.voltage = {battery_v:.5f}
node nbattery
attach nbattery porta0 BATTERY.pin
"""
_UART = f"""module load usart U1
U1.txbaud = {wire.BAUD}
U1.rxbaud = {wire.BAUD}
U1.console = true
U1.hex = true
node ntx
node nrx
attach ntx portc6 U1.RXPIN
attach nrx portc7 U1.TXPIN"""


def start(
    folder: Path, uart: str, *, defines: Sequence[str], battery: int, environment: Mapping[str, str] = {}
) -> subprocess.Popen[bytes]:
    """A gpsim with the firmware, its commands on standard input. uart: what is at the end of its serial line.

    Raises FirmwareError when the packages are missing.
    """
    gpsim = shutil.which("gpsim")
    if gpsim is None:
        raise FirmwareError("gpsim is not installed: sudo apt-get install gpsim gputils")
    assemble(folder, defines)
    (folder / "pic.stc").write_text(_SCRIPT.format(uart=uart, battery_v=_volts(battery)))
    return subprocess.Popen(
        [gpsim, "-i", "-c", "pic.stc"],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        bufsize=0,
        preexec_fn=die_with_parent,  # a gpsim left alone would run for ever
        env={**os.environ, **environment, "HOME": str(folder)},  # keeps its readline history out of the person's home
    )


def kill(process: subprocess.Popen[bytes]) -> None:
    """End it; may be called twice."""
    if process.poll() is None:
        process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()


def _volts(battery: int) -> float:
    """At AN0 for an ADC value of 0..255."""
    return min(5.0, (battery + 0.5) / 256 * 5.0)


class Gpsim:
    """One gpsim process with the firmware in it; an `Engine`. Raises FirmwareError when the packages are missing."""

    def __init__(self, defines: Sequence[str] = (), *, battery: int = 255) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="chairward-gpsim-")
        try:
            self._process = start(Path(self._folder.name), _UART, defines=defines, battery=battery)
        except FirmwareError:
            self._folder.cleanup()
            raise
        self._asked: list[str] = []
        self._line = bytearray()
        self._line_free = 0.0
        self._out = bytearray()
        self._unread = b""
        self._read = False
        self._portd = self._steer = self._drive = self._state = self._fault = 0
        self.now = 0
        self.advance(100)

    def feed(self, data: bytes) -> None:
        """Bytes from the host."""
        self._line += data

    def take(self) -> bytes:
        """The bytes that have left the PIC since the last call."""
        data = bytes(self._out)
        self._out.clear()
        return data

    def advance(self, microseconds: float) -> None:
        """Run to an exact cycle."""
        cycles = round(microseconds * CYCLES_PER_US)
        if cycles <= 0:
            return  # a break at the present cycle would never come
        end = self.now + cycles
        while self._line:
            self._line_free = max(self._line_free, self.now)
            room = UART_ROOM - math.ceil((self._line_free - self.now) / RX_BYTE_CYCLES)
            part, self._line = self._line[:room], self._line[room:]
            self._asked += [f"U1.tx = {byte}" for byte in part]
            self._line_free += len(part) * RX_BYTE_CYCLES
            if not self._line or (until := int(self._line_free - 2 * RX_BYTE_CYCLES)) >= end:
                break
            self.now = max(until, self.now + 1)
            self._asked += [f"break c {self.now}", "run"]
        self.now = end
        self._asked += [f"break c {end}", "run"]
        self._write("\n".join(self._asked) + "\n")
        self._asked.clear()
        self._read = False
        text = self._until(re.compile(rb"cycle break: \S+ = %d\b" % end))
        self._out += bytes(int(pair, 16) for pair in _BYTE.findall(text))

    def line_clear_s(self) -> float:
        """Not told: look every millisecond."""
        return 0.001

    def pins(self) -> Pins:
        """Ports and PWM registers as pins."""
        self._look()
        d = self._portd
        return Pins(
            d & 1,
            d >> 1 & 1,
            self._steer / PWM_STEPS,
            d >> 2 & 1,
            d >> 3 & 1,
            self._drive / PWM_STEPS,
            int(not d & 0x80),
            d >> 4 & 1,
            d >> 5 & 1,
        )

    def registers(self) -> tuple[int, int]:
        """(state, fault) from RAM."""
        self._look()
        return self._state, self._fault

    def set_inputs(self, *, stop: bool | None = None, charger: bool | None = None, battery: int | None = None) -> None:
        """Voltages at RB0, RB1 and AN0."""
        if stop is not None:
            self._asked.append(f"STOP.voltage = {5 if stop else 0}")
        if charger is not None:
            self._asked.append(f"CHARGER.voltage = {5 if charger else 0}")
        if battery is not None:
            self._asked.append(f"BATTERY.voltage = {_volts(battery):.5f}")

    def restart(self) -> None:
        """As by the reset pin: from address 0. (gpsim's own `reset` leaves its UART stuck, its watchdog does not.)"""
        self._asked.append("pc = 0")

    def close(self) -> None:
        """End the process; may be called twice."""
        kill(self._process)
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _look(self) -> None:
        """Ask for ports and registers, once for each advance: asking costs more than running."""
        if self._read:
            return
        self._write(f"portd\nccpr1l\nccpr2l\nreg({STATE:#x})\nreg({FAULT:#x})\n")
        text = self._until(_LAST)
        self._portd, self._steer, self._drive = (_value(text, name) for name in (b"portd", b"ccpr1l", b"ccpr2l"))
        self._state, self._fault = _value(text, b"state"), _value(text, b"fault")
        self._read = True

    def _write(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text.encode())

    def _until(self, pattern: re.Pattern[bytes]) -> bytes:
        """gpsim's output up to and with the pattern."""
        assert self._process.stdout is not None
        while True:
            found = pattern.search(self._unread)
            if found:
                text, self._unread = self._unread[: found.end()], self._unread[found.end() :]
                return text
            if not select.select([self._process.stdout], [], [], HANG_S)[0]:
                raise FirmwareError(
                    f"gpsim says nothing for {HANG_S:g} s: {self._unread[-300:].decode(errors='replace')}"
                )
            more = self._process.stdout.read(65536)
            if not more:
                raise FirmwareError(f"gpsim has ended: {self._unread[-300:].decode(errors='replace')}")
            self._unread += more


def _value(text: bytes, name: bytes) -> int:
    """The last `name = 0x12` or `name[...] = $12` in gpsim's output."""
    found = re.findall(name + rb"\S* = (?:0x|\$)([0-9a-fA-F]+)", text)
    if not found:
        raise FirmwareError(f"gpsim did not tell {name.decode()}: {text[-300:].decode(errors='replace')}")
    return int(found[-1], 16)
