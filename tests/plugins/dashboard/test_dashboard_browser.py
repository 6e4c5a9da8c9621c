"""The pages in a real browser: what people see and press reaches the lane, in every language, by keyboard alone."""

from __future__ import annotations

import json
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from chairward.facts import Wish
from chairward.messages import Alive, Button, Command, Intent, Message, Press
from chairward_dashboard.site import STATIC

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (uv sync)")
CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.processes,
    pytest.mark.timeout(400),
    pytest.mark.skipif(CHROMIUM is None, reason="needs a browser: apt-get install chromium"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
SCREENSHOTS = Path(__file__).resolve().parents[3] / "docs" / "screenshots"
QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
LANGUAGES = ("en", "de", "fr", "hi", "ar")

Chair = Any
Tab = Any


class Life:
    """Keeps the chair alive beside the browser: records and pictures, ten times a second."""

    def __init__(self, chair: Chair) -> None:
        self.chair, self.ahead_mm = chair, 3_000
        self.heard: tuple[Wish, ...] = ()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(0.1):
            heard, self.heard = self.heard, ()
            self.chair.decide(self.ahead_mm, heard=heard)
            self.chair.picture()

    def end(self) -> None:
        self._end.set()
        self._thread.join()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as tool:
        one = tool.chromium.launch(executable_path=CHROMIUM, headless=True, args=QUIET)
        yield one
        one.close()


@pytest.fixture
def life(chair: Chair) -> Iterator[Life]:
    one = Life(chair)
    yield one
    one.end()


@pytest.fixture
def tab(browser: Any, chair: Chair, life: Life) -> Iterator[Tab]:
    """The drive page, open; it must not have said anything to the console, nor asked any other server."""
    context = browser.new_context(viewport={"width": 1180, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(90_000)
    page = context.new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda r: said.append(r.url) if chair.address not in r.url and "blob:" not in r.url else None)
    page.goto(chair.source.url)
    wait(page, "document.getElementById('mm').textContent.length > 1")
    yield page
    context.close()
    assert [words for words in said if "ERR_CONNECTION_REFUSED" not in words] == []


def wait(tab: Tab, condition: str, arg: Any = None, within_s: float = 90.0) -> None:
    """Until a JavaScript expression is true. (The tool's own waiting needs `eval`, which the pages forbid.)"""
    end = time.monotonic() + within_s
    while not tab.evaluate(condition, arg):
        assert time.monotonic() < end, f"not true within {within_s} s: {condition} {arg or ''}"
        tab.wait_for_timeout(50)


def is_press(button: Button) -> Callable[[Message], bool]:
    return lambda m: isinstance(m, Press) and m.button is button


def well(message: Message) -> bool:
    return isinstance(message, Alive) and message.well


def text_is(tab: Tab, element: str, wanted: str) -> None:
    """Wait until the element says exactly that."""
    wait(tab, "([id, words]) => document.getElementById(id).textContent === words", [element, wanted])


def choose(tab: Tab, language: str) -> None:
    words = json.loads((STATIC / "messages" / f"{language}.json").read_text())
    tab.select_option("#language", language)
    wait(tab, "words => document.querySelector('#arm').textContent === words", words["arm"])


def violations(tab: Tab) -> list[str]:
    """What axe-core finds wrong, by rule, with the elements."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python (uv sync)")
    options = {"rules": {"target-size": {"enabled": True}}}  # the rule of WCAG 2.2 AA, off by default
    found = axe.Axe().run(tab, options=options).response["violations"]
    return [f"{v['id']}: {v['help']}: {[n['target'] for n in v['nodes']][:4]}" for v in found]


def picture(tab: Tab, name: str) -> None:
    """A screenshot for the documentation, when asked for; always that one can be taken."""
    wanted = os.environ.get("CHAIRWARD_SCREENSHOTS") == "1"
    SCREENSHOTS.mkdir(exist_ok=True) if wanted else None
    data = tab.screenshot(path=SCREENSHOTS / f"{name}.png" if wanted else None, full_page=True)
    assert data


def test_the_page_shows_distance_instruction_and_reason(tab: Tab, life: Life) -> None:
    text_is(tab, "mm", "3,000")
    text_is(tab, "instruction", "Way clear")
    assert tab.get_attribute("#sign", "class") == "go"
    life.ahead_mm = 540
    text_is(tab, "mm", "540")
    text_is(tab, "instruction", "Stop now")
    assert tab.get_attribute("#sign", "class") == "stop"
    assert "Too near" in tab.inner_text("#reasons")
    sizes = tab.evaluate("[...document.querySelectorAll('*')].map(e => parseFloat(getComputedStyle(e).fontSize))")
    assert tab.evaluate("parseFloat(getComputedStyle(document.getElementById('mm')).fontSize)") == max(sizes)
    assert "protective stop" in tab.inner_text("footer")


def test_all_four_pictures_are_drawn(tab: Tab) -> None:
    drawn = """() => [...document.querySelectorAll('#panes figure:not(.old) > canvas:first-child')].filter(pane => {
        const copy = new OffscreenCanvas(pane.width, pane.height).getContext('2d', { willReadFrequently: true });
        copy.drawImage(pane, 0, 0);
        return copy.getImageData(300, 120, 1, 1).data.slice(0, 3).some(value => value > 200);
    }).length"""
    wait(tab, f"() => ({drawn})() === 4")


def test_stop_by_click_touch_space_and_escape_reaches_the_lane(tab: Tab, chair: Chair) -> None:
    presses: list[Callable[[], None]] = [
        lambda: tab.click("#stop"),
        lambda: tab.keyboard.press("Space"),
        lambda: tab.keyboard.press("Escape"),
        lambda: tab.press("#arm", "Space"),
        lambda: tab.press("#language", "Space"),
    ]
    for press in presses:
        chair.read_for(0.4)
        press()
        chair.read_until(is_press(Button.STOP))
    assert not any(isinstance(m, Press) and m.button is not Button.STOP for m in chair.read_for(0.3))


def test_any_button_of_a_gamepad_stops(tab: Tab, chair: Chair) -> None:
    chair.read_until(well)
    tab.evaluate("() => { navigator.getGamepads = () => [null, {buttons: [{pressed: false}, {pressed: true}]}]; }")
    chair.read_until(is_press(Button.STOP))


def test_a_screen_reader_is_told_the_instruction_at_once_and_the_distance_when_it_is_its_turn(
    tab: Tab, life: Life
) -> None:
    wait(tab, "document.querySelector('#instruction[aria-live=assertive]').textContent === 'Way clear'")
    before = tab.inner_text("#distance-said[aria-live=polite]")
    life.ahead_mm = 540
    wait(tab, "document.querySelector('#instruction[aria-live=assertive]').textContent === 'Stop now'")
    said = "document.querySelector('#distance-said[aria-live=polite]').textContent"
    wait(tab, f"before => {said} !== before && {said}.length > 0", before)


def test_the_screen_stays_on_and_a_stop_shakes_where_sound_is_on(tab: Tab, life: Life) -> None:
    tab.add_init_script(
        """navigator.vibrate = (shakes) => { window.shaken = shakes; };
        WakeLock.prototype.request = async (kind) => { window.kept = kind; return new EventTarget(); };"""
    )
    tab.reload()
    free = "document.querySelector('#take:not([hidden])')"  # the page before it may have let go too late
    wait(tab, f"({free}?.click(), window.kept === 'screen')")
    text_is(tab, "instruction", "Way clear")
    tab.check("#sound")
    life.ahead_mm = 540
    wait(tab, "window.shaken?.length === 3")


def test_help_by_click_and_by_enter_reaches_the_lane(tab: Tab, chair: Chair) -> None:
    tab.focus("#help")
    tab.keyboard.press("Enter")
    called = chair.read_until(lambda m: isinstance(m, Intent))
    assert isinstance(called, Intent)
    assert called.command is Command.HELP


def test_arm_is_there_only_standing_and_not_armed(tab: Tab, chair: Chair) -> None:
    chair.read_until(well)
    assert tab.get_attribute("#arm", "aria-disabled") == "true", "the chair is armed already"
    tab.click("#arm", force=True)
    assert not any(isinstance(m, Press) for m in chair.read_for(0.4))
    chair.state = type(chair.state)()
    tab.wait_for_selector("#arm[aria-disabled=false]")
    tab.focus("#arm")
    end, heard = time.monotonic() + 60.0, False
    while not heard:  # a page that has just stuttered is refused, as it should be: a person presses again
        assert time.monotonic() < end, "ARM did not reach the lane within 60 s"
        tab.keyboard.press("Enter")
        heard = any(is_press(Button.ARM)(message) for message in chair.read_for(0.5))


def test_closing_the_page_ends_the_stop_device(browser: Any, chair: Chair, life: Life) -> None:
    context = browser.new_context()
    page = context.new_page()
    page.goto(chair.source.url)
    chair.read_until(well, within_s=30.0)
    context.close()
    chair.read_until(lambda m: isinstance(m, Alive) and not m.well)
    assert not any(well(m) for m in chair.read_for(0.7))


def test_a_second_page_only_looks(tab: Tab, browser: Any, chair: Chair) -> None:
    chair.read_until(well)
    other = browser.new_context().new_page()
    other.goto(chair.source.url)
    wait(other, "document.getElementById('control').textContent.startsWith('Another screen')")
    assert other.get_attribute("#arm", "aria-disabled") == "true"
    chair.read_for(0.2)
    other.keyboard.press("Space")
    chair.read_until(is_press(Button.STOP))
    other.context.close()


def test_with_one_switch_the_focus_walks_and_enter_presses(tab: Tab, chair: Chair) -> None:
    tab.select_option("#scan", "1")
    wait(tab, "document.activeElement.id === 'stop'")
    wait(tab, "document.activeElement.id === 'help'")
    tab.keyboard.press("Enter")
    chair.read_until(lambda m: isinstance(m, Intent))
    seen = {tab.evaluate("document.activeElement.id")}
    for _ in range(20):
        tab.wait_for_timeout(200)
        seen.add(tab.evaluate("document.activeElement.id"))
    assert "stop" in seen
    assert seen <= {"stop", "help", "give", "take"}, "what does nothing now is not offered"


def test_the_lease_bar_shrinks_and_what_was_heard_is_shown(tab: Tab, life: Life) -> None:
    life.heard = (
        Wish(
            source="voice/voice_dtw",
            seq=1,
            at_ns=time.monotonic_ns(),
            command=Command.FRONT,
            word="आगे",
            confidence=0.93,
        ),
    )
    wait(
        tab,
        "document.getElementById('heard').textContent.replace(/[\\u2066\\u2069]/g, '').startsWith('आगे = front, 93 %')",
    )
    text_is(tab, "instruction", "Go straight")
    width = "parseFloat(document.querySelector('#lease span').style.width)"
    wait(tab, f"{width} > 0 && {width} < 95")


def test_a_lost_link_is_shown_as_stop_and_comes_back(tab: Tab, chair: Chair) -> None:
    chair.source.close()
    wait(tab, "document.getElementById('reasons').textContent.includes('No connection')")
    text_is(tab, "instruction", "Stop now")
    text_is(tab, "mm", "–")


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language_fits_and_arabic_runs_from_right_to_left(tab: Tab, language: str) -> None:
    choose(tab, language)
    assert tab.evaluate("document.documentElement.lang") == language
    rtl = language == "ar"
    assert tab.evaluate("document.documentElement.dir") == ("rtl" if rtl else "ltr")
    for width in (1180, 390):
        tab.set_viewport_size({"width": width, "height": 900})
        assert tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    tab.set_viewport_size({"width": 1180, "height": 900})
    sign, stop = (
        tab.evaluate(f"document.querySelector('{s}').getBoundingClientRect().left") for s in ("#sign", "#controls")
    )
    assert (sign > stop) == rtl
    untold = tab.evaluate(
        "[...document.querySelectorAll('[data-text]')].filter(e => e.textContent === e.dataset.text && "
        "e.dataset.text.includes('.')).map(e => e.dataset.text)"
    )
    assert untold == []
    if language in ("en", "ar"):
        picture(tab, f"drive-{language}")


def test_reasons_are_told_in_the_language_of_the_page(tab: Tab, life: Life) -> None:
    choose(tab, "de")
    life.ahead_mm = 540
    wait(tab, "document.getElementById('reasons').textContent.includes('Zu nah – front/stereo_range: ')")
    shown = tab.inner_text("#reasons").replace("\u2066", "").replace("\u2069", "")
    assert "540 mm voraus" in shown


@pytest.mark.parametrize("theme", ["light", "dark", "contrast"])
def test_axe_finds_nothing_in_any_theme_and_instruction(tab: Tab, life: Life, theme: str) -> None:
    tab.select_option("#theme", theme)
    tab.check("#large")
    for ahead_mm, words in ((3_000, "Way clear"), (700, "Turn slightly left"), (540, "Stop now")):
        life.ahead_mm = ahead_mm
        text_is(tab, "instruction", words)
        assert violations(tab) == []
    if theme == "contrast":
        picture(tab, "drive-contrast-large")


def test_the_live_view_shows_one_picture_and_stops_but_is_no_stop_device(tab: Tab, chair: Chair) -> None:
    tab.goto(f"{chair.source.url}live?pane=right")
    tab.wait_for_selector("#view:not([hidden])")
    wait(tab, "document.getElementById('view').naturalWidth > 100")
    assert violations(tab) == []
    picture(tab, "live")
    chair.read_for(0.7)
    tab.keyboard.press("Escape")
    chair.read_until(is_press(Button.STOP))
    assert not any(well(m) for m in chair.read_for(0.5))


def test_the_pairing_page_is_accessible(tab: Tab, chair: Chair) -> None:
    tab.goto(f"{chair.source.url}pair?wrong")
    wait(tab, "document.getElementById('wrong').textContent.length > 10")
    assert violations(tab) == []
    picture(tab, "pair")


def test_all_languages_have_all_words() -> None:
    tables = {name: json.loads((STATIC / "messages" / f"{name}.json").read_text()) for name in LANGUAGES}
    assert {f.stem for f in (STATIC / "messages").iterdir()} == set(LANGUAGES)
    for name, table in tables.items():
        assert table.keys() == tables["en"].keys(), name
        assert all(words.strip() for words in table.values()), name
