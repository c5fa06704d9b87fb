r"""Plants: what the delayed command acts on.

A plant is a proper rational transfer function b(s)/a(s) in floats (those with delays inside:
`_given_plants`; those that limit the rate of their command: `_rate_limits`). Its state space is the
observable canonical form: with a monic of degree n and D = b\ :sub:`0`,

    x_i' = -a_i x_1 + x_{i+1} + (b_i - a_i D) w,   y = x_1 + D w,

in which the first state is the output and a plant at rest is found by inspection.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, SupportsFloat, cast

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, non_negative, non_zero, unmasked
from deadtime.loops._native import canonical_form, plant_polynomials
from deadtime.systems import TransferFunction


class StateSpace(NamedTuple):
    """x' = A x + B w, y = C x + D w with one input and one output.

    Attributes
    ----------
    A : ndarray, shape (n, n)
    B : ndarray, shape (n,)
    C : ndarray, shape (n,)
    D : float
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: float


class PlantForm(NamedTuple):
    """The form of a plant as the kernel takes it: gain num/den, and the factors by their numbers.

    Without `num` and `den` its polynomials are given with its numbers, or it has delays inside.
    """

    names: tuple[str, ...]
    num: Sequence[float] | None = None
    den: Sequence[float] | None = None
    lags: int = 0
    has_zero: bool = False
    has_pair: bool = False
    #: Numerator and denominator of a plant with delays inside.
    delayed: tuple[Any, Any] | None = None


class Plant(ABC):
    """What the delayed command w acts on, with the output y; linear but for `RateLimited`."""

    @property
    def is_rational(self) -> bool:
        """Whether it is a ratio of polynomials; else it has delays inside."""
        return True

    @property
    def is_linear(self) -> bool:
        """Whether it has a transfer function."""
        return True

    @property
    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """The plant's named numbers."""

    def _replace(self, numbers: Mapping[str, float]) -> Plant:
        """Return the same plant with other numbers."""
        return cast(Plant, replace(cast(Any, self), **numbers))

    @property
    @abstractmethod
    def _form(self) -> PlantForm:
        """What it is without its numbers."""

    def _given(self, values: Mapping[str, Any]) -> tuple[list[Any], list[Any]] | None:
        """Polynomials for a gain of one, in what `values` hold; None where `_form` has them."""
        return None

    def _polynomials(self, values: Mapping[str, float]) -> tuple[list[float], list[float]]:
        """Numerator and denominator, descending, for these numbers."""
        form = self._form
        return plant_polynomials(form, [values[name] for name in form.names])

    def polynomials(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Numerator and denominator of the transfer function.

        Returns
        -------
        (num, den) : tuple of ndarray
            Coefficients in descending powers of s, without leading zeros.

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.Integrator(gain=0.9, lag=0.2).polynomials()
        (array([0.9]), array([0.2, 1. , 0. ]))
        """
        num, den = self._polynomials(self.parameters)
        return _trimmed(num), _trimmed(den)

    def transfer_function(self) -> TransferFunction:
        """Return the plant as a transfer function.

        Returns
        -------
        TransferFunction

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.Integrator(gain=0.9, lag=0.2).transfer_function() * dtm.delay(0.36)
        0.9 exp(-0.36 s) / (s + 0.2 s^2)
        """
        return TransferFunction(*self.polynomials())

    def state_space(self) -> StateSpace:
        """State space in observable canonical form: the first state is y - D w.

        Returns
        -------
        StateSpace

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.FirstOrder(gain=2.0, time_constant=0.5).state_space()
        StateSpace(A=array([[-2.]]), B=array([4.]), C=array([1.]), D=0.0)
        """
        return realise(*self._polynomials(self.parameters))


#: Reasons why a number cannot be zero, for errors.
NO_GAIN = "a plant whose gain is zero does not respond to its command, so the loop is open"
NO_TIME = "then the plant is only a gain, which is RationalPlant([gain], [1.0])"


@dataclass(frozen=True)
class Integrator(Plant):
    """gain / (s (lag s + 1)).

    The height of a hovering vehicle answers the vertical speed it is told to fly so: the command
    becomes speed after a first-order lag, and speed adds up to height.

    Parameters
    ----------
    gain : float
        Output per second and unit of command, not zero.
    lag : float
        Time constant of the lag in s, zero for none.

    Raises
    ------
    ValueError
        If `gain` is zero or a number is not finite, or `lag` is negative.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.Integrator(gain=0.9, lag=0.2).parameters
    {'gain': 0.9, 'lag': 0.2}
    """

    gain: float = 1.0
    lag: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", non_zero("gain", self.gain, NO_GAIN))
        object.__setattr__(self, "lag", non_negative("lag", self.lag))

    @property
    def parameters(self) -> dict[str, float]:
        """``gain`` and ``lag``."""
        return {"gain": self.gain, "lag": self.lag}

    @property
    def _form(self) -> PlantForm:
        return PlantForm(("gain", "lag"), (1.0,), (1.0, 0.0), lags=1)


@dataclass(frozen=True)
class FirstOrder(Plant):
    """gain / (time_constant s + 1).

    Parameters
    ----------
    gain : float
        Steady output per unit of command, not zero.
    time_constant : float
        In s, above zero for a stable plant; a negative one is an unstable plant. Not zero.

    Raises
    ------
    ValueError
        If a number is zero or not finite.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.FirstOrder(2.0, time_constant=0.5), dtm.P(1.0), delay=0.1)
    >>> float(round(loop.step_response().steady_state, 6))         # proportional: an error stays
    0.666667
    """

    gain: float = 1.0
    time_constant: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", non_zero("gain", self.gain, NO_GAIN))
        object.__setattr__(
            self, "time_constant", non_zero("time_constant", self.time_constant, NO_TIME)
        )

    @property
    def parameters(self) -> dict[str, float]:
        """``gain`` and ``time_constant``."""
        return {"gain": self.gain, "time_constant": self.time_constant}

    @property
    def _form(self) -> PlantForm:
        return PlantForm(("gain", "time_constant"), (1.0,), (1.0,), lags=1)


@dataclass(frozen=True)
class RationalPlant(Plant):
    """gain * num(s) / den(s), proper.

    Parameters
    ----------
    num, den : sequence of float
        Coefficients in descending powers of s; the degree of `num` is at most that of `den`.
    gain : float
        Factor on the whole, not zero: the number that a fit or a map varies.

    Raises
    ------
    ValueError
        If a polynomial is empty or zero, the plant is not proper, or a number is not finite.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.RationalPlant([1.0], [1.0, 0.4, 4.0]).parameters
    {'gain': 1.0}
    """

    num: Sequence[float]
    den: Sequence[float]
    gain: float = 1.0

    def __post_init__(self) -> None:
        num = _coefficients("num", self.num)
        den = _coefficients("den", self.den)
        if len(num) > len(den):
            raise ValueError(
                f"num has degree {len(num) - 1}, and den only {len(den) - 1}. A plant cannot "
                "differentiate its command, so give a den of at least the degree of num"
            )
        object.__setattr__(self, "num", num)
        object.__setattr__(self, "den", den)
        object.__setattr__(self, "gain", non_zero("gain", self.gain, NO_GAIN))

    @property
    def parameters(self) -> dict[str, float]:
        """``gain``."""
        return {"gain": self.gain}

    @property
    def _form(self) -> PlantForm:
        return PlantForm(("gain",), self.num, self.den)


def kit_plant() -> RationalPlant:
    """Height model of the AR Drone Simulink Development Kit.

    (0.15265 s + 5.1529) / (s (s + 5.820)), from vertical speed command in m/s to height in m,
    without the delay of the link.

    Returns
    -------
    RationalPlant

    References
    ----------
    D. Escobar Sanabria and P. J. Mosterman, AR Drone Simulink Development Kit, v1.1.

    Examples
    --------
    >>> import deadtime as dtm
    >>> num, den = dtm.kit_plant().polynomials()
    >>> round(float(num[-1] / den[-2]), 3)          # m/s of climb per m/s of command
    0.885
    """
    return RationalPlant(num=(0.15265, 5.1529), den=(1.0, 5.820, 0.0))


def steady_lag(num: Sequence[float], den: Sequence[float]) -> float:
    """How late the answer of num/den to a ramp is in the end, s; its integrators left out.

    To first order in s, a plant without integrators is its steady gain times 1 - lag s.
    """

    def slope(coefficients: Sequence[float]) -> float:
        rising = list(reversed(coefficients))
        first = next((i for i, c in enumerate(rising) if c != 0.0), None)
        if first is None or first + 1 >= len(rising):
            return 0.0
        return float(rising[first + 1] / rising[first])

    return slope(den) - slope(num)


def realise(num: Sequence[float], den: Sequence[float]) -> StateSpace:
    """Observable canonical form of num/den (descending, proper)."""
    A, B, D, *_ = canonical_form(list(num), list(den))
    return StateSpace(A, B, np.eye(1, len(B))[0], D)


def rest(num: Sequence[float], den: Sequence[float], output: float) -> tuple[Array, float]:
    """State and command of a plant at rest with the given output, for `realise`'s state."""
    *_, state, command = canonical_form(list(num), list(den), output)
    return state, command


def _trimmed(coefficients: Sequence[float]) -> NDArray[np.float64]:
    """Drop leading zeros, keep at least one coefficient."""
    array = np.asarray(coefficients, dtype=np.float64)
    first = int(np.argmax(array != 0.0))
    return array[first:] if array[first] != 0.0 else array[-1:]


def _coefficients(name: str, given: Sequence[SupportsFloat]) -> tuple[float, ...]:
    given = unmasked(name, given)
    try:
        listed = list(given)
    except TypeError as error:
        raise TypeError(f"{name}={given!r}: give a sequence of coefficients") from error
    numbers = np.asarray([finite(name, c) for c in listed], dtype=np.float64)
    if numbers.size == 0 or not numbers.any():
        raise ValueError(f"{name}={listed}: give at least one coefficient other than zero")
    return tuple(float(c) for c in _trimmed(numbers.tolist()))
