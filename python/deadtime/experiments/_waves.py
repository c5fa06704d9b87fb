"""Reference signals on samples: steps, binary sequences and multisines.

A pseudo-random binary sequence is a maximum-length one of a shift register (Golomb 1967; SciPy's
`max_len_seq`); a multisine is a sum of harmonics of one period with equal amplitudes and phases
that are random or those of Schroeder (1970), which keep its peak low.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.validation import positive, whole_number
from deadtime.recordings import MINIMUM_SAMPLES

Whole = NDArray[np.int64]

#: Largest deviation of a time from a multiple of the sample time, as a share of the sample time.
ON_A_SAMPLE = 1e-6

#: Upper limit of the samples of an experiment (finds times that are not in seconds; bounds memory).
MOST_SAMPLES = 10_000_000

#: Longest shift register of `scipy.signal.max_len_seq`.
MOST_BITS = 32


def sample_times(duration: float, sample_time: float) -> Array:
    """Sample times from zero to the last one before `duration`."""
    sample = positive("sample_time", sample_time)
    count = positive("duration", duration) / sample
    if count < MINIMUM_SAMPLES:
        raise ValueError(
            f"duration={duration} s is less than {MINIMUM_SAMPLES} samples of {sample} s: "
            "give a longer duration"
        )
    if count > MOST_SAMPLES:
        raise ValueError(
            f"duration={duration} s is {count:.3g} samples of {sample} s, but at most "
            f"{MOST_SAMPLES} are possible: give a shorter duration, and check that the duration "
            "is in seconds"
        )
    return np.arange(np.ceil(count - ON_A_SAMPLE), dtype=np.float64) * sample


def hold_numbers(time: Array, hold: float, sample_time: float) -> Whole:
    """Index of the hold interval of each sample."""
    if positive("hold", hold) < sample_time * (1.0 - ON_A_SAMPLE):
        raise ValueError(
            f"hold={hold} s is shorter than a sample, which is {sample_time} s: give a longer hold"
        )
    return np.floor((time + ON_A_SAMPLE * sample_time) / hold).astype(np.int64)


def whole_period(period: float, sample_time: float) -> float | None:
    """The period if it is a whole number of samples, else None."""
    count = period / sample_time
    return period if count >= 1.0 and abs(count - round(count)) <= ON_A_SAMPLE else None


def excited_lines(lines: int | Sequence[int], count: int, odd: bool) -> Whole:
    """The excited harmonics of a period of `count` samples, checked."""
    if np.ndim(lines) == 0:
        lines = range(1, whole_number("lines", cast(int, lines)) + 1)
    found = np.unique(np.asarray(lines))
    if found.size and found.dtype.kind not in "iu":
        raise TypeError(f"lines={lines!r}: give whole numbers")
    if found.size and (found[0] < 1 or 2 * found[-1] >= count):
        raise ValueError(
            f"lines={lines!r}: give harmonics from 1 to {(count - 1) // 2}, below half of the "
            f"{count} samples of a period"
        )
    if odd:
        found = found[found % 2 == 1]
    if found.size == 0:
        raise ValueError(
            f"lines={lines!r} contains no {'odd ' if odd else ''}harmonic: give at least one "
            f"{'odd ' if odd else ''}harmonic"
        )
    return found.astype(np.int64)


def binary_sequence(needed: int, seed: int) -> tuple[Array, int]:
    """Signs of a maximum-length sequence from a random position on, and its whole length."""
    from scipy import signal

    bits = max(2, needed.bit_length())
    if bits > MOST_BITS:
        raise ValueError(
            f"the signal would change its sign {needed} times, which is too often: give a "
            "longer hold"
        )
    # Each state of the register but zero is a position in the sequence.
    start = np.random.default_rng(seed).integers(1, 2**bits)
    register = (start >> np.arange(bits)) & 1
    sequence, _ = signal.max_len_seq(bits, state=register, length=needed)
    return np.where(sequence, 1.0, -1.0), 2**bits - 1


def multisine(lines: Whole, count: int, phases: str, seed: int) -> Array:
    """One period of `count` samples with the largest value 1."""
    if phases == "random":
        shifts = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size)
    elif phases == "schroeder":
        place = np.arange(lines.size)
        shifts = -np.pi * place * (place + 1) / lines.size
    else:
        raise ValueError(f"phases={phases!r}: give 'random' or 'schroeder'")
    turns = np.outer(lines, np.arange(count)) / count
    wave = np.cos(2.0 * np.pi * turns + shifts[:, None]).sum(axis=0)
    return np.asarray(wave / np.abs(wave).max(), dtype=np.float64)
