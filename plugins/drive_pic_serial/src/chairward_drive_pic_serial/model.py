"""The firmware in Python, step by step as firmware/drive.asm: bytes in, bytes out, pins, time in instruction cycles.

The tests hold it against the real firmware in gpsim, state by state. It stands in for gpsim where that is not
installed, and it runs some hundred times faster.
"""

from __future__ import annotations

from fastcrc import crc16

from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.motor import Motor, Pins
from chairward_drive_pic_serial.uart import CYCLES_PER_US, Uart
from chairward_drive_pic_serial.wire import Ask, Fault, Input, Reason, Reply, State, Why, signed

TICK_CYCLES = 5_000
BOOT_CYCLES = 50_500
"""From reset until the timer runs: mostly one EEPROM write, 4 to 8 ms in a real part, plus its oscillator's start."""

TIMEOUT_MS = 195
PARK_MS = 250
DEBOUNCE_MS = 3
RISE_MS = 8
FALL_MS = 5
RATE_MAX_MS = 50
RX_MAX = 12


class FirmwareModel:
    """A PIC with the firmware in it. Inputs: `stop_input`, `charger` (pin high), `battery` (0..255)."""

    def __init__(self, *, resets: int = 0, battery: int = 255, boot_cycles: int = BOOT_CYCLES) -> None:
        self.nonce = resets
        self._boot_cycles = boot_cycles
        self.stop_input = False
        self.charger = False
        self.battery_pin = battery
        self.now = 0
        self._uart = Uart()
        self.reset(Reason.POWER_ON)

    def reset(self, reason: Reason = Reason.RESET_PIN) -> None:
        """Everything the RAM held is gone, the pins are safe at once, the nonce counts one up."""
        self.nonce = (self.nonce + 1) & 0xFFFF
        self.reason = reason
        self.state, self.fault, self.inputs = State.BOOT, Fault(0), Input(0)
        self.tick_to = self.seq = self.last = self.battery = 0
        self.rise = self.rise_c = RISE_MS
        self.fall = self.fall_c = FALL_MS
        self.park, self.soft = PARK_MS, False
        self.stop_c = self.chg_c = 0
        self.steer, self.drive = Motor(), Motor()
        self._uart.reset()
        self._buf, self._rem, self._first, self._rerr = bytearray(), 0, True, False
        self._booted = False
        self._next_tick = self.now + self._boot_cycles

    # ---- the world's side

    def feed(self, data: bytes) -> None:
        """Bytes from the host; each takes its time on the line."""
        self._uart.feed(data, self.now)

    def take(self) -> bytes:
        """The bytes that have left the PIC since the last call."""
        return self._uart.take()

    def advance(self, microseconds: float) -> None:
        """Let time pass."""
        self.advance_cycles(round(microseconds * CYCLES_PER_US))

    def advance_cycles(self, cycles: int) -> None:
        """Let instruction cycles pass."""
        end = self.now + cycles
        while True:
            rx, tx = self._uart.rx_at, self._uart.tx_at
            at = min(rx, tx, self._next_tick)
            if at > end:
                break
            self.now = max(self.now, int(at))
            if at == rx:
                self._receive(self._uart.received())
            elif at == tx:
                self._uart.left()
            else:
                self._next_tick += TICK_CYCLES
                self._tick() if self._booted else self._boot()
            self._uart.pump(self.now)
        self.now = end

    def line_clear_s(self) -> float:
        """Until the last byte on its way in has arrived, else out; infinity on a quiet line. When to look again."""
        return self._uart.clear_s(self.now)

    def pins(self) -> Pins:
        """The pins now; all safe until the reset is over."""
        if not self._booted:
            return Pins(0, 0, 0.0, 0, 0, 0.0, 1, 0, 0)
        return Pins(
            *self.steer.pins(),
            *self.drive.pins(),
            int(self.park == PARK_MS),
            int(self.state == State.ARMED),
            int(self.fault != 0),
        )

    # ---- the firmware

    def _boot(self) -> None:
        self._booted = True
        self.seq = 0
        self._uart.send(b"\0")
        self._reply_hello()

    def _tick(self) -> None:
        self.battery = self.battery_pin
        if not self.stop_input:
            self.stop_c = 0
            self.inputs &= ~Input.STOP
        elif self.stop_c < DEBOUNCE_MS:
            self.stop_c += 1
            if self.stop_c == DEBOUNCE_MS:
                self.inputs |= Input.STOP
                self.fault |= Fault.STOP_INPUT
                self._latch()
                self._event()
        if not self.charger:
            self.chg_c = 0
            self.inputs &= ~Input.CHARGER
        elif self.chg_c < DEBOUNCE_MS:
            self.chg_c += 1
            if self.chg_c == DEBOUNCE_MS:
                self.inputs |= Input.CHARGER
                self._disarm()
                self._event()
        if self.tick_to:
            self.tick_to -= 1
            if self.tick_to == 0:
                self.fault |= Fault.SILENCE
                self._disarm()
                self._event()
        self.rise_c -= 1
        rise = self.rise_c == 0
        if rise:
            self.rise_c = self.rise
            self.soft = not self.soft
        self.fall_c -= 1
        fall = self.fall_c == 0
        if fall:
            self.fall_c = self.fall
        steer, drive = self.steer, self.drive
        steer.step(rise=rise, fall=fall, soft=self.soft)
        drive.step(rise=rise, fall=fall, soft=self.soft)
        if steer.target or steer.applied or drive.target or drive.applied:
            self.park = 0
        elif steer.held and drive.held and self.park != PARK_MS:
            self.park += 1

    def _latch(self) -> None:
        self.state = State.ESTOP
        self._standby()

    def _disarm(self) -> None:
        if self.state == State.ARMED:
            self.state = State.NEUTRAL
        self._standby()

    def _standby(self) -> None:
        self.tick_to = 0
        self._brake()

    def _brake(self) -> None:
        self.steer.brake()
        self.drive.brake()
        self.park = PARK_MS

    def _receive(self, byte: int) -> None:
        if not self._booted:
            return
        if byte == 0:
            self._frame_end()
            self._buf.clear()
            self._rem, self._first, self._rerr = 0, True, False
        elif self._rem:
            self._rem -= 1
            self._append(byte)
        else:
            if not self._first:
                self._append(0)
            self._first = False
            self._rem = byte - 1

    def _append(self, byte: int) -> None:
        if len(self._buf) >= RX_MAX:
            self._rerr = True
        else:
            self._buf.append(byte)

    def _frame_end(self) -> None:
        if not self._rerr and self._first:
            return
        if self._rerr or self._rem or len(self._buf) < wire.SHORTEST:
            self.seq = 0
            self._nak(Why.FRAME)
        elif crc16.ibm_3740(bytes(self._buf)) != 0:
            self.seq = 0
            self._nak(Why.CRC)
        else:
            self.seq = self._buf[1]
            why = self._obey(self._buf[0], bytes(self._buf[2:-2]))
            if why:
                self._nak(why)

    def _obey(self, kind: int, body: bytes) -> Why | None:
        """Length, sequence, range, state; then obey and answer. The reason where it is refused."""
        sizes = {Ask.DRIVE: 2, Ask.HELLO: 2, Ask.ESTOP: 0, Ask.CLEAR: 2, Ask.BRAKE: 1}
        if kind not in sizes:
            return Why.TYPE
        if len(body) != sizes[Ask(kind)]:
            return Why.FRAME
        if kind == Ask.HELLO:
            return self._hello(*body)
        if kind == Ask.ESTOP:
            self.fault |= Fault.HOST
            self._latch()
            self._status()
            return None
        if not 1 <= (self.seq - self.last) & 0xFF <= 127:
            return Why.SEQ
        self.last = self.seq
        if kind == Ask.CLEAR:
            return self._clear(body[0] << 8 | body[1])
        if kind == Ask.BRAKE:
            return self._brake_frame(body[0])
        return self._drive_frame(signed(body[0]), signed(body[1]))

    def _hello(self, rise: int, fall: int) -> Why | None:
        if not (1 <= rise <= RATE_MAX_MS and 1 <= fall <= RATE_MAX_MS):
            return Why.RANGE
        self.rise = self.rise_c = rise
        self.fall = self.fall_c = fall
        self.last = self.seq
        self.fault &= ~Fault.SILENCE
        if self.state != State.ESTOP:
            self.state = State.NEUTRAL
        self._standby()
        self._reply_hello()
        return None

    def _clear(self, nonce: int) -> Why | None:
        if nonce != self.nonce:
            return Why.NONCE
        if self.state == State.BOOT or self.inputs & Input.STOP:
            return Why.STATE
        self._standby()
        self.fault &= ~(Fault.STOP_INPUT | Fault.HOST)
        self.state = State.NEUTRAL
        self._status()
        return None

    def _brake_frame(self, mode: int) -> Why | None:
        if mode > 1:
            return Why.RANGE
        if mode == 1:
            self._disarm()
        else:
            self._brake()
            if self.state == State.ARMED:
                self.tick_to = TIMEOUT_MS
        self._status()
        return None

    def _drive_frame(self, steer: int, drive: int) -> Why | None:
        if abs(steer) > wire.FULL or abs(drive) > wire.FULL:
            return Why.RANGE
        if self.state != State.ARMED:
            if self.state != State.NEUTRAL or steer or drive:
                return Why.STATE
            if self.inputs & Input.CHARGER:
                return Why.CHARGING
            self.state = State.ARMED
            self.fault &= ~Fault.SILENCE
        self.tick_to = TIMEOUT_MS
        self.steer.target, self.drive.target = steer, drive
        self._status()
        return None

    # ---- replies

    def _event(self) -> None:
        self.seq = 0
        self._status()

    def _status(self) -> None:
        self._refresh_inputs()
        self._send(
            Reply.STATUS, self.state, self.fault, self.steer.applied, self.drive.applied, self.battery, self.inputs
        )

    def _refresh_inputs(self) -> None:
        self.inputs &= Input.STOP | Input.CHARGER
        if self.park == PARK_MS:
            self.inputs |= Input.BRAKE
        if not self.steer.applied and not self.drive.applied:
            self.inputs |= Input.STANDING

    def _reply_hello(self) -> None:
        self._send(Reply.HELLO, wire.PROTOCOL, self.state, self.nonce >> 8, self.nonce & 0xFF, self.reason, TIMEOUT_MS)

    def _nak(self, why: Why) -> None:
        self._send(Reply.NAK, why, self.state, self.fault, self.last, 0, 0)

    def _send(self, kind: Reply, *body: int) -> None:
        self._uart.send(wire.encode(bytes([kind, self.seq, *(b & 0xFF for b in body)])))
