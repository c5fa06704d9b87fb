"""Read Blackbox logs of Betaflight, Cleanflight and INAV."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime.logs._blackbox_frames import Frames, layout, read_frames, seconds
from deadtime.logs._blackbox_head import MARK, Head, read_head
from deadtime.logs._blackbox_modes import flight_modes
from deadtime.logs._columns import Columns
from deadtime.logs._contents import LogContents, Topic

Integers = NDArray[np.int32]

#: Fields that a Betaflight log of high resolution holds ten times as large.
FINE = re.compile(r"(gyroADC|gyroUnfilt|rcCommand)\[\d\]|setpoint\[[012]\]")
#: A scale of the gyroscope below this is not one in deg/s, whose least is that of 16 bits.
LEAST_SCALE = 1e-4

COMMIT = re.compile("[0-9a-f]{7,40}")
GYRO = re.compile(r"(gyroADC|gyroUnfilt)\[\d\]")


def read_blackbox(data: bytes, source: str, *, flight: int | None = None) -> LogContents:
    r"""Read a Blackbox log of Betaflight, Cleanflight or INAV.

    Logs of data version 2 define their fields themselves. Versions whose fields, scales and modes
    are known: Betaflight 4.2 to 4.6 and 2025.12, INAV 5 to 8. Those of other versions are read by
    what their heads define.

    Parameters
    ----------
    data : bytes
        The file (``.bbl``, ``.bfl``, ``.TXT``).
    source : str
        Its name, for messages.
    flight : int, optional
        Which flight of a file that holds several, counted from 1. The longest if not given; a
        remark then names the others.

    Returns
    -------
    LogContents
        Topic ``"main"`` has the fields of the loop. Setpoints and rates (``setpoint[0]`` to
        ``[2]``, ``gyroADC``, ``gyroUnfilt``, INAV's ``axisRate``) are in deg/s; everything else is
        as logged: INAV's ``attitude`` in 0.1 deg, ``navPos`` and ``navVel`` in cm and cm/s,
        ``eRPM`` in 100 rpm, ``baroAlt`` in cm. ``"slow"`` has modes and states from the times at
        which they hold; ``"gps"`` is there where it is logged. Parameters are the numbers of the
        head, several of a line as ``"rollPID[0]"``.

    Raises
    ------
    RecordingError
        When there is no flight with that number, or none that can be read.

    Examples
    --------
    >>> head = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n"
    >>> head += b"H Data version:2\nH Firmware revision:Betaflight 4.5.1 (abc) X\n"
    >>> for line in ("name:loopIteration,time,gyroADC[0]", "encoding:1,1,0", "predictor:0,0,0"):
    ...     head += f"H Field I {line}\n".encode()
    >>> contents = read_blackbox(head + b"I\0\x64\x02" + b"I\1\x65\x03", "small.bbl")
    >>> contents.firmware, contents.topics["main"].columns["gyroADC[0]"]
    ('Betaflight 4.5.1 (abc) X', array([ 1., -2.]))
    """
    starts = [found.start() for found in re.finditer(re.escape(MARK), data)]
    if not starts:
        raise RecordingError(
            f"{source} is not a Blackbox log, because the line "
            f'"{MARK[2:].decode().strip()}" is missing'
        )
    if flight is not None and not 1 <= flight <= len(starts):
        raise RecordingError(
            f"{source} contains {len(starts)} flights, but flight={flight} is given: give a "
            f"number from 1 to {len(starts)}"
        )
    best, lengths, faults = None, [], []
    for number, (start, end) in enumerate(zip(starts, [*starts[1:], len(data)], strict=True), 1):
        try:
            found = _read_flight(data[start:end], number)
        except RecordingError as error:
            faults.append(f"flight {number}: {error}" if len(starts) > 1 else str(error))
            continue
        lengths.append(f"flight {number} of {found.length:.3g} s")
        is_longer = best is None or found.length > best.length
        if flight == number or (flight is None and is_longer):
            best = found
    if best is None:
        wanted = f"flight {flight}: " if flight is not None else "flight "
        raise RecordingError(
            f"{source}: "
            + "; ".join([fault for fault in faults if fault.startswith(wanted)] or faults)
        )
    remarks = []
    if len(starts) > 1:
        remarks.append(
            f"The file contains {len(starts)} flights, and this is flight {best.number}: "
            + ", ".join(lengths)
            + "."
        )
    remarks += [f"Not read: {fault}." for fault in faults]
    return _contents(best, tuple(remarks))


@dataclass(frozen=True)
class _Flight:
    """A flight of a file, decoded."""

    number: int
    head: Head
    frames: Frames
    time: Array

    @property
    def length(self) -> float:
        return float(np.ptp(self.time))


def _read_flight(log: bytes, number: int) -> _Flight:
    head = read_head(log)
    version = head.text("Data version")
    if version != "2":
        raise RecordingError(f'version "{version}" of the data cannot be read, only version 2')
    frames = read_frames(log, head)
    if not frames.main.size:
        raise RecordingError("there is no frame that can be read")
    time = seconds(frames.main[head.list("Field I name").index("time")])
    return _Flight(number, head, frames, time)


def _contents(flight: _Flight, remarks: tuple[str, ...]) -> LogContents:
    head, frames, time = flight.head, flight.frames, flight.time
    firmware = head.text("Firmware revision")
    autopilot = _autopilot(firmware, head.text("Firmware type"))
    topics = {"main": Topic(time, _columns(flight, "I", frames.main))}
    modes: tuple[tuple[float, str], ...] = ()
    if frames.slow.size:
        # It is written just before the main frame from which it holds.
        places = np.minimum(frames.slow_before, time.size - 1)
        slow = Topic(time[places], _columns(flight, "S", frames.slow))
        topics["slow"] = slow
        if "flightModeFlags" in slow.columns:
            modes = flight_modes(firmware, slow.time, slow.columns["flightModeFlags"])
    if frames.gps.size:
        topics["gps"] = _gps(flight)
    return LogContents(
        format="Blackbox",
        autopilot=autopilot,
        vehicle=head.text("Craft name"),
        firmware=firmware,
        topics=topics,
        parameters=dict(head.numbers),
        modes=modes,
        remarks=(*remarks, *_remarks(flight, autopilot)),
        gaps=_gaps(flight),
    )


def _autopilot(firmware: str, kind: str) -> str:
    """The firmware's name; in a head without it the type, which its successors left as it was."""
    found = re.match("(Betaflight|Cleanflight|INAV) ", firmware, re.IGNORECASE)
    if found is None:
        # A commit alone stands where the first versions of Cleanflight name themselves.
        return "Cleanflight" if kind == "Cleanflight" and COMMIT.fullmatch(firmware) else ""
    return {"betaflight": "Betaflight", "cleanflight": "Cleanflight", "inav": "INAV"}[
        found[1].lower()
    ]


def _gaps(flight: _Flight) -> tuple[tuple[float, float], ...]:
    """Where iterations are missing that the firmware was told to log."""
    shape = layout(flight.head)
    some, all_ = shape.logged
    has_deltas = shape.inter is not None and flight.head.numbers.get("P interval") != 0.0
    step = max(all_ - some, 0) + 1 if has_deltas else shape.interval
    iterations = flight.frames.main[shape.iteration]
    after = np.flatnonzero(np.diff(iterations) > step)
    return tuple((float(flight.time[k]), float(flight.time[k + 1])) for k in after)


def _remarks(flight: _Flight, autopilot: str) -> Iterator[str]:
    frames = flight.frames
    if not autopilot:
        yield (
            f'The firmware "{flight.head.text("Firmware revision")}" is neither Betaflight, '
            "Cleanflight nor INAV, so its fields are read as the header defines them."
        )
    if frames.damaged:
        yield f"The log is damaged at {frames.damaged} places, and these parts are left out."
    if frames.unusable:
        yield (
            f"{frames.unusable} frames are left out because they depend on a frame that is lost."
        )
    if not frames.ended:
        yield "The log has no end mark, so it was probably cut off."


def _gps(flight: _Flight) -> Topic:
    columns = _columns(flight, "G", flight.frames.gps)
    last = np.maximum(flight.frames.gps_before, 1) - 1
    time = flight.time[last]
    names = flight.head.list("Field G name")
    if "time" in names:
        # The same clock as that of the last main frame, a little later.
        main = flight.frames.main[flight.head.list("Field I name").index("time")][last]
        own = flight.frames.gps[names.index("time")]
        time = time + (own - main) * 1e-6
    return Topic(time, columns)


def _columns(flight: _Flight, letter: str, table: Integers) -> Columns:
    """The columns of a table, by the names that the head gives them."""
    head = flight.head
    names = head.list(f"Field {letter} name")
    signs = head.list(f"Field {letter} signed")
    scales = _scales(head) if letter == "I" else {}
    makers: dict[str, Callable[[], Array]] = {}
    for k, name in enumerate(names):
        if letter != "S" and name == "time":
            continue
        is_signed = k >= len(signs) or signs[k] != "0"
        makers[name] = partial(_column, table[k], is_signed, scales.get(name, 1.0))
    return Columns(makers)


def _scales(head: Head) -> dict[str, float]:
    """By what the columns are multiplied that are not as the log holds them."""
    fine = 0.1 if head.numbers.get("blackbox_high_resolution") == 1.0 else 1.0
    gyro = head.numbers.get("gyro_scale", head.numbers.get("gyro.scale", 1.0))
    if 0.0 < gyro < LEAST_SCALE:
        gyro *= 1e6 * 180.0 / np.pi  # Baseflight's is in rad/µs
    return {
        name: (fine if FINE.fullmatch(name) else 1.0) * (gyro if GYRO.fullmatch(name) else 1.0)
        for name in head.list("Field I name")
    }


def _column(values: Integers, is_signed: bool, scale: float) -> Array:
    column = (values if is_signed else values.view(np.uint32)).astype(np.float64)
    return column if scale == 1.0 else column * scale
