"""The tour of the demo: done with ideal ears, survives misheard words, never by touching anything."""

from __future__ import annotations

from itertools import pairwise
from random import Random

import pytest


def test_tour_shows_all_that_the_demo_must_show_within_a_minute(make_chair) -> None:
    world = make_chair().run(60.0)
    report = world.report()
    assert report["tour_done"], report
    assert set(report["words_said"]) == {"front", "back", "left", "right", "reverse", "stop"}
    assert [s["thing"] for s in report["stopped_before"]] == ["person", "cardboard box", "corner wall"]
    assert [(p["doorway"], p["stops"]) for p in report["doorways_passed"]] == [("doorway", 0)]
    assert report["collisions"] == []
    assert report["nearest_ahead_mm"] >= 590
    assert world.now_s < 58.0


@pytest.mark.parametrize(("answer_s", "step_gain"), [(0.2, 0.85), (0.8, 1.0), (0.8, 0.85)])
def test_tour_is_a_closed_loop_slow_answers_and_uneven_steps_only_cost_time(make_chair, answer_s, step_gain) -> None:
    report = make_chair(answer_s=answer_s, step_gain=step_gain).run(150.0).report()
    assert report["tour_done"], report
    assert len(report["doorways_passed"]) == 1
    assert {s["thing"] for s in report["stopped_before"]} >= {"person", "cardboard box", "corner wall"}
    assert report["collisions"] == []


@pytest.mark.parametrize("seed", range(3))
def test_misheard_words_do_not_derail_the_tour(make_chair, seed) -> None:
    report = make_chair(misheard=0.15, rng=Random(seed)).run(300.0).report()
    assert report["tour_done"], report
    assert len(report["doorways_passed"]) >= 1
    assert {s["thing"] for s in report["stopped_before"]} >= {"cardboard box", "corner wall"}
    assert report["collisions"] == []


def test_a_chair_that_does_not_answer_is_reset_and_armed_again(make_chair) -> None:
    chair = make_chair(misheard=1.0)
    chair.rng.choice = lambda _: ""  # deaf
    world = chair.run(20.0)
    assert world.rider.arm_presses >= 2
    assert world.rider.reset_presses >= 1
    assert world.truth.driven_mm == 0.0


def test_words_are_never_said_into_each_other(make_chair) -> None:
    chair = make_chair()
    world, said = chair.world, []
    while world.now_s < 60.0 and not world.rider.finished:
        if word := world.step(chair.pins()):
            said.append((world.now_s, world.now_s + world.duration_s(word, world.rider.utterances)))
            chair.hear(word)
    assert len(said) > 15
    assert all(end + 0.2 < begin for (_, end), (begin, _) in pairwise(said))
