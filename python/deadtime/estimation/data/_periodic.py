"""Spectra of a periodic experiment: means over the periods, and their covariances.

The DFT of period m at the lines that the reference excites is U_m, Y_m; noise differs from period
to period, the response to the reference does not. Means over M periods have 1/M of the covariances
between the periods (Pintelon & Schoukens 2012, section 10.2). The spectrum of the noise is smooth,
so covariances are also averaged over neighbouring lines, and few periods are enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array, Complex, Indices
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.recordings import Recording

#: A line of the reference counts as excited above this share of the largest line.
EXCITED = 1e-3

#: Lines to either side over which covariances are averaged. The spectrum of noise in a loop is not
#: flat: with three lines, standard errors were 10 % too small.
NEIGHBOURS = 1

#: Largest deviation of a period from a whole number of samples, in samples.
WHOLE = 1e-3


@dataclass(frozen=True, eq=False)
class PeriodicSpectra:
    """Means over the periods at the excited lines, and their covariances.

    Attributes
    ----------
    lines : ndarray of int
        Harmonics of the period.
    samples, periods : int
        Samples in a period, and periods that were averaged.
    input, output : ndarray of complex
        Mean DFT of command and output.
    input_variance, output_variance, covariance : ndarray
        Variances and covariance of these means; ``covariance`` is E[n_y n_u*].
    freedom : float
        Complex degrees of freedom of each.
    """

    lines: Indices
    samples: int
    periods: int
    input: Complex
    output: Complex
    input_variance: Array
    output_variance: Array
    covariance: Complex
    freedom: float


def periodic_spectra(
    data: Recording, command: Array, period: float, left_out: int, highest: float
) -> PeriodicSpectra:
    """Spectra of the whole periods after the first `left_out`, up to `highest` Hz."""
    h = data.sample_time
    samples = round(period / h)
    if abs(period / h - samples) > WHOLE or samples < 4:
        raise ValueError(
            f"period={period:g} s is {period / h:.4g} samples of {h:g} s: give a whole "
            "number of samples, at least four"
        )
    begin = whole_number("left_out", left_out, least=0) * samples
    periods = (len(data) - begin) // samples
    if periods < 2:
        raise NotIdentifiableError(
            f"{max(0, periods)} periods of {period:g} s after {left_out} left out: at least "
            "two are needed for their covariance; record longer"
        )
    begin = len(data) - periods * samples  # the last ones, in which the transient has decayed most

    def spectra(values: Array) -> Complex:
        parts = values[begin:].reshape(periods, samples)
        return np.asarray(np.fft.rfft(parts, axis=1), dtype=np.complex128)

    reference = data.reference[begin:].reshape(periods, samples)
    spread = float(np.max(np.ptp(reference, axis=0)))
    if spread > 1e-6 * float(np.ptp(reference)) or float(np.ptp(reference)) == 0.0:
        raise NotIdentifiableError(
            f"the reference does not repeat every {period:g} s (periods differ by {spread:.3g}, "
            "or the reference is constant): give the period of Experiment.multisine"
        )
    power = np.abs(np.fft.rfft(reference[0]))
    power[0] = 0.0  # the mean of an integrator's output holds no information
    excited = (power > EXCITED * power.max()) & (np.arange(power.size) / period <= highest)
    lines = np.flatnonzero(excited)
    lines = lines[2 * lines < samples]
    u, y = spectra(command)[:, lines], spectra(data.output)[:, lines]
    mean_u, mean_y = u.mean(axis=0), y.mean(axis=0)
    off_u, off_y = u - mean_u, y - mean_y
    scale = 1.0 / (periods * (periods - 1.0))

    def averaged(products: Complex) -> Complex:
        summed = products.sum(axis=0) * scale
        width = np.ones(2 * NEIGHBOURS + 1)
        count = np.convolve(np.ones(lines.size), width, "same")
        if lines.size < width.size:
            return np.full(lines.size, summed.mean())
        return np.asarray(np.convolve(summed, width, "same") / count)

    together = min(lines.size, NEIGHBOURS + 1)  # lines that are averaged at the ends
    return PeriodicSpectra(
        lines=lines,
        samples=samples,
        periods=periods,
        input=mean_u,
        output=mean_y,
        input_variance=averaged(off_u * np.conj(off_u)).real,
        output_variance=averaged(off_y * np.conj(off_y)).real,
        covariance=averaged(off_y * np.conj(off_u)),
        freedom=max(1.5, float((periods - 1) * together)),
    )
