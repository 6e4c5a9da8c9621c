"""When a motion word counts, when a shout stops, when it is too noisy; and whether the voice still fits."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from chairward.talk_switch import TalkListener, TalkSwitch
from chairward_voice_dtw import drift
from chairward_voice_dtw.gate import Gate
from chairward_voice_dtw.level import LevelMeter
from chairward_voice_dtw.settings import ARMED_THRESHOLD, OPEN_THRESHOLD, VoiceSettings
from chairward_voice_dtw.store import WordStore

S = 1_000_000_000


def gate(listening: str) -> Gate:
    return Gate(VoiceSettings.model_validate({"listening": listening, "armed_s": 3.0}))


def test_always_means_always() -> None:
    assert gate("always").lets_pass(0, S)


def test_an_open_microphone_is_unfit_for_a_chair_with_a_person_in_it_unless_much_is_asked_of_a_word() -> None:
    unfit = VoiceSettings(listening="always", threshold=OPEN_THRESHOLD - 0.1).unfit_to_ride()
    assert unfit is not None
    assert unfit[0] == "listening"
    for fit in ({}, {"listening": "armed"}, {"listening": "push_to_talk", "threshold": 0.0}, {"threshold": 4.0}):
        assert VoiceSettings.model_validate(fit).unfit_to_ride() is None


def test_each_mode_of_listening_has_its_own_threshold_unless_one_is_stated() -> None:
    usual = {"always": OPEN_THRESHOLD, "armed": ARMED_THRESHOLD, "push_to_talk": ARMED_THRESHOLD}
    for listening, threshold in usual.items():
        assert VoiceSettings.model_validate({"listening": listening}).threshold == threshold
        stated = VoiceSettings.model_validate({"listening": listening, "threshold": 0.5})
        assert stated.threshold == 0.5
        assert VoiceSettings.model_validate(stated.model_dump()) == stated
    assert VoiceSettings().threshold == OPEN_THRESHOLD
    with pytest.raises(ValidationError, match="listening"):
        VoiceSettings.model_validate({"listening": []})


def test_armed_opens_after_the_wake_word_or_a_press_and_closes_again() -> None:
    for wake in (Gate.wake, Gate.hold):
        ears = gate("armed")
        assert not ears.lets_pass(10 * S, 11 * S)
        wake(ears, 12 * S)
        assert ears.lets_pass(13 * S, 14 * S)
        assert not ears.lets_pass(15 * S, 16 * S)


def test_push_to_talk_needs_the_switch_during_the_word() -> None:
    ears = gate("push_to_talk")
    ears.wake(10 * S)
    assert not ears.lets_pass(10 * S, 11 * S)
    ears.hold(12 * S)
    assert ears.lets_pass(11 * S, 12 * S)
    assert not ears.lets_pass(13 * S, 14 * S)


def test_the_talk_switch_is_let_go_by_silence_and_may_come_and_go(tmp_path: Path) -> None:
    ears = TalkListener(tmp_path)
    assert not ears.is_held(S)
    for start in (S, 20 * S):
        switch = TalkSwitch(tmp_path)
        assert not ears.is_held(start)
        switch.hold(start + S)
        assert ears.is_held(start)
        assert not ears.is_held(start + 2 * S)
        switch.close()
    ears.close()
    ears.close()


@pytest.mark.parametrize(("shout_dbfs", "level", "tenths", "expected"), [
    (-12.0, 0.5, 2, True),
    (-12.0, 0.5, 1, False),
    (-12.0, 0.1, 9, False),
    (0.0, 0.9, 9, False),
])  # fmt: skip
def test_a_shout_is_as_loud_as_set_and_not_a_bang(shout_dbfs: float, level: float, tenths: int, expected: bool) -> None:
    meter = LevelMeter(8000, shout_dbfs=shout_dbfs)
    meter.push(np.zeros(8000, np.float32))
    meter.push((level * np.sign(np.sin(np.arange(800 * tenths)))).astype(np.float32))
    assert meter.shout is expected


def test_another_voice_of_the_same_person_is_kept_apart(tmp_path: Path, speak) -> None:  # type: ignore[no-untyped-def]
    usual, hoarse = WordStore(tmp_path), WordStore(tmp_path, "hoarse")
    usual.replace("left", [speak("left", 0)])
    assert hoarse.files() == {}
    hoarse.replace("left", [speak("left", 1), speak("left", 2)])
    assert (len(usual.files()["left"]), len(hoarse.files()["left"])) == (1, 2)


def test_a_voice_that_changes_over_weeks_is_told_and_new_recordings_begin_anew(tmp_path: Path, speak) -> None:  # type: ignore[no-untyped-def]
    store = WordStore(tmp_path)
    store.replace("left", [speak("left", 0)])
    begin = date(2026, 1, 1)
    for day in range(20):
        drift.note(store.folder, begin + timedelta(day), [4.0 - 0.15 * day] * 30)
        assert bool(drift.proposal(store.folder)) == (day >= 14)
    assert "record them again" in drift.proposal(store.folder)
    store.replace("left", [speak("left", 1)])
    assert drift.proposal(store.folder) == ""


def test_steady_days_few_words_and_broken_files_propose_nothing(tmp_path: Path) -> None:
    for day in range(20):
        drift.note(tmp_path, date(2026, 1, 1) + timedelta(day), [3.0, 3.5, 2.5] * 10)
        drift.note(tmp_path, date(2026, 2, 1) + timedelta(day), [-9.0])
    assert drift.proposal(tmp_path) == ""
    (tmp_path / drift.FILE).write_text("{", encoding="utf-8")
    assert drift.proposal(tmp_path) == ""
    drift.note(tmp_path, date(2026, 3, 1), [1.0])
