"""Read binary DataFlash logs of ArduPilot.

Each message is the bytes A3 95, the number of its type, and values at fixed places. Messages FMT
tell length, format and columns of each type. The file is walked through once; the messages of a
type are decoded together when they are asked for. pymavlink reads such files too, but never ends on
a damaged FMT of length 0, and stops at the first message of an unknown type.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
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
    if set(messages) <= {"FMT"}:
        raise RecordingError(
            f"{source} begins as a DataFlash log, but holds no message whose format it tells"
        )
    remarks = []
    if index.skipped:
        remarks.append(f"{index.skipped} bytes of the file are no message and are left out")
    if index.cut:
        remarks.append("the file is cut off in a message")
    return contents_of("DataFlash", messages, tuple(remarks))


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
        return _Columns(self._records(layout, places), layout)

    def texts(self, name: str, column: str) -> list[str]:
        layout = self._layouts.get(name)
        if layout is None or column not in layout.columns:
            return []
        field = self._records(layout, self._places[name])[column]
        if field.dtype.kind != "S":
            return [str(value) for value in field.tolist()]
        return [text.split(b"\0")[0].decode("utf-8", "replace") for text in field.tolist()]

    def _records(self, layout: Layout, places: NDArray[np.int64]) -> NDArray[np.void]:
        """The messages at these places as rows of a structured array."""
        rows = np.empty((places.size, layout.length), dtype=np.uint8)
        for k in range(layout.length):
            np.take(self._bytes, places + k, out=rows[:, k])
        found: NDArray[np.void] = rows.view(_dtype(layout))[:, 0]
        return found


class _Columns(Mapping[str, Array]):
    """The numbers of the messages of a type, as floats when they are asked for."""

    def __init__(self, records: NDArray[np.void], layout: Layout) -> None:
        self._records = records
        pairs = zip(layout.columns, layout.form, strict=True)
        self._divisors = {name: DIVISORS[letter] for name, letter in pairs if letter in DIVISORS}

    def __getitem__(self, name: str) -> Array:
        with np.errstate(invalid="ignore"):  # damaged bytes may be a signalling NaN
            values: Array = self._records[name].astype(float) / self._divisors[name]
        return values

    def __contains__(self, name: object) -> bool:
        return name in self._divisors

    def __iter__(self) -> Iterator[str]:
        return iter(self._divisors)

    def __len__(self) -> int:
        return len(self._divisors)
