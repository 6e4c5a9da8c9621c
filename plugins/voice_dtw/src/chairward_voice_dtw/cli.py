"""`chairward words ...`: record, import, list, test and evaluate a person's words."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

if TYPE_CHECKING:
    from chairward_voice_dtw.store import WordStore
from chairward_voice_dtw.settings import EngineName, VoiceSettings

words = typer.Typer(help="A person's own words: record, import, list, try, evaluate.", no_args_is_help=True)

Person = Annotated[str, typer.Option("--person", help="whose words")]
Folder = Annotated[
    Path | None, typer.Option("--dir", help="folder of the person's recordings (default: the user's data folder)")
]

WordSet = Annotated[
    str,
    typer.Option("--set", help="another set of recordings of the same person: tired, hoarse; empty: the usual voice"),
]

StopWord = Annotated[str, typer.Option("--stop-word", help="the word that means stop")]


def people_dir() -> Path:
    """The folder with one folder for each person: what `chairward.profile` uses too."""
    import platformdirs

    return Path(platformdirs.user_data_dir("chairward")) / "people"


def person_dir(person: str, folder: Path | None) -> Path:
    """Where a person's recordings are kept. Raises StoreError."""
    from chairward_voice_dtw.store import folder_of

    return folder_of(people_dir(), person) if folder is None else folder


def fail(error: Exception) -> typer.Exit:
    """One sentence on stderr, exit code 1."""
    said = str(error)
    if isinstance(error, OSError):
        said = f"{error.filename} cannot be written ({error.strerror}): choose another folder by --dir"
    typer.echo(f"chairward words: {said}", err=True)
    return typer.Exit(1)


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
    """What would be heard in these sound files, and how surely: by the recogniser that drives."""
    from chairward_voice_dtw.audio import SoundError, read_wav
    from chairward_voice_dtw.engine import Thresholds, Voice
    from chairward_voice_dtw.store import StoreError, WordStore
    from chairward_voice_dtw.streams import STREAM_HZ
    from chairward_voice_dtw.templates import from_files
    from chairward_voice_dtw.trial import hear

    usual = VoiceSettings()
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


@words.command()
def evaluate(
    manifest: Annotated[Path, typer.Argument(help="csv with path, word, speaker, role, source")],
    templates: Annotated[int, typer.Option("--templates", min=1, max=20, help="recordings of each word to use")] = 3,
    snr: Annotated[str, typer.Option("--snr", help="comma separated: clean or dB")] = "clean,20,10,5",
    hours: Annotated[float, typer.Option("--hours", min=0.0, help="of sound without commands")] = 3.0,
    engine: Annotated[str, typer.Option("--engine", help=", ".join(get_args(EngineName)))] = "default",
    placements: Annotated[int, typer.Option("--placements", min=1, help="streams for each speaker and SNR")] = 2,
    stop_word: StopWord = "stop",
    seed: Annotated[int, typer.Option("--seed", min=0, help="of places, noises and levels")] = 1,
    threshold: Annotated[float, typer.Option("--threshold", help="log-odds a word needs")] = VoiceSettings().threshold,
    stop_threshold: Annotated[
        float, typer.Option("--stop-threshold", help="log-odds the stop word needs")
    ] = VoiceSettings().stop_threshold,
    processes: Annotated[int, typer.Option("--processes", min=0, help="0: up to two")] = 0,
    embedding: Annotated[
        bool, typer.Option("--embedding/--no-embedding", help="use the speech embedding where it is installed")
    ] = True,
    variant: Annotated[str, typer.Option("--variant", help="usual, slow, slurred, loud, soft")] = "usual",
    quick: Annotated[bool, typer.Option("--quick", help="one placement, 6 minutes without commands")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="the whole report as JSON")] = False,
) -> None:
    """Measure accuracy, rejection, latency and false accepts on recordings, through the streaming path."""
    from chairward_voice_dtw.audio import SoundError
    from chairward_voice_dtw.evaluate import Plan
    from chairward_voice_dtw.evaluate import evaluate as run
    from chairward_voice_dtw.variants import VARIANTS

    try:
        snrs = tuple(None if part.strip() == "clean" else float(part) for part in snr.split(","))
    except ValueError:
        raise fail(ValueError(f"--snr {snr}: write clean or numbers of dB, separated by commas")) from None
    if engine not in get_args(EngineName):
        raise fail(ValueError(f"--engine {engine}: allowed are {', '.join(get_args(EngineName))}"))
    if variant not in VARIANTS:
        raise fail(ValueError(f"--variant {variant}: allowed are {', '.join(VARIANTS)}"))
    settings = VoiceSettings(threshold=threshold, stop_threshold=stop_threshold)
    plan = Plan(
        manifest=manifest.absolute(),
        templates=templates,
        snrs=snrs,
        hours=0.1 if quick else hours,
        placements=1 if quick else placements,
        engine=engine,  # type: ignore[arg-type]
        stop_word=stop_word,
        seed=seed,
        processes=processes,
        embedding=embedding,
        variant=variant,
        settings=settings,
    )
    try:
        result = run(plan, lambda line: typer.echo(line, err=True))
    except SoundError as error:
        raise fail(error) from None
    if as_json:
        typer.echo(json.dumps(result, ensure_ascii=False, indent=1))
        return
    for line in table(result):
        typer.echo(line)


def table(result: dict[str, Any]) -> list[str]:
    """The report's main figures, a line for each source and SNR."""
    columns: tuple[str, ...] = ("accuracy_pct", "closed_set_accuracy_pct", "stop_recall_pct", "unknown_accepted_pct")
    columns += ("unknown_accepted_at_95_pct", "cut_early_pct", "never_ended_pct", "undetected_pct")
    lines = [f"engine {result['engine']}, speech embedding {'used' if result['speech_embedding'] else 'not used'}"]
    for source, cells in result["sources"].items():
        lines.append(f"{source} ({next(iter(cells.values()))['speakers']} speakers)")
        for snr, figures in cells.items():
            parts = [
                f"{name.removesuffix('_pct')} {value['pct']} [{value['low']}..{value['high']}]"
                for name in columns
                if (value := figures[name])["n"]
            ]
            parts.append(f"EER {figures['equal_error_rate_pct']}")
            parts.append(
                f"end to intent p50/p95 {figures['end_to_intent_ms']['p50']}/{figures['end_to_intent_ms']['p95']} ms"
            )
            lines.append(f"  {snr}: n {figures['accuracy_pct']['n']}  " + "  ".join(parts))
    false = result["false_accepts_per_hour"]
    lines.append(
        f"false accepts an hour ({false['hours']} h): motion {false['motion']['per_hour']} "
        f"[{false['motion']['low']}..{false['motion']['high']}], stop {false['stop']['per_hour']}, "
        f"motion when armed {false['motion_armed']['per_hour']}"
    )
    lines += [
        f"  at threshold {p['threshold']:+.1f}: accuracy {p['accuracy_pct']['pct']}, "
        f"unknown accepted {p['unknown_accepted_pct']['pct']}, "
        f"false accepts an hour {p['false_accepts_per_hour']['per_hour']}"
        for p in result["operating_points"]
    ]
    lines.append(
        f"CPU: {result['cpu_ms_per_s']} ms per second of sound; deciding p50/p95 "
        f"{result['deciding_ms']['p50']}/{result['deciding_ms']['p95']} ms"
    )
    return lines
