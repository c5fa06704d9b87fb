"""The Cramér-Rao bound of a planned experiment.

For output y_i = f(t_i; p) + Gaussian noise of covariance V, no unbiased estimator that reads p from
the mean has a smaller covariance than (J^T V^-1 J)^-1, J = df/dp; for white noise of standard
deviation sigma it is sigma^2 (J^T J)^-1. Two bounds, for two kinds of log:

* command logged: f is the response of the plant to that command, which is known, with the noise
  that the controller acted on. With P its transfer function, w the command and T the delay,
  df/dT = -s P e^(-sT) w, df/dlag = -s/(lag s + 1) P e^(-sT) w, df/dgain = f/gain: plants with
  delay themselves, simulated exactly; other numbers by difference quotients.
* reference only: f is the output of the whole loop, whose controller does not act on the noise; J
  is the sensitivity of its simulation.

Both are taken along the run without noise. Noise that the controller acts on moves the command too,
which adds information; the information of the first kind is then the mean of J^T V^-1 J over runs.

With V = L L' the covariance of the rows, in units of the white noise, whitened columns L⁻¹ J have
the information J' V⁻¹ J. There are two covariances:

* command logged: the command is known, so the noise is the response of the plant alone to the air
  (`in_open_loop`). It does not depend on the delay. The kernel whitens in one Kalman pass.
* reference only: the controller acts on the effect d of the air. Along the run, a P controller of
  gain Kp answers with -Kp S y, where S is 1 in rows in which the command is within its limit and 0
  in the others. With G the response of the plant and its delay to commands, y = d - G Kp S y, so

      y = T d,  T = (I + G Kp S)⁻¹,  V = T V_air T' + V_sensor,

  which is a dense matrix (`bound_with_reference`).

That V depends on the lag, and in closed loop on the delay as well, would add a little information,
which is left out: an estimator would have to know how the spectrum of the air depends on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._plant import disturbances_of, names_in_kernel, whitened
from deadtime.estimation._result import CramerRaoBound
from deadtime.estimation.data._checks import QUOTIENT, check_distinguishable, standard_errors
from deadtime.experiments import Experiment, FlightNoise, RandomProcess, check_reads_samples
from deadtime.loops import ControlLoop, P, Plant
from deadtime.recordings import Recording
from deadtime.roots import delay, s
from deadtime.systems import TransferFunction

#: Where a delay is a whole number of samples, the derivative is one-sided, towards a longer delay:
#: the delay is increased by this share of a sample, which is more than rounding.
LONGER = 1e-9

#: Change of the initial output, as a share of the noise, in the difference quotient by it.
START_CHANGE = 1e-3

#: A random walk is taken as gusts that last so many times as long as the run.
LONG = 1e5

#: Most rows of the dense covariance.
MOST_ROWS = 3000


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
                raise ValueError(
                    f"{name!r} is not free. The free parameters are {', '.join(self.free)}"
                )
        i, j = self.free.index(one), self.free.index(other)
        return float(self.cov[i, j] / np.sqrt(self.cov[i, i] * self.cov[j, j]))


def bound_of(
    runs: Sequence[dict[str, Array]],
    white: Callable[[Array], Array],
    names: tuple[str, ...],
    noise: FlightNoise,
    plant: Plant,
) -> PlannedBound:
    """The bound from the mean information of runs; the sensitivities of the first are kept.

    `white` whitens columns, a row each, in units of the white noise.
    """
    labels = tuple(runs[0])
    jacobian = np.concatenate([white(np.stack(list(run.values()))).T for run in runs])
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
            f"{loop.plant!r} has direct feedthrough, so its output jumps with its command, "
            "and has no derivative with respect to the delay. Give the plant a lag"
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


def trim_is_free(noise: FlightNoise) -> bool:
    """Whether the trim is unknown to an estimator.

    It is the mean of the air, and where the air walks at random, its value at the first row.
    """
    return bool(noise.trim or noise.air_walk)


def trim_response(loop: ControlLoop, time: Array) -> Array:
    """Derivative of the output of the plant by the trim."""
    return FlightNoise(trim=1.0).disturbance(time, 0, loop.plant)


def in_open_loop(loop: ControlLoop, time: Array, columns: Array, noise: FlightNoise) -> Array:
    """Columns, a row each, whitened by the covariance of air and sensor without the loop."""
    present = disturbances_of(noise, LONG * float(time[-1] - time[0]))
    return whitened(loop.plant, time, columns, present)


def bound_with_command(
    loop: ControlLoop,
    names: tuple[str, ...],
    offset: bool,
    noise: FlightNoise,
    recordings: Sequence[Recording],
) -> PlannedBound:
    """The bound where the command is in the log, from the mean information of these runs."""
    if not loop.is_sampled:
        raise NotIdentifiableError(
            "a continuous loop changes its command between the samples of a log"
        )
    trim, time = trim_is_free(noise), recordings[0].time
    slopes = [from_the_command(loop, recording, names, offset, trim) for recording in recordings]
    white = partial(in_open_loop, loop, time, noise=noise)
    return bound_of(slopes, white, names, noise, loop.plant)


def bound_with_reference(
    loop: ControlLoop,
    names: tuple[str, ...],
    offset: bool,
    noise: FlightNoise,
    experiment: Experiment,
    recording: Recording,
) -> PlannedBound:
    """The bound where only reference and output are known, along the run without noise."""
    from scipy import linalg

    time = experiment.time
    slopes = from_the_reference(loop, experiment, names, offset, noise.white)
    if not noise.moves_plant:
        white = partial(in_open_loop, loop, time, noise=noise)
        return bound_of([slopes], white, names, noise, loop.plant)
    assert recording.command is not None
    feedback = _feedback(loop, experiment, recording.command)
    response = partial(linalg.solve_triangular, feedback, lower=True)
    if trim_is_free(noise):
        slopes["trim"] = response(trim_response(loop, time))
    V = response(response(noise.process(loop.plant).covariance(time)).T)
    if noise.sensor:
        # Outside of the loop.
        V += RandomProcess.of_sensor(noise.sensor, noise.sensor_time).covariance(time)
    V[np.diag_indices_from(V)] += noise.white**2
    root = np.linalg.cholesky(V) / noise.white

    def white_in_loop(columns: Array) -> Array:
        return np.asarray(linalg.solve_triangular(root, columns.T, lower=True).T)

    return bound_of([slopes], white_in_loop, names, noise, loop.plant)


def _feedback(loop: ControlLoop, experiment: Experiment, command: Array) -> Array:
    """I + G Kp S around the run with this command, shape (n, n)."""
    from scipy import linalg

    check_reads_samples(loop)
    time, controller = experiment.time, loop.controller
    if experiment.relay_amplitude is not None:
        raise NotIdentifiableError(
            "wind (air) changes the times at which the relay switches, and these "
            "times have no derivative with respect to the parameters: log the command"
        )
    if not isinstance(controller, P):
        raise NotIdentifiableError(
            f"the response of {controller!r} to wind (air) cannot "
            "be computed: log the command, or use a P controller"
        )
    if time.size > MOST_ROWS:
        raise NotIdentifiableError(
            f"{time.size} samples with wind (air) in the loop need a matrix with as many "
            f"rows, more than {MOST_ROWS}: log the command, or plan a shorter experiment"
        )
    plant = TransferFunction(*loop.plant.polynomials()) * delay(loop.parameters["delay"])
    pulse = np.zeros(time.size)
    pulse[0] = 1.0
    answer = np.asarray(plant.simulate(time, pulse, input_time=time).outputs)
    G = linalg.toeplitz(answer, np.zeros(time.size))
    within = np.ones(time.size) if loop.limit is None else np.abs(command) < loop.limit
    return np.asarray(np.eye(time.size) + G * (controller.Kp * within))
