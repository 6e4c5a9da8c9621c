"""Any controller that a DBC file describes: the chair file's table says which signal is what."""

from __future__ import annotations

from collections.abc import Sequence
from math import trunc
from pathlib import Path
from typing import Any

from chairward.components import STILL, DriveError, Motion
from chairward_drive_can.bus import sentence
from chairward_drive_can.checksum import KINDS
from chairward_drive_can.dialect import Report
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.scale import signed
from chairward_drive_can.settings import CanSettings, DbcSettings

COMMAND_ROLES = ("forward", "turn", "enable", "counter", "checksum")
STATUS_ROLES = ("speed", "turning", "fault", "stopped_by_user", "armed", "battery", "charging")
DEFAULT_CYCLE_MS = 20


def read(path: Path) -> Any:
    """The file, as cantools' Database. Raises DriveError."""
    import cantools  # late: only chairs with a DBC file need it

    try:
        return cantools.database.load_file(path, strict=True)
    except Exception as error:  # cantools raises its parser's own errors
        raise DriveError(f"drive.can.dbc.file: {path} cannot be read as a DBC file: {sentence(error)}") from error


def load(settings: DbcSettings, folder: Path) -> Any:
    """The file of the table, with every signal of the table found in it. Raises DriveError."""
    path = folder / settings.file
    database = read(path)
    for role in (*COMMAND_ROLES, *STATUS_ROLES):
        if name := getattr(settings, role):
            _find(database, role, name)
    if not any(getattr(settings, role) for role in STATUS_ROLES):
        raise DriveError(
            f"drive.can.dbc: {path.name} is used without a status signal ({', '.join(STATUS_ROLES)}): "
            "a controller that cannot be heard cannot be trusted to be there; name at least one"
        )
    for name in settings.fixed:
        _find(database, "fixed", name)
    return database


def _find(database: Any, role: str, name: str) -> tuple[Any, Any]:
    """Message and signal of "Message.Signal". Raises DriveError naming what there is."""
    message_name, _, signal_name = name.partition(".")
    try:
        message = database.get_message_by_name(message_name)
    except KeyError:
        known = ", ".join(sorted(m.name for m in database.messages)) or "none"
        raise DriveError(
            f"drive.can.dbc.{role} = '{name}': the file has no message '{message_name}' ({known})"
        ) from None
    for signal in message.signals:
        if signal.name == signal_name:
            return message, signal
    known = ", ".join(signal.name for signal in message.signals)
    raise DriveError(f"drive.can.dbc.{role} = '{name}': message {message_name} has no signal '{signal_name}' ({known})")


class _Outgoing:
    """One message we send: its signals' values, its counter, its checksum."""

    def __init__(self, message: Any, settings: DbcSettings) -> None:
        self.message, self._settings = message, settings
        self._count = 0
        self.fixed = {
            signal.name: settings.fixed.get(f"{message.name}.{signal.name}", signal.initial or 0)
            for signal in message.signals
        }
        self._counter = self._mine(settings.counter)
        self._checksum = self._mine(settings.checksum)
        if self._checksum and (self._checksum.length != 8 or self._checksum.start % 8 not in (0, 7)):
            raise DriveError(f"drive.can.dbc.checksum = '{settings.checksum}' is not one whole byte of its message")

    def _mine(self, name: str | None) -> Any:
        return next((s for s in self.message.signals if f"{self.message.name}.{s.name}" == name), None)

    def frame(self, values: dict[str, float]) -> Frame:
        """The next frame. Raises DriveError for a value that the DBC file does not allow."""
        filled = {**self.fixed, **{k: v for k, v in values.items() if k in self.fixed}}
        if self._counter:
            filled[self._counter.name] = self._count
            self._count = (self._count + 1) % (1 << self._counter.length)
        if self._checksum:
            filled[self._checksum.name] = 0
        try:
            data = bytearray(self.message.encode(filled, strict=True))
        except Exception as error:  # cantools' EncodeError and its relatives
            raise DriveError(
                f"drive.can.dbc: {self.message.name} cannot carry this command: {sentence(error)}"
            ) from error
        if self._checksum:
            place = self._checksum.start // 8
            data[place] = KINDS[self._settings.checksum_kind](bytes(data[:place] + data[place + 1 :]))
        return Frame(self.message.frame_id, bytes(data), extended=self.message.is_extended_frame)


class DbcDialect:
    """Sends the command messages every cycle, armed or not (a controller may want to hear "not enabled")."""

    def __init__(self, settings: CanSettings, database: Any) -> None:
        self._settings, self._table = settings, settings.dbc
        names = {name.partition(".")[0] for role in COMMAND_ROLES if (name := getattr(self._table, role))}
        self._outgoing = [_Outgoing(database.get_message_by_name(name), self._table) for name in sorted(names)]
        self._ids = {(o.message.frame_id, o.message.is_extended_frame) for o in self._outgoing}
        status = {name for role in STATUS_ROLES if (name := getattr(self._table, role))}
        self._incoming = {
            (message.frame_id, message.is_extended_frame): message
            for message in database.messages
            if any(name.startswith(f"{message.name}.") for name in status)
        }
        cycles = [o.message.cycle_time for o in self._outgoing if o.message.cycle_time]
        self.period_ns = (self._table.cycle_ms or min(cycles, default=DEFAULT_CYCLE_MS)) * MS
        self.window = 2 * len(self._outgoing)
        self.quiet_ns = max(2 * self.period_ns, self._table.status_ms * MS)
        self._scales = {
            f"{o.message.name}.{signal.name}": abs(float(signal.scale))
            for o in self._outgoing
            for signal in o.message.signals
        }
        self._known: dict[str, float] = {}
        self._heard_ns = 0
        self._armed = self._accepted = False

    def is_command(self, frame: Frame) -> bool:
        return (frame.id, frame.extended) in self._ids

    def setup(self, _now_ns: int) -> Sequence[Frame]:
        return ()

    def hear(self, frame: Frame, now_ns: int, _motion: Motion | None) -> Sequence[Frame]:
        message = self._incoming.get((frame.id, frame.extended))
        if message is None or frame.remote:
            return ()
        try:
            values = message.decode(frame.data, decode_choices=False)
        except Exception:  # noqa: BLE001 - a frame of the wrong length or multiplexer is not an answer: as if unheard
            return ()
        self._heard_ns = now_ns
        self._known.update({f"{message.name}.{name}": float(value) for name, value in values.items()})
        accepts = self._value(self._table.armed)
        if self._armed and self._accepted and accepts == 0.0:
            self._armed = False
        self._accepted = bool(accepts)
        if (
            self._value(self._table.fault)
            or self._value(self._table.charging)
            or self._value(self._table.stopped_by_user)
        ):
            self._armed = False
        return ()

    def arm(self, _now_ns: int) -> Sequence[Frame]:
        if code := self._value(self._table.fault):
            raise DriveError(f"drive.can: the controller reports fault {code:g} ({self._table.fault}); clear it first")
        if self._value(self._table.stopped_by_user):
            raise DriveError(f"drive.can: {self._table.stopped_by_user} is active; release the stop or the joystick")
        if self._value(self._table.charging):
            raise DriveError("drive.can: a charger is connected; unplug it")
        self._armed = True
        return ()

    def disarm(self, now_ns: int) -> Sequence[Frame]:
        self._armed = False
        return self.command(now_ns, STILL, False)

    def command(self, _now_ns: int, motion: Motion, hard_stop: bool) -> Sequence[Frame]:
        table = self._table
        drive, turn = signed(motion if self._armed else STILL, self._settings)
        values = {table.forward: drive * table.forward_per_mm_s, table.turn: turn * table.turn_per_deg_s}
        values = {name: self._whole_steps(name, value) for name, value in values.items()}
        if table.enable:
            stop = table.enable_stop if hard_stop and table.enable_stop is not None else table.enable_off
            values[table.enable] = table.enable_on if self._armed and not hard_stop else stop
        return [
            outgoing.frame({name.partition(".")[2]: v for name, v in values.items() if _in(name, outgoing)})
            for outgoing in self._outgoing
        ]

    def report(self, _now_ns: int) -> Report:
        table = self._table
        fault, speed, turning = self._value(table.fault), self._value(table.speed), self._value(table.turning)
        battery = self._value(table.battery)
        return Report(
            heard_ns=self._heard_ns,
            ready=True,
            armed=self._armed and (table.armed is None or bool(self._value(table.armed))),
            fault=f"drive.can: the controller reports fault {fault:g} ({table.fault})" if fault else "",
            speed_mm_s=None if speed is None else speed * table.speed_mm_s_per_unit * self._settings.drive_sign,
            turn_deg_s=None if turning is None else turning * table.turning_deg_s_per_unit * self._settings.turn_sign,
            stopped_by_user=bool(self._value(table.stopped_by_user)),
            battery=None if battery is None else min(1.0, max(0.0, battery / table.battery_full)),
            charging=bool(self._value(table.charging)),
        )

    def farewell(self, now_ns: int) -> Sequence[Frame]:
        self._armed = False
        return self.command(now_ns, STILL, True)

    def _whole_steps(self, name: str, value: float) -> float:
        """The value cut to the signal's resolution towards zero, so that rounding never makes the chair faster."""
        scale = self._scales[name]
        return trunc(value / scale + (1e-9 if value / scale >= 0 else -1e-9)) * scale

    def _value(self, name: str | None) -> float | None:
        return self._known.get(name) if name else None


def _in(name: str, outgoing: _Outgoing) -> bool:
    return bool(name.partition(".")[0] == outgoing.message.name)
