"""The numbers of an estimate, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import confidence, one_dimensional
from deadtime._base.verdicts import Verdict
from deadtime.estimation.evidence._found import CLEAR, Cause, PlantCandidate, SensorFault, plant_of
from deadtime.estimation.evidence._question import Question
from deadtime.loops import Controller, ControlLoop, Plant
from deadtime.recordings import Recording

#: Step of the derivatives over the numbers of a plant, in their errors. Larger: more curvature is
#: lost; smaller: digits are.
STEP = 0.02


@dataclass(frozen=True, eq=False)
class LoopView(ReadOnlyArrays):
    """What a loop feels of a plant at some frequencies, with the ends of the intervals.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Frequencies, rad/s.
    gain, phase, delay : ndarray, shape (n,)
        Size of G, its angle in rad, and the equivalent delay -(arg G + 90° for each integrator)
        / omega in s. Where the gain of the plant is negative, angle and delay are those of -G.
    gain_ci, phase_ci, delay_ci : ndarray, shape (2, n)
        Lower and upper ends of the 95 % intervals, over all kinds of plant that the recording does
        not rule out.
    """

    omega: Array
    gain: Array
    phase: Array
    delay: Array
    gain_ci: Array
    phase_ci: Array
    delay_ci: Array


def frequencies(name: str, given: ArrayLike) -> Array:
    """The given frequencies, refused unless they are above zero."""
    omega = one_dimensional(name, np.atleast_1d(np.asarray(given, dtype=float)))
    bad = omega[~(omega > 0.0)]
    if bad.size:
        raise ValueError(f"{name}={bad[0]:g} rad/s: give frequencies above zero")
    return omega


class AtCrossover:
    """What a loop feels of a plant at `crossover`."""

    if TYPE_CHECKING:

        @property
        def _at_crossover(self) -> tuple[float, float, float]: ...

    @property
    def gain_at_crossover(self) -> float:
        """Size of G at `crossover`."""
        return self._at_crossover[0]

    @property
    def phase_at_crossover(self) -> float:
        """Angle of G at `crossover`, rad."""
        return self._at_crossover[1]

    @property
    def delay_at_crossover(self) -> float:
        """Equivalent delay at `crossover`, s."""
        return self._at_crossover[2]


@dataclass(frozen=True, eq=False)
class FittedRecording(ReadOnlyArrays):
    """A further recording of the plant, and what the likeliest plant explains of it.

    Attributes
    ----------
    recording : Recording
        The rows that were used, and those before them.
    fitted, residuals : ndarray, shape (n,)
        Output of the likeliest plant, and measured less fitted output; NaN in rows not used.
    noise_std : float
        Standard deviation of the residuals, in the unit of the output.
    """

    recording: Recording
    fitted: Array
    residuals: Array
    noise_std: float


@dataclass(frozen=True, eq=False, repr=False)
class FoundPlant(AtCrossover, ReadOnlyArrays):
    """The plant that a recording shows, as numbers: the attributes of `PlantEstimate`."""

    verdict: Verdict
    reason: str
    delay: float
    plant: Plant | None
    parameters: dict[str, float]
    crossover: float
    largest_gain: float
    candidates: tuple[PlantCandidate, ...]
    intervals: dict[str, tuple[float, float]]
    determined: int
    asked: int
    shift: int
    at_rest: bool
    excited: Array
    recording: Recording
    fitted: Array
    residuals: Array
    others: tuple[FittedRecording, ...] = ()
    causes: tuple[Cause, ...] = ()
    sensor_faults: tuple[SensorFault, ...] = ()
    better: PlantCandidate | None = None
    _own_noise: float = math.nan
    _code: str = ""
    _question: Question = field(kw_only=True)
    _at_crossover: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    _native: list[native.FamilyFit] = field(default_factory=list)

    @property
    def best(self) -> PlantCandidate:
        """The likeliest plant, or the one that was named."""
        if not self.candidates:
            raise ValueError(f"no plant: {self.reason}")
        return self.candidates[0]

    @property
    def runs(self) -> tuple[FittedRecording, ...]:
        """All recordings with what is explained of each, the first one included."""
        own = FittedRecording(self.recording, self.fitted, self.residuals, self._own_noise)
        return (own, *self.others)

    @property
    def noise_std(self) -> float:
        """Standard deviation of the residuals of all recordings, in the unit of the output."""
        return self.best.noise_std if self.candidates else math.nan

    @property
    def delay_plus_lag(self) -> float:
        """Dead time and lags less the zero: the equivalent delay as omega goes to zero, s."""
        best = self.best
        return best.delay + best.lag_sum - self.parameters.get("zero", 0.0)

    def ci(self, level: float = 0.95, name: str = "delay") -> tuple[float, float]:
        """Interval of a number, over all kinds of plant that explain the recording alike.

        Parameters
        ----------
        level : float
            Between 0 and 1.
        name : str
            One of `intervals`: ``"delay"``, ``"gain"``, ``"lag"`` (the largest time constant),
            ``"delay+lag"`` (`delay_plus_lag`),
            ``"largest_gain"``, ``"crossover"``, ``"gain_at_crossover"``, ``"phase_at_crossover"``
            and ``"delay_at_crossover"``, as far as the plant has them.

        Returns
        -------
        (float, float)
            Claimed to hold the true value in a share `level` of recordings where the verdict is
            ``"reliable"``; not claimed where it is ``"indication"``.

        Raises
        ------
        ValueError
            If the verdict is ``"none"``, the level is not between 0 and 1, or there is no such
            interval.
        """
        self._check(level, name)
        low, high = self.intervals[name] if level == 0.95 else self._answer().hull_at(level)[name]
        return float(low), float(high)

    def pieces(self, name: str = "delay", level: float = 0.95) -> tuple[tuple[float, float], ...]:
        """The pieces of an interval, where the values between them are ruled out.

        Parameters
        ----------
        name : str
            As for `ci`, which gives the lowest and the highest end.
        level : float
            Between 0 and 1.

        Returns
        -------
        tuple of (float, float)
            In order. There are several where minima of the likelihood are far from each other, such
            as delays that differ by a period of the command.
        """
        self._check(level, name)
        return tuple((float(a), float(b)) for a, b in self._answer().pieces_at(level)[name])

    def _check(self, level: float, name: str) -> None:
        """Refuse an interval that there is not."""
        confidence(level)
        if self.verdict == "none":
            raise ValueError(f"no interval: {self.reason}")
        if name not in self.intervals:
            names = ", ".join(self.intervals)
            raise ValueError(f"{name!r} has no interval. There are intervals only for {names}")

    def value(self, name: str) -> float:
        """The number that an interval belongs to.

        Parameters
        ----------
        name : str
            One of `intervals`.
        """
        if name == "delay+lag":
            return self.delay_plus_lag
        if name == "lag":
            return max(self.best.lags, default=math.nan)
        return float(self.parameters[name] if name in self.parameters else getattr(self, name))

    def at(self, omega: ArrayLike) -> LoopView:
        """Gain, phase and equivalent delay at some frequencies, with intervals of 95 %.

        Parameters
        ----------
        omega : array_like, shape (n,)
            Frequencies above zero, rad/s.

        Returns
        -------
        LoopView
        """
        given = frequencies("omega", omega)
        found = self._answer().at(given.tolist())
        values = {name: np.array(found[name][0]) for name in ("gain", "phase", "delay")}
        ends = {f"{name}_ci": np.array(found[name][1:]) for name in values}
        return LoopView(given, **values, **ends)

    def mean_delay(self, omega: ArrayLike, weight: ArrayLike) -> tuple[float, tuple[float, float]]:
        """Mean of the equivalent delay over frequencies, and its 95 % interval.

        Parameters
        ----------
        omega : array_like, shape (n,)
            Frequencies above zero, rad/s.
        weight : array_like, shape (n,)
            What each counts; scaled so that they add up to one.

        Returns
        -------
        float, (float, float)
            s. The interval is over the kinds of plant that the recording does not rule out and
            whose numbers it determines.
        """
        given = one_dimensional("weight", np.asarray(weight, dtype=float))
        places = one_dimensional("omega", np.asarray(omega, dtype=float))
        share = (given / given.sum()).tolist()
        value, low, high = self._answer().mean_delay(places.tolist(), share)
        return value, (low, high)

    def loop(
        self,
        controller: Controller,
        *,
        sample_time: float | None = None,
        limit: float | None = None,
    ) -> ControlLoop:
        """A controller around the likeliest plant with its dead time.

        Parameters
        ----------
        controller : P, PI, PD, PV or PID
            The controller.
        sample_time : float, optional
            Time between its commands, s; continuous without.
        limit : float, optional
            Largest size of its command.

        Returns
        -------
        ControlLoop

        Raises
        ------
        ValueError
            If the verdict is ``"none"``.
        """
        if self.plant is None or self.verdict == "none":
            raise ValueError(f"no plant: {self.reason}")
        return ControlLoop(
            self.plant, controller, delay=self.delay, sample_time=sample_time, limit=limit
        )

    def in_loop(
        self,
        controller: Controller,
        of: Callable[[ControlLoop], float],
        *,
        sample_time: float | None = None,
        limit: float | None = None,
    ) -> tuple[float, tuple[float, float]]:
        """A number of a loop around the plant, and its 95 % interval.

        Parameters
        ----------
        controller : P, PI, PD, PV or PID
            The controller.
        of : callable
            The number of a `ControlLoop`, such as the overshoot of its step response.
        sample_time : float, optional
            Time between its commands, s; continuous without.
        limit : float, optional
            Largest size of its command.

        Returns
        -------
        float, (float, float)
            That of the likeliest plant, and the interval over the kinds of plant that the recording
            does not rule out, by the delta method.

        Raises
        ------
        ValueError
            If the verdict is ``"none"``.
        """
        around = self.loop(controller, sample_time=sample_time, limit=limit)
        found = self._answer().candidates
        least = min(fit.bic for fit in found)
        near = [fit for fit in found if fit.bic <= least + CLEAR and fit.told == len(fit.names)]
        parts = []
        for fit in near or found[:1]:

            def number(values: Array, fit: native.FamilyCandidate = fit) -> float:
                plant, numbers = plant_of(fit, values.tolist())
                return float(of(around.replace(plant=plant, delay=max(numbers["delay"], 0.0))))

            steps = np.diag(STEP * np.array(fit.errors))
            values, n = np.array(fit.values), len(fit.names)
            slopes = [(number(values + h) - number(values - h)) / 2.0 / STEP for h in steps]
            unit = np.outer(fit.errors, fit.errors)
            correlation = np.array(fit.covariance).reshape(n, n) / np.where(unit > 0.0, unit, 1.0)
            reach = fit.quantile * math.sqrt(max(float(slopes @ correlation @ slopes), 0.0))
            parts.append((number(values), reach))
        low = min(value - reach for value, reach in parts)
        return parts[0][0], (low, max(value + reach for value, reach in parts))

    @property
    def crossover_in_loop(self) -> float:
        """Highest frequency, rad/s, at which the loop with the given controller crosses over.

        NaN if no controller was given, or if it crosses over nowhere.
        """
        controller = self._question.controller
        if controller is None or self.verdict == "none":
            return math.nan
        return float(max(self.loop(controller).margin().gain_crossovers, default=math.nan))

    def _answer(self) -> native.FamilyFit:
        """The answer of the kernel, asked again after the estimate was pickled."""
        if not self._native:
            self._native.append(self._question.answer())
        return self._native[0]

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_native": []}
