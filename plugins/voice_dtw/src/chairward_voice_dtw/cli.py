"""`chairward words ...`: record, import, list and try a person's words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chairward_voice_dtw.cli_evaluate import evaluate
from chairward_voice_dtw.options import Folder, Person, StopWord, WordSet, fail, people_dir, person_dir
from chairward_voice_dtw.settings import VoiceSettings

if TYPE_CHECKING:
    from chairward_voice_dtw.store import WordStore

words = typer.Typer(help="A person's own words: record, import, list, try, evaluate.", no_args_is_help=True)


@words.command("list")
def list_words(person: Person, folder: Folder = None, word_set: WordSet = "") -> None:
    """The words that are stored, how far apart they are, and whether the voice has changed since."""
    from chairward_voice_dtw import drift
    from chairward_voice_dtw.audio import SoundError
    from chairward_voice_dtw.enrolment import separability
    from chairward_voice_dtw.store import StoreError, WordStore
    from chairward_voice_dtw.templates import from_files

    try:
        where = person_dir(person, folder)
        store = WordStore(where, word_set)
        files = store.files()
        if not files:
            typer.echo(f"{person} has no recorded words yet ({where}); record them with 'chairward words record'")
            return
        found = separability(from_files(files))
    except (StoreError, SoundError) as error:
        raise fail(error) from None
    for word, paths in sorted(files.items()):
        near, ratio = found.nearest[word]
        beside = f"nearest word '{near}', {ratio:.1f} times as far as its own repetitions" if near else "the only word"
        typer.echo(f"{word}: {len(paths)} recording(s), {beside}")
    for sentence in [*found.warnings, drift.proposal(store.folder)]:
        if sentence:
            typer.echo(sentence)


@words.command("import")
def import_words(
    word: Annotated[str, typer.Argument(help="the word that is said")],
    files: Annotated[list[Path], typer.Argument(help="3 to 5 sound files, one repetition each")],
    person: Person,
    folder: Folder = None,
    force: Annotated[bool, typer.Option("--force", help="keep recordings that look wrong")] = False,
    word_set: WordSet = "",
) -> None:
    """Make sound files (any rate and width) the recordings of a word; the old ones stay unless all is well."""
    from chairward_voice_dtw.audio import SoundError, read_wav
    from chairward_voice_dtw.store import StoreError, WordStore
    from chairward_voice_dtw.streams import STREAM_HZ

    try:
        store = WordStore(person_dir(person, folder), word_set)
        keep(word, [(str(path), read_wav(path, STREAM_HZ)[0]) for path in files], store, person, force=force)
    except (SoundError, StoreError, OSError) as error:
        raise fail(error) from None


def keep(word: str, recordings: list[Any], store: WordStore, person: str, *, force: bool, trial: Any = None) -> None:
    """Check repetitions and store them when they are good. Raises SoundError, StoreError.

    trial: one more recording (samples at STREAM_HZ), which the new recordings must recognise among the other words.
    """
    from chairward_voice_dtw.audio import SoundError
    from chairward_voice_dtw.enrolment import check, separability, tried
    from chairward_voice_dtw.templates import from_files

    problems = check(word, recordings)
    if not problems and trial is not None:
        problems += tried(word, recordings, trial, store.files())
    for problem in problems:
        typer.echo(problem, err=True)
    if problems and not force:
        raise SoundError(f"'{word}' was not stored; record the refused repetitions again, or insist with --force")
    store.replace(word, [samples for _, samples in recordings])
    typer.echo(f"stored {len(recordings)} recording(s) of '{word}' for {person} in {store.folder}")
    for sentence in separability(from_files(store.files())).warnings:
        typer.echo(sentence)


@words.command()
def record(
    word: Annotated[str, typer.Argument(help="the word to record")],
    person: Person,
    folder: Folder = None,
    times: Annotated[int, typer.Option("--times", min=1, max=10, help="repetitions")] = 4,
    device: Annotated[str, typer.Option("--device", help="part of the input's name; empty: the default")] = "",
    force: Annotated[bool, typer.Option("--force", help="keep recordings that look wrong")] = False,
    word_set: WordSet = "",
) -> None:
    """Record a word a few times from the microphone, with a level meter, try it, and store it if it is recognised."""
    from chairward_voice_dtw.audio import SoundError
    from chairward_voice_dtw.recorder import find_input, record_once
    from chairward_voice_dtw.store import StoreError, WordStore

    try:
        store = WordStore(person_dir(person, folder), word_set)
        store.folder.mkdir(parents=True, exist_ok=True)
        find_input(device)
        recordings = []
        for number in range(1, times + 1):
            typer.prompt(f"press Enter, then say '{word}' ({number} of {times})", default="", show_default=False)
            recordings.append((f"repetition {number}", record_once(device)))
        typer.prompt(f"now try it: press Enter, then say '{word}' once more", default="", show_default=False)
        keep(word, recordings, store, person, force=force, trial=record_once(device))
    except (SoundError, StoreError, OSError) as error:
        raise fail(error) from None


@words.command("test")
def try_words(
    files: Annotated[list[Path], typer.Argument(help="sound files to try")],
    person: Person,
    folder: Folder = None,
    word_set: WordSet = "",
    stop_word: StopWord = "stop",
) -> None:
    """What would be heard in these sound files, and how surely: by the recogniser that drives, armed."""
    from chairward_voice_dtw.audio import SoundError, read_wav
    from chairward_voice_dtw.engine import Thresholds, Voice
    from chairward_voice_dtw.store import StoreError, WordStore
    from chairward_voice_dtw.streams import STREAM_HZ
    from chairward_voice_dtw.templates import from_files
    from chairward_voice_dtw.trial import hear

    usual = VoiceSettings(listening="armed")
    thresholds = Thresholds(word=usual.threshold, stop=usual.stop_threshold, stop_words=frozenset({stop_word}))
    try:
        stored = WordStore(person_dir(person, folder), word_set).files()
        if not stored:
            raise SoundError(f"{person} has no recorded words yet; record them with 'chairward words record'")
        voice = Voice(from_files(stored))
        for path in files:
            heard = hear(voice, thresholds, read_wav(path, STREAM_HZ)[0])
            if heard is None:
                typer.echo(f"{path}: nothing in it sounds like a word of {person}'s")
                continue
            said = f"heard '{heard.word}'" if heard.accepted else f"refused (nearest is '{heard.word}')"
            typer.echo(f"{path}: {said}, score {heard.score:.1f}, needed {thresholds.of(heard.word):.1f}")
    except (SoundError, StoreError) as error:
        raise fail(error) from None


@words.command()
def serve(
    people: Annotated[
        Path | None, typer.Option("--people", help="folder with one folder for each person (default: the user's data)")
    ] = None,
) -> None:
    """Answer a screen's words page: one JSON request a line on standard input, one JSON answer a line on output."""
    import sys

    from chairward_voice_dtw.words_desk import WordsDesk

    desk = WordsDesk(people or people_dir())
    for line in sys.stdin:
        typer.echo(desk.answer(line))


@words.command()
def show(path: Annotated[Path, typer.Argument(help="a sound file")]) -> None:
    """Draw the mel spectrum of a recording: a column for each 10 ms, low bands at the bottom."""
    from chairward_voice_dtw.audio import RATE_HZ, SoundError, read_wav
    from chairward_voice_dtw.frontend import MelStream

    try:
        mel = MelStream().push(read_wav(path, RATE_HZ)[0])
    except SoundError as error:
        raise fail(error) from None
    for row in shades(mel.T[::-1].tolist()):
        typer.echo(row)


def shades(bands: list[list[float]], inks: str = " .:-=+*#%@") -> list[str]:
    """Rows of power as characters: the darkest within 5 dB of the loudest, blank 50 dB under it."""
    from math import log10

    loudest = max((max(row, default=0.0) for row in bands), default=0.0) + 1e-12

    def ink(power: float) -> str:
        step = int((10.0 * log10((power + 1e-12) / loudest) + 50.0) / 5.0)
        return inks[min(max(step, 0), len(inks) - 1)]

    return ["".join(ink(power) for power in row) for row in bands]


words.command()(evaluate)
