"""While the chair speaks, and a little longer, listeners know it."""

from __future__ import annotations

from pathlib import Path

from chairward.speaking import ECHO_NS, Listener, Speaker

S = 1_000_000_000


def test_a_listener_knows_when_the_chair_spoke(tmp_path: Path) -> None:
    listener = Listener(tmp_path)
    assert not listener.is_speaking(S), "nobody speaks in this run"
    speaker = Speaker(tmp_path)
    assert not listener.is_speaking(S)
    speaker.say(5 * S, 7 * S)
    assert [listener.is_speaking(at) for at in (5 * S - 1, 5 * S, 7 * S + ECHO_NS, 7 * S + ECHO_NS + 1)] == [
        False,
        True,
        True,
        False,
    ]
    speaker.close()
    listener.close()
    listener.close()


def test_a_second_sentence_never_ends_the_first_one_early(tmp_path: Path) -> None:
    speaker, listener = Speaker(tmp_path), Listener(tmp_path)
    speaker.say(5 * S, 9 * S)
    speaker.say(6 * S, 7 * S)
    assert listener.is_speaking(5 * S)
    assert listener.is_speaking(9 * S)
    speaker.say(20 * S, 21 * S)
    assert not listener.is_speaking(15 * S)
    speaker.close()
    speaker = Speaker(tmp_path)
    assert not listener.is_speaking(20 * S), "started again: nothing has been said yet"
    speaker.say(30 * S, 31 * S)
    assert listener.is_speaking(30 * S)
    speaker.close()
    listener.close()
