"""The statistics of the reports, and a floor under the accuracy on real recordings."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from chairward_voice_dtw import calibration, figures
from chairward_voice_dtw.cli import words as app
from chairward_voice_dtw.engine import Heard
from chairward_voice_dtw.evaluate import trials
from chairward_voice_dtw.plan import Plan, Strange, Trial
from chairward_voice_dtw.reporting import correct, false_accepts, stop_point
from chairward_voice_dtw.settings import ARMED_THRESHOLD, OPEN_THRESHOLD
from chairward_voice_dtw.streams import STREAM_HZ, Placed, Row, embed, word_bounds
from chairward_voice_dtw.variants import VARIANTS, said


def test_shares_carry_wilson_bounds() -> None:
    assert figures.share(0, 0)["pct"] is None
    found = figures.share(90, 100)
    assert (found["pct"], found["low"], found["high"]) == (90.0, 82.56, 94.48)


def test_rates_carry_exact_poisson_bounds() -> None:
    assert figures.rate_per_hour(0, 3.0) == {"per_hour": 0.0, "n": 0, "low": 0.0, "high": 1.23}
    assert figures.rate_per_hour(10, 2.0)["low"] == 2.4


def test_equal_error_rate_of_known_answers() -> None:
    assert figures.equal_error_rate_pct([2.0, 3.0], [0.0, 1.0]) == 0.0
    assert figures.equal_error_rate_pct([0.0, 1.0], [0.0, 1.0]) == 50.0
    assert figures.accepted_at([1.0] * 95 + [0.0] * 5, [0.5, 1.5], 0.95)["pct"] == 50.0


def test_the_fit_finds_known_odds_and_what_bends_them() -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(4_000, 3))
    for odds in (x @ [2.0, -1.0, 0.0] + 0.5, 3.0 * np.tanh(2.0 * x[:, 0] + x[:, 1]) - x[:, 2]):
        said = rng.random(len(x)) < 1.0 / (1.0 + np.exp(-odds))
        found = calibration.fit(x, said, units=4, ridge=1.0)
        assert np.mean(np.abs(found.of(x) - odds)) < 0.35


def test_the_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(200, len(calibration.EVIDENCE)))
    found = calibration.fit(x, x[:, 0] > 0.0)
    file = tmp_path / "calibration.json"
    file.write_text(calibration.text({"plain": found}))
    again = calibration.fitted(file)[len(calibration.EVIDENCE)]
    np.testing.assert_allclose(again.of(x), found.of(x), atol=0.01)


def test_the_shipped_table_fits_what_is_measured() -> None:
    plain = len(calibration.EVIDENCE)
    assert set(calibration.fitted()) == {plain, plain + len(calibration.PRINTS)}


def test_embedded_words_are_where_the_truth_says(speak) -> None:  # type: ignore[no-untyped-def]
    clips = [(Row(Path("x"), word, "anna", "test", "made"), speak(word, 1)) for word in ("left", "stop")]
    stream = embed(clips, [], None, np.random.default_rng(3))
    for placed in stream.placed:
        inside = stream.samples[int(placed.onset_s * STREAM_HZ) : int(placed.end_s * STREAM_HZ)]
        before = stream.samples[int(placed.onset_s * STREAM_HZ) - 4000 : int(placed.onset_s * STREAM_HZ) - 400]
        assert np.sqrt(np.mean(inside**2)) > 20 * np.sqrt(np.mean(before**2))
    first, last = word_bounds(clips[0][1])
    assert first / STREAM_HZ == pytest.approx(0.2, abs=0.04)
    assert (len(clips[0][1]) - last) / STREAM_HZ == pytest.approx(0.2, abs=0.04)


def test_a_slow_word_is_longer_at_the_same_pitch_and_a_slurred_one_is_dull() -> None:
    t = np.arange(STREAM_HZ) / STREAM_HZ
    tone = (np.sin(2 * np.pi * 440.0 * t) + np.sin(2 * np.pi * 5000.0 * t)).astype(np.float32)
    for name in ("slow", "slurred"):
        variant = VARIANTS[name]
        spoken = said(tone, variant)
        assert len(spoken) == round(variant.stretch * len(tone))
        power = np.abs(np.fft.rfft(spoken[2000:-2000] * np.hanning(len(spoken) - 4000))) ** 2
        hz = np.fft.rfftfreq(len(spoken) - 4000, 1.0 / STREAM_HZ)
        assert hz[np.argmax(power * (hz < 1000.0))] == pytest.approx(440.0, abs=5.0)
        high, low = power[(hz > 4500.0) & (hz < 5500.0)].sum(), power[(hz > 300.0) & (hz < 600.0)].sum()
        assert (high > 0.5 * low) == (name == "slow")
    assert said(tone, VARIANTS["usual"]) is tone


def test_a_looser_stop_threshold_hears_more_stops_and_more_false_ones() -> None:
    def heard(word: str, score: float) -> Heard:
        return Heard(word=word, score=score, accepted=False, onset_s=1.0, end_s=1.5, decided_s=1.7)

    def trial(snr: float | None, *found: Heard) -> Trial:
        placed = Placed("stop", "test", 1.0, 1.5, 0.0, 3.0, 1.4)
        return Trial(source="made", speaker="anna", snr=snr, placed=placed, heard=found)

    found = [trial(None, heard("stop", 1.0)), trial(10.0, heard("stop", -2.4)), trial(10.0, heard("left", 3.0))]
    strange = [[heard("stop", -2.2), heard("left", 5.0), heard("stop", -4.0)]]
    for line, noisy, false in ((-2.0, 0.0, 0), (-2.5, 50.0, 1), (-5.0, 50.0, 2)):
        point = stop_point(found, 2.0, strange, "stop", line)
        assert point["stop_recall_pct"]["clean"]["pct"] == 100.0
        assert point["stop_recall_pct"]["10"]["pct"] == noisy
        assert point["false_stops_per_hour"]["per_hour"] == false / 2.0


def test_each_mode_of_listening_counts_its_own_false_words() -> None:
    def heard(word: str, end_s: float, *, accepted: bool) -> Heard:
        return Heard(word=word, score=0.0, accepted=accepted, onset_s=end_s - 0.5, end_s=end_s, decided_s=end_s + 0.2)

    words = (("left", 2.0), ("left", 100.0), ("stop", 120.0), ("right", 1000.0))
    armed = [heard(*word, accepted=True) for word in words]
    always = [heard(*word, accepted=word[0] == "stop" or word[1] > 500.0) for word in words]
    found = false_accepts(Plan(manifest=Path("x")), [Strange(hours=2.0, heard=armed, always=always)])
    rates = {name: found[name]["n"] for name in ("motion", "stop", "motion_armed", "motion_armed_per_open_hour")}
    assert rates == {"motion": 1, "stop": 1, "motion_armed": 1, "motion_armed_per_open_hour": 3}


@pytest.mark.needs_shared
def test_real_words_are_heard_and_strange_ones_mostly_not(shared_data: Path) -> None:
    manifest = shared_data / "voice" / "manifest.csv"
    if not manifest.is_file():
        pytest.skip("needs ../shared/data/voice/manifest.csv")
    found = [t for s in ("asc_00000006", "asc_00000008") for t in trials(Plan(manifest=manifest), s, 20.0, 0)]
    known = [t for t in found if t.placed.role == "test"]
    strange = [t for t in found if t.placed.role == "unknown"]
    assert np.mean([correct(t) for t in known]) >= 0.85
    assert np.mean([any(h.accepted for h in t.heard) for t in strange]) <= 0.3


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("a.wav,left,anna,template,x\n", "no speaker has both template and test rows"),
        ("a.wav,left,anna,template,x\nb.wav,left,anna,test,x\n", "has no noise rows"),
        ("a.wav,left,anna,teacher,x\n", "role 'teacher', allowed are"),
        ("", "has no rows"),
    ],
)
def test_a_manifest_that_cannot_be_evaluated_is_one_sentence(tmp_path: Path, rows: str, sentence: str) -> None:
    path = tmp_path / "words.csv"
    path.write_text("path,word,speaker,role,source\n" + rows)
    result = CliRunner().invoke(app, ["evaluate", str(path)])
    assert result.exit_code == 1
    assert sentence in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_a_way_of_saying_that_is_not_known_is_one_sentence(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["evaluate", str(tmp_path / "words.csv"), "--variant", "mumbled"])
    assert result.exit_code == 1
    assert "--variant mumbled: allowed are usual, slow, slurred, loud, soft" in result.output


def test_a_word_that_nobody_says_cannot_be_evaluated(tmp_path: Path) -> None:
    path = tmp_path / "words.csv"
    path.write_text("path,word,speaker,role,source\na.wav,left,anna,template,x\nb.wav,left,anna,test,x\n")
    result = CliRunner().invoke(app, ["evaluate", str(path), "--only", "stop"])
    assert result.exit_code == 1
    assert "no speaker has both template and test rows of stop" in result.output


def test_an_evaluation_of_a_small_manifest_reports_every_figure(tmp_path: Path, speak) -> None:  # type: ignore[no-untyped-def]
    import soundfile

    lines = ["path,word,speaker,role,source"]
    for word in ("left", "right", "stop"):
        for take in range(5):
            name = f"{word}_{take}.wav"
            soundfile.write(str(tmp_path / name), speak(word, take), STREAM_HZ)
            lines.append(f"{name},{word},anna,{'template' if take < 3 else 'test'},made")
    soundfile.write(str(tmp_path / "front.wav"), speak("front", 1), STREAM_HZ)
    soundfile.write(str(tmp_path / "noise.wav"), np.random.default_rng(1).normal(0.0, 0.1, 48_000), STREAM_HZ)
    lines += ["front.wav,front,anna,unknown,made", "noise.wav,,,noise,made"]
    (tmp_path / "words.csv").write_text("\n".join(lines) + "\n")
    arguments = ["evaluate", str(tmp_path / "words.csv"), "--snr", "clean,20", "--hours", "0.02", "--placements", "1"]
    result = CliRunner().invoke(app, [*arguments, "--processes", "1", "--json"])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    for figures_ in report["sources"]["made"].values():
        assert figures_["accuracy_pct"]["n"] == 6
        assert figures_["accuracy_pct"]["pct"] == 100.0
        assert figures_["end_to_intent_ms"]["p95"] <= 300.0
    assert report["false_accepts_per_hour"]["hours"] == 0.02
    assert (report["listening"], report["thresholds"]["word"]) == ("armed", ARMED_THRESHOLD)
    assert report["always_listening"]["thresholds"]["word"] == OPEN_THRESHOLD
    for figures_ in report["always_listening"]["sources"]["made"].values():
        assert figures_["accuracy_pct"]["n"] == 6
    only = trials(Plan(manifest=tmp_path / "words.csv", words=("stop",)), "anna", None, 0)
    assert [trial.placed.word for trial in only] == ["stop", "stop"]
