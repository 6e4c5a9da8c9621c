"""The server with real clients: what pages see, what they may cause, and what hostile ones cannot."""

from __future__ import annotations

import json
import random
import socket
import time
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from chairward.components import DeviceLost
from chairward.facts import MS, Wish
from chairward.messages import Alive, Button, Command, Intent, Message, Press
from chairward_dashboard.settings import DashboardSettings

Chair = Any
Page = Any
OpenPage = Callable[..., Any]
"""Those of conftest.py, which a test module cannot import."""


def is_press(button: Button) -> Callable[[Message], bool]:
    return lambda m: isinstance(m, Press) and m.button is button


def well(message: Message) -> bool:
    return isinstance(message, Alive) and message.well


def not_well(message: Message) -> bool:
    return isinstance(message, Alive) and not message.well


def closed_with(page: Page, within_s: float = 10.0) -> int:
    """The code with which the server closes the page."""
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        try:
            page.socket.recv(within_s)
        except ConnectionClosed as closed:
            return closed.rcvd.code if closed.rcvd else 1006
    raise AssertionError("the page was not closed")


# ---- what pages see -------------------------------------------------------------------------------------------------


def test_a_page_shows_the_distance_the_reason_and_the_word_of_the_newest_record(
    chair: Chair, open_page: OpenPage
) -> None:
    now_ns = time.monotonic_ns()
    word = Wish(source="voice/voice_dtw", seq=1, at_ns=now_ns, command=Command.FRONT, word="vorwärts", confidence=0.87)
    chair.decide(540, heard=(word,))
    page = open_page()
    state = page.bundle_until(lambda head: head["state"].get("nearest_mm") == 540)["state"]
    assert (state["colour"], state["shape"], state["instruction"]) == ("stop", "octagon", "stop_now")
    assert any(r["rule"] == "stop_distance" and "540 mm" in r["detail"] for r in state["reasons"])
    assert (state["heard"]["word"], state["heard"]["confidence"]) == ("vorwärts", 0.87)
    assert "ahead" not in state["open"]
    assert state["microphone"]["level_dbfs"] == -31.0
    assert state["drive"]["battery"] == 0.8
    assert {s["name"] for s in state["sources"]} == {"drive", "supervisor"}, "without plan.json no limits are known"


def test_go_straight_needs_a_live_forward_word_otherwise_the_way_is_clear(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    chair.decide(3_000)
    page.bundle_until(lambda head: head["state"]["instruction"] == "way_clear")
    word = Wish(source="voice/voice_dtw", seq=1, at_ns=time.monotonic_ns(), command=Command.FRONT, word="front")
    chair.decide(3_000, heard=(word,))
    state = page.bundle_until(lambda head: head["state"]["instruction"] == "go_straight")["state"]
    assert state["colour"] == "go"
    assert 0.0 < state["lease_left_s"] <= state["lease_s"]


def test_a_chair_that_says_nothing_is_shown_as_stop_without_a_distance(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    chair.decide(3_000)
    page.bundle_until(lambda head: head["state"].get("nearest_mm") == 3_000)
    state = page.bundle_until(lambda head: not head["state"]["news"])["state"]
    assert (state["instruction"], state["nearest_mm"], state["open"]) == ("stop_now", None, [])


def test_pictures_come_as_jpeg_only_those_asked_for_and_each_once(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    page.say(t="look", panes=["left", "disparity"])
    chair.picture()
    names: list[str] = []
    for _ in range(40):
        head, blobs = page.bundle()
        names += [pane["name"] for pane in head["panes"]]
        assert all(blob.startswith(b"\xff\xd8") for blob in blobs)
        if len(names) >= 2:
            break
    for _ in range(5):
        names += [pane["name"] for pane in page.bundle()[0]["panes"]]
    assert sorted(names) == ["disparity", "left"]


def test_a_page_that_does_not_acknowledge_gets_two_bundles_then_the_newest(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    sizes = [page.socket.recv(5.0), page.socket.recv(5.0)]
    assert len(sizes) == 2
    with pytest.raises(TimeoutError):
        page.socket.recv(0.7)
    chair.decide(1_234)
    time.sleep(0.2)  # the record must be older than the bundle: what waits is not a queue
    page.say(t="got", n=2)
    head, _ = page.bundle()
    assert head["n"] == 3
    assert head["state"]["nearest_mm"] == 1_234


# ---- the stop device ------------------------------------------------------------------------------------------------


def test_alive_is_said_only_while_the_controlling_page_beats(chair: Chair, open_page: OpenPage) -> None:
    assert chair.read_for(0.3) == [], "no page, no stop device"
    page = open_page()
    page.say(t="take")
    assert not any(well(m) for m in chair.read_for(0.3)), "a page that does not beat is none"
    page.beat()
    alive = chair.read_until(well)
    assert time.monotonic_ns() - alive.captured_ns < 5_000 * MS
    lost = chair.read_until(not_well)
    assert isinstance(lost, Alive)
    assert "silent" in lost.reason
    assert not any(well(m) for m in chair.read_for(0.5))


def test_closing_the_page_says_at_once_that_the_stop_device_is_gone(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    chair.alive_through(page)
    page.beat()
    page.close()
    gone = chair.read_until(not_well)
    assert isinstance(gone, Alive)
    assert "closed" in gone.reason


def test_a_hidden_page_is_no_stop_device_and_arms_nothing(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    chair.alive_through(page)
    page.say(t="hidden")
    chair.read_until(not_well)
    page.say(t="push", button="arm")
    page.bundle_until(lambda head: head["you"]["refused"] == "refused.stutter")
    assert not any(isinstance(m, Press) for m in chair.read_for(0.3))


def test_buttons_of_the_controlling_page_reach_the_lane(chair: Chair, open_page: OpenPage) -> None:
    page = open_page()
    for button in (Button.ARM, Button.RESET, Button.STOP):
        page.take()
        page.say(t="push", button=button.value)
        chair.read_until(is_press(button))
    page.say(t="push", button="help")
    called = chair.read_until(lambda m: isinstance(m, Intent))
    assert isinstance(called, Intent)
    assert called.command is Command.HELP


def test_of_two_pages_one_controls_and_both_can_stop(chair: Chair, open_page: OpenPage) -> None:
    first, second = open_page(), open_page()
    chair.alive_through(first)
    second.take()
    second.say(t="push", button="arm")
    you = second.bundle_until(lambda head: bool(head["you"]["refused"]))["you"]
    assert (you["controls"], you["refused"]) == (False, "refused.viewer")
    second.say(t="push", button="stop")
    chair.read_until(is_press(Button.STOP))


def test_control_changes_hands_only_through_a_stop(chair: Chair, open_page: OpenPage) -> None:
    first, second = open_page(), open_page()
    chair.alive_through(first)
    first.say(t="give")
    second.bundle_until(lambda head: head["you"]["free"])
    second.take()
    said = [m for m in chair.read_for(0.5) if isinstance(m, Alive)]
    assert not_well(said[0])
    assert well(said[-1])


# ---- who may not ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "http://127.0.0.1:1"])
def test_a_page_of_another_origin_is_refused(chair: Chair, open_page: OpenPage, origin: str | None) -> None:
    with pytest.raises(InvalidStatus):
        open_page(origin=origin)
    assert chair.read_for(0.1) == []


def test_a_foreign_name_that_points_here_is_refused(chair: Chair) -> None:
    answer = httpx.get(chair.source.url, headers={"host": "evil.example"})
    assert answer.status_code == 403
    assert httpx.get(chair.source.url).status_code == 200


def test_every_answer_forbids_foreign_content(chair: Chair) -> None:
    for path in ("", "live", "static/style.css", "static/nothing", "../../etc/passwd"):
        headers = httpx.get(chair.source.url + path).headers
        assert headers["content-security-policy"].startswith("default-src 'self'")
        assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "words",
    [
        "",
        "{}",
        "nonsense",
        '{"t":"push","button":"hold"}',
        '{"t":"push","button":"arm","now":1}',
        '{"t":"beat","at_ms":"1"}',
        '{"t":"beat","at_ms":NaN}',
        '{"t":"look","panes":["../../secret"]}',
        "[" * 400,
        b"\x00\xff",
    ],
)
def test_a_malformed_message_closes_its_page_and_touches_no_other(
    chair: Chair, open_page: OpenPage, words: str | bytes
) -> None:
    good, bad = open_page(), open_page()
    good.take()
    bad.socket.send(words)
    assert closed_with(bad) == 1008
    chair.alive_through(good)
    good.bundle_until(lambda head: head["you"]["controls"])


def test_a_hundred_pages_of_malformed_messages_take_nothing_from_the_one_that_controls(
    chair: Chair, open_page: OpenPage
) -> None:
    good = open_page()
    good.say(t="take")
    rng = random.Random(7)
    words = ['{"t":"push","button":"arm"}', '{"t":"beat","at_ms":1e3}', '{"t":"look","panes":["left"],"large":true}']
    for nth in range(100):
        bad = open_page()
        for _ in range(10):
            word = list(rng.choice(words))
            for _ in range(rng.randint(1, 4)):
                word[rng.randrange(len(word))] = chr(rng.randrange(1, 0x2FF))
            try:
                bad.socket.send("".join(word))
            except ConnectionClosed:
                break  # the first malformed one ends it, what follows was on its way
        bad.close()
        if nth % 10 == 0:
            chair.alive_through(good)
    assert not any(isinstance(m, Press) for m in chair.read_for(0.2))
    good.say(t="push", button="stop")
    chair.read_until(is_press(Button.STOP))


def test_an_oversized_message_closes_its_page(chair: Chair, open_page: OpenPage) -> None:
    bad = open_page()
    bad.socket.send(json.dumps({"t": "look", "panes": ["x" * 1_000_000]}))
    assert closed_with(bad) == 1009
    good = open_page()
    chair.alive_through(good)


def _flood(page: Page) -> None:
    for _ in range(20_000):
        page.say(t="push", button="stop")


def test_a_flooding_page_is_closed_and_the_lane_stays_quiet(chair: Chair, open_page: OpenPage) -> None:
    good, bad = open_page(), open_page()
    good.take()
    began = time.monotonic()
    with pytest.raises(ConnectionClosed):
        _flood(bad)
    seconds = time.monotonic() - began + 0.5
    presses = [m for m in chair.read_for(0.5) if isinstance(m, Press)]
    assert 1 <= len(presses) <= 20 * seconds + 2, "the same press again within 50 ms says nothing new"
    chair.alive_through(good)


def test_more_pages_than_allowed_are_turned_away(chair: Chair, open_page: OpenPage) -> None:
    pages = [open_page() for _ in range(DashboardSettings().pages)]
    assert closed_with(open_page()) == 1013
    chair.alive_through(pages[0])


def test_half_open_connections_and_slow_requests_lose_nothing(chair: Chair, open_page: OpenPage) -> None:
    host, port = chair.address.split(":")
    idle = [socket.create_connection((host, int(port))) for _ in range(200)]
    try:
        for end in idle[::2]:
            end.sendall(b"GET / HTTP/1.1\r\nHost: ")
        page = open_page()
        chair.alive_through(page)
        page.say(t="push", button="stop")
        chair.read_until(is_press(Button.STOP))
        idle[0].settimeout(20.0)
        assert idle[0].recv(1000) in (b"",) or idle[0].recv(1000) == b"", "they are closed after a while"
    finally:
        for end in idle:
            end.close()


# ---- on a network ---------------------------------------------------------------------------------------------------


class TestOnANetwork:
    """Bound to more than loopback, a screen must have been paired."""

    @pytest.fixture
    def settings(self) -> DashboardSettings:
        return DashboardSettings(host="0.0.0.0", port=0)

    def test_without_a_token_only_the_pairing_page_is_there(self, chair: Chair, page_at: OpenPage) -> None:
        url = chair.source.url.replace("0.0.0.0", "127.0.0.1")
        answer = httpx.get(url)
        assert (answer.status_code, answer.headers["location"]) == (303, "/pair")
        address = url.removeprefix("http://").removesuffix("/")
        for cookie in ("", "chairward=", "chairward=wrong", "chairward=é"):
            with pytest.raises(InvalidStatus):
                page_at(address, additional_headers={"Cookie": cookie})

    def test_the_code_in_the_run_folder_gives_a_token_that_opens_everything(
        self, chair: Chair, page_at: OpenPage
    ) -> None:
        url = chair.source.url.replace("0.0.0.0", "127.0.0.1")
        file = chair.context.run_dir / "screen.code"
        assert file.stat().st_mode & 0o077 == 0
        origin = {"origin": url.removesuffix("/")}
        with httpx.Client(base_url=url) as client:
            assert client.post("/pair", data={"code": "00000000"}, headers=origin).headers["location"] == "/pair?wrong"
            answer = client.post("/pair", data={"code": file.read_text().strip()}, headers=origin)
            assert answer.headers["location"] == "/"
            assert "HttpOnly" in answer.headers["set-cookie"]
            assert client.get("/").status_code == 200
            token = client.cookies["chairward"]
        address = url.removeprefix("http://").removesuffix("/")
        page = page_at(address, additional_headers={"Cookie": f"chairward={token}"})
        chair.alive_through(page)
        page.close()

    def test_five_wrong_codes_make_a_new_one_and_pairing_rests(self, chair: Chair) -> None:
        url = chair.source.url.replace("0.0.0.0", "127.0.0.1")
        file = chair.context.run_dir / "screen.code"
        before = file.read_text().strip()
        origin = {"origin": url.removesuffix("/")}
        for _ in range(5):
            httpx.post(url + "pair", data={"code": "x"}, headers=origin)
        after = file.read_text().strip()
        assert after != before
        for code in (before, after):
            assert httpx.post(url + "pair", data={"code": code}, headers=origin).headers["location"] == "/pair?wrong"


# ---- the lane's side ------------------------------------------------------------------------------------------------


def test_a_taken_port_is_a_lost_device_with_a_sentence(chair: Chair) -> None:
    from chairward_dashboard.source import Dashboard

    port = int(chair.address.split(":")[1])
    with pytest.raises(DeviceLost, match=rf"cannot listen on 127.0.0.1:{port} .*dashboard.port"):
        Dashboard(DashboardSettings(port=port), chair.context).open()


def test_closing_does_not_wait_for_pages_that_are_open(chair: Chair, open_page: OpenPage) -> None:
    for _ in range(3):
        open_page().take()
    chair.read_until(well)
    began = time.monotonic()
    chair.source.close()
    assert time.monotonic() - began < 9.0


def test_closed_and_opened_again_it_goes_on_with_a_rising_sequence(chair: Chair, page_at: OpenPage) -> None:
    first = page_at(chair.address)
    first.take()
    one = chair.read_until(well)
    chair.source.close()
    chair.source.close()
    with pytest.raises(DeviceLost, match=r"open\(\) comes first"):
        chair.source.read(0.0)
    chair.source.open()
    chair.decide(777)
    again = page_at(chair.address)
    again.take()
    again.bundle_until(lambda head: head["state"].get("nearest_mm") == 777)
    two = chair.read_until(well)
    assert two.seq > one.seq
    again.close()
