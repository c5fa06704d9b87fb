"""A plant given by its factors, so that its poles and its zero have names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from deadtime._base.validation import finite, non_negative, non_zero, positive, unmasked
from deadtime.loops._native import plant_polynomials
from deadtime.loops._plants import NO_GAIN, Plant, PlantForm

#: Names of the numbers of a pair of complex poles.
PAIR = ("pole_frequency", "pole_damping")


@dataclass(frozen=True)
class FactoredPlant(Plant):
    """gain (zero s + 1) / ((lag_1 s + 1) (lag_2 s + 1) …), and one over s with an integrator.

    With a pair of complex poles also over s²/w² + 2 d s/w + 1, w the `pole_frequency` and d the
    `pole_damping`.

    A vehicle that follows an attitude or rate answers with two or three lags, or with a pair that
    overshoots; one that is told a rate and whose attitude is logged with an integrator besides.
    Each lag, the zero, the frequency and the damping can be fitted by its name.

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
    pole_frequency, pole_damping : float, optional
        Natural frequency in rad/s and damping ratio of a pair of complex poles, above zero; both or
        neither.

    Raises
    ------
    ValueError
        If the gain is zero, a lag negative or a number not finite; if there is a zero without a lag
        or a pair, or no lag, pair or integrator at all; if `pole_frequency` or `pole_damping`
        is given alone or not above zero.

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
    >>> dtm.FactoredPlant(pole_frequency=20.0, pole_damping=0.4).parameters
    {'gain': 1.0, 'zero': 0.0, 'pole_frequency': 20.0, 'pole_damping': 0.4}
    """

    lags: Sequence[float] = ()
    gain: float = 1.0
    zero: float = 0.0
    integrator: bool = False
    pole_frequency: float | None = None
    pole_damping: float | None = None

    def __post_init__(self) -> None:
        try:
            given = list(unmasked("lags", self.lags))
        except TypeError:
            raise TypeError(f"lags={self.lags!r}: give a sequence of times in s") from None
        lags = tuple(non_negative(f"lag_{i}", lag) for i, lag in enumerate(given, 1))
        object.__setattr__(self, "lags", lags)
        object.__setattr__(self, "gain", non_zero("gain", self.gain, NO_GAIN))
        object.__setattr__(self, "zero", finite("zero", self.zero))
        if (self.pole_frequency is None) != (self.pole_damping is None):
            raise ValueError(
                f"pole_frequency={self.pole_frequency}, pole_damping={self.pole_damping}: a "
                "complex pair of poles needs both numbers, so give both or leave both out"
            )
        for name in PAIR if self.has_pair else ():
            object.__setattr__(self, name, positive(name, getattr(self, name)))
        if not lags and not self.integrator and not self.has_pair:
            raise ValueError(
                "a plant without lags and without integrator is only a gain: give lags, such "
                "as lags=[0.1], or give RationalPlant([gain], [1.0])"
            )
        if self.zero != 0.0 and not any(lags) and not self.has_pair:
            raise ValueError(
                f"zero={self.zero}: a plant with a zero needs a lag above zero, such as lags=[0.1]"
            )

    @property
    def has_pair(self) -> bool:
        """Whether there is a pair of complex poles."""
        return self.pole_frequency is not None

    @property
    def parameters(self) -> dict[str, float]:
        """``gain``, ``lag_1`` and so on; ``zero`` with any of them; those of a pair."""
        found = {"gain": self.gain}
        found |= {f"lag_{i}": lag for i, lag in enumerate(self.lags, 1)}
        if self.lags or self.has_pair:
            found["zero"] = self.zero
        if self.pole_frequency is not None and self.pole_damping is not None:
            found |= dict(zip(PAIR, (self.pole_frequency, self.pole_damping), strict=True))
        return found

    @property
    def lag(self) -> float:
        """Total lag, s: the sum of the lags, less the zero, plus that of a pair, 2 d/w.

        The answer to a ramp is late by this and the delay in the end. It is well determined also
        where a recording does not tell one lag from another.
        """
        total = sum(self.lags) - self.zero
        if self.pole_frequency is not None and self.pole_damping is not None:
            total += 2.0 * self.pole_damping / self.pole_frequency
        return total

    def _replace(self, numbers: Mapping[str, float]) -> FactoredPlant:
        values = {**self.parameters, **numbers}
        lags = [values.pop(f"lag_{i}") for i in range(1, len(self.lags) + 1)]
        return replace(self, lags=lags, **values)  # type: ignore[arg-type]

    @property
    def _form(self) -> PlantForm:
        return PlantForm(
            tuple(self.parameters),
            (1.0,),
            (1.0, 0.0) if self.integrator else (1.0,),
            len(self.lags),
            "zero" in self.parameters,
            self.has_pair,
        )

    def _without_lags(self, values: Mapping[str, float]) -> tuple[list[float], list[float]]:
        """Numerator and denominator without the lags and the zero."""
        names = ("gain", *PAIR) if self.has_pair else ("gain",)
        form = self._form._replace(names=names, lags=0, has_zero=False)
        return plant_polynomials(form, [values[name] for name in names])
