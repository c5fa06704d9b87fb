"""One kind of plant with its fitted numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import deadtime.estimation._native as native
from deadtime._base.digits import time_unit
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.loops import PAIR, FactoredPlant, FirstOrder, Integrator, Plant, RationalPlant

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
    delay, gain, lags, zero, poles = found.plant_of(found.values.tolist())
    pair = dict(zip(PAIR, poles or (), strict=False))
    parameters = {"delay": delay, "gain": gain}
    parameters |= {f"lag_{place}": lag for place, lag in enumerate(lags, 1)}
    if found.has_zero:
        parameters["zero"] = zero
    return PlantCandidate(
        found.plant,
        delay,
        _plant(gain, tuple(lags), zero, found.integrating, pair),
        parameters | pair,
        found.bic - best,
        found.told,
        found.noise_std,
    )


def plant_of(found: native.FamilyCandidate, values: Sequence[float]) -> tuple[float, Plant]:
    """The dead time and the plant of a candidate with these values of its numbers."""
    delay, gain, lags, zero, poles = found.plant_of(values)
    pair = dict(zip(PAIR, poles or (), strict=False))
    return max(delay, 0.0), _plant(gain, tuple(lags), zero, found.integrating, pair)


def _plant(
    gain: float, lags: tuple[float, ...], zero: float, integrator: bool, pair: dict[str, float]
) -> Plant:
    """The simplest plant of the package that has these numbers."""
    if not pair and not zero and len(lags) < 2:
        if integrator:
            return Integrator(gain, *lags)
        return FirstOrder(gain, *lags) if lags else RationalPlant([1.0], [1.0], gain)
    return FactoredPlant(lags, gain, zero, integrator, **pair)
