"""Read logs of a Crazyflie's micro-SD card."""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime.logs._columns import Columns, gathered
from deadtime.logs._contents import LogContents, Topic

#: The first byte of a log.
MARK = 0xBC
#: Letters of the types of variables.
TYPES = "BbHhIifeQqd"
#: By version: the type of a time stamp, and its unit in s.
CLOCKS = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}
#: Most events and variables of a log; people log about a hundred.
MOST = 10_000
#: After damage, records are searched again over so many bytes.
SEARCH = 65_536


@dataclass(frozen=True)
class _Event:
    """A kind of record: its name, and its variables with their types and offsets."""

    name: str
    variables: tuple[tuple[str, np.dtype[np.generic], int], ...]
    size: int


def read_crazyflie(data: bytes, source: str) -> LogContents:
    r"""Read a log of a Crazyflie's micro-SD card (versions 1 and 2 of the format).

    The log defines its events, each an identifier, a name, and variables with a type; records
    follow, and a checksum over everything (CRC-32).

    Parameters
    ----------
    data : bytes
        The file.
    source : str
        Its name, for messages.

    Returns
    -------
    LogContents
        A topic for each event, as ``"fixedFrequency"``, with its variables in the units of the
        firmware: ``gyro.x`` to ``z`` in deg/s, ``acc.x`` to ``z`` in g, ``stabilizer.roll`` in deg,
        ``motor.m1`` to ``m4`` from 0 to 65535. Times are those since the start of the firmware.

    Raises
    ------
    RecordingError
        When it is no such log, or has no record that can be read.

    Examples
    --------
    >>> import struct, zlib
    >>> log = b"\xbc" + struct.pack("<HHH", 2, 1, 0) + b"fixedFrequency\0"
    >>> log += struct.pack("<H", 1) + b"gyro.x(f)\0" + struct.pack("<HQf", 0, 2_500_000, 1.5)
    >>> contents = read_crazyflie(log + struct.pack("<I", zlib.crc32(log)), "log00")
    >>> topic = contents.topics["fixedFrequency"]
    >>> topic.time, topic.columns["gyro.x"]
    (array([2.5]), array([1.5]))
    """
    if data[:1] != bytes([MARK]):
        raise RecordingError(
            f"{source} is not a log of a Crazyflie, because its first byte is not 0xbc"
        )
    try:
        version, events, start = _definitions(data)
    except (struct.error, ValueError) as error:
        raise RecordingError(
            f"{source}: the definitions of the events are damaged: {error}"
        ) from None
    whole = len(data) >= 4 and zlib.crc32(data[:-4]) == int.from_bytes(data[-4:], "little")
    stop = len(data) - 4 if whole else len(data)
    clock, unit = CLOCKS[version]
    places, faults = _records(data, start, stop, events, np.dtype(clock).itemsize)
    raw = np.frombuffer(data, dtype=np.uint8)
    topics: dict[str, Topic] = {}
    for number, event in events.items():
        if not places[number]:
            continue
        at = np.frombuffer(places[number], dtype=np.int64)
        time = _values(raw, at, 2, np.dtype(clock)) * unit
        head = 2 + np.dtype(clock).itemsize
        makers: dict[str, Callable[[], Array]] = {
            name: partial(_values, raw, at, head + offset, kind)
            for name, kind, offset in event.variables
        }
        topics[_unused(event.name, topics)] = Topic(time, Columns(makers))
    if not topics:
        raise RecordingError(f"{source} contains no record that can be read")
    if not whole:
        faults.insert(0, "The checksum is wrong, so the log was cut off or is damaged.")
    return LogContents(
        format="Crazyflie uSD",
        autopilot="Crazyflie",
        vehicle="",
        firmware="",
        topics=topics,
        remarks=tuple(faults),
    )


def _definitions(data: bytes) -> tuple[int, dict[int, _Event], int]:
    """Version, events by their identifiers, and the offset of the first record."""
    version, count = struct.unpack_from("<HH", data, 1)
    if version not in CLOCKS:
        raise ValueError(f"version {version} of the log cannot be read, only versions 1 and 2")
    at, defined = 5, 0
    events: dict[int, _Event] = {}
    for _ in range(count):
        (number,) = struct.unpack_from("<H", data, at)
        name, at = _text(data, at + 2)
        (variables,) = struct.unpack_from("<H", data, at)
        at += 2
        defined += 1 + variables
        if defined > MOST:
            raise ValueError(f"the log defines more than {MOST} events and variables")
        found, size = [], 0
        for _ in range(variables):
            text, at = _text(data, at)
            if len(text) < 3 or text[-3] != "(" or text[-1] != ")" or text[-2] not in TYPES:
                raise ValueError(
                    f'the variable "{text}" does not end in a known type, such as "(f)"'
                )
            kind = np.dtype("<" + text[-2])
            found.append((text[:-3], kind, size))
            size += kind.itemsize
        if number in events:
            raise ValueError(f"the event {number} is defined twice")
        events[number] = _Event(name, tuple(found), size)
    return version, events, at


def _text(data: bytes, at: int) -> tuple[str, int]:
    """A text up to a byte of zero, and where what follows begins."""
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError(f"the name that begins at byte {at} has no end")
    return data[at:end].decode("utf-8", "replace"), end + 1


def _records(
    data: bytes, start: int, stop: int, events: Mapping[int, _Event], clock: int
) -> tuple[dict[int, array[int]], list[str]]:
    """Where the records of each event begin, and what is wrong, in sentences."""
    places = {number: array("q") for number in events}
    appends = {number: found.append for number, found in places.items()}
    sizes = {number: 2 + clock + event.size for number, event in events.items()}
    at, faults, lost = start, [], 0
    while at + 2 <= stop:
        number = data[at] | data[at + 1] << 8
        size = sizes.get(number)
        if size is None:
            found = _next(data, at, stop, sizes)
            if found is None:
                faults.append(f"The part from byte {at} of {stop} on is damaged, and is left out.")
                break
            lost += 1
            at = found
            continue
        if at + size > stop:
            break
        appends[number](at)
        at += size
    if lost:
        faults.append(f"The log is damaged at {lost} places, and these parts are left out.")
    return places, faults


def _next(data: bytes, at: int, stop: int, sizes: Mapping[int, int]) -> int | None:
    """Where records begin again: two of them follow each other there."""
    for place in range(at + 1, min(stop - 1, at + SEARCH)):
        size = sizes.get(data[place] | data[place + 1] << 8)
        if size is None or place + size + 2 > stop:
            continue
        after = place + size
        if data[after] | data[after + 1] << 8 in sizes:
            return place
    return None


def _values(
    raw: NDArray[np.uint8], at: NDArray[np.int64], offset: int, kind: np.dtype[np.generic]
) -> Array:
    """The numbers that begin so far behind these places."""
    parts = gathered(raw, at + offset, kind.itemsize)
    # NumPy warns of a NaN whose bits signal one, as damage can make it.
    with np.errstate(invalid="ignore"):
        return parts.view(kind)[:, 0].astype(np.float64)


def _unused(name: str, topics: Mapping[str, Topic]) -> str:
    """The name of a topic; a second one of a name has its number."""
    if name not in topics:
        return name
    number = next(k for k in range(1, len(topics) + 2) if f"{name}[{k}]" not in topics)
    return f"{name}[{number}]"
