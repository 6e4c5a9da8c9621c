"""Settings of the source `keys`."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from chairward.components import Settings
from chairward_keys.events import is_key_name

Action = Literal["stop", "arm", "reset", "hold", "front", "back", "left", "right", "reverse", "help", "talk", "ignore"]

DEFAULT_KEYS: dict[str, Action] = {
    "space": "stop",
    "enter": "arm",
    "r": "reset",
    "h": "hold",
    "up": "front",
    "down": "back",
    "left": "left",
    "right": "right",
    "w": "front",
    "s": "back",
    "a": "left",
    "d": "right",
}


class KeysSettings(Settings):
    """Which keyboard or switch, and what its keys mean."""

    device: str = Field(
        "terminal",
        min_length=1,
        description="terminal: the one this was started in; or a path: /dev/input/by-id/...-event-kbd, /dev/tty1",
    )
    keys: dict[str, Action] = Field(
        DEFAULT_KEYS,
        min_length=1,
        description="key -> stop arm reset hold front back left right reverse help talk ignore; talk: motion words "
        "count while it is held (voice_dtw.listening = push_to_talk); keys are letters, digits, "
        "space enter escape up down left right, mouse_left, or code_N for key number N of an input device",
    )
    other_keys: Literal["stop", "ignore"] = Field(
        "stop", description="what a key that is not in `keys` does: whoever hits anything in a fright means stop"
    )
    repeat_gap_ms: int = Field(
        150, ge=40, le=240, description="terminal: a key whose repeats come within this is held; longer means let go"
    )
    grab: bool = Field(False, description="input device: keep its keys from all other programs")

    @field_validator("keys")
    @classmethod
    def _known_names(cls, keys: dict[str, Action]) -> dict[str, Action]:
        wrong = sorted(key for key in keys if not is_key_name(key))
        if wrong:
            raise ValueError(f"no key is called '{wrong[0]}': use a letter, a digit, space, enter, up, ... or code_N")
        return keys

    @model_validator(mode="after")
    def _can_stop(self) -> Self:
        if self.other_keys != "stop" and "stop" not in self.keys.values():
            raise ValueError("no key stops the chair: map one to stop, or set other_keys to stop")
        return self
