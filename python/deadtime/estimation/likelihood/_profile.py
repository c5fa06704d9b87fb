"""Intervals of the profile likelihood, with the degrees of freedom of the noise.

−2 ln L rises by m ln(1 + t²/m) where a quantity is held at the end of its interval, m the rows less
the unknowns of the mean. The quantile t is that of Student's distribution with as many degrees of
freedom as the variance of the quantity is known with (Satterthwaite 1946; Kenward & Roger 1997):
slow air is seen a few times in a flight, however many rows there are.

In a recording of more than `PART` rows the likelihood is close to a parabola, and each of its
evaluations takes long: intervals are t standard errors wide, from its curvature.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import ClassVar

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.frozen import PickledByFields
from deadtime.estimation._native import PlantNumbers, RowLikelihood, RowNoise
from deadtime.estimation.likelihood._search import (
    PARTS,
    NoiseFit,
    airs_of,
    changed,
)
from deadtime.estimation.likelihood._start import is_long

#: Step of difference quotients in the logarithms of the numbers of the noise.
LOG_STEP = 0.1

#: Least curvature of the likelihood in them: its range is bounded, whatever the recording says.
LEAST_CURVATURE = 0.25

#: Fewest degrees of freedom: fewer are a failure of the parabola, not of the recording.
LEAST_FREEDOM = 4.0

#: A held fit that is lower than the best by this much is another, better minimum.
BETTER = 0.02

#: Air that may be there unseen, in the weak air of the search.
UNSEEN = tuple(2.0**k for k in range(-6, 5))

#: Most restarts from better minima, at which the search for an interval ends.
RESTARTS = 8

#: Error in rows from which a lag shorter than a row counts as not resolved, and the error in rows
#: that it then has: half a row is its interval.
UNRESOLVED, SPLIT = 4.0, 0.25


@dataclass(frozen=True, eq=False)
class LikelihoodProfile(PickledByFields):
    """The profile of one fit.

    Attributes
    ----------
    fit : NoiseFit
    names : mapping of str to str
        The kernel's name of each quantity.
    """

    fit: NoiseFit
    names: Mapping[str, str]
    preferred: str = "the noise is fitted"
    #: Whether the commands are given, not functions of the plant that is fitted.
    commands_given: ClassVar[bool] = True
    _ends: dict[tuple[str, float], tuple[float, float]] = field(default_factory=dict)

    @property
    def centre(self) -> PlantNumbers:
        """The fit with its gain, from which one quantity is moved."""
        return self.fit.with_gain

    @property
    def initial_output(self) -> float:
        """The fitted output at the start of the first recording."""
        model = self.fit.model
        return self.fit.parts[0].linear["gain" in model.names and len(self.fit.runs) == 1]

    @cached_property
    def rows(self) -> int:
        """Rows less unknowns of the mean."""
        return sum(part.freedom for part in self.fit.parts)

    @property
    def common(self) -> Array:
        """Covariance of the common numbers, for the fitted noise."""
        return common_covariance(self.fit)

    @cached_property
    def bounds(self) -> dict[str, float]:
        """Standard errors for the fitted noise."""
        cov = self.common
        known = bool(np.all(np.isfinite(cov)))
        squares = {name: float(w @ cov @ w) for name, w in self._weights.items() if known}
        if not known or not all(square > 0.0 for square in squares.values()):
            raise NotIdentifiableError(
                f"{', '.join(self.fit.model.names)} cannot be told apart by this recording: give "
                "the plant fewer lags, or let deadtime.estimation.choose_plant choose"
            )
        return {name: math.sqrt(square) for name, square in squares.items()}

    @cached_property
    def stderr(self) -> dict[str, float]:
        """Standard errors for the fitted noise, and for air that may be there unseen."""
        return {name: one * math.sqrt(self.unseen[name]) for name, one in self.bounds.items()}

    @cached_property
    def unseen(self) -> dict[str, float]:
        """Factor on the variance of each quantity for air that is too weak to be seen."""
        return unseen_air(self.fit, self._weights, self.bounds)

    @cached_property
    def _weights(self) -> dict[str, Array]:
        """Each quantity as a sum of the common numbers: gain, delay, lags, zero."""
        order = [kernel for _, kernel in self.fit.model.order]
        total = {"gain": 0.0, "zero": -1.0}
        return {
            name: np.array(
                [total.get(one, 1.0) if kernel == "total" else one == kernel for one in order],
                dtype=np.float64,
            )
            for name, kernel in self.names.items()
        }

    @cached_property
    def freedom(self) -> dict[str, float]:
        """Degrees of freedom of the variance of each quantity."""
        return degrees_of_freedom(self.fit, self._weights, self.rows)

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of the quantile for a quantity."""
        return self.freedom[name]

    def rise(self, name: str, level: float) -> float:
        """The rise of −2 ln L at the ends of an interval."""
        return self.rows * math.log1p(
            self.unseen[name] * self._quantile(name, level) ** 2 / self.rows
        )

    def _quantile(self, name: str, level: float) -> float:
        from scipy import special

        return float(special.stdtrit(self.freedom[name], 0.5 + level / 2))

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        held = self.fit.likelihood.held(self.centre, self.names[name], value - self._outside(name))
        rise = max(0.0, held.objective - self.centre.objective)
        return self.rows * math.expm1(rise / self.rows) / self.unseen[name]

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted `value`; long recordings: from the curvature."""
        if is_long(self.fit.runs):
            return self._from_curvature(name, value, level)
        key = (name, level)
        if key not in self._ends:
            self._ends[key], _ = self.ends(name, level)
        low, high = self._ends[key]
        return low + self._outside(name), high + self._outside(name)

    def _from_curvature(self, name: str, value: float, level: float) -> tuple[float, float]:
        reach = self._quantile(name, level) * self.stderr[name]
        low = value - reach
        return low if self.names[name] == "gain" else max(0.0, low), value + reach

    def _outside(self, name: str) -> float:
        """What a sum of times holds besides the numbers of the kernel, s."""
        return self.fit.model.own_lag if self.names[name] == "total" else 0.0

    def ends(
        self, name: str, level: float, lower: float = math.inf
    ) -> tuple[tuple[float, float], PlantNumbers]:
        """The interval, and the lowest minimum that was seen on the way.

        The search ends at a minimum that is `lower` by as much: there is no interval then.
        """
        kernel = self.names[name]
        leads = kernel == "total" and ("zero" in self.fit.model.names or self.fit.model.zero > 0.0)
        floor = -math.inf if kernel in ("gain", "zero") or leads else 0.0
        if kernel.startswith("lag"):
            floor = 1e-3 * self.fit.runs[0].row_time
        rise = self.rise(name, level)
        reach = max(self.stderr[name] * math.sqrt(rise), 1e-9)
        found, lowest = [], self.centre
        for sign in (-1.0, 1.0):
            end, low = self.fit.likelihood.end(
                self.centre, kernel, sign * reach, rise, floor, lower
            )
            found.append(0.0 if end == floor else end)
            lowest = min(lowest, low, key=lambda one: one.objective)
            if lowest.objective < self.centre.objective - lower:
                break
        return (found[0], found[-1]), lowest


def best_profile(
    profile: LikelihoodProfile, first: Iterable[str], level: float = 0.95
) -> LikelihoodProfile:
    """The profile, or that of a better minimum which the intervals of `first` find."""
    if is_long(profile.fit.runs):
        return profile
    for _ in range(RESTARTS):
        better = None
        for name in first:
            found, lowest = profile.ends(name, level, BETTER)
            if lowest.objective < profile.centre.objective - BETTER:
                better = lowest
                break
            profile._ends[name, level] = found
        if better is None:
            break
        fit = profile.fit
        profile = LikelihoodProfile(fit.moved(fit.likelihood.fit(better)), profile.names)
    return profile


def common_covariance(fit: NoiseFit) -> Array:
    """Covariance of the numbers that all recordings share: gain, delay, lags, zero."""
    return _held(_covariance(fit, fit.parts), unresolved_lags(fit), fit)


def unresolved_lags(fit: NoiseFit) -> tuple[int, ...]:
    """Places of the lags that the rows do not resolve, the shortest first.

    Far below the time between rows a lag has the effect of a delay, and beside one of about the
    same size that of this one: the linear model takes them for unknown to any size.
    """
    cov, kernel = _covariance(fit, fit.parts), [name for _, name in fit.model.order]
    longest = max(float(np.ptp(rows.time)) for rows in fit.runs)
    size = {
        place: fit.numbers.lags[int(name.removeprefix("lag "))]
        for place, name in enumerate(kernel)
        if name.startswith("lag")
    }
    times = [place for place, name in enumerate(kernel) if name != "gain"]
    held: tuple[int, ...] = ()
    for place in sorted(size, key=lambda place: size[place]):
        squares = np.diag(_held(cov, held, fit))
        short = size[place] < _row(fit) and squares[place] > (UNRESOLVED * _row(fit)) ** 2
        if not short and np.all((squares[times] > 0.0) & (squares[times] < longest**2)):
            break
        held = (*held, place)
    return held


def _held(cov: Array, held: Sequence[int], fit: NoiseFit) -> Array:
    """The covariance where what such a lag is longer the delay is shorter."""
    kernel = [name for _, name in fit.model.order]
    for place in held:
        if 0.0 < cov[place, place] < math.inf:
            cov = cov - np.outer(cov[:, place], cov[place]) / cov[place, place]
        cov[place, :] = cov[:, place] = 0.0
    for place in held:
        shifted = np.array([(i == place) - 1.0 * (one == "delay") for i, one in enumerate(kernel)])
        cov = cov + (SPLIT * _row(fit)) ** 2 * np.outer(shifted, shifted)
    return cov


def _under(
    fit: NoiseFit, noises: Sequence[Sequence[RowNoise]], weights: Mapping[str, Array]
) -> tuple[Array, Array]:
    """-2 ln L under each of these noises of the recordings, and the variance of each quantity."""
    each = [
        fit.likelihood.under(run, fit.numbers, [noise[run] for noise in noises])
        for run in range(len(fit.runs))
    ]
    held, w = unresolved_lags(fit), np.array(list(weights.values()))
    cov = np.array([_held(_covariance(fit, parts), held, fit) for parts in zip(*each, strict=True)])
    objectives = np.array([[one.objective for one in parts] for parts in each]).sum(axis=0)
    return objectives, np.einsum("qi,nij,qj->nq", w, cov, w)


def _row(fit: NoiseFit) -> float:
    """Time between rows, s."""
    return fit.runs[0].row_time


def _covariance(fit: NoiseFit, parts: Sequence[RowLikelihood]) -> Array:
    blocks = [_common(part.inverse, len(part.linear), fit) * part.variance for part in parts]
    if len(blocks) == 1:
        return blocks[0]
    # A recording whose derivatives are singular tells nothing here, which is the safe side.
    told = [block for block in blocks if np.all(np.isfinite(block))]
    if not told:
        return blocks[0]
    # A number that one recording does not move at all, as a second lag of zero, has no variance.
    information = sum(np.linalg.pinv(block, hermitian=True) for block in told)
    return np.asarray(np.linalg.pinv(information, hermitian=True))


def _common(inverse: Array, linear: int, fit: NoiseFit) -> Array:
    """The block of the common numbers."""
    size = math.isqrt(inverse.size)
    own = list(range(linear, size))
    if "gain" in fit.model.names and len(fit.runs) == 1:
        own = [0, *own]
    return np.asarray(inverse.reshape(size, size)[own][:, own])


def unseen_air(
    fit: NoiseFit, weights: Mapping[str, Array], bounds: Mapping[str, float]
) -> dict[str, float]:
    """Mean variance of each quantity over slow air, weighted by its likelihood, over `bounds`².

    An estimate of no air does not mean that there is none. The prior density of its deviation falls
    with the square root of it: with a constant one intervals cover too much without air, with one
    that falls with the deviation too little in the weakest air.
    """
    none = dict.fromkeys(weights, 1.0)
    if not fit.model.integrates or any(one.air > 0.0 for one in fit.numbers.noise):
        return none
    _, slow = airs_of(fit.model, fit.runs)
    noises = [
        [
            changed(one, air=step * air.air, air_time=air.air_time)
            for one, air in zip(fit.numbers.noise, slow, strict=True)
        ]
        for step in UNSEEN
    ]
    objectives, variances = _under(fit, noises, weights)
    rises = np.maximum(objectives - fit.numbers.objective, -1.0)
    likely = np.sqrt(UNSEEN) * np.exp(-0.5 * rises)
    means = likely @ variances / np.sum(likely)
    return {
        name: max(1.0, float(mean) / bounds[name] ** 2)
        for name, mean in zip(weights, means, strict=True)
    }


def degrees_of_freedom(fit: NoiseFit, weights: Mapping[str, Array], rows: int) -> dict[str, float]:
    """ν = 2/var(ln V) of the variance V of each quantity, over the numbers of the noise."""
    base = fit.numbers.noise
    places = [
        (run, part)
        for run, noise in enumerate(base)
        for part in PARTS
        if getattr(noise, part.removesuffix("_time")) > 0.0
    ]
    if not places:
        return dict.fromkeys(weights, float(rows))

    def at(steps: Mapping[int, float]) -> list[RowNoise]:
        noise = [{name: getattr(one, name) for name in PARTS} for one in base]
        for place, step in steps.items():
            run, part = places[place]
            noise[run][part] *= math.exp(step)
        return [RowNoise(**one) for one in noise]

    h, count = LOG_STEP, len(places)
    pairs = list(combinations(range(count), 2))
    singles = [{i: step} for step in (h, -h) for i in range(count)]
    noises = [at(steps) for steps in ({}, *singles, *({i: h, j: h} for i, j in pairs))]
    objectives, variances = _under(fit, noises, weights)
    if not np.all(np.isfinite(objectives)):
        # At some noise near by one unknown cannot be told from others.
        return dict.fromkeys(weights, LEAST_FREEDOM)
    middle, above, below = objectives[0], objectives[1 : count + 1], objectives[count + 1 :]
    hessian = np.zeros((count, count))
    for i in range(count):
        hessian[i, i] = (above[i] - 2.0 * middle + below[i]) / h**2
    for (i, j), both in zip(pairs, objectives[2 * count + 1 :], strict=True):
        hessian[i, j] = hessian[j, i] = (both - above[i] - above[j] + middle) / h**2
    logs = np.log(np.maximum(variances, 1e-300))
    quotients = (logs[1 : count + 1] - logs[count + 1 : 2 * count + 1]) / (2.0 * h)
    slopes = dict(zip(weights, quotients.T, strict=True))
    values, vectors = np.linalg.eigh(0.5 * hessian)
    spread = (vectors / np.maximum(values, LEAST_CURVATURE)) @ vectors.T
    return {
        name: max(LEAST_FREEDOM, float(2.0 / (2.0 / rows + slope @ spread @ slope)))
        for name, slope in slopes.items()
    }
