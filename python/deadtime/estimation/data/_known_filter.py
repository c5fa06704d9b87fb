"""What a sensor read before a known digital filter, from the filtered rows of a log.

The filter and its inverse are those of the kernel. Rows are averaged over the time by which the
filter is late, in which filtered rows are alike, and at least in pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.recordings import Recording

#: Coefficients (b, a) in powers of 1/z.
GivenFilter: TypeAlias = tuple[Sequence[float], Sequence[float]]

#: Largest difference between two steps of time, as a share of the mean step.
EVEN = 0.5


def known_filter(given: GivenFilter | None) -> native.KnownFilter | None:
    """The filter (b, a), as scipy.signal designs and takes it, with its inverse.

    Raises
    ------
    TypeError
        If it is not a pair of sequences of numbers.
    ValueError
        If it is not finite or not stable, or cannot be undone.
    """
    if given is None:
        return None
    try:
        b, a = (np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in given)
    except (TypeError, ValueError):
        raise TypeError(
            f"output_filter={given!r}: give (b, a), two lists of coefficients in powers of 1/z"
        ) from None
    for name, part in (("b", b), ("a", a)):
        if part.ndim != 1 or not np.all(np.isfinite(part)) or not np.any(part):
            raise ValueError(f"{name}={part.tolist()}: give finite coefficients, not all zero")
    found, is_stable = native.KnownFilter.inverted(b.tolist(), a.tolist())
    if not is_stable:
        raise ValueError(
            f"a={a.tolist()}: the filter with these "
            "coefficients is not stable. Check the coefficients"
        )
    if found is None:
        raise ValueError(
            f"b={b.tolist()}: the filter cannot be undone. It removes a frequency that "
            "the response needs, or has a zero outside the unit circle. Leave the filter "
            "out"
        )
    return found


def before_filter(recording: Recording, rows: slice, known: native.KnownFilter) -> Recording:
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
