"""What a page may say to the server: small JSON objects, checked by type and range; anything else closes the page."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

LONGEST_BYTES = 512
"""No message of a page needs more."""

PaneName = Annotated[str, msgspec.Meta(max_length=20, pattern="^[a-z_]+$")]


class _Said(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="t"):
    pass


class Beat(_Said, frozen=True, tag="beat"):
    """Every 100 ms while the page can be seen; at_ms: the page's own clock, to see through late delivery."""

    at_ms: Annotated[float, msgspec.Meta(ge=0.0, le=1e13)]


class Hidden(_Said, frozen=True, tag="hidden"):
    """The page is no longer seen: it is no stop device now."""


class Got(_Said, frozen=True, tag="got"):
    """Bundle n has arrived; without this the server sends no more (a slow page gets fewer, never a queue)."""

    n: Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class Push(_Said, frozen=True, tag="push"):
    """A button of the page."""

    button: Literal["stop", "arm", "reset", "help"]


class Take(_Said, frozen=True, tag="take"):
    """The page asks to be the one that controls."""


class Give(_Said, frozen=True, tag="give"):
    """The page no longer wants to control."""


class Look(_Said, frozen=True, tag="look"):
    """Which pictures the page wants (none: no pictures), and whether large."""

    panes: Annotated[list[PaneName], msgspec.Meta(max_length=4)]
    large: bool = False


class Speaks(_Said, frozen=True, tag="speaks"):
    """The page begins to speak aloud, for so long: what it says must move nothing."""

    ms: Annotated[int, msgspec.Meta(ge=0, le=15_000)]


Said = Beat | Hidden | Got | Push | Take | Give | Look | Speaks
_decoder: msgspec.json.Decoder[Said] = msgspec.json.Decoder(Said)


def decode(text: str) -> Said:
    """What a page said. Raises ValueError (which msgspec's errors are)."""
    if len(text) > LONGEST_BYTES:
        raise ValueError(f"a message of more than {LONGEST_BYTES} characters")
    try:
        return _decoder.decode(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
