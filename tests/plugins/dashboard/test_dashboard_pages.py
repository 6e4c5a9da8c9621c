"""The set-up pages in a real browser: accessible in every direction of writing, and what they are for works."""

from __future__ import annotations

import os
import shutil
import threading
import time
import tomllib
import wave
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from chairward.messages import Button, DriveStatus, Press
from chairward_dashboard.settings import DashboardSettings

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (uv sync)")
CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.processes,
    pytest.mark.timeout(600),
    pytest.mark.skipif(CHROMIUM is None, reason="needs a browser: apt-get install chromium"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
ROOT = Path(__file__).resolve().parents[3]
SAID = ROOT / "plugins/simulator/src/chairward_simulator/words/templates"
SCREENSHOTS = ROOT / "docs" / "screenshots"
WITHIN_S = 120.0
PAGES = ("words", "person", "plugins", "stops", "calibrate")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
AUDIO = ["--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream"]

Chair = Any
Tab = Any


def microphone_file(folder: Path) -> Path:
    """What the browser's microphone hears, over and over: four times "front", with pauses."""
    parts, rng = [], np.random.default_rng(3)
    for nth in (1, 2, 3, 4):
        with wave.open(str(SAID / f"front_{nth}.wav")) as file:
            rate, word = file.getframerate(), np.frombuffer(file.readframes(file.getnframes()), "<i2")
        parts += [word, rng.normal(0.0, 12.0, int(0.9 * rate)).astype(np.int16)]
    path = folder / "said.wav"
    with wave.open(str(path), "wb") as out:
        out.setnchannels(1)
        out.setsampwidth(2)
        out.setframerate(rate)
        out.writeframes(np.concatenate(parts).astype("<i2").tobytes())
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    said = microphone_file(tmp_path_factory.mktemp("said"))
    with playwright.sync_playwright() as tool:
        args = [*QUIET, *AUDIO, f"--use-file-for-fake-audio-capture={said}"]
        one = tool.chromium.launch(executable_path=CHROMIUM, headless=True, args=args)
        yield one
        one.close()


@pytest.fixture
def life(planned_chair: Chair) -> Iterator[Callable[[int], None]]:
    """The chair stands, not armed, and its guard goes on deciding; gives what sets the distance ahead."""
    over, ahead = threading.Event(), [2_400]
    planned_chair.state = type(planned_chair.state)()

    def run() -> None:
        while not over.wait(0.1):
            at_rest = DriveStatus(at_ns=time.monotonic_ns(), linked=True, armed=False, speed_mm_s=0.0, battery=0.8)
            planned_chair.decide(ahead[0], drive=at_rest)
            planned_chair.picture()

    thread = threading.Thread(target=run)
    thread.start()
    yield lambda mm: ahead.__setitem__(0, mm)
    over.set()
    thread.join()


@pytest.fixture
def show(browser: Any, planned_chair: Chair, life: Any) -> Iterator[Callable[[str], Tab]]:
    """Opens a page and waits until it has loaded; none may complain on the console or ask another server."""
    context = browser.new_context(viewport={"width": 1180, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(120_000)
    said: list[str] = []

    def one(name: str) -> Tab:
        tab = context.new_page()
        tab.on("pageerror", lambda error: said.append(str(error)))
        tab.on("request", lambda r: said.append(r.url) if planned_chair.address not in r.url else None)
        tab.goto(f"{planned_chair.source.url}{name}")
        wait(tab, "document.getElementById('loading')?.hidden")
        assert tab.inner_text("#trouble") == ""
        wait(tab, "document.getElementById('mm').textContent.length > 1")
        return tab

    yield one
    context.close()
    assert [words for words in said if not words.startswith("blob:")] == []


def wait(tab: Tab, condition: str, arg: Any = None, within_s: float = WITHIN_S) -> None:
    """Until a JavaScript expression is true. (The tool's own waiting needs `eval`, which the pages forbid.)"""
    end = time.monotonic() + within_s
    while not tab.evaluate(condition, arg):
        assert time.monotonic() < end, f"not true within {within_s} s: {condition}; the page: {tab.inner_text('main')}"
        tab.wait_for_timeout(100)


def violations(tab: Tab) -> list[str]:
    """What axe-core finds wrong, by rule, with the elements."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python (uv sync)")
    options = {"rules": {"target-size": {"enabled": True}}}  # the rule of WCAG 2.2 AA, off by default
    found = axe.Axe().run(tab, options=options).response["violations"]
    return [f"{v['id']}: {v['help']}: {[n['target'] for n in v['nodes']][:4]}" for v in found]


def picture(tab: Tab, name: str) -> None:
    """A screenshot for the documentation, when asked for: the whole page, nothing sticking over it."""
    if os.environ.get("CHAIRWARD_SCREENSHOTS") != "1":
        return
    height = tab.evaluate("document.documentElement.scrollHeight")
    tab.set_viewport_size({"width": 1180, "height": min(height, 1800)})
    image = cv2.imdecode(np.frombuffer(tab.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    few = np.where(image >= 0xF8, 255, (image & 0xF8) | 3).astype(np.uint8)
    SCREENSHOTS.mkdir(exist_ok=True)
    cv2.imwrite(str(SCREENSHOTS / f"{name}.png"), few, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    tab.set_viewport_size({"width": 1180, "height": 900})


@pytest.mark.parametrize("name", PAGES)
def test_every_set_up_page_is_accessible_and_fits_in_both_directions(show: Callable[[str], Tab], name: str) -> None:
    tab = show(name)
    if name not in ("words", "stops"):  # their pictures are taken when there is something on them
        picture(tab, name)
    for theme in ("light", "contrast"):
        tab.evaluate("theme => { document.documentElement.dataset.theme = theme; }", theme)
        assert violations(tab) == []
    tab.evaluate("document.documentElement.toggleAttribute('data-large', true)")
    for language, direction in (("ar", "rtl"), ("de", "ltr")):
        tab.select_option("#language", language)
        wait(
            tab,
            "([language, direction]) => document.documentElement.lang === language && "
            "document.documentElement.dir === direction",
            [language, direction],
        )
        for width in (1180, 390):
            tab.set_viewport_size({"width": width, "height": 900})
            over = tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert over <= 0, f"{name} in {language} is {over} px wider than {width} px"
        tab.set_viewport_size({"width": 1180, "height": 900})
        untold = "[...document.querySelectorAll('[data-text]')].filter(e => e.textContent === e.dataset.text)"
        assert tab.evaluate(f"{untold}.map(e => e.dataset.text)") == []
    stop, sign = (tab.evaluate(f"document.querySelector('#{i}').getBoundingClientRect().left") for i in ("stop", "mm"))
    assert sign < stop, "in German the Stop is on the right"
    tab.select_option("#language", "ar")
    wait(tab, "document.documentElement.dir === 'rtl'")
    stop, sign = (tab.evaluate(f"document.querySelector('#{i}').getBoundingClientRect().left") for i in ("stop", "mm"))
    assert stop < sign, "in Arabic it is on the left"


def test_a_word_is_recorded_with_the_browsers_microphone_saved_and_recognised(
    show: Callable[[str], Tab], home: Path, call: Callable[..., Any]
) -> None:
    takes = [call("words/take", (SAID / f"stop_{n}.wav").read_bytes()).json()["take"] for n in (1, 2, 3)]
    call("words/save", {"person": "demo", "word": "stop", "takes": takes, "force": True})
    tab = show("words")
    tab.click("tr[data-word='front'] button:has-text('Record')")
    tab.click("#record")
    wait(
        tab,
        "document.querySelectorAll('#takes li').length >= 3 && "
        "document.getElementById('save').getAttribute('aria-disabled') === 'false'",
    )
    drawn = """[...document.querySelectorAll('#takes canvas')].every(canvas => {
        const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return new Set(data).size > 2;
    })"""
    assert tab.evaluate(drawn), "every recording shows a waveform and a spectrum"
    assert violations(tab) == []
    picture(tab, "words")
    tab.click("#save")
    wait(tab, "document.getElementById('recording').hidden || !document.getElementById('anyway').hidden")
    if tab.is_visible("#anyway"):  # the same four sounds over and over may be found too much, or too little, alike
        tab.click("#anyway")
        wait(tab, "document.getElementById('recording').hidden")
    wait(tab, "document.querySelectorAll('tr[data-word=front] button[aria-label^=Play]').length >= 3")
    assert len(list((home / "data/chairward/people/demo/words").glob("front_*.wav"))) >= 1
    tab.click("#try")
    wait(tab, "document.getElementById('heard').classList.contains('go')")
    assert "“front”" in tab.inner_text("#heard")
    assert tab.evaluate("document.querySelector('#scores .score bdi').textContent") == "front"
    assert float(tab.get_attribute("#level", "aria-valuenow")) > -80.0
    tab.click("#try")


def test_an_unsafe_limit_is_refused_on_the_page_and_cannot_be_saved(show: Callable[[str], Tab], profiles: Path) -> None:
    tab = show("person")
    tab.fill("input[data-name='limits.stop_mm']", "500")
    wait(tab, "document.getElementById('proof').textContent.includes('limits.stop_mm = 500')")
    assert tab.get_attribute("#keep", "aria-disabled") == "true"
    assert violations(tab) == []
    tab.fill("input[data-name='limits.stop_mm']", "700")
    wait(tab, "document.getElementById('keep').getAttribute('aria-disabled') === 'false'")
    assert "stops in" in tab.inner_text("#proof")
    tab.click("#keep")
    wait(tab, "document.getElementById('proof').textContent.startsWith('Saved')")
    kept = tomllib.loads((profiles / "people" / "demo.toml").read_text(encoding="utf-8"))
    assert kept["limits"] == {"stop_mm": 700}


def test_by_keyboard_a_space_is_typed_into_a_word_but_stops_elsewhere(
    show: Callable[[str], Tab], planned_chair: Chair
) -> None:
    tab = show("words")
    tab.focus("#new-word")
    tab.keyboard.type("go on")
    assert tab.input_value("#new-word") == "go on"
    assert not any(isinstance(m, Press) for m in planned_chair.read_for(0.5))
    tab.keyboard.press("Escape")
    planned_chair.read_until(lambda m: isinstance(m, Press) and m.button is Button.STOP, within_s=30.0)
    planned_chair.read_for(1.0)  # the same press again, just handed on, would say nothing new
    tab.evaluate("document.activeElement.blur()")
    tab.keyboard.press("Space")
    planned_chair.read_until(lambda m: isinstance(m, Press) and m.button is Button.STOP, within_s=30.0)


class TestWithRawCameras:
    """A chair whose camera pair is a folder of pictures of a chessboard that is held here and there."""

    @pytest.fixture
    def profiles(self, profiles: Path, tmp_path: Path) -> Path:
        folder = tmp_path / "boards"
        folder.mkdir()
        board = np.kron((np.indices((7, 10)).sum(0) % 2).astype(np.uint8), np.ones((22, 22), np.uint8)) * 215 + 20
        for nth, (x, y) in enumerate([(60, 40), (180, 40), (180, 150), (60, 150)]):
            for side, shift in (("left", 0), ("right", -12)):
                picture = np.full((360, 480), 235, np.uint8)
                picture[y : y + board.shape[0], x + shift : x + shift + board.shape[1]] = board
                for again in range(10):
                    cv2.imwrite(str(folder / f"{side}{10 * nth + again:02d}.png"), picture)
        file = profiles / "chairs" / "screen.toml"
        text = file.read_text(encoding="utf-8").replace('source = "sim_cameras"', 'source = "cameras"')
        more = f'\n[settings.cameras]\nkind = "folder"\nfolder = "{folder}"\nplayback_fps = 5\n'
        file.write_text(text + more, encoding="utf-8")
        return profiles

    def test_calibrating_live_shows_what_to_do_next_and_what_is_covered(
        self, show: Callable[[str], Tab], planned_chair: Chair
    ) -> None:
        tab = show("calibrate")
        tab.click("#begin")
        lent = planned_chair.context.run_dir / "lent-front"
        wait(tab, "Number(document.getElementById('coverage').getAttribute('aria-valuenow')) > 20")
        assert tab.inner_text("#hint") != ""
        wait(tab, "document.getElementById('preview').naturalWidth > 100")
        assert violations(tab) == []
        picture(tab, "calibrate")
        wait(tab, "document.getElementById('finish').hidden")
        end = time.monotonic() + 30.0
        while lent.exists():
            assert time.monotonic() < end, "the cameras were not given back within 30 s"
            time.sleep(0.05)
        assert tab.inner_text("#hint") != "", "four pictures are too few, and it says so"
        assert tab.is_hidden("#result")


def test_stops_are_listed_with_picture_and_reason(show: Callable[[str], Tab], planned_chair: Chair) -> None:
    from chairward.facts import Pressed

    planned_chair.state = type(planned_chair.state)(latch="")
    pressed = Pressed(source="screen/dashboard", button=Button.STOP, at_ns=time.monotonic_ns())
    planned_chair.decide(540, pressed=(pressed,))
    tab = show("stops")
    wait(tab, "document.querySelectorAll('#log li.card').length > 0")
    assert "STOP was pressed" in tab.inner_text("#log")
    assert "no picture kept" in tab.inner_text("#log")
    assert violations(tab) == []
    picture(tab, "stops")


class TestOnANetwork:
    """Bound to more than loopback: a screen must be paired first."""

    @pytest.fixture
    def settings(self) -> DashboardSettings:
        return DashboardSettings(host="0.0.0.0", port=0)

    def test_a_wrong_code_is_refused_and_the_right_one_opens_the_page(self, browser: Any, chair: Chair) -> None:
        context = browser.new_context()
        context.set_default_timeout(120_000)
        tab = context.new_page()
        url = chair.source.url.replace("0.0.0.0", "127.0.0.1")
        tab.goto(url)
        assert tab.url.endswith("/pair")
        for code, arrives in (
            ("00000000", "?wrong"),
            ((chair.context.run_dir / "screen.code").read_text().strip(), "/"),
        ):
            tab.fill("input[name=code]", code)
            tab.click("button")
            wait(tab, "ends => location.href.endsWith(ends)", arrives)
        wait(tab, "document.getElementById('control')?.textContent.length > 0")
        context.clear_cookies()
        tab.goto(f"{url}words")
        assert tab.url.endswith("/pair"), "without the token nothing is shown"
        context.close()
