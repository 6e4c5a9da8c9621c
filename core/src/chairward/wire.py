"""Sockets and codec between processes: AF_UNIX SOCK_SEQPACKET carrying msgpack of typed structs.

Whole messages or none (half a message cannot block the reader), sends never wait, a closed peer reads as b"".
Never pickle: a hostile message would run code in the guard. Never multiprocessing.Connection: it blocks on half a
message. Both were measured.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence

import msgspec

from chairward.messages import Name, Parcel

MAX_MESSAGE_BYTES = 4096
"""A longer message is refused at the border: no fact needs more."""

RECORD_BYTES = 262_144
"""Upper bound of one encoded record on an observer's socket."""

_parcel_encoder = msgspec.msgpack.Encoder()
_parcel_decoder = msgspec.msgpack.Decoder(Parcel)


class Heartbeat(msgspec.Struct, frozen=True, tag="heartbeat"):
    """Supervisor to guard, every 25 ms: still there."""


class Attach(msgspec.Struct, frozen=True, tag="attach"):
    """Supervisor to guard: a new socket for that lane comes with this message (SCM_RIGHTS)."""

    lane: Name


class Died(msgspec.Struct, frozen=True, tag="died"):
    """Supervisor to guard: that lane's process is gone, and how; for the reason that people read."""

    lane: Name
    reason: str


class Observe(msgspec.Struct, frozen=True, tag="observe"):
    """Supervisor to guard: one more observer; its socket comes with this message."""


class Quit(msgspec.Struct, frozen=True, tag="quit"):
    """Supervisor to guard: stop the chair, then leave."""


class GuardIsUp(msgspec.Struct, frozen=True, tag="up"):
    """Guard to supervisor, once: what the machine allowed. why: sentences for what it did not."""

    pid: int
    fifo: bool
    memory_locked: bool
    why: Sequence[str] = ()


class Note(msgspec.Struct, frozen=True, tag="note"):
    """Guard or lane to supervisor: a sentence for the log."""

    text: str


class Beat(msgspec.Struct, frozen=True, tag="beat"):
    """Lane to supervisor: still working.

    items: taken from the source; dropped: messages the guard did not take; lost: its device is not there.
    """

    items: int
    dropped: int
    ended: bool = False
    lost: bool = False


Control = Heartbeat | Attach | Observe | Died | Quit | GuardIsUp | Note | Beat
_control_decoder: msgspec.msgpack.Decoder[Control] = msgspec.msgpack.Decoder(Control)


def pair(buffer_bytes: int = 0) -> tuple[socket.socket, socket.socket]:
    """Two connected, non-blocking SEQPACKET ends; buffer_bytes: ask for that much room in each direction."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setblocking(False)
        if buffer_bytes:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, buffer_bytes)
    return ends


def adopt(fd: int) -> socket.socket:
    """The socket behind an inherited descriptor, non-blocking."""
    end = socket.socket(fileno=fd)
    end.setblocking(False)
    return end


def encode_parcel(parcel: Parcel) -> bytes:
    """A parcel as msgpack."""
    return _parcel_encoder.encode(parcel)


def decode_parcel(data: bytes) -> Parcel:
    """A parcel back. Raises msgspec.DecodeError, UnicodeDecodeError, and RecursionError for deep nesting."""
    return _parcel_decoder.decode(data)


def send(end: socket.socket, data: bytes) -> bool:
    """Send without waiting; False when there is no room now. Raises ConnectionError when the peer has gone."""
    try:
        end.send(data)
    except BlockingIOError:
        return False
    return True


def send_control(end: socket.socket, message: Control, fds: Sequence[int] = ()) -> bool:
    """Send a control message, with descriptors if any; False when it could not be sent."""
    try:
        socket.send_fds(end, [_parcel_encoder.encode(message)], list(fds))
    except (BlockingIOError, ConnectionError):
        return False
    return True


def receive(end: socket.socket, limit: int = MAX_MESSAGE_BYTES + 1) -> bytes | None:
    """The next whole message; b"" when the peer has closed, None when there is none now."""
    try:
        return end.recv(limit)
    except BlockingIOError:
        return None
    except ConnectionError:
        return b""


def receive_control(end: socket.socket) -> tuple[Control, list[int]] | None:
    """The next control message with its descriptors (the caller's to close); None when there is none now.

    What cannot be decoded comes as a Note that says so. Raises EOFError when the peer has closed.
    """
    try:
        data, fds, _, _ = socket.recv_fds(end, MAX_MESSAGE_BYTES, 4)
    except BlockingIOError:
        return None
    except ConnectionError as error:
        raise EOFError("the peer has closed its end") from error
    if not data:
        raise EOFError("the peer has closed its end")
    try:
        return _control_decoder.decode(data), list(fds)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        return Note(f"a control message that is none: {error}"[:300]), list(fds)
