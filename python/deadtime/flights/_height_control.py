"""P and PV control of a height, sample by sample, during a flight."""

from __future__ import annotations

import numpy as np

from deadtime.loops import PV, DerivativeFilter, P
from deadtime.loops._derivative_filter import PAPER_FILTER, discretised


class Velocity:
    """Vertical speed from samples of the height: the filtered derivative by the trapezoidal rule.

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

    def next(self, height: float) -> float:
        """The speed at the next sample, m/s; 0 at the first, where rest is assumed."""
        discrete = self._filter
        if self._state is None:
            self._state = np.linalg.solve(np.eye(2) - discrete.F, discrete.G) * height
        speed = float(discrete.C @ self._state + discrete.D * height)
        self._state = discrete.F @ self._state + discrete.G * height
        return speed


class HeightControl:
    """The command of a P or PV controller at each sample, before any limit.

    Parameters
    ----------
    controller : P or PV
        Gains in 1/s for the error, and without unit for the vertical speed.
    sample_time : float
        s.
    smoothing : DerivativeFilter
        Filter of the speed where the vehicle reports none.

    Examples
    --------
    >>> HeightControl(P(2.0), 0.065).command(reference=1.25, height=1.0, climb=0.1)
    0.5
    >>> HeightControl(PV(2.0, 0.5), 0.065).command(reference=1.25, height=1.0, climb=0.1)
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

    def command(self, reference: float, height: float, climb: float | None) -> float:
        """The commanded vertical speed, m/s.

        Parameters
        ----------
        reference, height : float
            m.
        climb : float or None
            Vertical speed reported by the vehicle, m/s; None to derive it from the heights.
        """
        # The filter gets every height, so that its state is right whenever a report is missing.
        speed = self._velocity.next(height)
        if climb is not None:
            speed = climb
        command = self.controller.Kp * (reference - height)
        if isinstance(self.controller, PV):
            command -= self.controller.Kv * speed
        return command
