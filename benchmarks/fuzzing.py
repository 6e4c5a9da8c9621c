"""Runs atheris for fuzz_pic.py and fuzz_can.py and writes down how far it came."""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from report import machine, save


def fuzz(name: str, functions: Sequence[Any], one: Callable[[bytes, Any], None], *, max_len: int) -> int:
    """Fuzz for sys.argv[1] seconds (60); results/NAME.json says how many inputs there were, and which one broke it.

    one: data, and an atheris FuzzedDataProvider over it. Returns an exit code.
    """
    try:
        atheris: Any = importlib.import_module("atheris")
    except ImportError:
        print("atheris is not installed: pip install atheris", file=sys.stderr)
        return 2
    seconds = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    for function in functions:
        function.__code__ = atheris.instrument_func(function).__code__
    inputs, start, broken = 0, time.monotonic(), ""

    def counted(data: bytes) -> None:
        nonlocal inputs, broken
        inputs += 1
        try:
            one(data, atheris.FuzzedDataProvider(data))
        except BaseException as error:
            broken = f"{type(error).__name__}: {error}; input {data.hex()}"
            raise
        finally:
            if broken or inputs % 1000 == 0:  # libFuzzer ends the process by itself
                told()

    def told() -> None:
        result = {
            "what": "coverage-guided fuzzing (atheris); broken: the first input that raised or armed, none is wanted",
            "functions": len(functions),
            "inputs": inputs,
            "seconds": round(time.monotonic() - start, 1),
            "broken": broken,
        }
        save(name, result | machine())

    atheris.Setup([sys.argv[0], f"-max_total_time={seconds}", f"-max_len={max_len}"], counted)
    atheris.Fuzz()
    return 0
