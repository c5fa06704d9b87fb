"""MAT files of version 5: our own reader of their arrays of numbers and of their structures.

On damaged files `scipy.io.loadmat` ends the whole process. A file is a header of 128 bytes and
elements: type and size in 4 bytes each, then the data, filled up to a multiple of 8 bytes. At most
4 bytes of data may stand in the place of the size instead. An array is an element that consists of
elements: flags, dimensions, name, and numbers, or the fields of a structure, which are arrays.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime.recordings.readers._columns import Table
from deadtime.recordings.readers._limits import errors_of, largest
from deadtime.recordings.readers._mat_addresses import (
    DEPTH,
    check_columns,
    signal_names,
    signals,
    with_objects,
)

HEADER = 128

#: Types of elements, besides those of numbers.
ARRAY, PACKED = 14, 15
NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip

#: Classes of arrays: structures, numbers from double to unsigned 64-bit, and objects of MATLAB.
STRUCTURE, NUMERIC, OBJECTS = 2, range(6, 16), (3, 17)
COMPLEX = 0x800

Element = tuple[int, memoryview]


def mat_file(path: str | os.PathLike[str], wanted: set[str]) -> Table:
    """The table of a file, of which only the columns with `wanted` addresses are kept."""
    columns: dict[str, NDArray[Any]] = {}
    with errors_of(path, "MAT v5"):
        raw = Path(path).read_bytes()
        reader = _Reader(">" if raw[126:HEADER] == b"MI" else "<")
        for kind, data in reader.elements(memoryview(raw)[HEADER:]):
            if kind == PACKED:
                kind, data = _next(reader.elements(_unpacked(data, largest(len(raw)))))
            if kind == ARRAY:
                for address, column in reader.columns(data, ""):
                    # The columns that are not wanted are listed only.
                    columns[address] = column if address in wanted else column[:0]
                    check_columns(path, len(columns))
    return Table(with_objects(path, reader.objects), [*columns], columns.__getitem__)


def _unpacked(data: memoryview, limit: int) -> memoryview:
    unpacking = zlib.decompressobj()
    content = unpacking.decompress(data, limit)
    if not unpacking.eof:
        raise ValueError(f"a variable ends too early, or has more than {limit} bytes when unpacked")
    return memoryview(content)


def _next(elements: Iterator[Element]) -> Element:
    found = next(elements, None)
    if found is None:
        raise ValueError("a variable ends too early")
    return found


class _Reader:
    """Elements and arrays in one order of bytes."""

    def __init__(self, order: str) -> None:
        self.order = order
        self.objects = False

    def elements(self, data: memoryview) -> Iterator[Element]:
        """The elements that follow one another, each with its type."""
        at = 0
        while at + 8 <= len(data):
            kind, size = struct.unpack_from(f"{self.order}II", data, at)
            if kind >> 16:  # a short one, with its data in the place of the size
                kind, size, start, after = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            else:
                start = at + 8
                after = start + size + (0 if kind == PACKED else -size % 8)
            if start + size > min(after, len(data)):
                raise ValueError(
                    f"an element of {size} bytes ends outside of its variable or the file"
                )
            yield kind, data[start : start + size]
            at = after

    def numbers(self, element: Element) -> NDArray[Any]:
        kind, data = element
        if kind not in NUMBERS:
            raise ValueError(f"numbers have the unknown type {kind}")
        return np.frombuffer(data, f"{self.order}{NUMBERS[kind]}")

    def columns(
        self, data: memoryview, address: str, depth: int = 0
    ) -> Iterator[tuple[str, NDArray[Any]]]:
        """The columns of an array, each with its address; a variable has its name for address."""
        if not data.nbytes:
            return  # an empty field
        parts = self.elements(data)
        flags = int(self.numbers(_next(parts))[0])
        kind = flags & 0xFF
        self.objects = self.objects or kind in OBJECTS
        if kind not in NUMERIC and kind != STRUCTURE:
            return
        shape = tuple(self.numbers(_next(parts)).tolist())
        if min(shape) < 0:
            raise ValueError(f"an array has the shape {shape}")
        name = bytes(_next(parts)[1]).decode("latin-1")
        address = address or name
        if kind == STRUCTURE:
            yield from self.fields(parts, shape, address, depth)
        elif address:  # MATLAB keeps the content of objects in an array without a name
            array = self.numbers(_next(parts)).reshape(shape, order="F")
            if flags & COMPLEX:
                array = array.astype(complex)
            yield from zip(signal_names(address, shape), signals(array), strict=False)

    def fields(
        self, parts: Iterator[Element], shape: tuple[int, ...], address: str, depth: int
    ) -> Iterator[tuple[str, NDArray[Any]]]:
        """The columns of a structure: field by field for each of its elements."""
        if depth > DEPTH:
            raise ValueError("structures are nested too deeply")
        length = int(self.numbers(_next(parts))[0])
        text = bytes(_next(parts)[1])
        names = [
            text[at : at + length].split(b"\0")[0].decode("latin-1")
            for at in range(0, len(text), length)
        ]
        count = int(np.prod(shape, dtype=object))
        for i in range(count if names else 0):
            element = f"{address}[{i}]" if count > 1 else address
            for name in names:
                kind, data = _next(parts)
                if kind != ARRAY:
                    raise ValueError(f"a field has the unknown type {kind}")
                yield from self.columns(data, f"{element}.{name}", depth + 1)
