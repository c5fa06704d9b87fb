"""Chebyshev spectral continuous-time approximation (Torkamani & Butcher 2013).

The output over the last delay, y(t + θ) for -Td <= θ <= 0, is approximated by the polynomial
through its values Y_0 … Y_N at the Chebyshev points θ_j = Td/2 (cos(jπ/N) - 1). All but the first
follow from the differentiation matrix, Y_j' = 2/Td (D Y)_j (Trefethen 2000, chapter 6), the first
by the loop,
    Y_0' = v,   lag v' + v = K (r - Y_N)
(v itself the right side without a lag), so the delay equation becomes N + 1 ordinary ones, whose
step response is a sum of exponentials; the reference is a sum of steps. Delay, gain, lag and the
output at the start follow by least squares on the recording.

The polynomial cannot follow the corners that a step leaves, so the delay is biased: at K Td = 0.47
and 1.08 by -1.2 and -4.4 % for N = 2, by -0.06 and -0.4 % for N = 3 and by less than 1e-6 for N =
6. The method is for continuous loops without a limit; it is otherwise the waveform fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from deadtime._base.arrays import Array, Complex
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import (
    check_delay_free,
    check_distinguishable,
    check_excitation,
    check_gain,
    checked_names,
    standard_errors,
    start_and_span,
)
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.data._step_reading import stiffness_of
from deadtime.estimation.fit._least_squares import Fitted
from deadtime.estimation.fit._residuals import robust_covariance
from deadtime.estimation.methods._conclusion import read_off_estimate
from deadtime.estimation.methods._method import Method, Run, check_initial_output
from deadtime.loops import ControlLoop

#: Points of the initial grid over the delay, and its ends as shares of the window.
POINTS, SHORTEST, LONGEST = 20, 0.005, 0.6

#: Most intervals: with more, the corners dominate the error.
MOST_NODES = 24

#: Bound of the exponents, so that unstable loops do not overflow.
LARGEST_EXPONENT = 50.0


@dataclass(frozen=True)
class CTA(Method):
    """The waveform, with Chebyshev's approximation in the place of the delay.

    Parameters
    ----------
    intervals : int
        Degree of the polynomial that stands for the output over one delay, from 1 to 24.
    initial_output : float, optional
        True output at the start of the window; fitted if not given.

    Raises
    ------
    ValueError
        When the number of intervals is out of its range.
    """

    intervals: int = 8
    initial_output: float | None = None

    name: ClassVar[str] = "cta"

    def __post_init__(self) -> None:
        whole_number("intervals", self.intervals, limit=MOST_NODES + 1)
        check_initial_output(self.initial_output)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window, *_),) = runs
        names = checked_names(free, loop)
        check_delay_free(names, "cta")
        stiffness_of(loop, "cta")
        if loop.is_sampled or loop.limit is not None:
            what = "a hold" if loop.is_sampled else "a limit"
            raise ValueError(
                f"the cta method is for continuous loops without a limit, this one has {what}: use "
                "method='waveform' or 'grid', or loop.continuous() to leave a hold out on purpose"
            )
        simulated = SimulatedRecording(recording, loop, window)
        data = simulated.recording
        check_excitation(data, len(names))
        matrix = chebyshev_differentiation(self.intervals)
        fit = _Fit(data, names, self.initial_output, loop, matrix)
        point, jacobian = fit.solve()
        misfit = fit.misfit(point)
        check_distinguishable(jacobian, fit.labels)
        cov = robust_covariance(jacobian, -misfit)[: len(names), : len(names)]
        values = fit.values(point)
        check_gain(values, standard_errors(names, cov))
        return read_off_estimate(
            "cta",
            simulated,
            values,
            cov,
            fit.start_of(point),
            message=(
                f"least squares over {', '.join(names)}, the delay line in {self.intervals} "
                "intervals"
            ),
            uncalibrated=(
                "the cta method approximates the delay by a polynomial of degree "
                f"{self.intervals}, which biases it; noise alone makes the delay uncertain by "
                f"{math.sqrt(cov[0, 0]):.2g} s where the controller does not act on it; use "
                "method='waveform' for an interval"
            ),
            details={
                "intervals": self.intervals,
                "rms_of_approximation": float(np.sqrt(np.mean(misfit**2))),
                "initial_output": fit.start_of(point),
            },
        )


def chebyshev_differentiation(order: int) -> Array:
    """Matrix that differentiates polynomials by their values at cos(jπ/order), j = 0 … order."""
    index = np.arange(order + 1)
    x = np.cos(np.pi * index / order)
    c = np.where((index == 0) | (index == order), 2.0, 1.0) * (-1.0) ** index
    away = x[:, None] - x[None, :] + np.eye(order + 1)
    matrix = np.outer(c, 1.0 / c) / away
    # With this diagonal the derivative of a constant is zero to rounding.
    return np.asarray(matrix - np.diag(matrix.sum(axis=1)))


@dataclass(frozen=True, eq=False)
class _Fit(Fitted):
    """The misfit as a function of the parameters."""

    loop: ControlLoop
    matrix: Array

    @cached_property
    def jumps(self) -> tuple[Array, Array]:
        """Times of the steps, the first sample counted as one, and the references from there on."""
        rows = [0, *(step.index for step in self.recording.steps())]
        return self.recording.time[rows], self.recording.reference[rows]

    def misfit(self, point: Array) -> Array:
        """Approximated minus recorded output."""
        values = {**self.loop.parameters, **self.values(point)}
        start = self.start_of(point)
        times, levels = self.jumps
        jumps = np.diff(levels, prepend=start)
        late = values["delay"] if self.loop.delay_path == "command" else 0.0
        rates, weights = self._step_response(values)
        output = np.full(len(self.recording), start)
        for time, jump in zip(times, jumps, strict=True):
            since = np.maximum(self.recording.time - time - late, 0.0)
            exponents = np.minimum(np.outer(since, rates).real, LARGEST_EXPONENT)
            phases = np.outer(since, rates.imag)
            moved = np.exp(exponents + 1j * phases) @ weights
            output += jump * (1.0 + moved.real)
        return np.asarray(output - self.recording.output)

    def _step_response(self, values: dict[str, float]) -> tuple[Complex, ...]:
        """Rates λ and weights w of the unit step response 1 + sum w e^(λ t) of the output."""
        nodes = self.matrix.shape[0]
        stiffness, lag = values["gain"] * values["Kp"], values["lag"]
        size = nodes + (1 if lag > 0.0 else 0)
        a = np.zeros((size, size))
        a[1:nodes, :nodes] = 2.0 / values["delay"] * self.matrix[1:]
        if lag > 0.0:
            a[0, nodes] = 1.0
            a[nodes, nodes - 1], a[nodes, nodes] = -stiffness / lag, -1.0 / lag
        else:
            a[0, nodes - 1] = -stiffness
        rates, modes = np.linalg.eig(a)
        # The deviation from the new reference is -1 over the whole delay at first, at rest.
        begin = np.where(np.arange(size) < nodes, -1.0, 0.0)
        weights = modes[0] * np.linalg.solve(modes, begin)
        # One of each conjugate pair stands for both.
        weights = np.where(rates.imag > 0.0, 2.0, 1.0) * weights
        upper = rates.imag >= 0.0
        return rates[upper].astype(np.complex128), weights[upper].astype(np.complex128)

    def solve(self) -> tuple[Array, Array]:
        """The parameters of least cost, and the derivatives of the misfit there."""
        from scipy.optimize import least_squares

        parameters = self.loop.parameters
        start, span = start_and_span(self.recording)
        shortest = 1e-4 * span
        starts = {"gain": parameters["gain"], "lag": 0.02 * span, "initial output": start}
        low = {"delay": shortest, "gain": 1e-3 * starts["gain"], "lag": 0.0}
        high = {"delay": span, "gain": 1e3 * starts["gain"], "lag": span}
        best, cost = np.empty(0), math.inf
        for delay in np.geomspace(SHORTEST, LONGEST, POINTS) * span:
            point = np.array([{"delay": delay, **starts}[label] for label in self.labels])
            found = float(np.sum(self.misfit(point) ** 2))
            if found < cost:
                best, cost = point, found
        solution = least_squares(
            self.misfit,
            best,
            bounds=(
                [low.get(label, -np.inf) for label in self.labels],
                [high.get(label, np.inf) for label in self.labels],
            ),
            jac="3-point",
            x_scale="jac",
            xtol=1e-11,
            ftol=1e-13,
            gtol=None,  # an absolute bound, in units of the output squared
            max_nfev=100,
        )
        delay = float(solution.x[0])
        if not 1.01 * shortest < delay < 0.99 * span:
            raise NotIdentifiableError(
                f"the fit ends at a delay of {delay:.3g} s, a bound of its search: the output is "
                "no response of such a loop to this reference; check columns, signs and gains"
            )
        return solution.x, np.asarray(solution.jac)
