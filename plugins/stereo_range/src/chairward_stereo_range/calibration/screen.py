"""The terminal's form of live calibration: what is covered, and what to do next."""

from __future__ import annotations

from types import TracebackType

from rich.live import Live
from rich.table import Table
from rich.text import Text

from chairward_stereo_range.calibration.coverage import COLUMNS, ENOUGH_CELLS, ENOUGH_VIEWS, ROWS
from chairward_stereo_range.calibration.live import Progress


class Screen:
    """Redraws one table in place; a context manager."""

    def __init__(self) -> None:
        self._live = Live(Text("waiting for the cameras"), refresh_per_second=8)

    def __enter__(self) -> Screen:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def show(self, progress: Progress) -> None:
        """Show the newest picture's answer."""
        self._live.update(table(progress))


def table(progress: Progress) -> Table:
    """The answer in large, then the cells of both pictures (full: covered), then the numbers."""
    shown = Table.grid(padding=(0, 3))
    shown.add_row(Text(progress.ask.text.upper(), style="bold green" if progress.ask.what == "done" else "bold yellow"))
    cells = Table.grid(padding=(0, 4))
    cells.add_row("left picture", "right picture")
    for row in range(ROWS):
        cells.add_row(
            *(" ".join("██" if (c, row) in done else "··" for c in range(COLUMNS)) for done in progress.coverage.cells)
        )
    shown.add_row(cells)
    c = progress.coverage
    shown.add_row(
        f"{c.views} of {ENOUGH_VIEWS} pictures, {100 * c.share:.0f} % of {100 * ENOUGH_CELLS:.0f} % covered, "
        f"turned: {', '.join(sorted(c.turned)) or 'not yet'}; Ctrl-C: that will do"
    )
    return shown
