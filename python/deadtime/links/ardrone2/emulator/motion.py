r"""Motion of an emulated vehicle: exact for linear plants, and the interface of all motions.

A linear plant x' = A x + B w under a w that is constant since the last change is
exp(M t) (x, w) with M = [[A, B], [0, 0]]. Times are whole microseconds, so exp(M t) is a product of
exp(M 2^k us) over the set bits of t: a few dozen exponentials, computed once, give the state at any
time to rounding, at a cost that does not depend on the times of other evaluations.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from operator import mul
from typing import Literal, TypeAlias

import numpy as np

from deadtime.links.ardrone2.emulator.clock import SECOND, Micros
from deadtime.loops import Integrator, Plant, kit_plant, rest

PlantName: TypeAlias = Literal["kit", "paper", "real", "thrust"]

#: Transport delay of each plant, s.
DELAYS: dict[str, float] = {"kit": 0.26, "paper": 0.36, "real": 0.34, "thrust": 0.26}

#: Standard gravity, m/s^2.
GRAVITY = 9.80665

#: Terms of Taylor's series: 0.5^17 / 17! is below the rounding error of 1.
TERMS = 16

Row: TypeAlias = tuple[float, ...]


class Motion(ABC):
    """A quantity that follows a setpoint, which is constant between changes.

    Evaluation has no side effects: the value at a time does not depend on earlier evaluations.
    """

    @abstractmethod
    def settle(self, time: Micros, value: float) -> None:
        """Set the state to rest at a value, with the setpoint that keeps it there."""

    @abstractmethod
    def follow(self, time: Micros, value: float) -> None:
        """Change the setpoint from this time on; times do not go back."""

    @abstractmethod
    def at(self, time: Micros) -> tuple[float, float]:
        """Value and its rate per second at a time not before the last change."""


class LinearMotion(Motion):
    """The motion of a strictly proper linear plant, exact to rounding.

    Parameters
    ----------
    plant : Plant
        From the setpoint to the value.

    Examples
    --------
    >>> import deadtime as dtm
    >>> height = LinearMotion(dtm.Integrator(gain=0.5))
    >>> height.settle(0, 1.0)
    >>> height.follow(1_000_000, 0.4)
    >>> above, climb = height.at(6_000_000)
    >>> round(above, 12), round(climb, 12)
    (2.0, 0.2)
    """

    def __init__(self, plant: Plant) -> None:
        space = plant.state_space()
        if space.D != 0.0:
            raise ValueError(
                f"{plant} has direct feedthrough: give a plant with a lag or an integrator"
            )
        n = len(space.B)
        self._plant = plant
        flow = np.zeros((n + 1, n + 1))
        flow[:n, :n], flow[:n, n] = space.A, space.B
        value = np.append(space.C, 0.0)
        self._flow: list[list[float]] = flow.tolist()
        self._value: Row = tuple(value.tolist())
        self._rate: Row = tuple((value @ flow).tolist())
        self._since: Micros = 0
        self._state: Row = (0.0,) * (n + 1)
        self._powers: list[tuple[Row, ...]] = []
        # The last result, because autopilot, sensors and navdata evaluate the same time.
        self._last: tuple[Micros, Row] = (0, self._state)

    def settle(self, time: Micros, value: float) -> None:
        """Set the state to rest at a value, with the setpoint that keeps it there."""
        num, den = (part.tolist() for part in self._plant.polynomials())
        state, setpoint = rest(num, den, value)
        self._start(time, (*state.tolist(), float(setpoint)))

    def follow(self, time: Micros, value: float) -> None:
        """Change the setpoint from this time on."""
        self._start(time, (*self._state_at(time)[:-1], value))

    def at(self, time: Micros) -> tuple[float, float]:
        """Value and its rate per second."""
        state = self._state_at(time)
        return _dot(self._value, state), _dot(self._rate, state)

    def _start(self, time: Micros, state: Row) -> None:
        self._since, self._state, self._last = time, state, (time, state)

    def _state_at(self, time: Micros) -> Row:
        if time == self._last[0]:
            return self._last[1]
        left, state, k = time - self._since, self._state, 0
        while left:
            if left & 1:
                state = tuple([_dot(row, state) for row in self._power(k)])
            left, k = left >> 1, k + 1
        self._last = (time, state)
        return state

    def _power(self, k: int) -> tuple[Row, ...]:
        """The transition over 2^k microseconds."""
        while len(self._powers) <= k:
            over = 2.0 ** len(self._powers) / SECOND
            self._powers.append(_exponential([[over * x for x in row] for row in self._flow]))
        return self._powers[k]


class FreeFall(Motion):
    """The height of a falling vehicle, which follows no setpoint."""

    def __init__(self) -> None:
        self._start: tuple[Micros, float, float] = (0, 0.0, 0.0)

    def settle(self, time: Micros, value: float) -> None:
        """Begin to fall from a height, at rest."""
        self._start = (time, value, 0.0)

    def drop(self, time: Micros, height: float, climb: float) -> None:
        """Begin to fall from a height with a vertical speed."""
        self._start = (time, height, climb)

    def follow(self, time: Micros, value: float) -> None:
        """Ignored: without thrust no setpoint is followed."""

    def at(self, time: Micros) -> tuple[float, float]:
        """Height and climb."""
        since, height, climb = self._start
        t = (time - since) / SECOND
        return height + (climb - 0.5 * GRAVITY * t) * t, climb - GRAVITY * t


#: The linear plants: from commanded climb to height, without the transport delay.
LINEAR_PLANTS: dict[str, Plant] = {
    "kit": kit_plant(),
    "paper": Integrator(),
    "real": Integrator(gain=0.79, lag=0.135),  # fitted to flights of the vehicle
}


def _exponential(matrix: list[list[float]]) -> tuple[Row, ...]:
    """The exponential of a small matrix, by the Taylor series of a fraction of it and squaring.

    In plain Python: a product by a threaded BLAS can take as long as ten packets, and its rounding
    differs between machines.
    """
    size = max(sum(map(abs, row)) for row in matrix)
    squarings = max(0, math.frexp(size)[1] + 1)  # the norm of `part` is then below 0.5
    part = [[math.ldexp(x, -squarings) for x in row] for row in matrix]
    n = len(part)
    identity = [[float(i == j) for j in range(n)] for i in range(n)]
    total = identity
    for term in range(TERMS, 0, -1):
        product = _product(part, total)
        total = [
            [unit + x / term for unit, x in zip(*rows, strict=True)]
            for rows in zip(identity, product, strict=True)
        ]
    for _ in range(squarings):
        total = _product(total, total)
    return tuple(map(tuple, total))


def _product(left: list[list[float]], right: list[list[float]]) -> list[list[float]]:
    columns = list(zip(*right, strict=True))
    return [[_dot(row, column) for column in columns] for row in left]


def _dot(left: Sequence[float], right: Sequence[float]) -> float:
    return sum(map(mul, left, right), 0.0)
