"""`range evaluate`: the output that judges read, its definitions, its bounds, its errors."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from chairward.components import Bench, Pose
from chairward.messages import RangeReading
from chairward.stages import DisparityMap, FloorMap, RectifiedPair, StereoFrame
from chairward_stereo_range import evaluate, figures, manifest, statistics
from chairward_stereo_range.cli import range_app
from chairward_stereo_range.finder import Options

COLUMNS = [
    "split", "name", "kind", "left", "right", "gt", "gt_format", "baseline_mm", "focal_px", "doffs",
    "nearest_in_roi_mm", "licence", "source", "note",
]  # fmt: skip


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(range_app, ["evaluate", *arguments])


@pytest.fixture
def small_set(tools: Any, tmp_path: Path) -> Path:
    """Two walls, one empty room, one pair with true disparities, and a short drive at a wall."""
    rows = []

    def add(name: str, kind: str, nearest: str, **more: str) -> dict[str, str]:
        row = dict.fromkeys(COLUMNS, "") | {
            "name": name, "kind": kind, "left": f"{name}_L.png", "right": f"{name}_R.png", "baseline_mm": "50",
            "focal_px": "300", "doffs": "0", "nearest_in_roi_mm": nearest, "source": "test renderer seed 3",
        }  # fmt: skip
        rows.append(row | more)
        return rows[-1]

    def write(path: Path, pair: Any) -> None:
        cv2.imwrite(str(path.with_name(path.name + "_L.png")), pair[0])
        cv2.imwrite(str(path.with_name(path.name + "_R.png")), pair[1])

    for name, wall in (("near", 500.0), ("far", 1500.0)):
        write(tmp_path / name, tools.render(tools.room((tools.board(wall),))))
        add(name, "synthetic", str(wall), note="wall_tex mount=A")
    write(tmp_path / "empty", tools.render(tools.room()))
    add("empty", "synthetic", "", note="none mount=A")
    write(tmp_path / "gt", tools.render(tools.room((tools.board(1000.0),))))
    cv2.imwrite(str(tmp_path / "gt.png"), np.full((240, 320), 15 * 256, np.uint16))
    add("gt", "stereo_gt", "1000", gt="gt.png", gt_format="uint16 png disparity*256")
    (tmp_path / "seq").mkdir()
    truths = ["frame,mm"]
    for i in range(14):
        pair = tools.render(tools.room((tools.board(900.0),), driven_mm=33.0 * i, seed=i))
        cv2.imwrite(str(tmp_path / "seq" / f"left_{i:03d}.png"), pair[0])
        cv2.imwrite(str(tmp_path / "seq" / f"right_{i:03d}.png"), pair[1])
        truths.append(f"{i},{900 - 33 * i}")
    (tmp_path / "truth.csv").write_text("\n".join(truths), encoding="utf-8")
    add(
        "seq", "sequence", "", left="seq/left_%03d.png", right="seq/right_%03d.png", gt="truth.csv",
        note="wall_tex mount=A fps=15 speed_mm_s=500",
    )  # fmt: skip
    path = tmp_path / "manifest.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    return path


def test_the_json_has_every_figure_that_is_judged(small_set: Path) -> None:
    result = invoke(str(small_set), "--json")
    assert result.exit_code == 0, result.output
    out = json.loads(result.stdout)
    assert set(out["stereo_gt"]) >= {
        "pairs", "median_px", "bad1_pct", "coverage_pct", "nearest_rel_median_pct", "nearest_rel_p90_pct",
    }  # fmt: skip
    assert set(out["synthetic"]) >= {
        "frames", "missed_pct", "missed_unflagged_pct", "false_stop_pct", "false_or_blind_pct", "usable_clear_pct",
        "near_median_mm", "near_p95_mm", "median_mm",
    }  # fmt: skip
    assert set(out["sequence"]) >= {
        "approaches", "missed_approaches", "stop_distance_mm", "false_stops_per_100m", "abs_error_median_mm",
        "abs_error_p95_mm",
    }  # fmt: skip
    assert set(out["ms_per_frame"]) >= {"median", "p99"}
    assert list(out["per_source"]) == ["test renderer"]
    for kind in ("stereo_gt", "synthetic"):
        for name in out[kind]["bounds_95"]:
            assert name in out[kind]
            assert out[kind]["n"][name] >= 0
    made = out["synthetic"]
    assert (made["frames"], made["stops_due"], made["clear"]) == (3, 1, 2)
    assert (made["missed_pct"], made["false_or_blind_pct"], made["usable_clear_pct"]) == (0.0, 0.0, 100.0)
    assert made["near_median_mm"] < 12
    assert out["stereo_gt"]["bad1_pct"] < 2
    drive = out["sequence"]
    assert set(drive["stop_distance_mm"]) >= {"median", "min", "max", "n", "bounds_95"}
    assert set(drive["bounds_95"]) >= {"false_stops_per_100m", "abs_error_median_mm", "abs_error_p95_mm"}
    assert (drive["approaches"], drive["missed_approaches"], drive["false_stops_per_100m"]) == (1, 0, 0.0)
    assert 500 <= drive["stereo_alone"]["stop_distance_mm"]["median"] <= 620
    assert 500 <= drive["stop_distance_mm"]["median"] <= 690


def test_the_report_is_one_page_with_pictures(small_set: Path, tmp_path: Path) -> None:
    result = invoke(str(small_set), "--report", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    [page] = (tmp_path / "out").iterdir()
    text = page.read_text(encoding="utf-8")
    assert text.count("data:image/png") >= 3
    assert "Error against distance" in text
    assert "missed_unflagged_pct" in result.stdout


def test_other_methods_and_sizes_are_asked_for_by_name(small_set: Path) -> None:
    result = invoke(str(small_set), "--method", "bm", "--size", "640x480", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["method"] == "bm"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.csv"], ["nowhere.csv"]),
        (["MANIFEST", "--method", "magic"], ["--method magic", "pyramid"]),
        (["MANIFEST", "--size", "big"], ["--size big", "320x240"]),
    ],
)
def test_a_wrong_argument_is_one_readable_sentence(small_set: Path, arguments: list[str], words: list[str]) -> None:
    result = invoke(*[str(small_set) if a == "MANIFEST" else a for a in arguments])
    assert result.exit_code == 2
    assert all(word in result.stderr for word in words)
    assert "Traceback" not in result.output


def test_a_missing_picture_is_named(small_set: Path) -> None:
    (small_set.parent / "far_L.png").unlink()
    result = invoke(str(small_set))
    assert result.exit_code == 2
    assert "far_L.png" in result.stderr


def entry(truth: float, obstacle: str = "wall_tex") -> manifest.Entry:
    nowhere = Path()
    return manifest.Entry(
        "x", "synthetic", "s", nowhere, nowhere, None, "", 300.0, 50.0, 0.0, True, truth, {"obstacle": obstacle}
    )


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(300, 4000) | st.just(inf), st.floats(250, 4000) | st.just(5000.0), st.booleans()),
        max_size=30,
    )
)
def test_figures_follow_their_definitions(cases: list[tuple[float, float, bool]]) -> None:
    results = [evaluate.PairResult(entry(t), z, see, 1.0, "", 0.001) for t, z, see in cases]
    got = figures.synthetic(results)
    due = [(t, z, see) for t, z, see in cases if t < 590]
    clear = [(t, z, see) for t, z, see in cases if t > 1200]
    if due:
        assert got["missed_pct"] == pytest.approx(100 * sum(z > 600 for _, z, _ in due) / len(due), abs=1e-3)
        unflagged = sum(z > 600 and see for _, z, see in due)
        assert got["missed_unflagged_pct"] == pytest.approx(100 * unflagged / len(due), abs=1e-3)
    if clear:
        spoilt = sum(z <= 600 or not see for _, z, see in clear)
        assert got["false_or_blind_pct"] == pytest.approx(100 * spoilt / len(clear), abs=1e-3)
        assert got["usable_clear_pct"] == pytest.approx(100 - 100 * spoilt / len(clear), abs=2e-3)


def frames(*cases: tuple[float | None, float, bool]) -> evaluate.SequenceResult:
    return evaluate.SequenceResult(
        entry(0.0), [evaluate.Frame(i, t, z, see, "", 0.0) for i, (t, z, see) in enumerate(cases)]
    )


def test_a_stop_far_from_anything_is_false_and_counted_once() -> None:
    far = (2000.0, 3000.0, True)
    seen = figures.drive(frames(far, (2000.0, 500.0, True), far, far, far, (2000.0, 3000.0, False), far))
    assert (seen.false_stops, seen.blind_stops, seen.stop_at_mm) == (1, 1, None)


def test_an_approach_without_a_stop_is_missed() -> None:
    assert figures.drive(frames((800.0, 800.0, True), (580.0, 700.0, True))).stop_at_mm is None
    assert figures.drive(frames((650.0, 650.0, True), (580.0, 590.0, True))).stop_at_mm == 580.0


def test_a_passage_counts_as_passed_only_when_nothing_stopped_it() -> None:
    free = frames((inf, 5000.0, True), (900.0, 880.0, True))
    blind = frames((inf, 5000.0, True), (900.0, 880.0, False))
    false = frames((inf, 5000.0, True), (900.0, 590.0, True))
    approach = frames((900.0, 880.0, True), (580.0, 570.0, True))
    got = figures.sequence([free, blind, false, approach])
    assert (got["passages"], got["approaches"]) == (3, 1)
    assert got["passed_without_stop_pct"] == pytest.approx(100 / 3, abs=1e-3)


def test_a_stop_is_in_time_while_the_thing_is_still_400_mm_away() -> None:
    early = frames((650.0, 590.0, True), (500.0, 500.0, True))
    late = frames((650.0, 640.0, True), (390.0, 390.0, True))
    assert figures.sequence([early, late])["stopped_in_time_pct"] == 50.0


@given(events=st.integers(0, 50), metres=st.floats(1, 5000))
@settings(max_examples=40, deadline=None)
def test_stops_by_distance_lie_within_their_bounds(events: int, metres: float) -> None:
    figure = statistics.per_100(events, metres, 1)
    assert figure.low is not None
    assert figure.high is not None
    assert figure.value == pytest.approx(100 * events / metres)
    assert 0 <= figure.low <= 100 * events / metres <= figure.high


def test_no_stop_in_100_metres_still_allows_nearly_four() -> None:
    assert statistics.per_100(0, 100.0, 1).high == pytest.approx(3.69, abs=0.01)
    assert statistics.per_100(0, 0.0, 1).value is None


def test_a_mount_is_read_from_the_note() -> None:
    told = replace(entry(500.0), note={"z_mm": "520", "pitch_deg": "8", "roll_deg": "-1"})
    assert told.pose == Pose(z_mm=520.0, pitch_deg=8.0, roll_deg=-1.0)
    assert replace(told, note={"mount": "B"}).pose == Pose(z_mm=700.0, pitch_deg=15.0)
    assert replace(told, note={}).pose == Pose()


def test_a_drive_with_its_truth_in_the_corridor_is_measured_there(tools: Any, tmp_path: Path) -> None:
    posts = (tools.board(800.0, left_mm=900.0, right_mm=400.0), tools.board(800.0, left_mm=-400.0, right_mm=-900.0))
    for i in range(6):
        pair = tools.render(tools.room(posts, driven_mm=33.0 * i, seed=i))
        for side, picture in zip(("left", "right"), pair, strict=True):
            cv2.imwrite(str(tmp_path / f"{side}_{i:03d}.png"), picture)
    (tmp_path / "truth.csv").write_text("\n".join(["frame,mm", *(f"{i},inf" for i in range(6))]), encoding="utf-8")
    row = replace(
        entry(inf, "doorway"), kind="sequence", left=tmp_path / "left_%03d.png", right=tmp_path / "right_%03d.png",
        gt=tmp_path / "truth.csv",
        note={"obstacle": "doorway", "mount": "A", "fps": "15", "speed_mm_s": "500", "region": "corridor"},
    )  # fmt: skip
    [through] = evaluate.run([row], Options(region="trapezoid"), 240).sequences
    assert all(f.read_mm > 1000 for f in through.frames), "the posts of the door stand beside the way"
    assert figures.sequence([through])["passed_without_stop_pct"] == 100.0


def test_a_second_stage_has_its_vote_while_driving_and_adds_nothing_to_the_errors() -> None:
    seen = frames((700.0, 720.0, True), (500.0, 520.0, True), (450.0, 610.0, True))
    voted = replace(seen, frames=[replace(f, beside_mm=590.0) for f in seen.frames])
    blind = replace(seen, frames=[replace(f, beside_sees=False) for f in seen.frames])
    assert figures.drive(voted).stop_at_mm == figures.drive(blind).stop_at_mm == 500.0
    never = replace(seen, frames=[replace(f, read_mm=900.0, beside_mm=590.0) for f in seen.frames])
    got: Any = figures.sequence([never])
    assert (got["missed_approaches"], got["stereo_alone"]["missed_approaches"]) == (0, 1)
    assert got["abs_error_median_mm"] == got["stereo_alone"]["abs_error_median_mm"] == 400.0


class Parrot:
    """A stage that says the same of every pair, and keeps what it was given."""

    def __init__(self, ahead_mm: int | None, can_see: bool) -> None:
        self.ahead_mm, self.can_see = ahead_mm, can_see
        self.benches: list[Bench] = []

    def process(self, bench: Bench) -> list[RangeReading]:
        self.benches.append(bench)
        frame = bench.get(StereoFrame)
        assert frame is not None
        return [
            RangeReading(
                seq=frame.seq, captured_ns=frame.captured_ns, can_see=self.can_see, ahead_mm=self.ahead_mm, reason=""
            )
        ]

    def close(self) -> None:
        """Nothing is held."""


def test_a_second_stage_is_fed_as_a_lane_feeds_it_and_answers_in_the_measure_of_the_truth(small_set: Path) -> None:
    made: list[tuple[Pose, Parrot]] = []

    def make(pose: Pose) -> Parrot:
        made.append((pose, Parrot(500, True)))
        return made[-1][1]

    [row] = [replace(e, note=e.note | {"mount": "B"}) for e in manifest.read(small_set) if e.kind == "sequence"]
    [result] = evaluate.run([row], Options(region="trapezoid"), 240, also=make).sequences
    [(pose, parrot)] = made
    assert pose == manifest.MOUNTS["B"]
    assert len(parrot.benches) == len(result.frames) == 14
    for bench in parrot.benches:
        assert all(bench.get(kind) is not None for kind in (RectifiedPair, DisparityMap, FloorMap))
    depth_mm = 500.0 * np.cos(np.radians(15.0)) + 700.0 * np.sin(np.radians(15.0))
    assert all(f.beside_mm == pytest.approx(depth_mm) for f in result.frames)
    [forward] = evaluate.run(
        [replace(row, note=row.note | {"region": "corridor"})], Options(region="trapezoid"), 240, also=make
    ).sequences
    assert all(f.beside_mm == 500.0 for f in forward.frames)


def test_stereo_is_alone_where_that_is_asked_and_another_stage_must_be_installed(small_set: Path) -> None:
    alone = json.loads(invoke(str(small_set), "--also", "none", "--json").stdout)
    assert alone["also"] is None
    refused = invoke(str(small_set), "--also", "x_ray")
    assert refused.exit_code == 2
    assert "x_ray" in refused.stderr


def test_a_drive_at_a_low_thing_told_by_its_start_goes_on_when_the_camera_sees_past_it(
    small_set: Path, tmp_path: Path
) -> None:
    [row] = [e for e in manifest.read(small_set) if e.kind == "sequence"]
    note = {"obstacle": "cable", "mount": "A", "fps": "15", "speed_mm_s": "450", "D": "900"}
    told = replace(row, gt=tmp_path / "depth_%03d.png", note=note)
    truth = manifest.sequence_truth(told)
    assert told.region == "corridor"
    assert [truth[i] for i in (0, 1, 13)] == pytest.approx([900.0, 870.0, 510.0])
    assert replace(told, note=note | {"obstacle": "wall_tex"}).region == "trapezoid"
    assert replace(told, gt=row.gt).region == "trapezoid", "what tells the truth of its frames is believed"


def test_drives_at_hard_things_are_reported_apart() -> None:
    hard = replace(
        frames((650.0, 640.0, True), (580.0, 580.0, True)), entry=replace(entry(0.0, "drop"), kind="sequence")
    )
    out: Any = figures.summary(evaluate.Results(sequences=[hard]))
    assert out["sequence"]["approaches"] == 0
    assert out["hard"]["drop"]["sequence"]["approaches"] == 1


@given(n=st.integers(1, 400), data=st.data())
@settings(max_examples=40, deadline=None)
def test_rates_lie_within_their_bounds(n: int, data: Any) -> None:
    hits = data.draw(st.integers(0, n))
    figure = statistics.rate_pct(hits, n)
    assert figure.low is not None
    assert figure.high is not None
    assert figure.value is not None
    assert 0 <= figure.low <= figure.value <= figure.high <= 100


def test_no_misses_in_58_still_allow_six_per_cent() -> None:
    figure = statistics.rate_pct(0, 58)
    assert figure.high == pytest.approx(6.16, abs=0.01)
    assert statistics.rate_pct(0, 0).value is None


@pytest.mark.needs_shared
def test_the_real_drive_is_read_to_a_centimetre(shared: Callable[[str], Path]) -> None:
    path = shared("stereo/manifest.csv")
    [drive] = [e for e in manifest.read(path) if e.kind == "sequence"]
    result = evaluate.run([drive], Options(region="trapezoid"), 240)
    measured = figures.sequence(result.sequences)
    assert measured["abs_error_median_mm"] <= 12.0  # type: ignore[operator]
    assert measured["abs_error_p95_mm"] <= 40.0  # type: ignore[operator]
    assert measured["false_stops_per_100m"] == 0.0


@pytest.mark.needs_shared
def test_no_stop_that_is_due_is_missed_unflagged_on_the_shared_sets(shared: Callable[[str], Path]) -> None:
    for name in ("stereo", "stereo_photoreal"):
        entries = [e for e in manifest.read(shared(f"{name}/manifest.csv")) if e.kind == "synthetic" and not e.hard]
        measured = figures.synthetic(evaluate.run(entries, Options(region="trapezoid"), 240).pairs)
        assert measured["missed_unflagged_pct"] == 0.0, name
        assert measured["false_stop_pct"] == 0.0, name
        assert measured["false_or_blind_pct"] <= 8.0, name  # type: ignore[operator]
