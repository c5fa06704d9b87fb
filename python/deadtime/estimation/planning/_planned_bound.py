"""The Cramér-Rao bound of a planned experiment.

For output y_i = f(t_i; p) + Gaussian noise of covariance V, no unbiased estimator that reads p from
the mean has a smaller covariance than (J^T V^-1 J)^-1, J = df/dp; for white noise of standard
deviation sigma it is sigma^2 (J^T J)^-1. `_whitening` has V. Two bounds, for two kinds of log:

* command logged: f is the response of the plant to that command, which is known, with the noise
  that the controller acted on. With P its transfer function, w the command and T the delay,
  df/dT = -s P e^(-sT) w, df/dlag = -s/(lag s + 1) P e^(-sT) w, df/dgain = f/gain: plants with
  delay themselves, simulated exactly; other numbers by difference quotients.
* reference only: f is the output of the whole loop, whose controller does not act on the noise; J
  is the sensitivity of its simulation.

Both are taken along the run without noise. Noise that the controller acts on moves the command too,
which adds information; the information of the first kind is then the mean of J^T V^-1 J over runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import CramerRaoBound
from deadtime.estimation.data._checks import QUOTIENT, check_distinguishable, standard_errors
from deadtime.estimation.likelihood._plant import names_in_kernel
from deadtime.estimation.planning._whitening import trim_response
from deadtime.experiments import Experiment, FlightNoise
from deadtime.loops import ControlLoop, Plant
from deadtime.recordings import Recording
from deadtime.roots import delay, s
from deadtime.systems import TransferFunction

#: Where a delay is a whole number of samples, the derivative is one-sided, towards a longer delay:
#: the delay is increased by this share of a sample, which is more than rounding.
LONGER = 1e-9

#: Change of the initial output, as a share of the noise, in the difference quotient by it.
START_CHANGE = 1e-3


@dataclass(frozen=True, eq=False)
class PlannedBound(CramerRaoBound):
    """The Cramér-Rao bound of an experiment, with its covariance and sensitivities.

    Attributes
    ----------
    free : tuple of str
        What is taken as unknown; a bound without this says nothing.
    noise : FlightNoise
        The noise it is for.
    stderr : dict of str to float
        The bound for each free quantity, and for ``delay+lag`` where both are free.
    cov : ndarray, shape (len(free), len(free))
        Smallest covariance, in the order of `free`.
    sensitivities : dict of str to ndarray, shape (n,)
        Derivative of the output by each free quantity, at the samples of the experiment.
    """

    cov: Array
    sensitivities: dict[str, Array]

    def correlation(self, one: str, other: str) -> float:
        """Correlation of the errors of two free quantities.

        Parameters
        ----------
        one, other : str
            Of `free`.

        Returns
        -------
        float
            Near -1 or 1 the experiment hardly tells them apart.

        Raises
        ------
        ValueError
            If one of them is not free.
        """
        for name in (one, other):
            if name not in self.free:
                raise ValueError(f"{name!r} is not free, which are {', '.join(self.free)}")
        i, j = self.free.index(one), self.free.index(other)
        return float(self.cov[i, j] / np.sqrt(self.cov[i, i] * self.cov[j, j]))


def bound_of(
    runs: Sequence[dict[str, Array]],
    whitened: Callable[[Array], Array],
    names: tuple[str, ...],
    noise: FlightNoise,
    plant: Plant,
) -> PlannedBound:
    """The bound from the mean information of runs; the sensitivities of the first are kept.

    `whitened` whitens columns, a row each, in units of the white noise.
    """
    labels = tuple(runs[0])
    jacobian = np.concatenate([whitened(np.stack(list(run.values()))).T for run in runs])
    check_distinguishable(jacobian, list(labels))
    scale = np.linalg.norm(jacobian, axis=0)
    # P P^T is the inverse of J^T J for the pseudoinverse P of J.
    inverse = np.linalg.pinv(jacobian / scale) / scale[:, None]
    cov = noise.white**2 * len(runs) * inverse @ inverse.T
    return PlannedBound(labels, noise, standard_errors(names, cov, plant), cov, runs[0])


def from_the_command(
    loop: ControlLoop, recording: Recording, names: Sequence[str], offset: bool, trim: bool = False
) -> dict[str, Array]:
    """Sensitivities of the plant's response to the recorded command, held between samples.

    By the names, and by the initial output and the trim where these are unknown.
    """
    num, den = loop.plant.polynomials()
    if len(num) == len(den):
        raise NotIdentifiableError(
            f"{loop.plant!r} passes its command straight to its output, which jumps with it: there "
            "is no derivative by the delay; give the plant a lag"
        )
    values, command, time = loop.parameters, recording.command, recording.time
    assert command is not None
    late = delay(values["delay"] + LONGER * recording.sample_time)
    plant = TransferFunction(num, den)

    def response(system: TransferFunction) -> Array:
        return np.asarray((system * late).simulate(time, command, input_time=time).outputs)

    slopes: dict[str, Array] = {}
    for name in names:
        if name == "delay":
            slopes[name] = -response(plant * s)
        elif name == "gain":
            slopes[name] = response(plant) / values["gain"]
        elif name in names_in_kernel(loop.plant):  # a lag, time constant or zero
            slope = response(plant * s / (values[name] * s + 1.0))
            slopes[name] = slope if name == "zero" else -slope
        else:
            step = QUOTIENT * (abs(values[name]) or 1.0)
            higher, lower = (
                response(loop.plant._replace({name: values[name] + move}).transfer_function())
                for move in (step, -step)
            )
            slopes[name] = (higher - lower) / (2.0 * step)
    if offset:
        slopes["initial output"] = np.ones(len(recording))
    if trim:
        slopes["trim"] = trim_response(loop, time)
    return slopes


def from_the_reference(
    loop: ControlLoop, experiment: Experiment, names: Sequence[str], offset: bool, noise: float
) -> dict[str, Array]:
    """Sensitivities of the output of the whole loop."""
    time, reference = experiment.time, experiment.reference_in_run()
    response = loop.simulate(time, reference, reference_time=time, sensitivities=tuple(names))
    slopes = {name: response.sensitivities[name] for name in names}
    if offset:
        change = START_CHANGE * noise
        high, low = (
            loop.simulate(time, reference, reference_time=time, initial_output=start).outputs
            for start in (change, -change)
        )
        slopes["initial output"] = (high - low) / (2.0 * change)
    return slopes
