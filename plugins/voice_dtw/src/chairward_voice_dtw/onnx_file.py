"""The constant arrays of an ONNX file, without a runtime: enough of the protocol buffer format to find them.

ModelProto.graph is field 7, GraphProto.initializer 5, and of a TensorProto: dims 1, data_type 2, float_data 4, name 8,
raw_data 9 (onnx.proto of the ONNX project). Arrays that are not 32-bit floats are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

FLOAT = 1


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """(field number, value) in order; groups do not occur in ONNX files."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(data, at)
            yield key >> 3, value
            continue
        if kind == 2:
            size, at = _varint(data, at)
        elif kind in (1, 5):
            size = 8 if kind == 1 else 4
        else:
            raise ValueError(f"wire type {kind}")
        if at + size > len(data):
            raise ValueError("the file ends inside a field")
        yield key >> 3, data[at : at + size]
        at += size


def _messages(data: bytes, number: int) -> Iterator[bytes]:
    return (value for field, value in _fields(data) if field == number and isinstance(value, bytes))


def _dimensions(tensor: bytes) -> list[int]:
    sizes: list[int] = []
    for field, value in _fields(tensor):
        if field == 1 and isinstance(value, int):
            sizes.append(value)
        elif field == 1 and isinstance(value, bytes):
            at = 0
            while at < len(value):
                size, at = _varint(value, at)
                sizes.append(size)
    return sizes


def read_arrays(path: Path) -> dict[str, npt.NDArray[np.float32]]:
    """Float arrays of the file by name. Raises ValueError for a file that is not ONNX, OSError."""
    arrays: dict[str, npt.NDArray[np.float32]] = {}
    try:
        for graph in _messages(path.read_bytes(), 7):
            for tensor in _messages(graph, 5):
                parts = dict(_fields(tensor))
                raw = parts.get(9, parts.get(4, b""))
                if parts.get(2) == FLOAT and isinstance(raw, bytes):
                    name = parts.get(8, b"")
                    assert isinstance(name, bytes)
                    arrays[name.decode()] = np.frombuffer(raw, "<f4").reshape(_dimensions(tensor)).astype(np.float32)
    except (IndexError, UnicodeDecodeError, ValueError) as error:
        raise ValueError(f"{path}: is not an ONNX file that can be read ({error})") from None
    return arrays
