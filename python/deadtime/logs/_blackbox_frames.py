"""The frames of a Blackbox log by the definitions of its head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import deadtime.logs._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime.logs._blackbox_head import Head

Codes = tuple[bytes, bytes]
Frames = native.BlackboxFrames

#: What decoded values may take, bytes: so much, and so many times the size of the log. A frame of
#: 30 bytes holds 45 values of 4 bytes each.
MEMORY = 16 << 20
MEMORY_FACTOR = 6


@dataclass(frozen=True)
class Layout:
    """What the frames hold, for the decoder."""

    intra: Codes
    inter: Codes | None
    slow: Codes | None
    gps: Codes | None
    home: Codes | None
    iteration: int
    time: int
    first_motor: int | None
    least_throttle: int
    least_motor: int
    voltage: int
    interval: int
    logged: tuple[int, int]


def _codes(head: Head, letter: str) -> Codes | None:
    codes = head.codes(f"Field {letter} encoding"), head.codes(f"Field {letter} predictor")
    return codes if any(codes) else None


def _logged(head: Head) -> tuple[int, int]:
    """Of how many iterations how many are logged: "1/16" or "16" for one of sixteen."""
    if "P interval[1]" in head.numbers:
        pair = head.integer("P interval[0]", 1), head.integer("P interval[1]", 1)
    else:
        pair = 1, head.integer("P interval", 1)
    return max(pair[0], 1), max(pair[1], 1)


def layout(head: Head) -> Layout:
    """The layout of the frames, from the lines of the head."""
    names = head.list("Field I name")
    for name in ("loopIteration", "time"):
        if name not in names:
            raise RecordingError(f'the header does not define the field "{name}"')
    intra, inter = _codes(head, "I"), _codes(head, "P")
    if intra is None or len(intra[0]) != len(names):
        raise RecordingError(
            f"the header names {len(names)} fields, but defines another number of encodings"
        )
    for letter in "SGH":
        codes, others = _codes(head, letter), head.list(f"Field {letter} name")
        if codes is not None and len(codes[0]) != len(others):
            raise RecordingError(
                f"the header names {len(others)} fields of {letter} frames, but defines "
                f"{len(codes[0])} encodings"
            )
    motor = "motor[0]"
    return Layout(
        intra=intra,
        inter=inter,
        slow=_codes(head, "S"),
        gps=_codes(head, "G"),
        home=_codes(head, "H"),
        iteration=names.index("loopIteration"),
        time=names.index("time"),
        first_motor=names.index(motor) if motor in names else None,
        least_throttle=head.integer("minthrottle", 1150),
        least_motor=head.integer("motorOutput[0]", 0),
        voltage=head.integer("vbatref", 4095),
        interval=max(head.integer("I interval", 32), 1),
        logged=_logged(head),
    )


def read_frames(log: bytes, head: Head) -> Frames:
    """The frames of a flight; `log` starts at its head."""
    limit = (MEMORY + MEMORY_FACTOR * len(log)) // 4
    return native.blackbox_frames(log[head.size :], layout(head), limit)


def seconds(microseconds: NDArray[np.int32]) -> Array:
    """A clock of 32 bits, µs, as seconds that go on where it starts again from zero."""
    raw = microseconds.view(np.uint32)
    # A step is the nearest one, forwards or backwards.
    steps = np.diff(raw).view(np.int32).astype(np.int64)
    elapsed = np.concatenate([[0], np.cumsum(steps)]) + np.int64(raw[0])
    return elapsed.astype(np.float64) * 1e-6
