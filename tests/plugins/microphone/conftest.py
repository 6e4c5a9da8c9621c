"""Small sound files and manifests, made on the spot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from chairward.components import Context


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """A lane called voice whose run folder is the test's own."""
    return Context(lane="voice", run_dir=tmp_path / "run", chair_dir=tmp_path)


@pytest.fixture
def manifest(tmp_path: Path) -> Path:
    """Two speakers, one take of left and two of stop, at 8 kHz: 0.2 s of tone between 0.1 s of silence."""
    lines = ["path,word,speaker,role,source"]
    for speaker in ("anna", "bo"):
        for word, take in (("left", 1), ("stop", 1), ("stop", 2)):
            tone = 0.3 * np.sin(2 * np.pi * (500 + 100 * take) * np.arange(1600) / 8000)
            name = f"{speaker}_{word}_{take}.wav"
            soundfile.write(str(tmp_path / name), np.pad(tone, 800), 8000)
            lines.append(f"{name},{word},{speaker},test,made")
            lines.append(f"{name},{word},{speaker},template,made")
    path = tmp_path / "words.csv"
    path.write_text("\n".join(lines) + "\n")
    return path
