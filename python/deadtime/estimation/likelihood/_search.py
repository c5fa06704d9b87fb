"""Search of plant and noise: starts, and which parts of the noise the recording has.

The likelihood has local minima over the delay, and others where the air takes the place of what
the plant lacks. A grid over delay and lag, without air and with strong air, gives the starts. Trim,
air and coloured sensor noise are kept where Akaike's criterion asks for them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np

from deadtime._base.frozen import PickledByFields
from deadtime.estimation._native import FlightLikelihood, PlantNumbers, RowLikelihood, RowNoise
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

#: Longest delay of the search, as a share of the window.
LONGEST = 0.6

#: Steps of the grid over the delay: in rows, and as a share of the delay.
GRID_STEP, GRID_GROWTH = 1.0, 0.1

#: Parts of a row at which delays of a grid are, where rows are even: times between them differ by
#: less than this share of a part.
PARTS_OF_ROW, EVEN = 4, 1e-8

#: Lags of the grid, in rows, factors of it over a time constant, and how much shorter each further
#: lag is: equal lags have the same effect, so that a search does not move from them.
LAGS, FACTORS, SHORTER = (0.5, 3.0, 8.0), (0.3, 1.0, 3.0), 0.4

#: Deviations of the air in the grid, and where it is added to a fit without: white deviations a
#: row. Its time constant there, as a share of the window, and by how much slow air is slower.
STRONG_AIR, WEAK_AIR, AIR_TIME, SLOW = 0.65, 0.02, 0.13, 10.0

#: The same for plants that do not integrate, in white deviations.
STRONG_INPUT, WEAK_INPUT = 3.0, 0.3

#: Local minima of the grid that are refined, for each noise.
REFINED = 2

#: Accuracy of −2 ln L where fits are compared.
ROUGH = 0.02

#: Start of the coloured sensor noise: white deviations, and rows.
SENSOR, SENSOR_TIME = 1.0, 2.0

#: Rise of the criterion with trim, for each recording, from which no other air is tried with it
#: than none and that without trim. Where trim won (22 of 608 recordings), it had fallen there.
DOUBTFUL = 4.0

#: Prices in the criterion: of the two numbers of the coloured sensor noise that of Akaike (1974),
#: of the trim twice that, because it would cost accuracy on a calm flight. Air has none: no air is
#: the lower bound of its deviation.
PRICE_OF_SENSOR, PRICE_OF_TRIM, PRICE_OF_SCATTER = 4.0, 9.0, 4.0

#: Air with a shorter time constant, in rows, may be coloured noise of the sensor.
FAST = 3.0

#: The shortest lag of a search, in rows.
SHORTEST = 1e-3

#: Rise of −2 ln L without air, or without a lag, up to which it is none.
IDLE = 1e-3

#: Times that scatter by more rows than this are no scatter.
MOST_SCATTER = 1.0

#: A command that changes more often a row than this is one that a plant with limited rates gets: it
#: moves steadily, and has no times that may scatter.
STEADY = 2.0

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
    extra : int
        Further lags, not of the plant, that are tried.
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
    extra: int = 0
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
        return [name in self.names for name in self.lag_names] + [True] * self.extra

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

    def likelihood(self, runs: Sequence[FlightRows], trim: bool) -> FlightLikelihood:
        """The likelihood of these recordings, with or without trim."""
        longest = min(LONGEST * float(run.time[-1] - run.time[0]) for run in runs)
        return FlightLikelihood(
            self.num,
            self.den,
            [run._replace(trim=trim) for run in runs],
            delay="delay" in self.names,
            gain="gain" in self.names,
            lags=self.free_lags,
            zero="zero" in self.names,
            longest=longest,
            air_behind_lags=self.air_behind_lags,
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

    @cached_property
    def likelihood(self) -> FlightLikelihood:
        """The likelihood that was maximised."""
        return self.model.likelihood(self.runs, self.trim)

    @cached_property
    def parts(self) -> list[RowLikelihood]:
        """The likelihood of each recording at the maximum."""
        return [self.likelihood.at(run, self.numbers) for run in range(len(self.runs))]

    @property
    def criterion(self) -> float:
        """Akaike's criterion, from the plain likelihood: fits with and without trim compare."""
        total = 0.0
        for rows, part, noise in zip(self.runs, self.parts, self.numbers.noise, strict=True):
            count = int(np.sum(rows.used))
            total += count * np.log(part.variance * part.freedom / count) + part.log_det
            total += PRICE_OF_SENSOR * (noise.sensor > 0.0) + PRICE_OF_TRIM * self.trim
            total += PRICE_OF_SCATTER * ((noise.stamps > 0.0) + (noise.arrivals > 0.0))
        return float(total)

    @property
    def gain(self) -> float:
        """The gain at the maximum."""
        return self.parts[0].gain if self.given_gain is None else self.given_gain

    @cached_property
    def with_gain(self) -> PlantNumbers:
        """The numbers with the gain, which is not searched in a single recording."""
        one = self.numbers
        return PlantNumbers(
            one.delay, one.lags, one.noise, self.gain, one.zero, objective=one.objective
        )

    def moved(self, numbers: PlantNumbers) -> NoiseFit:
        """The same at other numbers, with the same likelihood."""
        found = NoiseFit(self.model, self.runs, self.trim, numbers, self.given_gain)
        found.__dict__["likelihood"] = self.likelihood
        return found


def with_noise(numbers: PlantNumbers, noise: Sequence[RowNoise]) -> PlantNumbers:
    """The same plant under other noise."""
    return PlantNumbers(numbers.delay, numbers.lags, noise, numbers.gain, numbers.zero)


def fit_noise(model: PlantModel, runs: Sequence[FlightRows], first: PlantNumbers) -> NoiseFit:
    """The likeliest plant and noise, from least squares (`first`) and a grid in strong air."""
    runs = tuple(runs)
    quiet = [RowNoise()] * len(runs)
    strong, slow = airs_of(model, runs)
    weak = [RowNoise(one.air_time / SLOW, one.air) for one in slow]
    found: list[NoiseFit] = []
    first = with_noise(first, quiet)
    calms, airs = [first, *_grid(model, runs, first, quiet)[:1]], _grid(model, runs, first, strong)
    for trim in (False, True) if model.integrates else (False,):
        fit = NoiseFit(model, runs, trim, first)
        likelihood = fit.likelihood
        calm = min((likelihood.fit(one, ROUGH) for one in calms), key=_objective)
        if found:
            near = (calm, likelihood.fit(found[0].numbers, ROUGH))
            rise = min(fit.moved(one).criterion for one in near) - found[0].criterion
            if rise > DOUBTFUL * len(runs):
                break
        airy = (with_noise(calm, weak), with_noise(calm, slow), *airs)
        tried = [calm, *(likelihood.fit(one, ROUGH) for one in airy)]
        found.append(fit.moved(min(tried, key=_objective)))
    best = min(found, key=_criterion)
    best = min([best, *_with_sensor(best)], key=_criterion_beside_sensor)
    best = without_idle_air(min([best, *_with_scatter(best)], key=_criterion))
    return _without_idle_lags(without_idle_air(best.moved(best.likelihood.fit(best.numbers))))


def _without_idle_lags(fit: NoiseFit) -> NoiseFit:
    """The fit without lags that make its recordings no likelier than the shortest lag does.

    A search ends at a lag far below the time between rows where the likelihood has a kink over the
    delay; there rows hardly tell lag and delay apart.
    """
    shortest = SHORTEST * fit.runs[0].row_time
    for place, free in enumerate(fit.model.free_lags if "delay" in fit.model.names else []):
        one = fit.with_gain
        lags = list(one.lags)
        late, lags[place] = lags[place] - shortest, shortest
        for delay in (one.delay, one.delay + late) if free and late > 0.0 else ():
            without = PlantNumbers(delay, lags, one.noise, one.gain, one.zero)
            if fit.likelihood.objective(without) < fit.numbers.objective + IDLE:
                found = fit.likelihood.fit(without)
                fit = min(fit, fit.moved(found), key=lambda one: one.numbers.objective)
                break
    return fit


def without_idle_air(fit: NoiseFit) -> NoiseFit:
    """The fit without air that makes its recording no likelier."""
    for run, one in enumerate(fit.numbers.noise):
        if one.air == 0.0:
            continue
        noise = list(fit.numbers.noise)
        noise[run] = changed(one, air=0.0)
        objective = fit.likelihood.objective(with_noise(fit.with_gain, noise))
        if objective < fit.numbers.objective + IDLE:
            p = fit.numbers
            fit = fit.moved(
                PlantNumbers(p.delay, p.lags, noise, p.gain, p.zero, objective=objective)
            )
    return fit


def _with_sensor(best: NoiseFit) -> list[NoiseFit]:
    """The fit with coloured sensor noise beside the air and in its place."""
    found = []
    for keeps_air in (True, False):
        noise = [
            RowNoise(
                one.air_time,
                one.air if keeps_air else 0.0,
                SENSOR_TIME * rows.row_time,
                SENSOR,
            )
            for one, rows in zip(best.numbers.noise, best.runs, strict=True)
        ]
        if keeps_air and not any(one.air > 0.0 for one in best.numbers.noise):
            continue
        found.append(best.moved(best.likelihood.fit(with_noise(best.numbers, noise), ROUGH)))
    return found


def _with_scatter(best: NoiseFit) -> list[NoiseFit]:
    """The fit with scattered times of the rows, and of the commands."""
    found: list[NoiseFit] = []
    for part in ("stamps", "arrivals"):
        runs, noise = [], []
        for rows, like, one in zip(best.runs, best.parts, best.numbers.noise, strict=True):
            with np.errstate(all="ignore"):
                speed = like.rate / like.gain
            moves = speed if part == "stamps" else np.diff(rows.command)
            size = float(np.max(np.abs(moves), initial=0.0))
            steady = part == "arrivals" and rows.command.size > STEADY * rows.time.size
            # A gain of zero leaves no finite speed.
            if not 0.0 < size < np.inf or steady:
                return found
            runs.append(rows._replace(speed=speed))
            noise.append(changed(one, **{part: getattr(one, part) or 1.0 / size}))
        moved = replace(best, runs=tuple(runs))
        fit = moved.moved(moved.likelihood.fit(with_noise(best.numbers, noise), ROUGH))
        # No command arrives before it is sent.
        latest = fit.numbers.delay if part == "arrivals" and "delay" in fit.model.names else np.inf
        if all(
            scatter_of(fit, run, part) < min(latest, MOST_SCATTER * rows.row_time)
            for run, rows in enumerate(runs)
        ):
            found.append(fit)
    return found


def scatter_of(fit: NoiseFit, run: int, part: str) -> float:
    """Scatter of the times of the rows (``"stamps"``) or of the commands (``"arrivals"``), s."""
    like = fit.parts[run]
    scatter: float = getattr(fit.numbers.noise[run], part)
    return scatter * math.sqrt(like.variance) / abs(like.gain)


def changed(noise: RowNoise, **parts: float) -> RowNoise:
    """The noise with some of its numbers changed."""
    return RowNoise(**{name: getattr(noise, name) for name in PARTS} | parts)


def _objective(numbers: PlantNumbers) -> float:
    return numbers.objective


def _criterion(fit: NoiseFit) -> float:
    return fit.criterion


def _criterion_beside_sensor(fit: NoiseFit) -> float:
    """Akaike's criterion where fast air has its price too.

    It moves the output as a sensor's noise of long correlation does, which may take its place.
    """
    fast = any(
        noise.air > 0.0 and noise.air_time < FAST * rows.row_time
        for noise, rows in zip(fit.numbers.noise, fit.runs, strict=True)
    )
    return fit.criterion + PRICE_OF_SENSOR * fast


def airs_of(model: PlantModel, runs: Sequence[FlightRows]) -> list[list[RowNoise]]:
    """Strong air, and weak air that is slow, for each recording."""
    found = []
    for a_row, flat, slow in ((STRONG_AIR, STRONG_INPUT, 1.0), (WEAK_AIR, WEAK_INPUT, SLOW)):
        noise = []
        for rows in runs:
            between = rows.row_time
            size = a_row / between if model.integrates else flat
            noise.append(RowNoise(slow * AIR_TIME * float(rows.time[-1] - rows.time[0]), size))
        found.append(noise)
    return found


def _grid(
    model: PlantModel, runs: tuple[FlightRows, ...], first: PlantNumbers, noise: list[RowNoise]
) -> list[PlantNumbers]:
    """The likeliest points of a grid over delay and lag under this noise."""
    rows = runs[0]
    if "delay" not in model.names:
        return [with_noise(first, noise)]
    likelihood = model.likelihood(runs, False)
    between = rows.row_time
    delays = [0.0]
    while delays[-1] < LONGEST * float(rows.time[-1] - rows.time[0]):
        delays.append(delays[-1] + max(GRID_STEP * between, GRID_GROWTH * delays[-1]))
    delays = on_parts_of_rows(delays, rows)
    return grid_minima(likelihood, delays, grid_lags(model, between), noise, first)


def on_parts_of_rows(delays: Sequence[float], rows: FlightRows) -> list[float]:
    """Increasing delays of a grid, moved to parts of a row where rows are even.

    A response serves all delays that are whole rows apart, there.
    """
    between = np.diff(rows.time)
    part = float(np.mean(between)) / PARTS_OF_ROW
    if np.ptp(between) > EVEN * part:
        return list(delays)
    moved: list[float] = (part * np.unique(np.rint(np.asarray(delays) / part))).tolist()
    return moved


def grid_minima(
    likelihood: FlightLikelihood,
    delays: Sequence[float],
    lags: list[list[float]],
    noise: list[RowNoise],
    first: PlantNumbers,
) -> list[PlantNumbers]:
    """The lowest local minima over the delay at sets of lags, else as `first`, the lowest first."""
    minima: list[PlantNumbers] = []
    for some in lags:

        def at(delay: float, objective: float = math.inf, some: list[float] = some) -> PlantNumbers:
            return PlantNumbers(delay, some, noise, first.gain, first.zero, objective=objective)

        values = np.array(likelihood.over_delays(at(delays[0]), delays))
        padded = np.r_[np.inf, values, np.inf]
        is_least = (values <= padded[:-2]) & (values <= padded[2:])
        # Where the command has no effect yet, the likelihood is infinite.
        places = np.flatnonzero(is_least & np.isfinite(values))
        minima += [at(delays[i], float(values[i])) for i in places.tolist()]
    minima.sort(key=_objective)
    # Nor do rows tell the numbers apart in which it has only just begun.
    told = (one for one in minima if math.isfinite(likelihood.objective(one)))
    return list(islice(told, REFINED))


def grid_lags(model: PlantModel, between: float) -> list[list[float]]:
    """The lags of the grid, for rows so far apart."""
    free = model.free_lags
    if not any(free):
        return [list(model.lags)]
    if "time_constant" in model.names:
        return [[factor * model.lags[0]] for factor in FACTORS]
    signs = [*np.sign(model.lags), *[1.0] * model.extra]
    known = [*model.lags, *[0.0] * model.extra]
    place = np.cumsum(free) - 1
    return [
        [
            float((sign or 1.0) * lag * between * SHORTER**i) if is_free else value
            for is_free, sign, value, i in zip(free, signs, known, place, strict=True)
        ]
        for lag in LAGS
    ]
