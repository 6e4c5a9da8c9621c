"""Brings every figure that docs/safety.md quotes up to the result it links to, and every verdict up to its target.

.venv/bin/python benchmarks/quote.py        after a benchmark has written its JSON; then read the page again
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from urllib.parse import unquote

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "safety.md"
FIGURE = re.compile(r"\[([\d,.]+)\]\(\.\./(benchmarks/results/\w+\.json)#([\w./%,]+)\)")
TARGET = re.compile(r"(at (?:most|least)) ([\d,.]+)([^|]*\| \[)([\d,.]+)(\][^|]*\| )[a-z*]+ \|$", re.MULTILINE)


def quoted(match: re.Match[str]) -> str:
    """The link with the figure of today, with as many digits after the point and the same grouping."""
    said, path, key = match.groups()
    found = json.loads((ROOT / path).read_text())
    for part in map(unquote, key.split("/")):
        found = found[int(part)] if isinstance(found, list) else found[part]
    digits = len(said.partition(".")[2]) or (2 if isinstance(found, float) and found % 1 else 0)
    grouped = f"{found:,.{digits}f}"
    return match[0].replace(f"[{said}]", f"[{grouped if ',' in said else grouped.replace(',', '')}]", 1)


def judged(match: re.Match[str]) -> str:
    """The row with its verdict."""
    side, target, between, figure, after = match.groups()
    aim, got = (float(number.replace(",", "")) for number in (target, figure))
    kept = got <= aim if side == "at most" else got >= aim
    return f"{side} {target}{between}{figure}{after}{'kept' if kept else '**missed**'} |"


def main() -> None:
    """Read, replace, write."""
    PAGE.write_text(TARGET.sub(judged, FIGURE.sub(quoted, PAGE.read_text())))


if __name__ == "__main__":
    main()
