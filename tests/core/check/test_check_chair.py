"""The acceptance run and the measured reaction: on the simulated chair by themselves, and what they write."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import date
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from chairward import profile
from chairward.check.acceptance import Acceptance
from chairward.check.hand import CheckHand, hand
from chairward.check.judges import Asked, simulated
from chairward.check.report import Head, html
from chairward.check.result import Curve, Result
from chairward.check.stimulus import FlashedScreen
from chairward.check.timing import Timing, write
from chairward.check.trial import HAND_SOURCE, Trial, TrialError, on_trial, trial
from chairward.cli.app import app
from chairward.components import Context, DeviceLost, NoSettings
from chairward.messages import Alive, Button, Command, Intent, Press
from chairward.plan import Plan
from chairward.plugins import discover
from chairward.profile import ProfileError

ROOT = Path(__file__).resolve().parents[3]
CURVE = Curve("deg/s", [0.0, 1.0, 2.0], [0.0, -20.0, -20.0], [None, -3.0, -19.5])
FOUND = Timing((61.0, 92.4, 70.0), "3 times, an obstacle", date(2026, 11, 22))


@pytest.fixture
def profiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shipped profiles, which may be written to."""
    folder = tmp_path / "profiles"
    shutil.copytree(ROOT / "profiles", folder)
    words = ROOT / "plugins" / "simulator" / "src" / "chairward_simulator" / "words" / "templates"
    sim = folder / "chairs" / "sim.toml"
    sim.write_text(
        sim.read_text().replace("../../plugins/simulator/src/chairward_simulator/words/templates", str(words))
    )
    monkeypatch.setenv("CHAIRWARD_PROFILES", str(folder))
    return folder


def sim() -> Plan:
    return profile.load("sim", None, [], discover())


@pytest.mark.processes
@pytest.mark.timeout(480)
def test_the_simulated_chair_is_tried_by_itself_and_the_report_says_what_was_found(tmp_path: Path) -> None:
    report = tmp_path / "acceptance.html"
    steps = ["not armed", "sign: front", "sign: left", "obstacle", "stop device", "hand lost", "unplugged"]
    only = [part for name in [*steps, "killed: lane panel", "reaction", "killed: guard"] for part in ("--only", name)]
    arguments = ["check", "chair", "--chair", "sim", "--times", "1", "--at-mm", "500", *only]
    result = CliRunner().invoke(app, [*arguments, "--report", str(report), "--by", "R. Tester", "--json"])
    said = json.loads(result.stdout[result.stdout.index("{") :])
    found = {step["step"]: step for step in said["steps"]}
    # all that a machine which is too busy can spoil: a step came late, or its chair stopped for a silence before it
    silence = ("silent for", "said nothing", "recent readings", "has not moved", "did not turn before")
    wrong = [step for step in found.values() if not step["ok"] and not step["late"]]
    assert [step for step in wrong if not any(word in step["found"] for word in silence)] == []
    assert found["not armed"]["ok"]
    assert len(found) == 12
    appeared = found["obstacle at 500 mm"]
    assert not appeared["ok"] or re.match(r"told to stop after \d+ ms, stood after \d+ ms, ", appeared["found"])
    assert said["passed"] == all(step["ok"] for step in found.values())
    assert result.exit_code == (0 if said["passed"] else 1)
    page = Page(report.read_text(encoding="utf-8"))
    assert page.text.count("pass") + page.text.count("FAIL") >= 10
    assert "R. Tester" in page.text
    assert page.pictures >= 1, "what the camera saw of the obstacle"
    assert page.charts == 12


@pytest.mark.processes
@pytest.mark.timeout(480)
def test_a_person_beside_the_chair_is_asked_and_only_the_chair_s_own_stop_device_passes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    plan = profile.load("sim", None, ["sim_home.speaks=false", "sim_home.wheels_off=true"], discover())
    asked = []
    with trial(plan) as it:
        judge, obstacle = simulated(it)

        def person(question: str, answers: tuple[str, ...]) -> str:
            """Does what is asked, but presses the hand of the check where the chair's own stop is meant."""
            asked.append(question)
            match question.split():
                case ["NOW,", *_]:
                    obstacle.show(500.0)
                case ["Take", *_]:
                    obstacle.hide()
                case ["Press", *_]:
                    it.hand.press(Button.STOP)
                case ["Unplug", *_]:
                    judge.unplug(it, "voice")
                case ["Plug", *_]:
                    judge.plug(it, "voice")
                case _:
                    return judge.turns(it, Command.FRONT) or "nothing"
            assert answers == ("done",)
            return "done"

        steps = Acceptance(it, Asked(person), FlashedScreen(), (500.0,), 1)
        found = {
            r.step: r for r in steps.run(["sign: front", "obstacle", "stop device", "unplugged: voice", "reaction"])
        }
    assert list(found) == [
        *("sign: front", "obstacle at 500 mm", "stop device: panel/sim_operator", "unplugged: voice", "reaction")
    ]
    for name in ("sign: front", "obstacle at 500 mm", "unplugged: voice"):
        assert found[name].ok or found[name].late or "silent" in found[name].found, found[name]
    pressed = found["stop device: panel/sim_operator"]
    assert not pressed.ok
    assert "STOP at 'panel/sim_operator' did not happen" in pressed.found
    assert not found["reaction"].ok
    assert "a screen that flashes before the cameras" in found["reaction"].found
    assert "NOW, while the wheels turn, push a box to 500 mm ahead of the feet, in the middle." in asked


def test_a_step_that_does_not_exist_is_refused_with_those_that_do() -> None:
    chair = Trial(sim(), Path(), None, None)  # type: ignore[arg-type]  # neither is reached
    steps = Acceptance(chair, Asked(lambda *_: "done"), FlashedScreen())
    with pytest.raises(TrialError, match=r"no step begins with 'brake'; there are: not armed, sign: front, "):
        next(steps.run(["brake"]))


def test_a_report_that_cannot_be_written_is_told_before_the_chair_moves(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["check", "chair", "--chair", "sim", "--report", str(tmp_path / "no" / "y.html")])
    assert result.exit_code == 2
    assert f"there is no folder {tmp_path / 'no'}" in result.output


@pytest.mark.processes
@pytest.mark.timeout(480)
def test_the_reaction_is_measured_and_written_and_the_comments_stay(profiles: Path) -> None:
    path = profiles / "chairs" / "sim.toml"
    result = CliRunner().invoke(app, ["check", "timing", "--chair", "sim", "--times", "3", "--json"])
    assert result.exit_code in (0, 1), result.output
    written = path.read_text(encoding="utf-8")
    stopping = tomllib.loads(written)["stopping"]
    assert stopping["reaction_ms"] > 0
    assert stopping["reaction_method"].startswith("3 times")
    assert abs((date.today() - stopping["reaction_measured"]).days) <= 1
    assert "# what the proof of distances rests on" in written
    assert "# the person who crosses" in written


class Page(HTMLParser):
    """What a reader sees: text, pictures, charts; and that the page is well made."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.text, self.pictures, self.charts, self._open = "", 0, 0, list[str]()
        self.feed(page)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.charts += tag == "svg"
        if tag == "img":
            assert str(dict(attrs)["src"]).startswith("data:image/png;base64,")
            assert dict(attrs)["alt"]
            self.pictures += 1
        if tag not in ("img", "meta"):
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        del tag, attrs

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_a_failed_step_is_in_the_headline_and_nothing_in_it_is_markup() -> None:
    results = [
        Result("sign: front", True, "front", "front", CURVE),
        Result("cap: <b>", False, "512 mm/s & more", "at most 500 mm/s"),
    ]
    page = Page(html(sim(), results, FOUND, Head("2026-11-22", "", ["chairward 1"])))
    assert "NOT passed: 1 of 2 steps failed" in page.text
    assert "cap: <b>" in page.text
    assert "93 ms at most" in page.text
    assert "SHA-256" in page.text


def test_a_chart_of_a_step_can_be_read_as_xml() -> None:
    page = html(sim(), [Result("x", True, "", "", CURVE)], None, Head("", "", []))
    ET.fromstring(page[page.index("<svg") : page.index("</svg>") + 6])


def test_a_measured_reaction_is_written_with_date_and_method_and_comments_stay(profiles: Path) -> None:
    path = profiles / "chairs" / "sim.toml"
    before = path.read_text()
    write(path, FOUND)
    after = path.read_text()
    stopping = tomllib.loads(after)["stopping"]
    assert stopping["reaction_ms"] == 93
    assert stopping["reaction_measured"] == date(2026, 11, 22)
    assert stopping["reaction_method"] == "3 times, an obstacle"
    assert [line for line in before.splitlines() if line not in after.splitlines()] == []
    write(path, replace(FOUND, reactions_ms=(50.0,)))
    assert tomllib.loads(path.read_text())["stopping"]["reaction_ms"] == 50


@pytest.mark.parametrize(("ms", "reaction_s"), [(0, 0.45), (93, 0.45), (246, 0.45), (300, 0.504)])
def test_the_proof_reckons_with_a_reaction_that_was_longer_than_the_limits_allow(
    profiles: Path, ms: int, reaction_s: float
) -> None:
    path = profiles / "chairs" / "sim.toml"
    path.write_text(path.read_text().replace("[stopping]", f"[stopping]\nreaction_ms = {ms}", 1))
    plan = profile.load("sim", None, [], discover())
    assert plan.limits.reaction_s == pytest.approx(reaction_s)


def test_a_reaction_that_is_too_long_for_the_speed_is_refused_with_the_speed_that_fits(profiles: Path) -> None:
    path = profiles / "chairs" / "sim.toml"
    path.write_text(path.read_text().replace("[stopping]", "[stopping]\nreaction_ms = 900", 1))
    with pytest.raises(ProfileError, match=r"limits.forward_mm_s = 500: .* at most \d+ fits"):
        profile.load("sim", None, [], discover())


def test_the_hand_is_one_more_stop_device_and_the_chair_s_own_votes_stay() -> None:
    plan, tried = sim(), on_trial(sim())
    name = HAND_SOURCE
    assert tried.lanes[:-1] == plan.lanes
    assert set(tried.limits.stop_devices) == {*plan.limits.stop_devices, name}
    assert set(tried.limits.recognizers) == {*plan.limits.recognizers, name}
    assert tried.limits.sensors == plan.limits.sensors
    assert msgspec.structs.replace(tried.limits, stop_devices={}, recognizers={}) == msgspec.structs.replace(
        plan.limits, stop_devices={}, recognizers={}
    )


def test_a_hand_says_what_it_holds_and_presses_and_is_lifeless_without_its_check(tmp_path: Path) -> None:
    source = CheckHand(NoSettings(), Context(lane="check", run_dir=tmp_path, chair_dir=tmp_path))
    with hand(tmp_path) as it:
        source.open()
        it.beat()
        it.hold(Command.LEFT)
        it.press(Button.ARM)
        said = source.read(1.0) or []
        assert [type(message) for message in said] == [Press, Alive, Intent]
        assert [m.button for m in said if isinstance(m, Press)] == [Button.ARM]
        assert [(m.command, m.held) for m in said if isinstance(m, Intent)] == [(Command.LEFT, True)]
        it.hold(None)
    silent = [source.read(0.1) for _ in range(8)]
    assert silent[-1] is None, "the check has left, and the hand lets go"
    source.close()
    source.close()


def test_a_hand_without_a_check_is_a_lost_device(tmp_path: Path) -> None:
    source = CheckHand(NoSettings(), Context(lane="check", run_dir=tmp_path, chair_dir=tmp_path))
    with pytest.raises(DeviceLost, match="no check is running"):
        source.open()


def test_a_robot_is_not_moved_without_a_word(profiles: Path) -> None:
    path = profiles / "chairs" / "prototype.toml"
    table = "[drive.pic_serial]\nsilence_stop_ms = 180\nsilence_stop_measured = 2026-01-01"
    path.write_text(path.read_text().replace("[drive.pic_serial]", table))
    result = CliRunner().invoke(app, ["check", "chair", "--chair", "prototype"])
    assert result.exit_code == 2
    assert "say --yes once they are off the ground" in result.output
