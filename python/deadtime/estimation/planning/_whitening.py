"""Whiten sensitivities by the covariance of the noise of a planned run.

With V = L L' the covariance of the rows, in units of the white noise, whitened columns L⁻¹ J have
the information J' V⁻¹ J. Two covariances, for two kinds of log:

* command logged: the command is known, so the noise is the response of the plant alone to the air
  (`in_open_loop`). It does not depend on the delay. The kernel whitens in one Kalman pass.
* reference only: the controller acts on the effect d of the air. Along the run, a P controller of
  gain Kp answers with -Kp S y, where S is 1 in rows in which the command is within its limit and 0
  in the others. With G the response of the plant and its delay to commands, y = d - G Kp S y, so

      y = T d,  T = (I + G Kp S)⁻¹,  V = T V_air T' + V_sensor,

  which is a dense matrix (`in_closed_loop`).

That V depends on the lag, and in closed loop on the delay as well, would add a little information,
which is left out: an estimator would have to know how the spectrum of the air depends on them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.likelihood._disturbances import disturbances_of, whitened
from deadtime.experiments import Experiment, FlightNoise, RandomProcess, check_reads_samples
from deadtime.loops import ControlLoop, P
from deadtime.roots import delay
from deadtime.systems import TransferFunction

#: A random walk is taken as gusts that last so many times as long as the run.
LONG = 1e5

#: Most rows of the dense covariance.
MOST_ROWS = 3000


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


class ClosedLoop(NamedTuple):
    """What the loop makes of an effect on its output, along one run.

    Attributes
    ----------
    time : ndarray, shape (n,)
    feedback : ndarray, shape (n, n)
        I + G Kp S.
    """

    time: Array
    feedback: Array

    @classmethod
    def along(cls, loop: ControlLoop, experiment: Experiment, command: Array) -> ClosedLoop:
        """The loop around the run with this command."""
        check_reads_samples(loop)
        time, controller = experiment.time, loop.controller
        if experiment.relay_amplitude is not None:
            raise NotIdentifiableError(
                "the air moves the switching of the relay, which has no derivative: log the command"
            )
        if not isinstance(controller, P):
            raise NotIdentifiableError(
                f"the answer of {controller!r} to the air is not computed: log the command, or "
                "take a P controller"
            )
        if time.size > MOST_ROWS:
            raise NotIdentifiableError(
                f"{time.size} samples with air in the loop need a matrix of as many rows, beyond "
                f"{MOST_ROWS}: log the command, or plan a shorter experiment"
            )
        from scipy import linalg

        plant = TransferFunction(*loop.plant.polynomials()) * delay(loop.parameters["delay"])
        pulse = np.zeros(time.size)
        pulse[0] = 1.0
        answer = np.asarray(plant.simulate(time, pulse, input_time=time).outputs)
        G = linalg.toeplitz(answer, np.zeros(time.size))
        within = np.ones(time.size) if loop.limit is None else np.abs(command) < loop.limit
        return cls(time, np.eye(time.size) + G * (controller.Kp * within))

    def response(self, columns: Array) -> Array:
        """T times columns, a row each."""
        from scipy import linalg

        return np.asarray(linalg.solve_triangular(self.feedback, columns.T, lower=True).T)

    def whitened(self, loop: ControlLoop, columns: Array, noise: FlightNoise) -> Array:
        """Columns, a row each, whitened by V; sensor noise is outside of the loop."""
        from scipy import linalg

        air = noise.process(loop.plant).covariance(self.time)
        V = self.response(self.response(air).T)
        if noise.sensor:
            sensor = RandomProcess.of_sensor(noise.sensor, noise.sensor_time)
            V += sensor.covariance(self.time)
        V[np.diag_indices_from(V)] += noise.white**2
        root = np.linalg.cholesky(V) / noise.white
        return np.asarray(linalg.solve_triangular(root, columns.T, lower=True).T)
