"""Least squares of the simulated loop on the whole recording.

The output of the loop, simulated with its hold and its limit at the recording's time stamps, is
fitted to the recorded one over any of delay, gain and lag; the output at the start of the window
is fitted along, because one noisy sample is a poor initial condition. The cost has several
valleys over the delay (a whole period of the loop's oscillation too much fits almost as well),
so a grid over delay and gain comes first and the best few points of it are refined.

The residuals are white only if the model is the vehicle and the noise enters at the measurement
but does not circulate through the controller; where they are not, the standard errors are robust
ones and the result says that the model is not adequate.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from deadtime._errors import NotIdentifiableError
from deadtime._estimation.evidence import (
    check_distinguishable,
    checked_names,
    embedded,
    standard_errors,
)
from deadtime._estimation.residuals import robust_covariance, white_covariance, whiteness_of
from deadtime._estimation.result import CramerRaoBound, DelayEstimate
from deadtime._estimation.simulated import SimulatedRecording
from deadtime._loop import ControlLoop
from deadtime._recording import Recording

__all__ = ["estimate_by_waveform"]

#: Points of the first grid over the delay, and factors of the first grid over the gain.
DELAY_POINTS = 24
GAIN_FACTORS = (0.35, 0.6, 1.0, 1.6)

#: Grid points that are refined; the best of them wins.
REFINED = 3

#: A lag that changes the cost by less than this share is none: least squares itself stops there.
VANISHING = 1e-6

#: Delays and lags of a continuous loop below this share of the window, or of the time between two
#: samples, take long to simulate and cannot be told from none: they are taken for it.
SHORTEST_OF_WINDOW, SHORTEST_OF_SAMPLE = 1.0 / 2000.0, 1.0 / 4.0

#: A residual for simulations that leave all bounds, in units of the step.
HOPELESS = 1e3

Array = NDArray[np.float64]


def estimate_by_waveform(
    recording: Recording,
    loop: ControlLoop,
    window: tuple[float | None, float | None] | None,
    free: Sequence[str],
) -> DelayEstimate:
    """Fit `free` of the loop to the window of the recording."""
    names = checked_names(free, loop)
    simulated = SimulatedRecording(recording, loop, window)
    data = simulated.recording
    _check_excitation(data, len(names))
    problem = _Problem(simulated, names)
    solution = problem.solve()
    jacobian, residuals = solution.jacobian, -solution.misfit
    values = dict(zip(names, (float(value) for value in solution.parameters), strict=False))

    _check_ends(values, problem.ends())
    held = [name for name in names if name != "gain" and values[name] <= 1e-9]
    loose = [i for i, name in enumerate((*names, "start")) if name not in held]
    check_distinguishable(jacobian[:, loose], [(*names, "initial output")[i] for i in loose])
    whiteness = whiteness_of(residuals, len(names))
    exact = float(np.max(np.abs(residuals))) <= 1e-9 * float(np.ptp(data.output))
    adequate = (whiteness.white or exact) and not held
    white = embedded(white_covariance(jacobian[:, loose], residuals), loose, jacobian.shape[1])
    spread = white
    if not whiteness.white:
        robust = robust_covariance(jacobian[:, loose], residuals)
        spread = embedded(robust, loose, jacobian.shape[1])
    count = len(names)
    noise = float(np.sqrt(residuals @ residuals / (residuals.size - solution.parameters.size)))
    return DelayEstimate(
        method="waveform",
        loop=loop.replace(**values),
        free=names,
        stderr=standard_errors(names, spread),
        cov=spread[:count, :count],
        crb=CramerRaoBound((*names, "initial output"), noise, standard_errors(names, white)),
        recording=data,
        residuals=residuals,
        whiteness=whiteness,
        adequate=adequate,
        message=_message(names, held, adequate),
        details={"initial_output": float(solution.parameters[count])},
    )


@dataclass(frozen=True)
class _Minimum:
    """Where a search ended: parameters, misfit (simulated minus recorded), its derivatives."""

    parameters: Array
    misfit: Array
    jacobian: Array

    @property
    def cost(self) -> float:
        return float(self.misfit @ self.misfit)


class _Problem:
    """The least-squares problem: parameters are `names`, then the output at the start."""

    def __init__(self, simulated: SimulatedRecording, names: tuple[str, ...]) -> None:
        self.simulated = simulated
        self.names = names
        data = simulated.recording
        step = data.steps()[0]
        self.span = float(data.time[-1] - step.time)
        self.start = float(np.mean(data.output[: max(1, step.index)]))
        self.size = max(float(np.ptp(data.output)), float(np.ptp(data.reference)))
        self.shortest = 0.0
        if not simulated.loop.is_sampled:
            between = float(np.median(np.diff(data.time)))
            self.shortest = min(SHORTEST_OF_WINDOW * self.span, SHORTEST_OF_SAMPLE * between)

    def residuals(self, parameters: Array) -> Array:
        """Simulated minus recorded output; bounded where the loop with these numbers is not."""
        values = dict(zip(self.names, (float(value) for value in parameters), strict=False))
        bound = HOPELESS * self.size
        try:
            output = self.simulated.output(values, float(parameters[-1]))
        except ValueError:  # the response with these numbers grows without bound
            return np.full(len(self.simulated.recording), bound)
        return np.clip(output - self.simulated.recording.output, -bound, bound)

    def solve(self) -> _Minimum:
        """The best minimum reached from the best points of a grid."""
        points = [np.array([*point, self.start]) for point in itertools.product(*self._grid())]
        costs = [float(np.sum(self.residuals(point) ** 2)) for point in points]
        best: _Minimum | None = None
        for index in np.argsort(costs)[:REFINED]:
            solution = self._refine(points[int(index)])
            if best is None or solution.cost < best.cost:
                best = solution
        assert best is not None
        # A lag that vanishes leaves its length to the delay, which may then be the shortest.
        found = self._without_vanishing_lag(self._without_shortest_delay(best))
        return self._without_shortest_delay(found)

    def _without_shortest_delay(self, found: _Minimum) -> _Minimum:
        """Put the delay at zero where the search ended at the shortest one it tries."""
        if "delay" not in self.names or self.shortest == 0.0:
            return found
        delay = self.names.index("delay")
        if found.parameters[delay] > self.shortest * (1.0 + 1e-6):
            return found
        moved = found.parameters.copy()
        moved[delay] = 0.0
        return replace(found, parameters=moved, misfit=self.residuals(moved))

    def _without_vanishing_lag(self, found: _Minimum) -> _Minimum:
        """Put a lag at zero that is there for rounding's sake only.

        A small lag delays like a delay, to first order exactly so; next to zero the two cannot
        be told apart, and the search stops wherever it entered that valley.
        """
        if "lag" not in self.names or found.parameters[self.names.index("lag")] == 0.0:
            return found
        delay, lag = self.names.index("delay"), self.names.index("lag")
        moved = found.parameters.copy()
        moved[delay] += moved[lag]
        moved[lag] = 0.0
        shifted = replace(found, parameters=moved, misfit=self.residuals(moved))
        shortest = 0.0 < found.parameters[lag] <= self.shortest * (1.0 + 1e-6)
        alike = shifted.cost <= found.cost * (1.0 + VANISHING)
        return shifted if shortest or alike else found

    def _grid(self) -> list[Array]:
        plant = self.simulated.loop.parameters
        grids = {
            "delay": np.geomspace(0.003, 0.6, DELAY_POINTS) * self.span,
            "gain": np.array(GAIN_FACTORS) * plant.get("gain", 1.0),
            "lag": np.array([0.02]) * self.span,
        }
        return [grids[name] for name in self.names]

    def ends(self) -> dict[str, tuple[float, float]]:
        """Between which values each quantity is sought."""
        gain = self.simulated.loop.parameters.get("gain", 1.0)
        low, high = sorted((1e-3 * gain, 1e3 * gain))
        return {"delay": (0.0, self.span), "gain": (low, high), "lag": (0.0, self.span)}

    def _refine(self, start: Array) -> _Minimum:
        gain = self.simulated.loop.parameters.get("gain", 1.0)
        ends = self.ends()
        least = {name: end[0] for name, end in ends.items()}
        least |= {"delay": self.shortest, "lag": self.shortest}
        low = [least[name] for name in self.names] + [-np.inf]
        high = [ends[name][1] for name in self.names] + [np.inf]
        scale = {"delay": 0.1 * self.span, "gain": abs(gain), "lag": 0.1 * self.span}
        found = least_squares(
            self.residuals,
            start,
            bounds=(low, high),
            jac="3-point",
            x_scale=[scale[name] for name in self.names] + [self.size],
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
            max_nfev=200,
        )
        return _Minimum(found.x, found.fun, np.asarray(found.jac))


def _check_excitation(data: Recording, parameters: int) -> None:
    if not data.steps():
        raise NotIdentifiableError(
            f"the reference is {data.reference[0]:g} throughout the window: nothing excites the "
            "loop; choose a window with a step"
        )
    first = data.steps()[0].index
    if len(data) - first < 2 * (parameters + 1):
        raise NotIdentifiableError(
            f"{len(data) - first} samples after the step are too few for {parameters} numbers and "
            "an initial output: widen the window"
        )
    if float(np.ptp(data.output)) == 0.0:
        raise NotIdentifiableError(
            f"the output is {data.output[0]:g} throughout the window: the vehicle did not move"
        )


def _check_ends(values: Mapping[str, float], ends: Mapping[str, tuple[float, float]]) -> None:
    """Refuse a fit that ran to an end of its search; a delay or lag of zero is an answer."""
    for name, value in values.items():
        for end in ends[name]:
            if end != 0.0 and abs(value - end) <= 1e-3 * abs(end):
                raise NotIdentifiableError(
                    f"the fit runs away to a {name} of {end:g}, the end of its search: the output "
                    "is no answer of such a loop to this reference; check columns, signs, units "
                    "and gains, and choose a window around one step"
                )


def _message(names: tuple[str, ...], held: list[str], adequate: bool) -> str:
    text = f"least squares over {', '.join(names)}"
    if held:
        text += (
            f"; the {' and '.join(held)} came out at zero, its bound, so its standard error of 0 "
            "says nothing"
        )
    if not adequate:
        text += (
            "; the residuals are not white, so the loop is only an equivalent of the vehicle and "
            "the standard errors are robust ones"
        )
        if "lag" not in names:
            text += " (try free=('delay', 'gain', 'lag'))"
    return text
