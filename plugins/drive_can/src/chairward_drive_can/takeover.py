"""Four ways to an R-Net chair's motors, each with what it risks and when it is refused.

Published by people who did this to real chairs: "both of us were injured". The default is to listen.
"""

from __future__ import annotations

from dataclasses import dataclass

from chairward_drive_can.settings import CanSettings


@dataclass(frozen=True, slots=True)
class Mode:
    """How motion gets on the bus. accept: the words that `rnet.hazard_accepted` must repeat."""

    name: str
    what: str
    hazard: str
    accept: str


MODES = {
    mode.name: mode
    for mode in (
        Mode("listen", "only listens, never sends", "none", ""),
        Mode(
            "follow",
            "sends a joystick frame right behind each centred one of the user's joystick; the user's hand always wins",
            "The power module sees two senders for one joystick. When our frame is late it gets the centred one: the "
            "chair may jerk, or stop obeying for seconds. The motion ends when the user touches the joystick.",
            "two senders, the chair may jerk",
        ),
        Mode(
            "jsm_error",
            "sends three network-error frames so that the user's joystick module gives up, then sends in its place",
            "The user's joystick, horn and power key do NOT work until the chair is switched off and on again. Only a "
            "relay in the motor supply or the battery plug stops the chair if this program and the power module fail.",
            "the joystick will not work",
        ),
        Mode(
            "emulate",
            "answers the power module's start-up in the place of a joystick module that is unplugged",
            "There is no joystick at all: nobody can drive or switch off by hand. It only works with the serial number "
            "and the answers recorded from this very chair.",
            "there is no joystick",
        ),
    )
}


def refusals(settings: CanSettings) -> list[str]:
    """Why the takeover of this chair file may not be used, whatever the bus says; empty when it may."""
    mode = MODES[settings.rnet.takeover]
    reasons = []
    if mode.name == "listen":
        return ["drive.can.rnet.takeover = 'listen' never sends; name 'follow', 'jsm_error' or 'emulate' to drive"]
    if settings.rnet.hazard_accepted != mode.accept:
        reasons.append(
            f"takeover '{mode.name}' has a hazard that the chair file has not accepted: {mode.hazard} "
            f"To accept it set drive.can.rnet.hazard_accepted = '{mode.accept}'"
        )
    if mode.name in ("jsm_error", "emulate") and not settings.watchdog_relay:
        reasons.append(
            f"takeover '{mode.name}' leaves the user without a joystick: "
            "it is refused unless drive.can.watchdog_relay names a relay in the motor supply"
        )
    if mode.name == "emulate" and not (settings.rnet.serial and settings.rnet.startup):
        reasons.append("takeover 'emulate' needs drive.can.rnet.serial and drive.can.rnet.startup of this very chair")
    if unproved := settings.silence_unproved():
        reasons.append(unproved)
    return reasons
