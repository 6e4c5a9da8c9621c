"""Something that appears in front of the cameras at a known moment: a simulated obstacle, or a screen that flashes."""

from __future__ import annotations

import random
import time
from pathlib import Path
from typing import Any, Protocol

from chairward.check.trial import TrialError
from chairward.shared_state import SharedState

FILE = "stimulus"
NAMES = ("on", "since_ns", "distance_mm")
"""run_dir/stimulus, for simulated cameras: is it there, since when (CLOCK_MONOTONIC), how far from the footprint."""


class Stimulus(Protocol):
    """Appears and vanishes."""

    method: str

    def show(self, distance_mm: float) -> int:
        """Let it appear; when that was, CLOCK_MONOTONIC ns. A screen is where it was put."""

    def hide(self) -> None:
        """Let it vanish."""

    def close(self) -> None:
        """Clear away; may be called twice."""


class SimulatedObstacle:
    """An obstacle in the simulated home."""

    method = "an obstacle that appears before the simulated cameras"

    def __init__(self, run_dir: Path) -> None:
        self._state = SharedState.create(run_dir / FILE, NAMES)

    def show(self, distance_mm: float) -> int:
        """From now on it is in every picture."""
        now_ns = time.monotonic_ns()
        self._state.write(on=1, since_ns=now_ns, distance_mm=distance_mm)
        return now_ns

    def hide(self) -> None:
        """From now on it is in none."""
        self._state.write(on=0)

    def close(self) -> None:
        """Unmap."""
        self._state.close()


class FlashedScreen:
    """A window that fills this computer's screen: a pattern that stereo can see, and black, which it cannot.

    The cameras look at the screen from some 700 mm. Black counts as blind, so the chair stops as for an obstacle. The
    moment is taken when the window system says that it has drawn; the screen itself adds up to 1/60 s and a delay of
    its own, so what is measured is rather too long than too short.
    """

    method = "a screen that flashes before the cameras"

    def __init__(self) -> None:
        self._root: Any = None
        self._canvas: Any = None

    def _open(self) -> None:
        """The window, when it is needed first: until then the screen is whoever answers questions there's."""
        if self._root is not None:
            return
        try:
            import tkinter

            self._root = tkinter.Tk()
        except ImportError as error:
            raise TrialError(f"{self.method}: Python has no tkinter here ({error}): install python3-tk") from error
        except tkinter.TclError as error:
            raise TrialError(f"{self.method}: no screen ({error}): start it in a desktop, or set DISPLAY") from error
        self._root.attributes("-fullscreen", True)
        self._canvas = tkinter.Canvas(self._root, background="black", highlightthickness=0)
        self._canvas.pack(fill="both", expand=True)
        width, height = self._root.winfo_screenwidth(), self._root.winfo_screenheight()
        chance = random.Random(1)
        for _ in range(1500):
            x, y, side = chance.randrange(width), chance.randrange(height), chance.randrange(20, 90)
            grey = chance.randrange(256)
            colour = f"#{grey:02x}{grey:02x}{grey:02x}"
            self._canvas.create_rectangle(x, y, x + side, y + side, fill=colour, outline="", tags="pattern")

    def show(self, distance_mm: float) -> int:
        """Black: blind from now on. Raises TrialError where there is no screen."""
        del distance_mm
        self._open()
        self._canvas.itemconfigure("pattern", state="hidden")
        self._root.update()
        return time.monotonic_ns()

    def hide(self) -> None:
        """The pattern again. Raises TrialError where there is no screen."""
        self._open()
        self._canvas.itemconfigure("pattern", state="normal")
        self._root.update()

    def close(self) -> None:
        """Close the window."""
        if self._root is not None:
            self._root.destroy()
            self._root = None
