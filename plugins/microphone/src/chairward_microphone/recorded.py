"""Recorded sound as a source: a list of files, or words of a manifest over a low room noise, paced or flat out."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from chairward.components import Context, EndOfInput
from chairward.stages import AudioBlock, Floats
from chairward_microphone.settings import MicrophoneSettings
from chairward_microphone.sound import SoundFileError, read_sound, word_bounds, words_of


@dataclass(frozen=True, slots=True)
class Piece:
    """Sound to play; word "" for what is not a word. first, last: bounds of the word in it, in samples."""

    samples: Floats
    word: str = ""
    first: int = 0
    last: int = 0


def pieces(settings: MicrophoneSettings) -> list[Piece]:
    """All that will be played, read and checked before the first block. Raises SoundFileError."""
    rate = settings.rate_hz
    if settings.kind == "files":
        if not settings.files:
            raise SoundFileError("microphone.files is empty: name at least one sound file")
        return [Piece(read_sound(path, rate)) for path in settings.files]
    if settings.manifest is None:
        raise SoundFileError("microphone.kind is 'manifest' but microphone.manifest is not set: name the csv file")
    rng = np.random.default_rng(7)

    def room(seconds: float) -> Floats:
        level = 10.0 ** (settings.floor_dbfs / 20.0)
        return rng.normal(0.0, level, int(seconds * rate)).astype(np.float32)

    out = [Piece(room(settings.lead_s))]
    for item in words_of(settings.manifest, settings.speaker, settings.playlist):
        clip = read_sound(item.path, rate)
        first, last = word_bounds(clip, rate)
        loud = float(np.sqrt(np.mean(np.square(clip[first:last])) + 1e-12))
        clip = np.clip(clip * np.float32(10.0 ** (settings.level_dbfs / 20.0) / loud), -1.0, 1.0)
        clip = clip + room(len(clip) / rate + 1.0)[: len(clip)]
        out += [Piece(clip, item.word, first, last), Piece(room(settings.gap_s))]
    return out


class RecordedSound:
    """Yields AudioBlock of 10 ms. Paced, captured_ns is when the sound would have been there (CLOCK_MONOTONIC-true);
    flat out, it runs at the sound's own speed from the moment of opening. Words go to `<lane>-truth.jsonl`."""

    def __init__(self, settings: MicrophoneSettings, context: Context) -> None:
        self._settings = settings
        self._truth_path = context.run_dir / f"{context.lane}-truth.jsonl"
        self._truth: TextIO | None = None
        self._blocks: Iterator[Floats] | None = None
        self._block_samples = settings.rate_hz // 100
        self._start_ns = 0
        self._sent = 0
        self._seq = 0

    def open(self) -> None:
        """Read everything. Raises SoundFileError (a DeviceLost) with one sentence."""
        self.close()
        loaded = pieces(self._settings)
        self._truth_path.parent.mkdir(parents=True, exist_ok=True)
        self._truth = self._truth_path.open("a", encoding="utf-8")
        self._start_ns = time.monotonic_ns()
        self._sent = 0
        self._blocks = self._cut(loaded)

    def _cut(self, loaded: list[Piece]) -> Iterator[Floats]:
        rest = np.zeros(0, np.float32)
        told = 0
        while True:
            for piece in loaded:
                if piece.word:
                    self._tell(piece, told)
                told += len(piece.samples)
                rest = np.concatenate([rest, piece.samples])
                whole = len(rest) // self._block_samples
                for i in range(whole):
                    yield rest[i * self._block_samples : (i + 1) * self._block_samples]
                rest = rest[whole * self._block_samples :]
            if not self._settings.loop:
                break
        if len(rest):
            yield np.pad(rest, (0, self._block_samples - len(rest)))

    def _time_ns(self, sample: int) -> int:
        return self._start_ns + sample * 1_000_000_000 // self._settings.rate_hz

    def _tell(self, piece: Piece, at: int) -> None:
        assert self._truth is not None
        line = {
            "captured_ns": self._time_ns(at + piece.first),
            "end_ns": self._time_ns(at + piece.last),
            "word": piece.word,
        }
        self._truth.write(json.dumps(line, ensure_ascii=False) + "\n")
        self._truth.flush()

    def read(self, timeout_s: float) -> AudioBlock | None:
        """The next 10 ms, when they are over; None when that takes longer than timeout_s. Raises EndOfInput."""
        if self._blocks is None:
            raise SoundFileError("microphone: read before open")
        if self._settings.paced:
            due_ns = self._time_ns(self._sent + self._block_samples)
            wait_s = (due_ns - time.monotonic_ns()) / 1e9
            if wait_s > timeout_s:
                time.sleep(timeout_s)
                return None
            if wait_s > 0.0:
                time.sleep(wait_s)
        samples = next(self._blocks, None)
        if samples is None:
            raise EndOfInput("the recorded sound is over")
        block = AudioBlock(
            samples=samples, rate_hz=self._settings.rate_hz, captured_ns=self._time_ns(self._sent), seq=self._seq
        )
        self._sent += len(samples)
        self._seq += 1
        return block

    def close(self) -> None:
        """May be called twice."""
        self._blocks = None
        if self._truth is not None:
            self._truth.close()
            self._truth = None
