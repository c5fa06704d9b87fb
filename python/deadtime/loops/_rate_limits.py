"""Vehicles that limit how fast they let a command change.

An autopilot shapes what it is told: the command that its controllers follow changes at a limited
rate, and often at a limited rate of that. The shaped command depends on the commands alone, neither
on the output nor on the delay, so a recording of the commands determines it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import positive
from deadtime.loops._native import rate_limited
from deadtime.loops._plants import Plant, PlantForm, RationalPlant
from deadtime.systems import TransferFunction


@dataclass(frozen=True)
class RateLimited(Plant):
    """A plant that follows its command within limits of the rate, and of the rate of that.

    The command v that the plant gets follows the delayed command u. With the rate a = v',

    - without `rate_of_rate`, v goes to u at `rate` and stops there;
    - with it, a changes at `rate_of_rate` until it is (u - v)/T, at most `rate`, with
      T = rate/rate_of_rate, and stays there: v goes to u on a parabola, a line and an exponential
      with the time constant T. ArduPilot shapes velocity commands so, `rate` being the limit of
      acceleration and `rate_of_rate` that of jerk.

    Estimates from a logged command (`deadtime.estimation.OutputError`) take such a plant; the
    limits can be free. What is linear has no limits, so poles, margins, maps and designs, and the
    exact simulation, refuse it. For small commands it acts as `for_small_commands`, and slower for
    larger ones.

    Parameters
    ----------
    plant : Plant
        What follows v: `Integrator`, `FirstOrder` or `RationalPlant`.
    rate : float
        Largest rate, in units of the command per s, above zero.
    rate_of_rate : float, optional
        Largest rate of the rate, in units of the command per s², above zero.

    Raises
    ------
    ValueError
        If a limit is not above zero.
    TypeError
        If `plant` is no rational plant.

    References
    ----------
    ArduPilot, libraries/AP_Math/control.cpp, function shape_vel_accel.

    Examples
    --------
    >>> import deadtime as dtm
    >>> plant = dtm.RateLimited(dtm.Integrator(), rate=1.0, rate_of_rate=5.0)
    >>> plant.parameters
    {'gain': 1.0, 'lag': 0.0, 'rate': 1.0, 'rate_of_rate': 5.0}
    >>> loop = dtm.ControlLoop(plant, dtm.P(Kp=1.0), delay=0.3)
    >>> loop.is_stable()
    Traceback (most recent call last):
    ValueError: the plant limits the rate of its command, so it is not linear. Use ...
    >>> loop.replace(plant=plant.for_small_commands()).is_stable()
    True
    """

    plant: Plant
    rate: float
    rate_of_rate: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.plant, Plant) or not self.plant.is_rational:
            raise TypeError(
                f"plant={self.plant!r}: give an Integrator, a FirstOrder or a RationalPlant"
            )
        object.__setattr__(self, "rate", positive("rate", self.rate))
        if self.rate_of_rate is not None:
            jerk = positive("rate_of_rate", self.rate_of_rate)
            object.__setattr__(self, "rate_of_rate", jerk)

    @property
    def is_rational(self) -> bool:
        """False: its response to twice the command is not twice the response."""
        return False

    @property
    def is_linear(self) -> bool:
        """False: its response to twice the command is not twice the response."""
        return False

    @property
    def parameters(self) -> dict[str, float]:
        """Those of the plant, ``rate``, and ``rate_of_rate`` where there is one."""
        second = {} if self.rate_of_rate is None else {"rate_of_rate": self.rate_of_rate}
        return self.plant.parameters | {"rate": self.rate} | second

    def _replace(self, numbers: Mapping[str, float]) -> RateLimited:
        own = {"rate": self.rate, "rate_of_rate": self.rate_of_rate}
        inner = {name: value for name, value in numbers.items() if name not in own}
        own |= {name: value for name, value in numbers.items() if name in own}
        return RateLimited(self.plant._replace(inner), **own)  # type: ignore[arg-type]

    def for_small_commands(self) -> RationalPlant:
        """Return the linear plant as which it acts where no limit is reached.

        Returns
        -------
        RationalPlant
            The plant behind a lag of rate/rate_of_rate, or the plant alone.

        Examples
        --------
        >>> import deadtime as dtm
        >>> plant = dtm.RateLimited(dtm.Integrator(0.9), rate=1.0, rate_of_rate=5.0)
        >>> plant.for_small_commands().polynomials()
        (array([0.9]), array([0.2, 1. , 0. ]))
        """
        num, den = self.plant.polynomials()
        if self.rate_of_rate is not None:
            lag = self.rate / self.rate_of_rate
            den = lag * np.append(den, 0.0) + np.append(0.0, den)
        return RationalPlant(num.tolist(), den.tolist())

    def limited(self, time: Array, command: Array) -> tuple[Array, Array]:
        """The command that the plant gets, as commands that hold.

        Parameters
        ----------
        time, command : ndarray, shape (m,)
            From when each command holds, s, increasing. It starts at rest at the first one.

        Returns
        -------
        (time, command) : tuple of ndarray, shape (8 (m - 1) + 1,)
            Means over pieces between the given times.

        Raises
        ------
        ValueError
            If times do not increase or a number is not finite.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> plant = dtm.RateLimited(dtm.Integrator(), rate=2.0)
        >>> time, command = plant.limited(np.array([0.0, 0.4, 0.8]), np.array([0.0, 1.0, 1.0]))
        >>> print(command[8:].round(2))
        [0.05 0.15 0.25 0.35 0.45 0.55 0.65 0.75 0.8 ]
        """
        jerk = math.inf if self.rate_of_rate is None else self.rate_of_rate
        return rate_limited(time, command, self.rate, jerk)

    def transfer_function(self) -> TransferFunction:
        """Refuse: it is not linear.

        Raises
        ------
        ValueError
            Always; it says what to ask instead.
        """
        self._refuse()

    @property
    def _form(self) -> PlantForm:
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise ValueError(
            "the plant limits the rate of its command, so it is not linear. Use "
            "loop.replace(plant=loop.plant.for_small_commands()), which is exact as long as no "
            "limit is reached"
        )
