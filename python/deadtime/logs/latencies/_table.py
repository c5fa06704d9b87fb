"""The times of a log in one table, a row a loop, each of which can be printed as it is found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from deadtime._base.digits import between, shown, stated
from deadtime.logs.latencies._commands import Command
from deadtime.logs.latencies._relation import LoopLatency

#: Most rows: more do not fit on a screen with what is said below them.
ROWS = 15

#: Columns of a screen.
SCREEN = 100

#: Heads, and how wide each column is, for rows are printed before the next ones are known. The
#: names of loops are.
HEADS = ("loop", "from", "time", "95 %", "verdict", "seen in", "well damped", "flown")
WIDTHS = (0, 8, 12, 16, 10, 10, 11, 5)

#: The columns of gains, which a narrow screen does not show.
GAINS = 2

BETWEEN = "  "


class LatencyTable:
    """The table of times, row by row.

    Parameters
    ----------
    wanted : sequence of (str, {"setpoint", "actuator"})
        The loops that are estimated, and from what.
    screen : int, optional
        Columns of the screen, by default 100. The gains are left out where they do not fit.
    """

    def __init__(self, wanted: Sequence[tuple[str, Command]], screen: int | None = None) -> None:
        names = max([len(HEADS[0]), *(len(name) for name, _ in wanted)])
        self._widths = [names, *WIDTHS[1:]]
        wide = sum(self._widths) + len(BETWEEN) * (len(self._widths) - 1)
        if wide > (screen or SCREEN) or all(command == "setpoint" for _, command in wanted):
            del self._widths[-GAINS:]
        self._left, self._all = ROWS, len(wanted) <= ROWS

    def head(self) -> str:
        """The line of heads."""
        return self._line(HEADS)

    def row(self, loop: LoopLatency) -> str | None:
        """The line of a loop; None where it takes no row.

        That is one without a time, and one that is one too many, of a table that would be long.
        """
        if not self._left or (loop.verdict == "none" and not self._all):
            return None
        self._left -= 1
        return self._line(cells_of(loop))

    def rows(self, loops: Sequence[LoopLatency]) -> list[str]:
        """The lines of all loops."""
        return [line for line in map(self.row, loops) if line is not None]

    def _line(self, cells: Sequence[str]) -> str:
        used = zip(cells, self._widths, strict=False)
        return BETWEEN.join(f"{cell:<{width}}" for cell, width in used).rstrip()


def cells_of(loop: LoopLatency) -> tuple[str, ...]:
    """What stands in the row of a loop, under `HEADS`."""
    if loop.verdict == "none":
        return (loop.loop, loop.command, "—", "", "none", "", "", "")
    reliable = loop.verdict == "reliable"
    time = shown(loop.time, loop.stderr, "s") if reliable else f"about {about(loop.time, 's')}"
    if loop.is_bound:
        time = loop.bound()
    ends = between(*loop.interval, loop.stderr, "s") if reliable else ""
    return (loop.loop, loop.command, time, ends, loop.verdict, seen_in(loop), *_gains(loop))


def seen_in(loop: LoopLatency) -> str:
    """From how many moves of the setpoint a time comes, or from how many windows."""
    moves = 0 if loop.plain is None else loop.plain.aligned.count
    count, what = (moves, "move") if moves else (len(loop.times) or len(loop.windows), "window")
    return f"{count} {what}{'' if count == 1 else 's'}"


def _gains(loop: LoopLatency) -> tuple[str, str]:
    """The well damped gain, and the one that is flown."""
    cost = loop.cost
    if cost is None:
        return "", ""
    low, high = cost.well_damped_ci
    flown = "" if cost.flown is None else f"{cost.flown:.3g}"
    if loop.verdict != "reliable":
        return f"about {about(cost.well_damped)}", flown
    return stated(cost.well_damped, 0.25 * (high - low)), flown


def about(value: float, unit: str = "") -> str:
    """A number of two digits, for it has no interval."""
    size = math.floor(math.log10(abs(value))) if value else 0
    return shown(value, 0.3 * 10.0**size, unit)
