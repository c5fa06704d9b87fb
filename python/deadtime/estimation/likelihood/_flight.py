"""A plant and the likeliest fit of it, as the kernel has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from deadtime._base.arrays import Array
from deadtime._base.frozen import PickledByFields
from deadtime.estimation._native import (
    FlightFit,
    FlightPlant,
    PlantNumbers,
    RowLikelihood,
    RowNoise,
)
from deadtime.estimation.likelihood._rows import FlightRows
from deadtime.loops import (
    PAIR,
    FactoredPlant,
    FirstOrder,
    Integrator,
    ParametricPlant,
    Plant,
    RateLimited,
)

#: The numbers of the noise of one recording.
PARTS = ("air_time", "air", "sensor_time", "sensor", "stamps", "arrivals")


def names_in_kernel(plant: Plant) -> tuple[str, ...]:
    """The numbers of a loop with this plant that the kernel fits."""
    if isinstance(plant, RateLimited):
        plant = plant.plant
    own: tuple[str, ...] = ()
    if isinstance(plant, Integrator):
        own = ("lag",)
    elif isinstance(plant, FirstOrder):
        own = ("time_constant",)
    elif isinstance(plant, FactoredPlant):
        own = tuple(name for name in plant.parameters if name not in PAIR)
    return ("delay", "gain", *own)


@dataclass(frozen=True)
class PlantModel:
    """A plant as the kernel takes it: num/den of unit gain behind lags.

    Attributes
    ----------
    num, den : tuple of float
        Descending powers of s.
    lag_names : tuple of str
        Names of the lags.
    lags : tuple of float
        Their values, s.
    names : tuple of str
        What is fitted.
    zero : float
        Time constant of the zero behind the lags, s.
    own_lag : float
        The lag of num/den, s, where it counts among those of the plant.
    air_behind_lags : bool
        Whether air acts behind the lags, not through them.
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    lag_names: tuple[str, ...]
    lags: tuple[float, ...]
    names: tuple[str, ...]
    zero: float = 0.0
    own_lag: float = 0.0
    air_behind_lags: bool = False

    @classmethod
    def of(cls, plant: Plant, names: tuple[str, ...]) -> PlantModel:
        """The plant with `names` free; one that limits rates, after its limits."""
        if isinstance(plant, RateLimited):
            plant = plant.plant
        if isinstance(plant, Integrator):
            used = ("lag",) if "lag" in names or plant.lag else ()
            return cls((1.0,), (1.0, 0.0), used, (plant.lag,)[: len(used)], names)
        if isinstance(plant, FirstOrder):
            return cls((1.0,), (1.0,), ("time_constant",), (plant.time_constant,), names)
        if isinstance(plant, FactoredPlant):
            lags = {name: lag for name, lag in plant.parameters.items() if name.startswith("lag")}
            lags = {name: lag for name, lag in lags.items() if lag or name in names}
            if lags or plant.has_pair:
                num, den = plant._without_lags({**plant.parameters, "gain": 1.0})
                own = plant.lag + plant.zero - sum(plant.lags)
                known = (tuple(lags), tuple(lags.values()), names)
                return cls(tuple(num), tuple(den), *known, zero=plant.zero, own_lag=own)
        num, den = plant._polynomials({**plant.parameters, "gain": 1.0})
        own = plant.lag if isinstance(plant, (FactoredPlant, ParametricPlant)) else 0.0
        return cls(tuple(map(float, num)), tuple(map(float, den)), (), (), names, own_lag=own)

    @property
    def free_lags(self) -> list[bool]:
        """Which of the lags are fitted."""
        return [name in self.names for name in self.lag_names]

    @property
    def order(self) -> list[tuple[str, str]]:
        """Names of what is fitted, ours and those of the kernel, in the order of the kernel."""
        lags = ((name, f"lag {i}") for i, name in enumerate(self.lag_names))
        known = (("gain", "gain"), ("delay", "delay"), *lags, ("zero", "zero"))
        return [pair for pair in known if pair[0] in self.names]

    @property
    def integrates(self) -> bool:
        """Whether a constant input lets the output grow."""
        return len(self.den) > 1 and self.den[-1] == 0.0

    @property
    def native(self) -> FlightPlant:
        """The plant for the kernel."""
        return FlightPlant(
            self.num,
            self.den,
            self.lags,
            delay="delay" in self.names,
            gain="gain" in self.names,
            free_lags=self.free_lags,
            zero_is_free="zero" in self.names,
            zero=self.zero,
            own_lag=self.own_lag,
            air_behind_lags=self.air_behind_lags,
            time_constant="time_constant" in self.names,
        )


@dataclass(frozen=True, eq=False)
class NoiseFit(PickledByFields):
    """Plant and noise that make the recordings likeliest.

    Attributes
    ----------
    model : PlantModel
    runs : tuple of FlightRows
    trim : bool
        Whether there is a constant input besides the command.
    numbers : PlantNumbers
    given_gain : float, optional
        The gain, where it is not that of least squares on the rows of one recording.
    """

    model: PlantModel
    runs: tuple[FlightRows, ...]
    trim: bool
    numbers: PlantNumbers
    given_gain: float | None = None

    @classmethod
    def of(cls, model: PlantModel, runs: Sequence[FlightRows], native: FlightFit) -> NoiseFit:
        """The fit of the kernel to these recordings, without the rows that it left out."""
        rows = ((one, *native.rows(run)) for run, one in enumerate(runs))
        kept = tuple(one._replace(used=used, speed=speed) for one, used, speed in rows)
        return cls(model, kept, native.trim, native.numbers)._with(native)

    def _with(self, native: FlightFit) -> NoiseFit:
        self.__dict__["native"] = native
        return self

    @cached_property
    def native(self) -> FlightFit:
        """The fit of the kernel."""
        plant = self.model.native
        return FlightFit(plant, self.runs, self.trim, self.numbers, self.given_gain)

    @cached_property
    def parts(self) -> list[RowLikelihood]:
        """The likelihood of each recording at the maximum."""
        return self.native.parts

    @property
    def criterion(self) -> float:
        """Akaike's criterion, from the plain likelihood: fits with and without trim compare."""
        return self.native.criterion

    @property
    def gain(self) -> float:
        """The gain at the maximum."""
        return self.native.gain

    @property
    def with_gain(self) -> PlantNumbers:
        """The numbers with the gain, which is not searched in a single recording."""
        return self.native.with_gain

    @property
    def covariance(self) -> Array:
        """Covariance of the numbers that all recordings share: gain, delay, lags, zero."""
        size = len(self.model.order)
        return self.native.covariance.reshape(size, size)

    def moved(self, numbers: PlantNumbers) -> NoiseFit:
        """The same at other numbers, with the same likelihood."""
        found = NoiseFit(self.model, self.runs, self.trim, numbers, self.given_gain)
        return found._with(self.native.moved(numbers))

    def beside_noise(self) -> NoiseFit:
        """The likeliest plant and noise from these numbers of least squares, without outliers."""
        return NoiseFit.of(self.model, self.runs, self.native.beside_noise())

    def refit(self, tolerance: float, white: bool) -> NoiseFit:
        """The maximum near, also from slow air where there is none unless all noise is `white`."""
        native = self.native.refit(tolerance, white)
        return NoiseFit(self.model, self.runs, self.trim, native.numbers)._with(native)

    def scatter(self, run: int, part: str) -> float:
        """Scatter of the times of the rows (``"stamps"``) or of the commands, s."""
        return self.native.scatter(run, part == "stamps")


def least_squares(
    model: PlantModel, runs: Sequence[FlightRows], delay: float, gain: float
) -> NoiseFit:
    """The fit under white noise alone; `delay` and `gain` where they are known."""
    native = FlightFit.least_squares(model.native, runs, delay, gain)
    return NoiseFit(model, tuple(runs), False, native.numbers)._with(native)


def fitted_flight(model: PlantModel, runs: Sequence[FlightRows], first: PlantNumbers) -> NoiseFit:
    """The likeliest plant and noise, without outliers; from a part of long recordings first."""
    return NoiseFit.of(model, runs, FlightFit.fitted(model.native, runs, first))


def with_noise(numbers: PlantNumbers, noise: Sequence[RowNoise]) -> PlantNumbers:
    """The same plant under other noise."""
    return PlantNumbers(numbers.delay, numbers.lags, noise, numbers.gain, numbers.zero)


def changed(noise: RowNoise, **parts: float) -> RowNoise:
    """The noise with some of its numbers changed."""
    return RowNoise(**{name: getattr(noise, name) for name in PARTS} | parts)
