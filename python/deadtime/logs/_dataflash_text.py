"""Read text DataFlash logs of ArduPilot: one message a line, as ground stations write them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime.logs._contents import LogContents
from deadtime.logs._dataflash_contents import contents_of
from deadtime.logs._dataflash_messages import Layout, Messages


def read_dataflash_text(data: bytes, source: str) -> LogContents:
    """All messages of a text DataFlash log.

    Raises
    ------
    RecordingError
        When it has no message of a known format.
    """
    lines = data.decode("utf-8", "replace").splitlines()
    messages = _TextMessages(lines)
    remarks = []
    if messages.unread:
        remarks.append(f"{messages.unread} lines of the file are not messages, and are left out")
    return contents_of("DataFlash text", source, messages, remarks)


class _TextMessages(Messages):
    """The messages of a text log; a place is the number of a line."""

    def __init__(self, lines: list[str]) -> None:
        self._lines = lines
        layouts: dict[str, Layout] = {}
        places: dict[str, list[int]] = {}
        self.unread = 0
        for number, line in enumerate(lines):
            name = line.partition(",")[0].strip()
            if name == "FMT":
                layout = _layout(line)
                if layout is not None:
                    layouts.setdefault(layout.name, layout)
            elif name in layouts:
                places.setdefault(name, []).append(number)
            elif name:
                self.unread += 1
        super().__init__(
            {name: layouts[name] for name in places},
            {name: np.array(found) for name, found in places.items()},
        )

    def columns(self, layout: Layout, places: NDArray[np.int64]) -> Mapping[str, Array]:
        cells = [self._cells(layout, place) for place in places.tolist()]
        return {
            name: np.array([_number(row[k]) for row in cells])
            for k, name in enumerate(layout.columns)
            if name in layout.numbers
        }

    def column_as_texts(self, layout: Layout, column: str) -> list[str]:
        k = layout.columns.index(column)
        return [self._cells(layout, place)[k] for place in self._places[layout.name].tolist()]

    def _cells(self, layout: Layout, place: int) -> list[str]:
        """Values of a line; the last may contain commas if it is text. Missing ones are empty."""
        count = len(layout.columns)
        cells = [cell.strip() for cell in self._lines[place].split(",", count)[1:]]
        return cells + [""] * (count - len(cells))


def _layout(line: str) -> Layout | None:
    """The layout that a line FMT tells, or None if it makes no sense."""
    cells = [cell.strip() for cell in line.split(",", 5)[1:]]
    if len(cells) < 5 or not (cells[0].isdecimal() and cells[1].isdecimal()):
        return None
    columns = tuple(column.strip() for column in cells[4].split(","))
    layout = Layout(int(cells[0]), int(cells[1]), cells[2], cells[3], columns)
    return layout if layout.makes_sense() else None


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan
