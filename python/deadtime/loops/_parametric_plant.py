"""A rational plant whose coefficients are functions of named numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from deadtime._base.frozen import FrozenDict
from deadtime._base.validation import finite, non_zero
from deadtime.loops._plants import NO_GAIN, Plant, PlantForm, RationalPlant, steady_lag

#: Numerator and denominator, descending, from the named numbers.
Polynomials: TypeAlias = Callable[..., tuple[Sequence[Any], Sequence[Any]]]

#: Names that a loop and its controllers have.
TAKEN = (
    *("plant", "controller", "delay", "sample_time", "limit", "start", "gain", "rate"),
    *("rate_of_rate", "Kp", "Kv", "Kd", "Ki", "omega", "damping"),
)


@dataclass(frozen=True)
class ParametricPlant(Plant):
    """gain * num(s) / den(s) with coefficients computed from named numbers.

    Each number can be fitted, swept, or be an axis of a map by its name.

    Parameters
    ----------
    polynomials : callable
        ``polynomials(**numbers)`` returns (num, den): coefficients in descending powers of s. In
        maps and crossings it is called with symbols, so it may add, subtract and multiply its
        arguments; where it divides by them or takes functions of them, as ``np.exp`` does, the
        plant can be fitted, simulated and swept, but not be mapped over these numbers.
    numbers : mapping of str to float
        The names and their values.
    gain : float
        Factor on the whole, not zero.

    Raises
    ------
    TypeError
        If `polynomials` cannot be called with these names.
    ValueError
        If a number is not finite, a name is one of the loop's own or there is none, or the plant is
        not proper.

    Examples
    --------
    A vehicle of unknown mass m with drag c, from force to position:

    >>> import deadtime as dtm
    >>> def drag(m, c):
    ...     return [1.0], [m, c, 0.0]
    >>> plant = dtm.ParametricPlant(drag, {"m": 1.5, "c": 0.3})
    >>> plant.parameters
    {'gain': 1.0, 'm': 1.5, 'c': 0.3}
    >>> plant.transfer_function()
    1 / (0.3 s + 1.5 s^2)
    >>> dtm.ControlLoop(plant, dtm.PD(2.0, 1.0), delay=0.2).stable_range("m")
    (0.121..., inf)
    """

    polynomials_of: Polynomials = field(repr=False)
    numbers: Mapping[str, float]
    gain: float = 1.0

    def __init__(
        self, polynomials: Polynomials, numbers: Mapping[str, float], gain: float = 1.0
    ) -> None:
        if not isinstance(numbers, Mapping) or not numbers:
            raise ValueError(f"numbers={numbers!r}: give a name and a value for each number")
        taken = [name for name in TAKEN if name in numbers]
        if taken:
            raise ValueError(
                f"the name {taken[0]!r} is already a parameter of the loop: give another name"
            )
        values = {str(name): finite(str(name), value) for name, value in numbers.items()}
        object.__setattr__(self, "polynomials_of", polynomials)
        object.__setattr__(self, "numbers", FrozenDict(values))
        object.__setattr__(self, "gain", non_zero("gain", gain, NO_GAIN))
        RationalPlant(*self._polynomials(self.parameters))  # checks them

    def __hash__(self) -> int:
        return hash((self.polynomials_of, tuple(self.numbers.items()), self.gain))

    @property
    def parameters(self) -> dict[str, float]:
        """``gain`` and the named numbers."""
        return {"gain": self.gain, **self.numbers}

    @property
    def lag(self) -> float:
        """Total lag, s: how late the output follows in the end, besides the delay."""
        return steady_lag(*self._polynomials(self.parameters))

    def _replace(self, numbers: Mapping[str, float]) -> ParametricPlant:
        values = {**self.parameters, **numbers}
        gain = values.pop("gain")
        return ParametricPlant(self.polynomials_of, values, gain)

    @property
    def _form(self) -> PlantForm:
        return PlantForm(("gain", *self.numbers))

    def _polynomials(self, values: Mapping[str, float]) -> tuple[list[float], list[float]]:
        num, den = self._given(values)
        return [values["gain"] * c for c in num], den

    def _given(self, values: Mapping[str, Any]) -> tuple[list[Any], list[Any]]:
        try:
            num, den = self.polynomials_of(**{name: values[name] for name in self.numbers})
        except TypeError as error:
            raise TypeError(
                f"polynomials({', '.join(self.numbers)}) failed: {error}. This function takes "
                "the named numbers and returns (num, den). For maps it may only add, subtract "
                "and multiply"
            ) from error
        except ValueError as error:
            raise ValueError(
                f"polynomials({', '.join(self.numbers)}) failed: {error}. This function must "
                "return two lists, (num, den)"
            ) from error
        return list(num), list(den)
