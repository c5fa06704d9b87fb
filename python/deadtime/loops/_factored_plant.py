"""A plant given by its factors, so that its poles and its zero have names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from deadtime._base.validation import finite, non_negative, non_zero, unmasked
from deadtime.loops._plants import NO_GAIN, Plant


@dataclass(frozen=True)
class FactoredPlant(Plant):
    """gain (zero s + 1) / ((lag_1 s + 1) (lag_2 s + 1) …), and one over s with an integrator.

    A vehicle that follows an attitude or rate answers with two or three lags, one that is told a
    rate and whose attitude is logged with an integrator besides. Each lag and the zero can be
    fitted by its name.

    Parameters
    ----------
    lags : sequence of float
        Time constants of the poles in s, zero or more each.
    gain : float
        Steady output per unit of command, with an integrator that per second; not zero.
    zero : float
        Time constant of the zero in s; below zero the output first moves the other way.
    integrator : bool
        Whether the output is the integral of all that.

    Raises
    ------
    ValueError
        If the gain is zero, a lag negative or a number not finite, or if there is a zero and no
        lag, or neither a lag nor an integrator.

    See Also
    --------
    deadtime.estimation.choose_plant : Choose the number of lags from a recording.

    Examples
    --------
    >>> import deadtime as dtm
    >>> plant = dtm.FactoredPlant([0.15, 0.05], gain=0.9, zero=0.02)
    >>> plant.parameters
    {'gain': 0.9, 'lag_1': 0.15, 'lag_2': 0.05, 'zero': 0.02}
    >>> round(plant.lag, 12)
    0.18
    >>> plant.transfer_function()
    (0.9 + 0.018 s) / (1 + 0.2 s + 0.0075 s^2)
    """

    lags: Sequence[float] = ()
    gain: float = 1.0
    zero: float = 0.0
    integrator: bool = False

    def __post_init__(self) -> None:
        try:
            given = list(unmasked("lags", self.lags))
        except TypeError:
            raise TypeError(f"lags={self.lags!r}: give a sequence of times in s") from None
        lags = tuple(non_negative(f"lag_{i}", lag) for i, lag in enumerate(given, 1))
        object.__setattr__(self, "lags", lags)
        object.__setattr__(self, "gain", non_zero("gain", self.gain, NO_GAIN))
        object.__setattr__(self, "zero", finite("zero", self.zero))
        if not lags and not self.integrator:
            raise ValueError(
                "a plant without lags or integrator is a gain alone: give lags=[0.1] to begin "
                "with, or RationalPlant([gain], [1.0])"
            )
        if self.zero != 0.0 and not any(lags):
            raise ValueError(
                f"zero={self.zero}: a plant with a zero needs a lag above zero, lags=[0.1] for one"
            )

    @property
    def parameters(self) -> dict[str, float]:
        """``gain``, ``lag_1`` and so on, and with lags ``zero``."""
        lags = {f"lag_{i}": lag for i, lag in enumerate(self.lags, 1)}
        return {"gain": self.gain, **lags, **({"zero": self.zero} if lags else {})}

    @property
    def lag(self) -> float:
        """Total lag, s: the sum of the lags less the zero.

        The answer to a ramp is late by this and the delay in the end. It is well determined also
        where a recording does not tell one lag from another.
        """
        return sum(self.lags) - self.zero

    def _replace(self, numbers: Mapping[str, float]) -> FactoredPlant:
        values = {**self.parameters, **numbers}
        lags = [values.pop(f"lag_{i}") for i in range(1, len(self.lags) + 1)]
        return replace(self, lags=lags, gain=values["gain"], zero=values.get("zero", 0.0))

    def _polynomials(self, values: Mapping[str, Any]) -> tuple[list[Any], list[Any]]:
        den: list[Any] = [1.0]
        for i in range(1, len(self.lags) + 1):
            lag = values[f"lag_{i}"]
            # den (lag s + 1)
            den = [
                lag * higher + lower for higher, lower in zip([*den, 0.0], [0.0, *den], strict=True)
            ]
        num = [values["gain"] * values["zero"], values["gain"]] if self.lags else [values["gain"]]
        return num, [*den, 0.0] if self.integrator else den
