"""`chairward words evaluate`: the options of an evaluation, and its report as lines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from chairward_voice_dtw.options import StopWord, fail
from chairward_voice_dtw.settings import EngineName, VoiceSettings


def evaluate(
    manifest: Annotated[Path, typer.Argument(help="csv with path, word, speaker, role, source")],
    templates: Annotated[int, typer.Option("--templates", min=1, max=20, help="recordings of each word to use")] = 3,
    snr: Annotated[str, typer.Option("--snr", help="comma separated: clean or dB")] = "clean,20,10,5",
    hours: Annotated[float, typer.Option("--hours", min=0.0, help="of sound without commands")] = 3.0,
    engine: Annotated[str, typer.Option("--engine", help=", ".join(get_args(EngineName)))] = "default",
    placements: Annotated[int, typer.Option("--placements", min=1, help="streams for each speaker and SNR")] = 2,
    stop_word: StopWord = "stop",
    seed: Annotated[int, typer.Option("--seed", min=0, help="of places, noises and levels")] = 1,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold", min=-5.0, max=20.0, help="log-odds a word needs; else each mode of listening its own"
        ),
    ] = None,
    stop_threshold: Annotated[
        float, typer.Option("--stop-threshold", min=-20.0, max=5.0, help="log-odds the stop word needs")
    ] = VoiceSettings().stop_threshold,
    processes: Annotated[int, typer.Option("--processes", min=0, help="0: up to two")] = 0,
    embedding: Annotated[
        bool, typer.Option("--embedding/--no-embedding", help="use the speech embedding where it is installed")
    ] = True,
    variant: Annotated[str, typer.Option("--variant", help="usual, slow, slurred, loud, soft")] = "usual",
    only: Annotated[str, typer.Option("--only", help="comma separated: only these words are said")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="one placement, 6 minutes without commands")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="the whole report as JSON")] = False,
) -> None:
    """Measure accuracy, rejection, latency and false accepts on recordings, through the streaming path."""
    from chairward_voice_dtw.audio import SoundError
    from chairward_voice_dtw.evaluate import evaluate as run
    from chairward_voice_dtw.plan import Plan
    from chairward_voice_dtw.variants import VARIANTS

    try:
        snrs = tuple(None if part.strip() == "clean" else float(part) for part in snr.split(","))
    except ValueError:
        raise fail(ValueError(f"--snr {snr}: write clean or numbers of dB, separated by commas")) from None
    if engine not in get_args(EngineName):
        raise fail(ValueError(f"--engine {engine}: allowed are {', '.join(get_args(EngineName))}"))
    if variant not in VARIANTS:
        raise fail(ValueError(f"--variant {variant}: allowed are {', '.join(VARIANTS)}"))
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
        words=tuple(word.strip() for word in only.split(",") if word.strip()),
        threshold=threshold,
        stop_threshold=stop_threshold,
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
    always = result["always_listening"]
    if result["engine"] == "default":  # the thesis' engines accept everything
        lines.append(
            f"listening {result['listening']}, threshold {result['thresholds']['word']:+g} "
            f"(always listening {always['thresholds']['word']:+g})"
        )
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
            open_ears = always["sources"][source][snr]
            parts.append(
                f"always listening: accuracy {open_ears['accuracy_pct']['pct']}, "
                f"unknown accepted {open_ears['unknown_accepted_pct']['pct']}"
            )
            lines.append(f"  {snr}: n {figures['accuracy_pct']['n']}  " + "  ".join(parts))
    false = result["false_accepts_per_hour"]
    lines.append(
        f"false accepts an hour ({false['hours']} h): motion, always listening {false['motion']['per_hour']} "
        f"[{false['motion']['low']}..{false['motion']['high']}], stop {false['stop']['per_hour']}, "
        f"motion when armed {false['motion_armed']['per_hour']}, "
        f"in an hour of being open {false['motion_armed_per_open_hour']['per_hour']}"
    )
    lines += [
        f"  at threshold {p['threshold']:+.1f}: accuracy {p['accuracy_pct']['pct']}, "
        f"unknown accepted {p['unknown_accepted_pct']['pct']}, "
        f"false accepts an hour {p['false_accepts_per_hour']['per_hour']}"
        for p in result["operating_points"]
    ]
    lines += [
        f"  stop at threshold {p['threshold']:+.1f}: heard "
        + ", ".join(f"{snr} {heard['pct']}" for snr, heard in p["stop_recall_pct"].items())
        + f", false stops an hour {p['false_stops_per_hour']['per_hour']}"
        for p in result["stop_points"]
    ]
    lines.append(
        f"CPU: {result['cpu_ms_per_s']} ms per second of sound; deciding p50/p95 "
        f"{result['deciding_ms']['p50']}/{result['deciding_ms']['p95']} ms"
    )
    return lines
