"""Frames in words, for `chairward can monitor`: R-Net, any DBC file, CANopen with CiA 402. Never raises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from chairward_drive_can import rnet
from chairward_drive_can.canopen_frames import sdo_answer
from chairward_drive_can.cia402 import state_of
from chairward_drive_can.frames import Frame

NMT_COMMANDS = {0x01: "start", 0x02: "stop", 0x80: "pre-operational", 0x81: "reset", 0x82: "reset communication"}
NMT_STATES = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
CONTROL_WORDS = {0x06: "shut down", 0x07: "switch on", 0x0F: "enable", 0x02: "quick stop", 0x80: "reset fault"}


def describe_rnet(frame: Frame) -> str:
    """What an R-Net frame says; "" when nobody knows."""
    return str(rnet.decode(frame) or "")


def describe_canopen(frame: Frame) -> str:
    """What a CANopen frame says, PDOs as this plugin maps them."""
    if frame.extended:
        return ""
    kind, node, data = frame.id & 0x780, frame.id & 0x7F, frame.data
    if frame.id == 0 and len(data) == 2:
        return f"NMT {NMT_COMMANDS.get(data[0], hex(data[0]))} {f'node {data[1]}' if data[1] else 'all nodes'}"
    if frame.id == 0x080:
        return "SYNC"
    if kind == 0x080 and len(data) == 8:
        return f"node {node} emergency 0x{int.from_bytes(data[:2], 'little'):04X}"
    if kind == 0x180 and len(data) == 6:
        speed = int.from_bytes(data[2:], "little", signed=True)
        return f"node {node} {state_of(int.from_bytes(data[:2], 'little'))}, velocity {speed}"
    if kind == 0x200 and len(data) == 6:
        word = int.from_bytes(data[:2], "little")
        velocity = int.from_bytes(data[2:], "little", signed=True)
        return f"to node {node}: {CONTROL_WORDS.get(word, hex(word))}, velocity {velocity}"
    if kind == 0x580 and (answer := sdo_answer(data)):
        said = answer.reason if answer.abort else "written" if answer.value is None else f"is 0x{answer.value:X}"
        return f"node {node} SDO 0x{answer.index:04X}:{answer.sub:02X} {said}"
    if kind == 0x600 and len(data) == 8:
        what = "read" if data[0] == 0x40 else f"write 0x{int.from_bytes(data[4:], 'little'):X}"
        return f"to node {node}: SDO 0x{data[1] | data[2] << 8:04X}:{data[3]:02X} {what}"
    if kind == 0x700 and len(data) == 1:
        return f"node {node} {NMT_STATES.get(data[0] & 0x7F, hex(data[0]))}"
    return ""


def describe_dbc(database: Any) -> Callable[[Frame], str]:
    """What the file says of a frame: message and signals with units."""

    def describe(frame: Frame) -> str:
        for message in database.messages:
            if (message.frame_id, message.is_extended_frame) == (frame.id, frame.extended):
                try:
                    values = message.decode(frame.data)
                except Exception as error:  # noqa: BLE001 - whatever cantools says of a broken frame is worth showing
                    return f"{message.name}: cannot be decoded ({type(error).__name__})"
                units = {signal.name: signal.unit or "" for signal in message.signals}
                parts = (
                    f"{k} {round(v, 6) if isinstance(v, float) else v} {units[k]}".strip() for k, v in values.items()
                )
                return f"{message.name}: {', '.join(parts)}"
        return ""

    return describe
