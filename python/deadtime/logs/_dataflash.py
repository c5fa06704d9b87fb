"""Read binary DataFlash logs of ArduPilot.

Each message is the bytes A3 95, the number of its type, and values at fixed places. Messages FMT
tell length, format and columns of each type. The file is walked through once; the messages of a
type are decoded together when they are asked for. pymavlink reads such files too, but never ends on
a damaged FMT of length 0, and stops at the first message of an unknown type.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime.logs._columns import Columns, gathered
from deadtime.logs._contents import LogContents
from deadtime.logs._dataflash_contents import contents_of
from deadtime.logs._dataflash_messages import DIVISORS, TYPES, Layout, Messages

HEAD = b"\xa3\x95"

#: Bytes of the head and the number of the type.
HEAD_LENGTH = 3

#: The layout of the messages that tell the layouts.
FMT = Layout(0x80, 89, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))


def read_dataflash(data: bytes, source: str) -> LogContents:
    """All messages of a binary DataFlash log.

    Raises
    ------
    RecordingError
        When the file tells no format of a message that is in it.
    """
    index = _walk(data)
    messages = _BinaryMessages(data, index)
    remarks = []
    if index.skipped:
        remarks.append(
            f"{index.skipped} bytes of the file do not belong to a message, and are left out"
        )
    if index.cut:
        remarks.append("the file ends within a message, so it was cut off")
    return contents_of("DataFlash", source, messages, remarks)


@dataclass
class _Index:
    """Where the messages of each type are."""

    layouts: dict[int, Layout] = field(default_factory=lambda: {FMT.number: FMT})
    places: dict[int, list[int]] = field(default_factory=dict)
    skipped: int = 0
    cut: bool = False


def _walk(data: bytes) -> _Index:
    """Find every message. Bytes that are none are skipped until the next head of a known type."""
    index = _Index()
    lengths = [0] * 256
    lengths[FMT.number] = FMT.length
    at, size = 0, len(data)
    while at + HEAD_LENGTH <= size:
        kind = data[at + 2]
        length = lengths[kind]
        if not length or data[at] != HEAD[0] or data[at + 1] != HEAD[1]:
            found = data.find(HEAD, at + 1)
            found = size if found < 0 else found
            index.skipped += found - at
            at = found
            continue
        if at + length > size:
            index.cut = True
            break
        if kind == FMT.number:
            layout = _layout(data[at + HEAD_LENGTH : at + length])
            if layout is not None and index.layouts.setdefault(layout.number, layout) == layout:
                lengths[layout.number] = layout.length
        if kind in index.places:
            index.places[kind].append(at)
        else:
            index.places[kind] = [at]
        at += length
    return index


def _layout(body: bytes) -> Layout | None:
    """The layout that a FMT message tells, or None if it makes no sense."""
    name, form, columns = (
        part.split(b"\0")[0].decode("latin-1") for part in (body[2:6], body[6:22], body[22:86])
    )
    layout = Layout(body[0], body[1], name, form, tuple(columns.split(",")))
    if not layout.makes_sense() or _dtype(layout).itemsize > layout.length:
        return None
    return layout


def _dtype(layout: Layout) -> np.dtype[np.void]:
    """The values of a message, after its head."""
    names = zip(layout.columns, layout.form, strict=True)
    packed = [("", f"S{HEAD_LENGTH}"), *((name, TYPES[letter]) for name, letter in names)]
    rest = layout.length - np.dtype(packed).itemsize
    return np.dtype([*packed, (" ", f"S{rest}")] if rest > 0 else packed)


class _BinaryMessages(Messages):
    """The messages of a binary log."""

    def __init__(self, data: bytes, index: _Index) -> None:
        self._bytes = np.frombuffer(data, dtype=np.uint8)
        layouts, places = {}, {}
        for number, layout in index.layouts.items():
            if number in index.places:
                layouts[layout.name] = layout
                places[layout.name] = np.array(index.places[number])
        super().__init__(layouts, places)

    def columns(self, layout: Layout, places: NDArray[np.int64]) -> Mapping[str, Array]:
        records = self._records(layout, places)
        pairs = zip(layout.columns, layout.form, strict=True)
        return Columns(
            {
                name: partial(_numbers, records, name, DIVISORS[letter])
                for name, letter in pairs
                if letter in DIVISORS
            }
        )

    def column_as_texts(self, layout: Layout, column: str) -> list[str]:
        field = self._records(layout, self._places[layout.name])[column]
        if field.dtype.kind != "S":
            return [str(value) for value in field.tolist()]
        return [text.split(b"\0")[0].decode("utf-8", "replace") for text in field.tolist()]

    def _records(self, layout: Layout, places: NDArray[np.int64]) -> NDArray[np.void]:
        """The messages at these places as rows of a structured array."""
        rows = gathered(self._bytes, places, layout.length)
        found: NDArray[np.void] = rows.view(_dtype(layout))[:, 0]
        return found


def _numbers(records: NDArray[np.void], name: str, divisor: float) -> Array:
    """A column of the messages of a type as floats."""
    with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
        values: Array = records[name].astype(float) / divisor
    return values
