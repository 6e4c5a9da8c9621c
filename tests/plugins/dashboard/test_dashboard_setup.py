"""Set-up requests: checked first, refused while the chair is armed, and answered with sentences."""

from __future__ import annotations

import io
import time
import wave
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from chairward import next_run
from chairward.messages import DriveStatus
from chairward.speaking import Listener
from chairward_dashboard.setup import ARMED
from chairward_dashboard.speech import Speech, sized
from chairward_dashboard.stops import StopLog

SAID = Path(__file__).resolve().parents[3] / "plugins/simulator/src/chairward_simulator/words/templates"
WITHIN_S = 110.0
Chair = Any
Call = Callable[..., httpx.Response]


def arm(chair: Chair, page: Any) -> None:
    """The chair is armed, and the page shows it."""
    chair.state = type(chair.state)(latch="", armed=True)
    chair.decide(3_000)
    page.bundle_until(lambda head: bool(head["state"].get("armed")))


# ---- words ----------------------------------------------------------------------------------------------------------


def test_without_sound_from_the_chair_nothing_is_recorded(call: Call) -> None:
    answer = call("words/listen", {"seconds": 0.3})
    assert (answer.status_code, answer.json()["why"]) == (503, "words.no_microphone")


@pytest.mark.parametrize(
    ("path", "data", "status"),
    [
        ("words/take", b"not a sound", 400),
        ("words/take", b"RIFF" + bytes(2_000_001), 413),
        ("words/save", {"person": "demo"}, 400),
        ("words/save", {"person": "demo", "word": "go", "takes": ["../../etc/passwd"]}, 404),
        ("words/remove", {"person": "../demo", "word": "go"}, 404),
        ("words/means", {"person": "nobody", "word": "go", "command": "front"}, 404),
        ("words/try", {"person": "demo", "take": "x", "more": 1}, 400),
        ("words/listen", {"seconds": 99}, 400),
        ("words/sound/..%2f..%2fplan.json", None, 404),
        ("stops/..%2fplan.jpg", None, 404),
        ("set", {"person": "demo", "changes": []}, 400),
        ("set", {"person": "../chairs/screen", "changes": ["limits.stop_mm=700"]}, 404),
        ("set", {"person": "--help", "changes": ["limits.stop_mm=700"]}, 404),
        ("limits?person=../../etc/passwd", None, 404),
        ("set", b"[" * 100_000, 413),
        ("set", b"[" * 4_000, 400),
        ("choose", {"person": "nobody", "run": True}, 400),
        ("calibrate/begin", {"columns": 1}, 400),
    ],
)
def test_what_makes_no_sense_is_refused(call: Call, path: str, data: Any, status: int) -> None:
    assert call(path, data).status_code == status


# ---- only at rest ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "data"),
    [
        ("words/take", b"RIFF"),
        ("words/listen", {"seconds": 1}),
        ("words/save", {"person": "demo", "word": "go", "takes": ["x"]}),
        ("words/remove", {"person": "demo", "word": "go"}),
        ("words/try", {"person": "demo", "take": "x"}),
        ("words/means", {"person": "demo", "word": "go", "command": "front"}),
        ("set", {"person": "demo", "changes": ["limits.stop_mm=700"], "keep": True}),
        ("choose", {"person": "careful"}),
        ("choose", {"person": ""}),
        ("calibrate/begin", {}),
        ("calibrate/keep", {}),
    ],
)
def test_p2_while_the_chair_is_armed_set_up_rests(
    planned_chair: Chair, call: Call, page_at: Any, path: str, data: Any
) -> None:
    page = page_at(planned_chair.address)
    arm(planned_chair, page)
    page.close()
    answer = call(path, data)
    assert (answer.status_code, answer.json()["why"]) == (409, ARMED)
    assert next_run.asked(planned_chair.context.run_dir) is None


# ---- person ---------------------------------------------------------------------------------------------------------


# ---- plugins, stops, speech -----------------------------------------------------------------------------------------


def stopped(chair: Chair) -> None:
    """A decision that latches: STOP was pressed."""
    from chairward.facts import Pressed
    from chairward.messages import Button

    now_ns = time.monotonic_ns()
    chair.decide(540, pressed=(Pressed(source="screen/dashboard", button=Button.STOP, at_ns=now_ns),))


def test_a_stop_is_logged_with_its_reason_and_without_a_picture(planned_chair: Chair, call: Call) -> None:
    planned_chair.picture()
    stopped(planned_chair)
    end = time.monotonic() + 30.0
    while not (rows := call("stops").json()["stops"]):
        assert time.monotonic() < end, "no stop was logged within 30 s"
    assert rows[0]["nearest_mm"] == 540
    assert "STOP was pressed" in rows[0]["latch"]
    assert rows[0]["person"] == "demo"
    assert rows[0]["picture"] is False
    assert call(f"stops/{rows[0]['name']}.jpg").status_code == 404


class TestWherePicturesMayBeKept:
    """A chair whose file says so."""

    @pytest.fixture
    def settings(self) -> Any:
        from chairward_dashboard.settings import DashboardSettings

        return DashboardSettings(port=0, stop_pictures=True)

    def test_the_picture_of_the_left_camera_is_kept(self, planned_chair: Chair, call: Call) -> None:
        planned_chair.picture()
        stopped(planned_chair)
        end = time.monotonic() + 30.0
        while not (rows := call("stops").json()["stops"]):
            assert time.monotonic() < end, "no stop was logged within 30 s"
        assert call(f"stops/{rows[0]['name']}.jpg").content[:2] == b"\xff\xd8"


def test_the_log_of_stops_keeps_only_the_newest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, now = StopLog(tmp_path / "stops", 3), iter(range(1_000_000, 1_000_100))
    monkeypatch.setattr("chairward_dashboard.stops.time.time", lambda: float(next(now)))
    for nth in range(6):
        log.add({"nearest_mm": nth, "reasons": [], "latch": "", "person": "", "chair": ""}, b"picture")
    assert [row["nearest_mm"] for row in log.rows()] == [5, 4, 3]
    assert len(list((tmp_path / "stops").iterdir())) == 6
    (tmp_path / "stops" / "19700112T134646-000.json").write_text("broken")
    assert all(row["nearest_mm"] != "broken" for row in log.rows())
    StopLog(tmp_path / "none", 0).add({}, None)
    assert not (tmp_path / "none").exists()


def test_a_sentence_is_spoken_offline_in_every_language(call: Call) -> None:
    if Speech().program is None:
        pytest.skip("needs espeak-ng: apt-get install espeak-ng")
    for language, text in (("en", "Stop now"), ("hi", "अब रुकें"), ("ar", "قف الآن"), ("de", "-v halt"), ("fr", "Arrêt")):
        sound = call(f"say?language={language}&text={text}")
        assert sound.headers["content-type"] == "audio/wav"
        with wave.open(io.BytesIO(sound.content)) as wav:
            assert wav.getnframes() > 0.2 * wav.getframerate()
    for wrong in ("language=tlh&text=x", "language=en&text=", f"language=en&text={'x' * 300}"):
        assert call(f"say?{wrong}").status_code == 400


def test_without_a_speaker_the_page_is_told_so(
    planned_chair: Chair, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Speech, "__init__", lambda self: setattr(self, "program", None))
    planned_chair.source.close()
    planned_chair.source.open()
    answer = httpx.get(f"{planned_chair.source.url}api/say?text=x")
    assert (answer.status_code, answer.json()["why"]) == (404, "espeak-ng is not installed on the chair")


def test_a_wav_file_from_a_pipe_gets_its_true_sizes() -> None:
    file = io.BytesIO()
    with wave.open(file, "wb") as wav:
        wav.setnchannels(1)
        wav.setsampwidth(2)
        wav.setframerate(22_050)
        wav.writeframes(bytes(2_000))
    right = file.getvalue()
    piped = right[:4] + b"\xff\xff\xff\x7f" + right[8:40] + b"\xff\xff\xff\x7f" + right[44:]
    assert sized(piped) == right


def test_while_a_page_speaks_the_recognizer_can_know_it(planned_chair: Chair, page_at: Any) -> None:
    listener = Listener(planned_chair.context.run_dir)
    page = page_at(planned_chair.address)
    assert not listener.is_speaking(time.monotonic_ns())
    page.say(t="speaks", ms=15_000)
    end = time.monotonic() + 10.0
    while not listener.is_speaking(time.monotonic_ns()):
        assert time.monotonic() < end, "the chair does not know within 10 s that it speaks"
    page.close()
    listener.close()


def test_a_chair_at_rest_may_be_set_up(planned_chair: Chair, call: Call, page_at: Any) -> None:
    page = page_at(planned_chair.address)
    planned_chair.state = type(planned_chair.state)()
    planned_chair.decide(drive=DriveStatus(at_ns=time.monotonic_ns(), linked=True, armed=False, speed_mm_s=0.0))
    page.bundle_until(lambda head: head["state"].get("armed") is False)
    page.close()
    assert call("words/listen", {"seconds": 0.3}).status_code == 503
