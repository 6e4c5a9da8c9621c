"""The board's line: `$R,<count>,<ahead>,<left>,<right>,<behind>*<sum>` and a line feed. Pure.

count: 0..65535, one more with every line. The four echoes are millimetres; 0 means nothing within the ranger's reach,
-1 that this ranger does not answer. sum: the exclusive or of all bytes between `$` and `*`, two hex digits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce

WAYS = ("ahead", "left", "right", "behind")
NEAREST_MM, FARTHEST_MM = 20, 6000
"""What these rangers can measure; a figure outside is no echo."""
LONGEST_LINE = 64


@dataclass(frozen=True, slots=True)
class Echoes:
    """One line. ways: millimetres, 0 for nothing near, None for a ranger that does not answer."""

    count: int
    ways: Mapping[str, int | None]


def encode(count: int, echoes_mm: Mapping[str, int]) -> bytes:
    """The line as the board sends it."""
    body = ",".join(["R", str(count % 65536), *(str(echoes_mm[way]) for way in WAYS)]).encode()
    return b"$%s*%02X\n" % (body, checksum(body))


def checksum(body: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(int.__xor__, body, 0)


def newest(data: bytes) -> tuple[Echoes | None, bytes]:
    """(the last line in data that is whole and right, what is left of an unfinished one)."""
    *lines, rest = data.split(b"\n")
    found = next((echoes for echoes in map(decode, reversed(lines)) if echoes), None)
    return found, rest[-LONGEST_LINE:]


def decode(line: bytes) -> Echoes | None:
    """One line without its line feed; None when it is damaged or says what cannot be."""
    body, star, total = line[line.rfind(b"$") + 1 :].strip().partition(b"*")
    if not star or total != b"%02X" % checksum(body):
        return None
    name, *figures = body.split(b",")
    try:
        count, *echoes = [int(figure) for figure in figures]
    except ValueError:
        return None
    if name != b"R" or len(echoes) != len(WAYS) or not all(_can_be(echo) for echo in echoes):
        return None
    return Echoes(count, {way: None if echo == -1 else echo for way, echo in zip(WAYS, echoes, strict=True)})


def _can_be(echo: int) -> bool:
    return echo in (-1, 0) or NEAREST_MM <= echo <= FARTHEST_MM
