"""A frame as one readable line, for `chairward pic monitor`."""

from __future__ import annotations

from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.wire import Ask, Hello, Nak, Status


def describe(payload: bytes) -> str:
    """Payload without CRC -> one line; unknown ones as hex."""
    answer = wire.answer(payload)
    if isinstance(answer, Status):
        seen = ", ".join(flag.name.lower() for flag in answer.inputs if flag.name) or "nothing"
        fault = ", ".join(flag.name.lower() for flag in answer.fault if flag.name) or "none"
        return (
            f"<- {answer.seq:3} STATUS {answer.state.name} steer {answer.steer:+d} drive {answer.drive:+d} "
            f"battery {answer.battery} fault {fault} inputs {seen}"
        )
    if isinstance(answer, Hello):
        return (
            f"<- {answer.seq:3} HELLO protocol {answer.protocol} {answer.state.name} reset {answer.nonce} "
            f"({answer.reason.name}) timeout {answer.timeout_ms} ms"
        )
    if isinstance(answer, Nak):
        return f"<- {answer.seq:3} NAK {answer.why.name} {answer.state.name} last {answer.last}"
    if len(payload) >= 2 and payload[0] in set(Ask):
        kind, body = Ask(payload[0]), payload[2:]
        if kind == Ask.DRIVE and len(body) == 2:
            text = f"steer {wire.signed(body[0]):+d} drive {wire.signed(body[1]):+d}"
        else:
            text = " ".join(str(byte) for byte in body)
        return f"-> {payload[1]:3} {kind.name} {text}".rstrip()
    return f"?? {payload.hex(' ')}"
