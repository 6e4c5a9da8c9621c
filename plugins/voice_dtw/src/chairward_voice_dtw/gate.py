"""When a motion word counts: always, for some seconds after a wake word or switch, or while the talk switch is held.

Stop and help pass without being asked here.
"""

from __future__ import annotations

from chairward_voice_dtw.settings import VoiceSettings

NEVER_NS = -(10**18)


class Gate:
    """Pure; times are CLOCK_MONOTONIC nanoseconds."""

    def __init__(self, settings: VoiceSettings) -> None:
        self._listening = settings.listening
        self._armed_ns = int(settings.armed_s * 1e9)
        self._woken_ns = self._held_ns = NEVER_NS

    def wake(self, at_ns: int) -> None:
        """The wake word ended."""
        self._woken_ns = at_ns

    def hold(self, at_ns: int) -> None:
        """The talk switch was held."""
        self._held_ns = at_ns

    def lets_pass(self, onset_ns: int, end_ns: int) -> bool:
        """Does a motion word that was said from onset to end count?"""
        if self._listening == "push_to_talk":
            return self._held_ns >= onset_ns
        if self._listening == "armed":
            return end_ns <= max(self._woken_ns, self._held_ns) + self._armed_ns
        return True
