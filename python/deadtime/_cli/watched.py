"""What ``deadtime watch`` reads: a recording, a table that grows, a link that is listened to."""

from __future__ import annotations

import csv
import math
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from deadtime._base.errors import LinkError, RecordingError
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.recordings import read_recording

#: Times between looks at a file that grows and at a silent link, s.
LOOK = 0.1

#: Largest datagram, bytes.
DATAGRAM = 65535

#: Message fields of an axis: its position, its set point of speed, and the sign of both.
AXES = {"x": ("x", "vx", 1.0), "y": ("y", "vy", 1.0), "z": ("z", "vz", -1.0)}

#: Later by at least so much than what came before, s: two messages may come at once.
LATER = 1e-6


class Row(NamedTuple):
    """An output, None where it was lost, and the command that was sent then, if any."""

    time: float
    output: float | None
    command: float | None


class Sent(NamedTuple):
    """A command that was sent at a time of its own."""

    time: float
    value: float


class Columns(NamedTuple):
    """Names of the columns of a table."""

    time: str
    output: str
    command: str


def recorded(file: Path, columns: Columns) -> Iterator[Row]:
    """The rows of a table that is complete."""
    recording = read_recording(
        file,
        time=columns.time,
        reference=columns.output,  # none is needed
        output=columns.output,
        command=columns.command,
    )
    assert recording.command is not None
    values = (recording.time, recording.output, recording.command)
    for row in zip(*(one.tolist() for one in values), strict=True):
        yield Row(*row)


def growing(file: Path, columns: Columns, silence: float) -> Iterator[Row]:
    """The rows of a CSV file as they are written, until none has come for `silence` s."""
    with file.open(encoding="utf-8", newline="") as lines:
        number, head = 1, _whole_line(lines, silence)
        while head is not None and head.startswith("#"):  # as in a saved recording
            number, head = number + 1, _whole_line(lines, silence)
        if head is None:
            raise RecordingError(f"{file} has no header line")
        heads = [name.strip() for name in next(csv.reader([head]))]
        for name in columns:
            if name not in heads:
                raise RecordingError(f"{file} has no column {name!r}, only {', '.join(heads)}")
        places = [heads.index(name) for name in columns]
        while (line := _whole_line(lines, silence)) is not None:
            number += 1
            cells = next(csv.reader([line]), [])
            if not cells:
                continue
            try:
                found = [float(cells[place] or "nan") for place in places]
            except (ValueError, IndexError):
                raise RecordingError(
                    f"line {number} of {file} is {line.strip()!r}: give a number for each of "
                    f"{', '.join(columns)}"
                ) from None
            when, output, command = found
            yield Row(
                when,
                None if math.isnan(output) else output,
                None if math.isnan(command) else command,
            )


def _whole_line(lines: object, silence: float) -> str | None:
    """The next line once its end is written; None after a silence."""
    text, since = "", time.monotonic()
    while not text.endswith("\n"):
        more = lines.readline()  # type: ignore[attr-defined]
        if more:
            text, since = text + more, time.monotonic()
        elif time.monotonic() - since > silence:
            return text or None
        else:
            time.sleep(LOOK)
    return text


def heard(address: LinkAddress, axis: str, silence: float) -> Iterator[Row | Sent]:
    """Set points and positions on a MAVLink link, until nothing has come for `silence` s.

    The socket only receives: nothing is ever sent. Whoever routes the link has to pass on the
    messages to the vehicle as well as those from it.
    """
    if address.kind != "udp":
        raise ValueError(f"{address}: give udp:HOST:PORT, at which a link is listened to")
    position, speed, sign = AXES[axis]
    codec, begun = Codec(255, 0), time.monotonic()
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_DGRAM)) as ears:
        try:
            ears.bind((address.host, address.port))
        except OSError as error:
            raise LinkError(f"{address} cannot be opened: {error}") from None
        ears.settimeout(LOOK)
        last = since = -LATER
        no_speed = dialect().POSITION_TARGET_TYPEMASK_VZ_IGNORE
        ignored = {"x": no_speed >> 2, "y": no_speed >> 1, "z": no_speed}[axis]
        while last - since <= silence:
            try:
                data = ears.recv(DATAGRAM)
            except TimeoutError:
                last = max(last, time.monotonic() - begun)
                continue
            now = last = max(time.monotonic() - begun, last + LATER)
            for message in codec.decode(data, whole=True):
                kind = message.get_type()
                if kind == "LOCAL_POSITION_NED":
                    since = now
                    yield Row(now, sign * float(getattr(message, position)), None)
                elif kind == "SET_POSITION_TARGET_LOCAL_NED" and not message.type_mask & ignored:
                    since = now
                    yield Sent(now, sign * float(getattr(message, speed)))
                now = last = last + LATER
