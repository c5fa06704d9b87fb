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
from typing import ClassVar

import numpy as np

import deadtime.estimation.data._checks as checks
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.estimation._least_squares import Ends, ModelOfOne, place_of
from deadtime.estimation._native import ChebyshevMisfit
from deadtime.estimation.data._step_reading import stiffness_of
from deadtime.estimation.methods._method import OfOne, Read, Run, check_initial_output, spreads_of
from deadtime.loops import ControlLoop

#: Points of the initial grid over the delay, and its ends as shares of the window.
POINTS, SHORTEST, LONGEST = 20, 0.005, 0.6

#: Most intervals: with more, the corners dominate the error.
MOST_NODES = 24


@dataclass(frozen=True)
class CTA(OfOne):
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

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """The delay, and what else is asked for."""
        names = checks.delay_and(free, loop, "cta")
        stiffness_of(loop, "cta")
        if loop.is_sampled or loop.limit is not None:
            what = "a hold" if loop.is_sampled else "a limit"
            raise ValueError(
                "the cta method is for continuous loops without a limit, but this loop has "
                f"{what}. Use method='waveform' or 'grid', or use loop.continuous() to ignore "
                "the hold on purpose"
            )
        return names

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, data = run.loop, run.simulated.recording
        checks.check_excitation(data, len(names))
        model = _Model(data, names, self.initial_output, loop, self.intervals)
        found = model.problem.solve()
        delay, ends = float(found.point[0]), model.ends("delay")
        if not 1.01 * ends.low < delay < 0.99 * ends.high:
            raise NotIdentifiableError(
                f"the search ends at its bound, a delay of {delay:.3g} "
                "s. So the output is not a response of this loop to "
                "this reference. Check columns, signs and gains"
            )
        count = len(names)
        every = list(range(len(model.labels)))
        cov = spreads_of(found, model.labels, every, model.sizes)[1][:count, :count]
        values = model.values(found.point)
        checks.check_gain(values, checks.standard_errors(names, cov))
        return Read(
            values,
            cov,
            model.start_of(found.point),
            message=(
                f"least squares over {', '.join(names)}, with "
                f"the delay line in {self.intervals} intervals"
            ),
            uncalibrated=(
                "the cta method approximates the delay by a polynomial of degree "
                f"{self.intervals}, which biases the estimate. Noise outside the loop gives "
                f"the delay a standard error of {math.sqrt(cov[0, 0]):.2g} s. Use "
                "method='waveform' for an interval"
            ),
            details={
                "intervals": self.intervals,
                "rms_of_approximation": float(np.sqrt(np.mean(found.misfit**2))),
                "initial_output": model.start_of(found.point),
            },
        )


@dataclass(frozen=True, eq=False)
class _Model(ModelOfOne):
    """The misfit of the approximated loop."""

    loop: ControlLoop
    intervals: int

    @property
    def kernel(self) -> ChebyshevMisfit:
        """The misfit of the kernel."""
        data, known = self.recording, self.loop.parameters
        rows = [0, *(step.index for step in data.steps())]
        units = {"lag": data.sample_time, "initial output": self.size}
        return ChebyshevMisfit(
            data.time,
            data.output,
            list(zip(data.time[rows].tolist(), data.reference[rows].tolist(), strict=True)),
            known=(0.0, known["gain"], known["lag"], known["Kp"]),
            places=[place_of(name, self.names) for name in ("delay", "gain", "lag")],
            start=self.offset,
            intervals=self.intervals,
            is_late=self.loop.delay_path == "command",
            units=[units.get(label, 0.0) for label in self.labels],
        )

    def ends(self, label: str) -> Ends:
        """Bounds and starting values of one of the parameters."""
        start, span = checks.start_and_span(self.recording)
        gain = self.loop.parameters["gain"]
        return {
            "delay": Ends(1e-4 * span, span, np.geomspace(SHORTEST, LONGEST, POINTS) * span),
            "gain": Ends(1e-3 * gain, 1e3 * gain, [gain]),
            "lag": Ends(0.0, span, [0.02 * span]),
            "initial output": Ends(-np.inf, np.inf, [start]),
        }[label]
