"""Who may come in: host names (against rebinding), origins (against other sites), pairing code and token."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from urllib.parse import urlsplit

S = 1_000_000_000
COOKIE = "chairward"
CODE_DIGITS = 8
TRIES = 5
"""Wrong codes before a new code is made and pairing rests."""
REST_NS = 30 * S
MOST_TOKENS = 64


def host_of(header: str) -> str:
    """The host of a `Host` header without its port, lower case; "" when it makes no sense."""
    try:
        return (urlsplit(f"//{header}").hostname or "").lower()
    except ValueError:
        return ""


def host_allowed(header: str, names: tuple[str, ...]) -> bool:
    """Only addresses, localhost and the names the chair file gives: a foreign name that points here is an attack."""
    host = host_of(header)
    if host == "localhost" or host in (name.lower() for name in names):
        return True
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def origin_allowed(origin: str, host: str) -> bool:
    """A page of this very server: scheme http(s), the same host and port as asked for. No origin is refused."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(parts.netloc) and parts.netloc.lower() == host.lower()


@dataclass(slots=True)
class Pairing:
    """One code for whoever stands at the chair; each screen that knows it gets a token of its own, for this run."""

    tell: Callable[[str], None]
    code: str = ""
    _tokens: list[str] = field(default_factory=list)
    _wrong: int = 0
    _rests_until_ns: int = 0

    def __post_init__(self) -> None:
        self._new_code()

    def pair(self, code: str, now_ns: int) -> str | None:
        """A token for the right code, else None. After five wrong ones: a new code, and nobody for 30 s."""
        if now_ns < self._rests_until_ns:
            return None
        if not hmac.compare_digest(code.strip().encode(), self.code.encode()):
            self._wrong += 1
            if self._wrong >= TRIES:
                self._wrong, self._rests_until_ns = 0, now_ns + REST_NS
                self._new_code()
            return None
        self._wrong = 0
        token = secrets.token_urlsafe(32)
        self._tokens = [*self._tokens[-MOST_TOKENS + 1 :], token]
        return token

    def knows(self, token: str) -> bool:
        """Whether a token was given out in this run."""
        given = token.encode()
        return any(hmac.compare_digest(given, known.encode()) for known in self._tokens)

    def _new_code(self) -> None:
        self.code = f"{secrets.randbelow(10**CODE_DIGITS):0{CODE_DIGITS}d}"
        self.tell(self.code)
