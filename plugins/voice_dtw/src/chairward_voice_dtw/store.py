"""A person's own recordings on disk: wav files and one versioned index, replaced in one step.

    <person_dir>/words/words.json      {"version": 1, "words": {"stop": [{"file": "stop_1.wav", "recorded": "..."}]}}
    <person_dir>/words/*.wav           16 kHz, 16 bit, one word each

A word's old recordings stay until the new ones are complete: files first, then the index, then what nobody names goes.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from chairward_voice_dtw import drift
from chairward_voice_dtw.audio import Floats, SoundError, read_wav
from chairward_voice_dtw.streams import STREAM_HZ

VERSION = 1
FOLDER = "words"
INDEX = "words.json"
WORD_SET = r"[a-z0-9_]{0,20}"


class StoreError(ValueError):
    """The store of a person's words cannot be read or written: one sentence with the file."""


def folder_of(people: Path, person: str) -> Path:
    """A person's own folder among all people's. Raises StoreError for a name that would lead out of it."""
    if person in ("", ".", "..") or "\0" in person or Path(person).name != person:
        raise StoreError(f"'{person}' is not a person's name: it names one folder, without / in it")
    return people / person


class WordStore:
    """The words of one person; person_dir need not exist yet. word_set: "" is the usual voice, "hoarse" another.

    Raises StoreError for a set that cannot be called so.
    """

    def __init__(self, person_dir: Path, word_set: str = "") -> None:
        if not re.fullmatch(WORD_SET, word_set):
            raise StoreError(f"'{word_set}' cannot be a set's name: use up to 20 small letters, digits and _")
        self.folder = person_dir / (f"{FOLDER}-{word_set}" if word_set else FOLDER)

    def files(self) -> dict[str, list[Path]]:
        """Recordings by word; empty when nothing has been recorded. Raises StoreError for a broken index."""
        return {word: [self.folder / entry["file"] for entry in entries] for word, entries in self._read().items()}

    def replace(self, word: str, recordings: Sequence[Floats]) -> list[Path]:
        """Make these (at STREAM_HZ) the recordings of `word`, in place of older ones; the files' paths."""
        words = self._read()
        words[word] = [self._write(word, samples) for samples in recordings]
        if not words[word]:
            del words[word]
        self._commit(words)
        drift.forget(self.folder)
        return self.files().get(word, [])

    def add(self, word: str, samples: Floats) -> Path:
        """One more recording of `word`."""
        words = self._read()
        entry = self._write(word, samples)
        if all(entry["file"] != e["file"] for e in words.get(word, [])):
            words.setdefault(word, []).append(entry)
        self._commit(words)
        return self.folder / str(entry["file"])

    def remove(self, word: str) -> None:
        """Forget a word. Raises StoreError when it is not there."""
        words = self._read()
        if word not in words:
            raise StoreError(
                f"{self.folder}: there is no word '{word}' (recorded: {', '.join(sorted(words)) or 'none'})"
            )
        del words[word]
        self._commit(words)

    def _read(self) -> dict[str, list[dict[str, Any]]]:
        path = self.folder / INDEX
        if not path.exists():
            return {}
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            version, words = data["version"], data["words"]
            if version != VERSION:
                raise StoreError(
                    f"{path}: written by another version ({version}, this one reads {VERSION}): import the words again"
                )
            for entries in words.values():
                for entry in entries:
                    str(entry["file"])
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            if isinstance(error, StoreError):
                raise
            raise StoreError(
                f"{path}: cannot be read ({error}): restore it from a copy, or record the words again"
            ) from None
        return dict(words)

    def _write(self, word: str, samples: Floats) -> dict[str, Any]:
        import soundfile  # type: ignore[import-untyped,unused-ignore]

        self.folder.mkdir(parents=True, exist_ok=True)
        pcm = (np.clip(samples, -1.0, 1.0) * 32767.0).astype("<i2")
        plain = re.sub(r"[^\w-]+", "-", word).strip("-") or "word"
        name = f"{plain}_{sha256(word.encode() + pcm.tobytes()).hexdigest()[:12]}.wav"
        part = self.folder / (name + ".part")
        soundfile.write(str(part), pcm, STREAM_HZ, format="WAV", subtype="PCM_16")
        part.replace(self.folder / name)
        return {"file": name, "recorded": datetime.now(UTC).isoformat(timespec="seconds")}

    def _commit(self, words: Mapping[str, Sequence[Mapping[str, Any]]]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        part = self.folder / (INDEX + ".part")
        with part.open("w", encoding="utf-8") as file:
            json.dump({"version": VERSION, "words": words}, file, ensure_ascii=False, indent=1)
            file.flush()
            os.fsync(file.fileno())
        part.replace(self.folder / INDEX)
        named = {str(entry["file"]) for entries in words.values() for entry in entries}
        for path in self.folder.glob("*.wav"):
            if path.name not in named:
                path.unlink()


def enrol(person_dir: Path, word: str, wav_files: Sequence[Path]) -> list[Path]:
    """Make these wav files (any rate and width) the recordings of `word`, unchecked. Raises SoundError, StoreError.

    The command line checks first (`enrolment.check`); programs that bring their own recordings use this.
    """
    if not wav_files:
        raise SoundError(f"word '{word}': no recordings were given")
    return WordStore(person_dir).replace(word, [read_wav(path, STREAM_HZ)[0] for path in wav_files])
