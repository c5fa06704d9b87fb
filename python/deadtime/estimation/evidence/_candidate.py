"""One kind of plant with its fitted numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import deadtime.estimation._native as native
from deadtime._base.digits import time_unit
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.loops import FactoredPlant, FirstOrder, Integrator, Plant, RationalPlant

#: Lead in BIC from which a plant explains a recording clearly better: 10 is "very strong" of Kass
#: and Raftery (1995). Smaller: the second is ruled out by chance; larger: hulls are wider.
CLEAR = 10.0


@dataclass(frozen=True, eq=False)
class PlantCandidate(ReadOnlyArrays):
    """A kind of plant that was tried, with its most likely numbers.

    Attributes
    ----------
    name : str
        The kind, such as ``"two lags"``.
    delay : float
        Dead time, s.
    plant : Plant
        The plant without the dead time.
    parameters : dict of str to float
        Its numbers: ``delay``, ``gain``, and those of ``lag_1``, ``lag_2``, ``zero``,
        ``pole_frequency`` and ``pole_damping`` that it has. Times in s, frequency in rad/s.
    behind : float
        By how much it is behind the best in the Bayesian information criterion (BIC): 10 is clear.
    determined : int
        How many of its numbers the recording determines.
    noise_std : float
        Standard deviation of what it leaves unexplained, in the unit of the output.
    """

    name: str
    delay: float
    plant: Plant
    parameters: dict[str, float]
    behind: float
    determined: int
    noise_std: float

    @property
    def integrates(self) -> bool:
        """Whether the output ramps while the command is held."""
        return self.name.startswith("integrator")

    @property
    def lags(self) -> tuple[float, ...]:
        """Its real time constants, s, the largest first."""
        return tuple(value for name, value in self.parameters.items() if name.startswith("lag_"))

    @property
    def lag_sum(self) -> float:
        """Sum of its time constants, those of a pair of poles too, s."""
        numbers = self.parameters
        if "pole_frequency" in numbers:
            return 2.0 * numbers["pole_damping"] / numbers["pole_frequency"]
        return sum(self.lags)

    def in_words(self) -> str:
        """What the plant is, in words: "a process that comes to rest, time constant 40 s"."""
        numbers = self.parameters
        if self.name == "delay":
            return "a pure delay"
        kind = "a process that " + ("integrates" if self.integrates else "comes to rest")
        lags = [_time(lag) for lag in self.lags]
        if "pole_frequency" in numbers:
            kind += (
                f" and oscillates at {numbers['pole_frequency']:.3g} "
                f"rad/s with damping {numbers['pole_damping']:.2g}"
            )
        elif lags and self.integrates:
            kind += f", after a lag of {' and one of '.join(lags)}"
        elif lags:
            kind += f", time constant{'s' if len(lags) > 1 else ''} {' and '.join(lags)}"
        if "zero" in numbers:
            kind += f", zero {_time(numbers['zero'])}"
        return kind

    def formula(self) -> str:
        """The plant without its dead time as `--plant` of the commands takes it."""
        numbers = self.parameters
        factors = [f"({lag:.6g}*s+1)" for lag in self.lags]
        if "pole_frequency" in numbers:
            omega, damping = numbers["pole_frequency"], numbers["pole_damping"]
            factors.append(f"({omega**-2:.6g}*s*s+{2.0 * damping / omega:.6g}*s+1)")
        if self.integrates:
            factors.append("s")
        above = f"{numbers['gain']:.6g}"
        if numbers.get("zero"):
            above += f"*({numbers['zero']:.6g}*s+1)"
        below = "*".join(factors)
        return f"{above}/{below if len(factors) == 1 else f'({below})'}" if factors else above


def _time(value: float) -> str:
    """A time in the unit that suits it, with three digits."""
    unit, size = time_unit(value)
    return f"{value / size:.3g} {unit}"


def candidate_of(found: native.FamilyCandidate, best: float) -> PlantCandidate:
    """A candidate of the kernel; `best` is the least BIC."""
    numbers = dict(zip(found.names, found.values.tolist(), strict=True))
    delay, gain, zero = numbers["delay"], numbers["gain"], numbers.get("zero", 0.0)
    parameters = {"delay": delay, "gain": gain}
    parameters |= {f"lag_{place}": lag for place, lag in enumerate(found.lags, 1)}
    if "zero" in numbers:
        parameters["zero"] = zero
    pair: dict[str, float] = {}
    if found.complex_poles:
        pair = {"pole_frequency": found.pole_frequency, "pole_damping": found.pole_damping}
    return PlantCandidate(
        found.plant,
        delay,
        _plant(gain, tuple(found.lags), zero, found.integrating, pair),
        parameters | pair,
        found.bic - best,
        found.told,
        found.noise_std,
    )


def plant_of(
    names: Sequence[str], values: Sequence[float], integrator: bool
) -> tuple[float, Plant]:
    """The dead time and the plant with these numbers, by the names of the kernel."""
    numbers = dict(zip(names, values, strict=True))
    total, product = numbers.get("lag_sum", 0.0), numbers.get("lag_product", 0.0)
    lags: tuple[float, ...] = (numbers["lag"],) if "lag" in numbers else ()
    pair: dict[str, float] = {}
    if product > 0.0 and total * total < 4.0 * product:
        pair = {"pole_frequency": product**-0.5, "pole_damping": 0.5 * total * product**-0.5}
    elif product > 0.0:
        largest = 0.5 * (total + math.sqrt(total * total - 4.0 * product))
        lags = (largest, product / largest)
    zero = numbers.get("zero", 0.0)
    return max(numbers["delay"], 0.0), _plant(numbers["gain"], lags, zero, integrator, pair)


def _plant(
    gain: float, lags: tuple[float, ...], zero: float, integrator: bool, pair: dict[str, float]
) -> Plant:
    """The simplest plant of the package that has these numbers."""
    if not pair and not zero and len(lags) < 2:
        if integrator:
            return Integrator(gain, *lags)
        return FirstOrder(gain, *lags) if lags else RationalPlant([1.0], [1.0], gain)
    return FactoredPlant(lags, gain, zero, integrator, **pair)
