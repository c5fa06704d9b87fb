"""Messages of DataFlash logs, binary and text: their layouts, units, clock and instances."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime.logs._contents import Topic

#: Letters of a format: the type of numpy.
TYPES = {
    "a": "S64", "b": "<i1", "B": "<u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4",
    "f": "<f4", "d": "<f8", "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2",
    "e": "<i4", "E": "<u4", "L": "<i4", "M": "<u1", "q": "<i8", "Q": "<u8",
}  # fmt: skip

#: Letters of numbers, with the divisor that is part of the letter.
DIVISORS = dict.fromkeys("bBhHiIfdgMqQ", 1.0) | dict.fromkeys("cCeE", 1e2) | {"L": 1e7}

#: Prefixes of units by the factor of a column.
PREFIXES = {1.0: "", 1e-1: "d", 1e-2: "c", 1e-3: "m", 1e-6: "µ"}


@dataclass(frozen=True)
class Layout:
    """What a message of one type holds: as its FMT message tells."""

    number: int
    length: int
    name: str
    form: str
    columns: tuple[str, ...]

    def makes_sense(self) -> bool:
        """Whether there are as many letters as columns, all known."""
        return (
            bool(self.name)
            and all(column.strip() for column in self.columns)
            and len(self.form) == len(self.columns) == len(set(self.columns))
            and all(letter in TYPES for letter in self.form)
        )

    @property
    def numbers(self) -> list[str]:
        """The columns that hold numbers."""
        pairs = zip(self.columns, self.form, strict=True)
        return [name for name, letter in pairs if letter in DIVISORS]

    @property
    def holds_time(self) -> bool:
        """Whether it is the message of PX4 that holds the time of all that follow it."""
        return self.name == "TIME" and "StartTime" in self.numbers

    @property
    def clock(self) -> tuple[str, float] | None:
        """The column of the vehicle's clock, and its unit in s; None if there is none.

        Logs since 2015 hold µs, older ones ms. In the old GPS message that column is the time of
        the satellites, and T that of the vehicle. In PX4's, one message holds that of others.
        """
        if self.holds_time:
            return "StartTime", 1e-6
        if "TimeUS" in self.numbers:
            return "TimeUS", 1e-6
        name = "T" if {"T", "TimeMS", "Week"} <= set(self.numbers) else "TimeMS"
        return (name, 1e-3) if name in self.numbers else None


class Messages(Mapping[str, Topic], ABC):
    """The topics of a log: decoded when they are asked for.

    Parameters
    ----------
    layouts : mapping of str to Layout
        Of the types that have messages.
    places : mapping of str to ndarray of int
        Where the messages of each type are in the file, increasing.
    """

    def __init__(
        self, layouts: Mapping[str, Layout], places: Mapping[str, NDArray[np.int64]]
    ) -> None:
        self._layouts = layouts
        self._places = places
        self._decoded: dict[str, Topic] = {}
        self._units = _Units(self)
        timed = [name for name, layout in layouts.items() if layout.clock is not None]
        self._densest = max(timed, key=lambda name: places[name].size, default=None)
        self._rows = self._instances()

    @property
    def of_px4(self) -> bool:
        """Whether PX4 has written them, by sdlog2."""
        return any(layout.holds_time for layout in self._layouts.values())

    @abstractmethod
    def columns(self, layout: Layout, places: NDArray[np.int64]) -> Mapping[str, Array]:
        """The numbers in the messages at these places."""

    @abstractmethod
    def column_as_texts(self, layout: Layout, column: str) -> list[str]:
        """A column of all messages of a type, which has it, as texts."""

    def texts(self, name: str, column: str) -> list[str]:
        """A column of a type as texts; empty if the log has none."""
        layout = self._layouts.get(name)
        if layout is None or column not in layout.columns:
            return []
        return self.column_as_texts(layout, column)

    def __getitem__(self, name: str) -> Topic:
        if name not in self._decoded:
            self._decoded[name] = self._topic(*self._rows[name])
        return self._decoded[name]

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def _topic(self, layout: Layout, places: NDArray[np.int64]) -> Topic:
        columns = self.columns(layout, places)
        named = ((column, self._units.of(layout, k)) for k, column in enumerate(layout.columns))
        units = {column: unit for column, unit in named if unit}
        return Topic(self._time(layout, places, columns), columns, units)

    def _time(
        self, layout: Layout, places: NDArray[np.int64], columns: Mapping[str, Array]
    ) -> Array:
        """Times of the messages; of those without one, that of the next message that has one.

        In logs of PX4 it is that of the message before them that holds the time.
        """
        if layout.clock is not None:
            name, unit = layout.clock
            return columns[name] * unit
        if self._densest is None:
            return np.full(places.size, np.nan)
        timed, at = self._layouts[self._densest], self._places[self._densest]
        time = self._time(timed, at, self.columns(timed, at))
        if timed.holds_time:
            return time[np.maximum(np.searchsorted(at, places, side="right") - 1, 0)]
        return time[np.minimum(np.searchsorted(at, places), time.size - 1)]

    def _instances(self) -> dict[str, tuple[Layout, NDArray[np.int64]]]:
        """Topics with their messages: a type with several sensors is one topic for each of them."""
        found = {}
        for name, layout in self._layouts.items():
            places = self._places[name]
            column = self._units.instance_column(layout)
            if column is None:
                found[name] = (layout, places)
                continue
            instance = self.columns(layout, places)[column]
            numbers = np.unique(instance[np.isfinite(instance)])
            for number in numbers:
                shown = name if number == numbers[0] else f"{name}[{number:g}]"
                found[shown] = (layout, places[instance == number])
        return found


class _Units:
    """Units of columns from the messages UNIT, MULT and FMTU, in logs since 2018."""

    def __init__(self, messages: Messages) -> None:
        texts = messages.texts
        self._labels = _by_letter(texts("UNIT", "Id"), texts("UNIT", "Label"))
        self._factors = _by_letter(texts("MULT", "Id"), texts("MULT", "Mult"))
        letters = zip(texts("FMTU", "UnitIds"), texts("FMTU", "MultIds"), strict=False)
        self._letters = dict(zip(texts("FMTU", "FmtType"), letters, strict=False))

    def of(self, layout: Layout, k: int) -> str:
        """Unit of column k; empty if the log does not tell it.

        A letter that has a divisor of its own gives values in the unit itself; other values are as
        they were logged, and the factor is part of their unit.
        """
        units, factors = self._letters.get(str(layout.number), ("", ""))
        if k >= len(units):
            return ""
        label = self._labels.get(units[k], "").replace("degheading", "deg")
        if not label or DIVISORS.get(layout.form[k], 1.0) != 1.0:
            return label
        try:
            factor = float(self._factors.get(factors[k : k + 1], "1")) or 1.0
        except ValueError:
            return ""
        prefix = PREFIXES.get(float(f"{factor:.6g}"))
        return "" if prefix is None else prefix + label

    def instance_column(self, layout: Layout) -> str | None:
        """The column that tells which of several sensors a message is from."""
        k = self._letters.get(str(layout.number), ("", ""))[0].find("#")
        if not 0 <= k < len(layout.columns) or layout.columns[k] not in layout.numbers:
            return None
        return layout.columns[k]


def _by_letter(letters: list[str], values: list[str]) -> dict[str, str]:
    """Values by letters, which are logged as numbers of characters."""
    return {
        chr(int(letter)): value
        for letter, value in zip(letters, values, strict=False)
        if letter.isdigit() and int(letter) < 128
    }
