"""The merge law: whatever a person's file says, it is refused or the chair is no less careful than before."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from chairward.facts import Limits
from chairward.messages import Command
from chairward.profile import ProfileError, Safer
from chairward.profile.merge import looser, mark_of, merge, validated
from chairward.profile.models import LimitsTable, StoppingTable

RELAXED = settings(deadline=None)
COMMANDS = st.frozensets(st.sampled_from(Command)).map(lambda some: sorted(some | {Command.STOP, Command.HELP}))
NUMBERS = st.integers(-10, 4000) | st.floats(allow_nan=True, allow_infinity=True) | st.floats(0, 100)
ANYTHING = NUMBERS | COMMANDS | st.booleans() | st.text(max_size=5) | st.lists(st.integers(), max_size=2)


def values_of(key: str) -> st.SearchStrategy[Any]:
    """Values for one field: mostly inside its range, so that the law is put to the test."""
    field = LimitsTable.model_fields[key]
    if key == "commands":
        return COMMANDS
    low = next(m.ge for m in field.metadata if hasattr(m, "ge")) if key in _FROM else 0.001
    high = next(m.le for m in field.metadata if hasattr(m, "le"))
    if field.annotation is int:
        return st.integers(math.ceil(low), math.floor(high))
    return st.floats(low, high)


_FROM = {k for k, f in LimitsTable.model_fields.items() if any(hasattr(m, "ge") for m in f.metadata)}
SOME_LIMITS = st.lists(st.sampled_from(sorted(LimitsTable.model_fields)), max_size=6, unique=True).flatmap(
    lambda keys: st.fixed_dictionaries({key: values_of(key) for key in keys})
)
WILD_LIMITS = st.dictionaries(
    st.sampled_from(sorted(LimitsTable.model_fields)) | st.text(max_size=8), ANYTHING, max_size=4
)


def table(values: dict[str, Any]) -> LimitsTable:
    """A chair's limits: these values where they go together, the defaults otherwise."""
    try:
        return validated(LimitsTable, values, "chair: ")
    except ProfileError:
        return LimitsTable()


def test_every_limit_is_marked_or_known_to_be_the_integrators_alone() -> None:
    unmarked = {key for key in LimitsTable.model_fields if mark_of(LimitsTable, key) is None}
    assert unmarked == {"drive_freshness_ms", "supervisor_freshness_ms", "gap_limit_ms"}
    assert all(mark_of(StoppingTable, key) is None for key in StoppingTable.model_fields)


@RELAXED
@given(chair=SOME_LIMITS, person=SOME_LIMITS | WILD_LIMITS)
def test_no_person_file_can_loosen_any_field(chair: dict[str, Any], person: dict[str, Any]) -> None:
    before = table(chair)
    try:
        after = merge(before, person, "people/x.toml: limits.")
    except ProfileError:
        return
    assert after.stop_mm >= before.stop_mm >= 600
    assert after.avoid_mm >= before.avoid_mm
    assert after.near_loss_mm >= before.near_loss_mm
    assert after.turn_clear_mm >= before.turn_clear_mm
    assert after.commands <= before.commands
    for key in LimitsTable.model_fields:
        old, new = getattr(before, key), getattr(after, key)
        match mark_of(LimitsTable, key):
            case Safer.LOWER:
                assert new <= old
            case None:
                assert new == old
            case Safer.HIGHER:
                assert new >= old
            case Safer.SUBSET:
                assert set(new) <= set(old)
            case Safer.FREE:
                assert key == "lease_warn_s"
        if key not in person:
            assert new == old, "what a person does not name stays the chair's"


@RELAXED
@given(chair=SOME_LIMITS, person=SOME_LIMITS)
def test_the_safer_side_is_open_to_a_person(chair: dict[str, Any], person: dict[str, Any]) -> None:
    before = table(chair)
    asked = {k: v for k, v in person.items() if not looser(mark_of(LimitsTable, k), getattr(before, k), v)}
    distances = {"stop_mm": 0, "near_loss_mm": 1, "avoid_mm": 1}
    if distances.keys() & asked.keys():  # these go together: the nearest of them is the stop
        top = max(asked.get(key, getattr(before, key)) for key in distances)
        asked |= {key: top + plus for key, plus in distances.items() if top + plus <= 3000}
        assume(top < 3000)
    after = merge(before, asked, "people/x.toml: limits.")
    assert all(getattr(after, key) == (frozenset(v) if key == "commands" else v) for key, v in asked.items())


def test_what_is_free_may_go_both_ways_and_what_is_the_integrators_may_be_repeated() -> None:
    chair = LimitsTable()
    for seconds in (1.0, 4.0):
        assert merge(chair, {"lease_warn_s": seconds}, "x: ").lease_warn_s == seconds
    assert merge(chair, {"gap_limit_ms": chair.gap_limit_ms, "stop_mm": chair.stop_mm}, "x: ") == chair


@pytest.mark.parametrize("mark", [Safer.HIGHER, Safer.LOWER, None])
def test_what_cannot_be_compared_counts_as_looser(mark: Safer | None) -> None:
    assert looser(mark, 1.0, float("nan"))


@settings(RELAXED, max_examples=60)
@given(person=SOME_LIMITS)
def test_no_person_file_can_loosen_what_the_rules_work_with(person: dict[str, Any], limits_of_person: Any) -> None:
    before: Limits = limits_of_person({})
    try:
        after: Limits = limits_of_person(person)
    except ProfileError:
        return
    for higher in ("stop_mm", "avoid_mm", "near_loss_mm", "turn_clear_mm"):
        assert getattr(after, higher) >= getattr(before, higher)
    for lower in (
        *("forward_mm_s", "backward_mm_s", "turn_deg_s", "arc_mm_s", "avoid_mm_s", "steer_deg_s", "crawl_mm_s"),
        *("accel_mm_s2", "turn_accel_deg_s2", "lease_s", "turn_step_deg", "arc_step_deg", "back_step_mm"),
        *("reverse_step_mm", "held_ns", "latch_after_ns", "caps", "unseen"),
    ):
        old, new = getattr(before, lower), getattr(after, lower)
        assert all(n <= o for n, o in zip(new, old, strict=True)) if isinstance(new, tuple) else new <= old
    for same in (
        *("sensors", "recognizers", "stop_devices", "vetoers", "reaction_s", "decel_mm_s2"),
        *("drive_freshness_ns", "supervisor_freshness_ns", "gap_limit_ns"),
    ):
        assert getattr(after, same) == getattr(before, same)
    assert after.commands <= before.commands
