"""Packets of MAVLink 1 and 2 in a tlog: where they are, and their messages by type."""

from __future__ import annotations

import re
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array, Mask
from deadtime.logs._columns import gathered

#: Bytes of the time before a packet.
STAMP = 8

#: First byte of a packet, and the bytes of its head, by version.
FIRST = {0xFE: 6, 0xFD: 10}

CHECKSUM = 2
SIGNATURE = 13

#: Types of the struct formats of pymavlink.
KINDS = {
    "b": "<i1", "B": "<u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8",
    "f": "<f4", "d": "<f8", "c": "S1",
}  # fmt: skip

#: Arrays of more values are payloads of files or images.
LONGEST_ARRAY = 24


@dataclass
class Packets:
    """Where the packets are."""

    places: array[int] = field(default_factory=lambda: array("q"))
    types: array[int] = field(default_factory=lambda: array("i"))
    skipped: int = 0
    cut: bool = False


def find_packets(data: bytes) -> Packets:
    """Find every packet: its place is that of its time."""
    found = Packets()
    at, size = 0, len(data)
    while at + STAMP + 8 <= size:
        start = at + STAMP
        head = FIRST.get(data[start])
        if head is None:
            following = _next(data, at + 1)
            found.skipped += following - at
            at = following
            continue
        end = start + head + data[start + 1] + CHECKSUM
        if head == FIRST[0xFD]:
            if data[start + 2] & 1:
                end += SIGNATURE
            kind = int.from_bytes(data[start + 7 : start + 10], "little")
        else:
            kind = data[start + 5]
        if end > size:
            found.cut = True
            break
        found.places.append(at)
        found.types.append(kind)
        at = end
    return found


def _next(data: bytes, at: int) -> int:
    """The next place that may be the time before a packet: its first byte is 0 until 2112."""
    match = re.compile(rb"\0.{7}[\xfd\xfe]", re.DOTALL).search(data, at)
    return match.start() if match else len(data)


@dataclass(frozen=True)
class Batch:
    """All messages of one type, in the order of the file.

    Attributes
    ----------
    name : str
        Of the type.
    records : structured array
        The fields; an array of values is a field of two dimensions.
    places : ndarray of int
        Where in the file.
    ground : ndarray
        When the ground station received them, s since 1970.
    system, component, number : ndarray of int
        The senders, and their numbers of the packets.
    units : mapping of str to str
        Units of fields.
    """

    name: str
    records: NDArray[np.void]
    places: NDArray[np.int64]
    ground: Array
    system: NDArray[np.uint8]
    component: NDArray[np.uint8]
    number: NDArray[np.uint8]
    units: Mapping[str, str]

    def senders(self) -> dict[tuple[int, int], NDArray[np.int64]]:
        """Rows of each sender."""
        both = self.system.astype(np.int64) << 8 | self.component
        return {
            (int(sender) >> 8, int(sender) & 0xFF): np.flatnonzero(both == sender)
            for sender in np.unique(both)
        }

    def taken(self, rows: Mask) -> Batch:
        """The messages of these rows."""
        parts = ("records", "places", "ground", "system", "component", "number")
        return replace(self, **{name: getattr(self, name)[rows] for name in parts})


def batches(
    data: bytes, packets: Packets, definitions: Mapping[int, Any]
) -> tuple[list[Batch], int]:
    """The messages by type, and how many packets had a wrong checksum."""
    content = np.frombuffer(data, dtype=np.uint8)
    places = np.array(packets.places, dtype=np.int64)
    types = np.array(packets.types, dtype=np.int64)
    found, damaged = [], 0
    for kind in np.unique(types):
        if int(kind) in definitions:
            batch, wrong = _batch(content, places[types == kind], definitions[int(kind)])
            damaged += wrong
            if batch.places.size:
                found.append(batch)
    return found, damaged


def _batch(
    content: NDArray[np.uint8], places: NDArray[np.int64], definition: Any
) -> tuple[Batch, int]:
    """Decode the packets of one type. A packet is cut at its last byte that is not 0."""
    dtype = _dtype(definition)
    size = dtype.itemsize
    payload = np.zeros((places.size, size), dtype=np.uint8)
    right = np.zeros(places.size, dtype=bool)
    starts = places + STAMP
    shapes = content[starts].astype(np.int64) << 8 | content[starts + 1]
    for shape in np.unique(shapes):
        rows = np.flatnonzero(shapes == shape)
        head, length = FIRST[int(shape) >> 8], int(shape) & 0xFF
        whole = gathered(content, starts[rows] + 1, head - 1 + length + CHECKSUM)
        checked = np.concatenate(
            (
                whole[:, : head - 1 + length],
                np.full((rows.size, 1), definition.crc_extra, dtype=np.uint8),
            ),
            axis=1,
        )
        stored = whole[:, -2].astype(np.uint16) | whole[:, -1].astype(np.uint16) << 8
        right[rows] = _checksum(checked) == stored
        used = min(length, size)
        payload[rows, :used] = whole[:, head - 1 : head - 1 + used]
    number, system, component = numbers_and_senders(content, places)
    stamps = gathered(content, places, STAMP).view(">u8")[:, 0]
    batch = Batch(
        name=definition.msgname,
        records=payload.view(dtype)[:, 0],
        places=places,
        ground=1e-6 * stamps.astype(float),
        system=system,
        component=component,
        number=number,
        units=definition.fieldunits_by_name,
    )
    return batch.taken(right), int(np.count_nonzero(~right))


def numbers_and_senders(
    content: NDArray[np.uint8], places: NDArray[np.int64]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]:
    """Number, system and component of the packets at these places."""
    at = places + STAMP
    at += np.where(content[at] == 0xFD, 4, 2)
    return content[at], content[at + 1], content[at + 2]


def _dtype(definition: Any) -> np.dtype[np.void]:
    """The fields of a message, in the order in which they are sent."""
    tokens = re.findall(r"(\d*)([a-zA-Z])", definition.unpacker.format)
    fields: list[tuple[str, Any]] = []
    for name, (count, letter) in zip(definition.ordered_fieldnames, tokens, strict=True):
        number = int(count or 1)
        if letter == "s" or (count and (letter == "c" or number > LONGEST_ARRAY)):
            size = np.dtype(KINDS.get(letter, "S1")).itemsize
            fields.append((name, f"S{number * size}"))
        elif count:
            fields.append((name, (KINDS[letter], (number,))))
        else:
            fields.append((name, KINDS[letter]))
    return np.dtype(fields)


def _table() -> NDArray[np.uint16]:
    """The checksum of MAVLink (CRC-16/MCRF4XX) of each byte."""
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = np.where(table & 1, table >> 1 ^ 0x8408, table >> 1).astype(np.uint16)
    return table


TABLE = _table()


def _checksum(rows: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The checksum of each row."""
    found = np.full(rows.shape[0], 0xFFFF, dtype=np.uint16)
    for k in range(rows.shape[1]):
        found = found >> 8 ^ TABLE[(found ^ rows[:, k]) & 0xFF]
    return found
