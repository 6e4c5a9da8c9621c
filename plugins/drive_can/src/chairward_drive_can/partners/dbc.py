"""A simulated controller for any DBC file: believes checksum and counter, stops on silence, tells its status."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from chairward_drive_can.checksum import KINDS
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.partners.body import Body
from chairward_drive_can.settings import DbcSettings


@dataclass
class DbcChair:
    """full_*: signal values of full speed. Frames with a wrong checksum or a repeated counter are not obeyed."""

    table: DbcSettings
    database: Any
    full_forward: float = 0.5
    full_turn: float = 0.8
    silence_ms: int = 100
    status_ms: int = 20
    boot_ms: int = 0
    fault: int = 0
    user: int = 0
    battery: float = 80.0
    charging: int = 0
    body: Body = field(default_factory=Body)
    moves_heard: int = 0
    refused: int = 0
    enabled: bool = False
    _count: int | None = None
    _heard_ns: int = 0
    _last_ns: int = 0
    _due_ns: int = 0
    _born_ns: int = 0

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        """Obey a command message if it is whole."""
        if not self._born_ns or now_ns - self._born_ns < self.boot_ms * MS:
            return []
        wanted = {self.table.forward.partition(".")[0], self.table.turn.partition(".")[0]}
        for name in wanted:
            message = self.database.get_message_by_name(name)
            if (message.frame_id, message.is_extended_frame) == (frame.id, frame.extended):
                self._obey(message, frame, now_ns)
        return []

    def _obey(self, message: Any, frame: Frame, now_ns: int) -> None:
        if len(frame.data) != message.length or not self._whole(message, frame):
            self.refused += 1
            return
        values = {f"{message.name}.{k}": v for k, v in message.decode(frame.data, decode_choices=False).items()}
        self._heard_ns = now_ns
        if self.table.enable in values:
            self.enabled = values[self.table.enable] == self.table.enable_on
            if self.table.enable_stop is not None and values[self.table.enable] == self.table.enable_stop:
                self.body.halt()
                return
        forward, turn = float(values.get(self.table.forward, 0.0)), float(values.get(self.table.turn, 0.0))
        self.moves_heard += forward != 0.0 or turn != 0.0
        allowed = (self.enabled or self.table.enable is None) and not (self.fault or self.user)
        self.body.aim(forward / self.full_forward if allowed else 0.0, turn / self.full_turn if allowed else 0.0)

    def _whole(self, message: Any, frame: Frame) -> bool:
        for signal in message.signals:
            name = f"{message.name}.{signal.name}"
            if name == self.table.checksum:
                place = signal.start // 8
                rest = frame.data[:place] + frame.data[place + 1 :]
                if KINDS[self.table.checksum_kind](rest) != frame.data[place]:
                    return False
        if self.table.counter and self.table.counter.startswith(f"{message.name}."):
            count = int(message.decode(frame.data, decode_choices=False)[self.table.counter.partition(".")[2]])
            repeated, self._count = count == self._count, count
            return not repeated
        return True

    def tick(self, now_ns: int) -> list[Frame]:
        """Status when due; standing after silence."""
        self.body.step(max(0, now_ns - (self._last_ns or now_ns)) / 1e9)
        self._last_ns = now_ns
        if now_ns - self._heard_ns > self.silence_ms * MS:
            self.body.aim(0.0, 0.0)
            self.enabled = False
        if self.user:
            self.body.halt()
        self._born_ns = self._born_ns or now_ns
        if now_ns < self._due_ns or now_ns - self._born_ns < self.boot_ms * MS:
            return []
        self._due_ns = now_ns + self.status_ms * MS
        values = {
            self.table.speed: self.body.forward * self.full_forward,
            self.table.turning: self.body.left * self.full_turn,
            self.table.fault: self.fault,
            self.table.stopped_by_user: self.user,
            self.table.armed: int(self.enabled),
            self.table.battery: self.battery,
            self.table.charging: self.charging,
        }
        named = {name: value for name, value in values.items() if name}
        frames = []
        for message in self.database.messages:
            mine = {s.name: named.get(f"{message.name}.{s.name}") for s in message.signals}
            if any(value is not None for value in mine.values()):
                data = message.encode({k: v or 0 for k, v in mine.items()}, strict=False)
                frames.append(Frame(message.frame_id, bytes(data), extended=message.is_extended_frame))
        return frames
