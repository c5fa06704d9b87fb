"""What a sensor read before a known digital filter, from the filtered rows of a log.

A filter y = B/A x, in powers of 1/z, colours the noise of the sensor, and it is the filtered rows
that are logged. With its zeros inside the unit circle, x = A/B y is what the sensor read, and its
noise is white again. A low-pass has zeros at the Nyquist frequency, on the circle, and its inverse
has no end there. They are moved to a circle of radius `LARGEST`: C instead of B. What is computed
is then B/C x, which differs from x near the Nyquist frequency alone, and by a known delay. The mean
of two rows has no part there. What is added behind the filter, as by the digits of a log, is
amplified near that frequency by up to A/C, and a larger circle than needed lets it colour what is
computed. Rows are averaged over the time by which the filter is late, in which
filtered rows are alike, and at least in pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.recordings import Recording

#: Radius of the circle to which zeros are moved; zeros at lower frequencies than a quarter of the
#: rate of the rows stay where they are, up to this radius.
LARGEST, LARGEST_LOW = 0.5, 0.98

#: Share of the start that may be left when rows are used.
FORGOTTEN = 1e-6

#: Largest difference between two steps of time, as a share of the mean step.
EVEN = 0.5


@dataclass(frozen=True)
class KnownFilter:
    """A filter y = B/A x in ascending powers of 1/z, with a part C for B that can be inverted.

    Attributes
    ----------
    b, a : tuple of float
    inverted : tuple of float
        C, scaled so that C(1) = B(1).
    """

    b: tuple[float, ...]
    a: tuple[float, ...]
    inverted: tuple[float, ...]

    @classmethod
    def of(cls, given: tuple[Sequence[float], Sequence[float]]) -> KnownFilter:
        """The filter (b, a), as scipy.signal designs and takes it.

        Raises
        ------
        TypeError
            If it is not a pair of sequences of numbers.
        ValueError
            If it is not finite or not stable, or cannot be undone.
        """
        try:
            b, a = (np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in given)
        except (TypeError, ValueError):
            raise TypeError(
                f"output_filter={given!r}: give (b, a), two lists of coefficients in powers of 1/z"
            ) from None
        for name, part in (("b", b), ("a", a)):
            if part.ndim != 1 or not np.all(np.isfinite(part)) or not np.any(part):
                raise ValueError(f"{name}={part.tolist()}: give finite coefficients, not all zero")
        if a[0] == 0.0 or np.any(np.abs(np.roots(a)) >= 1.0):
            raise ValueError(
                f"a={a.tolist()}: the filter with these "
                "coefficients is not stable. Check the coefficients"
            )
        zeros = np.roots(b)
        sizes, fast = np.abs(zeros), zeros.real < 0.0
        if np.any(sizes > 1.0 + 1e-6) or np.any(sizes[~fast] > LARGEST_LOW):
            raise ValueError(
                f"b={b.tolist()}: the filter cannot be undone, because "
                "it removes a frequency of the response or has a zero "
                "outside the unit circle. Leave the filter out"
            )
        moved = np.where(
            fast & (sizes > LARGEST), zeros * LARGEST / np.maximum(sizes, LARGEST), zeros
        )
        inverted = np.atleast_1d(np.real(np.poly(moved)))
        inverted *= np.sum(b) / np.sum(inverted)
        return cls(tuple(b.tolist()), tuple(a.tolist()), tuple(inverted.tolist()))

    @property
    def late(self) -> float:
        """How late the filter follows a slow signal, in rows."""
        return _late(self.b) - _late(self.a)

    @property
    def remaining(self) -> float:
        """How late B/C follows, in rows."""
        return _late(self.b) - _late(self.inverted)

    @property
    def start(self) -> int:
        """Rows until what is computed does not depend on rows before the log."""
        radius = float(np.max(np.abs(np.roots(self.inverted)), initial=0.0))
        fading = math.log(FORGOTTEN) / math.log(radius) if radius > 0.0 else 0.0
        return len(self.a) + math.ceil(fading)

    @property
    def together(self) -> int:
        """Rows that are averaged."""
        return max(2, round(2.0 * self.late))

    def undone(self, output: Array) -> Array:
        """B/C x of the filtered rows."""
        from scipy.signal import lfilter, lfilter_zi

        back = (*self.inverted, 0.0)  # SciPy wants at least two coefficients
        state = lfilter_zi(self.a, back) * output[0]
        return np.asarray(lfilter(self.a, back, output, zi=state)[0])


def _late(coefficients: tuple[float, ...]) -> float:
    """Mean power of 1/z, weighted by the coefficients."""
    return float(np.average(np.arange(len(coefficients)), weights=coefficients))


def before_filter(recording: Recording, rows: slice, known: KnownFilter) -> Recording:
    """What the sensor read in these rows, averaged, at the times it read it.

    Raises
    ------
    NotIdentifiableError
        If the rows are not the samples of the filter, one after the other.
    """
    steps = np.diff(recording.time)
    between = float(np.mean(steps))
    if np.max(np.abs(steps - between)) > EVEN * between:
        raise NotIdentifiableError(
            f"rows are {steps.min():g} to {steps.max():g} s apart, but a filter can be "
            "undone only in evenly spaced rows: choose a window without missing rows"
        )
    together = known.together
    first = max(rows.start, known.start)
    count = max(0, rows.stop - first) // together
    if count < together:
        raise NotIdentifiableError(
            f"{len(recording)} rows are too few to undo the filter: give a longer recording"
        )
    kept = slice(first, first + count * together)

    def mean(values: Array) -> Array:
        return np.asarray(values[kept].reshape(count, together).mean(axis=1))

    command = None if recording.command is None else mean(recording.command)
    return Recording(
        mean(recording.time) - known.remaining * between,
        mean(recording.reference),
        mean(known.undone(recording.output)),
        command,
        dict(recording.units),
        recording.source,
    )
