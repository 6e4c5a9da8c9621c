"""A chair file by interview: through a real terminal, from an answers file, and with nobody there to ask."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from chairward.chair_new import chair_text, groups
from chairward.cli.app import app
from chairward.plugins import discover
from chairward.profile import files
from chairward.profile.load import load_chair

QUESTIONS = [question for group in groups() for question in group.questions]


def video(path: Path, shift: int) -> None:
    """A camera: uncompressed video of sharp-edged things with a little noise."""
    chance, scene = np.random.default_rng(7), np.full((240, 480, 3), 120, np.uint8)
    for _ in range(170):
        x, y = int(chance.integers(0, 470)), int(chance.integers(0, 235))
        w, h = (int(v) for v in chance.integers(5, 45, 2))
        cv2.rectangle(scene, (x, y), (x + w, y + h), tuple(int(v) for v in chance.integers(20, 235, 3)), -1)
    picture, noise = scene[:, 80 + shift : 400 + shift], chance.normal(0, 2, (240, 320, 3))
    with path.open("wb") as file:
        file.write(b"YUV4MPEG2 W320 H240 F30:1 Ip A1:1 C420jpeg\n")
        for _ in range(14):
            noise = np.roll(noise, 1, axis=0)
            seen = np.clip(picture + noise, 0, 255).astype(np.uint8)
            file.write(b"FRAME\n" + cv2.cvtColor(seen, cv2.COLOR_BGR2YUV_I420).tobytes())


@pytest.fixture
def cameras(tmp_path: Path) -> tuple[str, str]:
    video(tmp_path / "left.y4m", 0)
    video(tmp_path / "right.y4m", 12)
    return str(tmp_path / "left.y4m"), str(tmp_path / "right.y4m")


def saved(folder: Path, name: str = "box") -> str:
    path = folder / "chairs" / f"{name}.toml"
    text = path.read_text(encoding="utf-8")
    load_chair(files.read(path), next(iter(tomllib.loads(text)["drive"])), discover())  # as any run would read it
    return text


class Terminal:
    """The command at a real terminal: wait for what it says, then type."""

    def __init__(self, arguments: list[str]) -> None:
        ours, theirs = pty.openpty()
        self._fd, self._seen = ours, ""
        command = [sys.executable, "-m", "chairward", *arguments]
        environment = {**os.environ, "TERM": "dumb", "COLUMNS": "200"}
        self.process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
        os.close(theirs)

    def hears(self, text: str, seconds: float = 60.0) -> str:
        """All until that was said."""
        end = time.monotonic() + seconds
        while text not in self._seen:
            assert time.monotonic() < end, f"waited for {text!r}, seen:\n{self._seen}"
            if select.select([self._fd], [], [], 0.2)[0]:
                try:
                    self._seen += os.read(self._fd, 4096).decode(errors="replace")
                except OSError:  # its end of the terminal is closed
                    assert text in self._seen, f"waited for {text!r}, but it ended:\n{self._seen}"
        said, _, self._seen = self._seen.partition(text)
        return said

    def types(self, text: str = "") -> None:
        os.write(self._fd, text.encode() + b"\n")

    def close(self) -> int:
        code = self.process.wait(30)
        os.close(self._fd)
        return code


@pytest.mark.processes
def test_an_interview_at_a_terminal_tries_the_cameras_and_asks_again(cameras: tuple[str, str], tmp_path: Path) -> None:
    it = Terminal(["chair", "new", "box", "--profiles", str(tmp_path / "profiles")])
    typed = {
        "What is it?": "robot",
        "tips of the feet": "300",
        "rearmost part": "300",
        "outermost part": "two hundred",
    }
    for question, answer in typed.items():
        it.hears(question)
        it.types(answer)
    it.hears("a number is asked for")
    it.types("200")
    for question, answer in (("Left camera", str(tmp_path / "nothing.y4m")), ("Right camera", cameras[1])):
        it.hears(question)
        it.types(answer)
    for _ in range(3):  # where they stand: as it is proposed
        it.hears("[")
        it.types()
    it.hears("nothing.y4m) is not there")
    it.hears("Keep it all the same")
    it.types("n")
    for question, answer in (("Left camera", cameras[0]), ("Right camera", cameras[1])):
        it.hears(question)
        it.types(answer)
    for question in ("before the axle", "above the floor", "look down"):
        it.hears(question)
        it.types()
    it.hears("driven by words?")
    it.types("no")
    it.hears("terminal, or a path")
    it.types()
    it.hears("drives the wheels?")
    it.types("pic_serial")
    it.hears("Serial port")
    it.types(str(tmp_path / "no-such-port"))
    for question in ("Highest forward speed", "Deceleration", "Steepest slope"):
        it.hears(question)
        it.types()
    it.hears("there is no such port")
    it.hears("Keep it all the same")
    it.types("y")
    it.hears("chairward check drive --chair box")
    assert it.close() == 0
    text = saved(tmp_path / "profiles")
    made = tomllib.loads(text)
    assert made["footprint"] == {"front_mm": 300, "rear_mm": 300, "half_width_mm": 200}
    assert made["settings"]["cameras"] == {"left": cameras[0], "right": cameras[1]}
    assert list(made["lane"]) == ["front", "keys"]
    assert "# measure: from the middle of the drive axle" in text, "the comments are there"


def test_every_question_can_be_answered_by_a_file(cameras: tuple[str, str], tmp_path: Path) -> None:
    answers = tmp_path / "answers.toml"
    lines = [f'"{q.key}" = "{q.default}"' for q in QUESTIONS if q.key not in ("cameras.left", "cameras.right")]
    answers.write_text("\n".join([*lines, f'"cameras.left" = "{cameras[0]}"', f'"cameras.right" = "{cameras[1]}"']))
    arguments = ["chair", "new", "box", "--answers", str(answers), "--keep-untried", "--profiles", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert tomllib.loads(saved(tmp_path))["settings"]["cameras"]["left"] == cameras[0]


def test_nothing_is_saved_while_a_device_does_not_work(tmp_path: Path) -> None:
    answers = tmp_path / "answers.toml"
    answers.write_text('[cameras]\nleft = "/nowhere/left"\nright = "/nowhere/right"\n')
    arguments = ["chair", "new", "box", "--yes", "--answers", str(answers), "--profiles", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert "/nowhere/left) is not there" in result.output
    assert not (tmp_path / "chairs").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('kind = "boat"', "kind = 'boat': choose one of robot, chair"),
        ('[footprint]\nfront_mm = "far"', "footprint.front_mm = 'far': a number is asked for"),
        ("wheels = 4", "'wheels' is no question"),
        ('kind = "chair"', "hardware_stop is missing"),
    ],
)
def test_a_wrong_answer_is_one_sentence_and_nothing_is_saved(text: str, says: str, tmp_path: Path) -> None:
    answers = tmp_path / "answers.toml"
    answers.write_text(text)
    arguments = ["chair", "new", "box", "--yes", "--keep-untried", "--answers", str(answers)]
    result = CliRunner().invoke(app, [*arguments, "--profiles", str(tmp_path)])
    assert result.exit_code == 1
    assert says in result.output
    assert not (tmp_path / "chairs").exists()


def test_a_file_that_is_there_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "chairs").mkdir()
    (tmp_path / "chairs" / "box.toml").write_text("mine")
    result = CliRunner().invoke(app, ["chair", "new", "box", "--yes", "--profiles", str(tmp_path)])
    assert result.exit_code == 1
    assert "is there already and was not touched" in result.output
    assert (tmp_path / "chairs" / "box.toml").read_text() == "mine"


def made(folder: Path, answered: str) -> dict[str, Any]:
    """The chair file that `chair new` makes of these answers."""
    answers = folder / "answers.toml"
    answers.write_text(answered)
    arguments = ["chair", "new", "box", "--yes", "--keep-untried", "--answers", str(answers)]
    result = CliRunner().invoke(app, [*arguments, "--profiles", str(folder)])
    assert result.exit_code == 0, result.output
    return tomllib.loads(saved(folder))


def test_a_can_chair_can_be_asked_for(tmp_path: Path) -> None:
    assert made(tmp_path, 'drive = "can"\nvoice = "no"\n[can]\nchannel = "can1"\n')["drive"]["can"]["channel"] == "can1"


def test_an_answer_stands_where_the_file_had_it_commented_out_and_keeps_its_comment() -> None:
    answers = {"kind": "chair", "hardware_stop": "a contactor", "forward_mm_s": 250, "decel_mm_s2": 700}
    text = chair_text("box", answers)
    lines = text.splitlines()
    assert "forward_mm_s = 250                  # forward speed" in lines
    assert "decel_mm_s2 = 700                   # of the controlled stop, measured on the level" in lines
    for key in ("hardware_stop", "forward_mm_s", "arc_mm_s", "decel_mm_s2"):
        assert len(re.findall(rf"^(?:# )?{key} = ", text, re.MULTILINE)) == 1, f"{key} stands there once"
    assert tomllib.loads(text)["hardware_stop"] == "a contactor"
    assert "# slope_percent = 0.0               # steepest slope the chair may go down" in lines, "not answered"


def test_a_controller_that_a_dbc_file_describes_can_be_asked_for(tmp_path: Path) -> None:
    answered = 'drive = "can"\nvoice = "no"\n[can]\ndialect = "dbc"\n[can.dbc]\nfile = "mine.dbc"\n'
    can = made(tmp_path, answered)["drive"]["can"]
    assert (can["dialect"], can["dbc"]["file"], can["dbc"]["turn"]) == ("dbc", "mine.dbc", "Drive.Turn")


def test_the_questions_can_be_printed_as_an_answers_file() -> None:
    result = CliRunner().invoke(app, ["chair", "new", "box", "--questions"])
    assert {q.key for q in QUESTIONS} == set(tomllib.loads(result.output))
