"""numba where it is installed, plain Python where it is not: the same functions either way, only slower."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

try:
    import numba

    HAVE_NUMBA = True
except ImportError:  # an odd machine: everything still works, see the README for the speed
    HAVE_NUMBA = False


def jit(function: F) -> F:
    """Compile on first use (kept on disk between runs); float sums may be reordered (fastmath, but infinities live)."""
    if not HAVE_NUMBA:
        return function
    compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "arcp", "nsz"})(function)
    return cast("F", compiled)
