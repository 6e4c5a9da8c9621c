"""Laws of the desk: whatever pages do, in any order, no stop device is made up and none changes hands unnoticed."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from chairward.messages import Alive, Button, Message, Press
from chairward_dashboard.desk import ARM_WITHIN_NS, LOST_NS, MOST_WAITING, MS, Desk, Lag, Outbox

PAGES = (1, 2, 3)
BUTTONS = ("stop", "arm", "reset", "help")
events = st.lists(
    st.tuples(
        st.sampled_from(("take", "give", "beat", "beat", "beat", "late", "hide", "leave", "push", "check", "read")),
        st.sampled_from(PAGES),
        st.sampled_from(BUTTONS),
        st.sampled_from((0, 10, 45, 100, 100, 251, 501, 2_000)),
    ),
    max_size=80,
)


class Story:
    """The desk beside what a slow, obvious observer notes: who caused each good heartbeat."""

    def __init__(self) -> None:
        self.outbox = Outbox()
        self.desk = Desk(self.outbox)
        self.now_ns = 50_000 * MS
        self.last_beat_ns: dict[int, int] = {}
        self.hidden: set[int] = set()
        self.read: list[Message] = []

    def tell(self, kind: str, page: int, button: str, later_ms: int) -> None:
        """One event; the desk is checked at least every 66 ms, as the server does."""
        end = self.now_ns + later_ms * MS
        while self.now_ns < end:
            self.now_ns = min(end, self.now_ns + 66 * MS)
            self.desk.check(self.now_ns)
        desk, now_ns = self.desk, self.now_ns
        match kind:
            case "take":
                desk.take(page, now_ns)
            case "give":
                desk.give(page, now_ns, "given")
            case "beat" | "late":
                sent_ns = now_ns - (400 * MS if kind == "late" else 0)
                desk.beat(page, sent_ns / MS, now_ns)
                self.last_beat_ns[page] = now_ns
                self.hidden.discard(page)
            case "hide":
                desk.hide(page, now_ns)
                self.hidden.add(page)
            case "leave":
                desk.leave(page, now_ns)
            case "push":
                before = desk.controller
                why = desk.push(page, button, now_ns)
                if button in ("arm", "reset") and not why:
                    assert before == page
                    assert page not in self.hidden
                    assert now_ns - self.last_beat_ns[page] <= ARM_WITHIN_NS
            case "read":
                self.read += self.outbox.take(0.0) or []


@given(events)
@settings(max_examples=300)
def test_p1_every_good_heartbeat_is_a_beat_of_the_page_that_controls_and_hands_change_only_through_a_bad_one(
    told: list[tuple[str, int, str, int]],
) -> None:
    story, owner = Story(), None
    for event in told:
        waiting = story.read
        before = len(waiting)
        story.tell(*event)
        story.read += story.outbox.take(0.0) or []
        for message in story.read[before:]:
            assert message.captured_ns <= story.now_ns
            if not isinstance(message, Alive):
                continue
            if message.well:
                assert event[0] in ("beat", "late")
                assert story.desk.controller == event[1]
                assert owner in (None, event[1]), "another page's heartbeat without a bad one between"
                owner = event[1]
            else:
                owner = None
    seqs = [m.seq for m in story.read]
    assert seqs == sorted(set(seqs)), "the sequence rises"


@given(events)
@settings(max_examples=200)
def test_p1_without_a_beat_for_500_ms_no_page_is_alive_and_the_lane_has_been_told(
    told: list[tuple[str, int, str, int]],
) -> None:
    story = Story()
    for event in told:
        story.tell(*event)
    story.tell("read", 1, "stop", LOST_NS // MS + 70)
    assert not story.desk.is_alive(story.now_ns)
    assert story.desk.controller is None
    alive = [m for m in story.read if isinstance(m, Alive)]
    assert not alive or not alive[-1].well


@given(events)
@settings(max_examples=200)
def test_every_stop_is_handed_on_unless_the_very_same_press_was_within_50_ms(
    told: list[tuple[str, int, str, int]],
) -> None:
    story = Story()
    for event in told:
        story.tell(*event)
        if event[0] == "push" and event[2] == "stop":
            story.read += story.outbox.take(0.0) or []
            presses = [m for m in story.read if isinstance(m, Press)]
            assert presses[-1].button is Button.STOP
            assert story.now_ns - presses[-1].captured_ns < 50 * MS


def test_a_lane_that_does_not_read_finds_little_but_the_stop() -> None:
    outbox = Outbox()
    outbox.press(Button.STOP, 1)
    for at in range(10 * MOST_WAITING):
        outbox.alive(at, well=bool(at % 2))
        outbox.press(Button.ARM, at)
        outbox.press(Button.STOP, at)
    waiting = outbox.take(0.0) or []
    assert len(waiting) <= MOST_WAITING
    assert any(isinstance(m, Press) and m.button is Button.STOP for m in waiting)


def test_words_that_come_late_are_dated_when_they_were_sent_and_never_later_than_now() -> None:
    lag = Lag()
    for nth in range(300):  # the page's clock starts elsewhere; the quickest message takes 3 ms
        now_ns = 77_000 * MS + nth * 100 * MS
        delay_ns = 400 * MS if nth % 10 == 9 else (3 + nth % 3) * MS
        sent_ns = lag.sent_ns((now_ns - delay_ns) / MS - 12_345.0, now_ns)
        assert sent_ns <= now_ns
        if nth:
            assert abs((now_ns - sent_ns) - (delay_ns - 3 * MS)) <= 1 * MS
