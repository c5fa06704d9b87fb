"""P and PV control of one axis, sample by sample, during a flight."""

from __future__ import annotations

import numpy as np

from deadtime.loops import PAPER_FILTER, PV, DerivativeFilter, P, discretised


class Velocity:
    """Rate of an output from its samples: the filtered derivative by the trapezoidal rule.

    Parameters
    ----------
    smoothing : DerivativeFilter
        Corner frequency and damping.
    sample_time : float
        s.

    Examples
    --------
    >>> speed = Velocity(PAPER_FILTER, 0.065)
    >>> round([speed.next(1.0 + 0.3 * 0.065 * k) for k in range(60)][-1], 6)
    0.3
    """

    def __init__(self, smoothing: DerivativeFilter, sample_time: float) -> None:
        corner, damping = smoothing.omega, smoothing.damping
        F = np.array([[0.0, 1.0], [-(corner**2), -2.0 * damping * corner]])
        self._filter = discretised(
            F, np.array([0.0, 1.0]), np.array([0.0, corner**2]), sample_time, "tustin"
        )
        self._state: np.ndarray | None = None

    def next(self, output: float) -> float:
        """The rate at the next sample, 1/s; 0 at the first, where rest is assumed."""
        discrete = self._filter
        if self._state is None:
            self._state = np.linalg.solve(np.eye(2) - discrete.F, discrete.G) * output
        speed = float(discrete.C @ self._state + discrete.D * output)
        self._state = discrete.F @ self._state + discrete.G * output
        return speed


class AxisControl:
    """The command of a P or PV controller at each sample, before any limit.

    Parameters
    ----------
    controller : P or PV
        Gains in 1/s for the error, and without unit for the rate of the output.
    sample_time : float
        s.
    smoothing : DerivativeFilter
        Filter of the rate where the vehicle reports none.

    Examples
    --------
    >>> AxisControl(P(2.0), 0.065).command(reference=1.25, output=1.0, rate=0.1)
    0.5
    >>> AxisControl(PV(2.0, 0.5), 0.065).command(reference=1.25, output=1.0, rate=0.1)
    0.45
    """

    def __init__(
        self,
        controller: P | PV,
        sample_time: float,
        smoothing: DerivativeFilter = PAPER_FILTER,
    ) -> None:
        if not isinstance(controller, (P, PV)):
            raise TypeError(f"controller={controller!r}: give a P or PV controller")
        self.controller = controller
        self.sample_time = sample_time
        self._velocity = Velocity(smoothing, sample_time)

    def command(self, reference: float, output: float, rate: float | None) -> float:
        """The commanded rate.

        Parameters
        ----------
        reference, output : float
            m or rad.
        rate : float or None
            Rate of the output reported by the vehicle; None to derive it from the outputs.
        """
        # The filter gets every output, so that its state is right whenever a report is missing.
        speed = self._velocity.next(output)
        if rate is not None:
            speed = rate
        command = self.controller.Kp * (reference - output)
        if isinstance(self.controller, PV):
            command -= self.controller.Kv * speed
        return command
