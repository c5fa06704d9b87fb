"""Margins of designs: those that are required, exact ones, and estimates for thousands of loops.

The estimate: the loop gain is linear in the gains of the controller, L = sum_i K_i L_i, so that the
L_i on one grid of frequencies serve all gains. Between two frequencies log abs(L) and arg L are
taken as straight lines, which gives the margins of thousands of loops in a second, to about 1e-4.
What a design promises comes from `ControlLoop.margin`: where that is less than required, the search
is repeated with the requirement on the estimate raised by what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array, Complex
from deadtime._base.validation import finite, positive
from deadtime.tuning._problem import Problem, Scenario

#: Names of the margins, in the order of every array of them, and their units.
MARGINS = ("gain_margin", "phase_margin", "delay_margin")
UNITS = {"gain_margin": "", "phase_margin": "°", "delay_margin": " s"}

#: What is added to a requirement, as a multiple of what the exact margins miss of it.
_RAISED = 1.1

#: Frequencies that are equally spaced in their logarithm: more of them cost time in proportion and
#: make the estimate more accurate.
_FREQUENCIES = 1000
#: Turn of the phase by the delay between two frequencies, rad, and the most frequencies that this
#: may take: beyond them a long delay is resolved more coarsely.
_STEP = 0.3
_MOST_FREQUENCIES = 4000
#: Turns of the delay that the frequencies of a continuous loop cover.
_TURNS = 8.0

#: Values of the loop gain in memory at once: bounds memory.
_VALUES = 2_000_000


class RequiredMargins(NamedTuple):
    """Least gain margin (a factor), phase margin in degrees and delay margin in s; 0 for none."""

    gain_margin: float = 0.0
    phase_margin: float = 0.0
    delay_margin: float = 0.0

    @classmethod
    def checked(
        cls, gain_margin: float | None, phase_margin: float | None, delay_margin: float | None
    ) -> RequiredMargins:
        """Check the arguments of `design`; None requires nothing."""
        required = cls(
            0.0 if gain_margin is None else finite("gain_margin", gain_margin),
            0.0 if phase_margin is None else positive("phase_margin", phase_margin),
            0.0 if delay_margin is None else positive("delay_margin", delay_margin),
        )
        if gain_margin is not None and not required.gain_margin > 1.0:
            raise ValueError(
                f"gain_margin={required.gain_margin}: give a factor above 1 (6 dB are a factor of "
                "2)"
            )
        if required.phase_margin >= 180.0:
            raise ValueError(f"phase_margin={required.phase_margin}: give degrees below 180")
        return required

    @property
    def named(self) -> dict[str, float]:
        """The margins that are required, by name."""
        return {name: value for name, value in self._asdict().items() if value > 0.0}

    @property
    def vector(self) -> Array:
        return np.array(self)

    def without(self, name: str) -> RequiredMargins:
        """The other requirements."""
        return self._replace(**{name: 0.0})

    def scaled(self, factor: float) -> RequiredMargins:
        """All requirements multiplied by a factor."""
        return RequiredMargins(*(factor * self.vector).tolist())

    def raised(self, missing: Array) -> RequiredMargins:
        """Each requirement raised by what is missing, and a little more."""
        return RequiredMargins(*(self.vector + _RAISED * missing).tolist())

    def shortfall(self, margins: Array) -> Array:
        """Sum of the relative shortfalls of margins (..., 3); 1 for a margin that is NaN."""
        required = self.vector
        with np.errstate(divide="ignore", invalid="ignore"):
            missing = np.where(required > 0.0, 1.0 - margins / required, 0.0)
        missing = np.where(np.isnan(missing), 1.0, missing)
        return np.asarray(np.maximum(missing, 0.0).sum(axis=-1))


def exact_margins(
    problem: Problem,
    gains: Array,
    scenarios: Sequence[Scenario],
    required: RequiredMargins | None = None,
) -> Array:
    """Gain, phase and delay margin in each scenario, shape (scenarios, 3).

    With `required` the delay margin, which takes most of the time, may be NaN where it is not.
    """
    late = required is None or required.delay_margin > 0.0
    found = [problem.at(gains, one)._margin(late) for one in scenarios]
    return np.array([[getattr(one, name) for name in MARGINS] for one in found])


class MarginEstimate:
    """Margins of stable loops of one problem, from loop gains on a grid of frequencies."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._omega = _frequencies(problem)
        self._kept: dict[tuple[float, ...], Complex] = {}

    def of(self, points: Array, scenarios: Sequence[Scenario], stride: int = 1) -> Array:
        """Margins of each row of gains at their least over the scenarios, shape (n, 3).

        Only one in `stride` frequencies is used.
        """
        omega = self._omega[::-stride][::-1]
        block = max(_VALUES // len(omega), 1)
        found = np.full((len(points), 3), np.inf)
        for one in scenarios:
            responses = self._responses(one)[:, ::-stride][:, ::-1]
            for first in range(0, len(points), block):
                part = slice(first, first + block)
                L = self._gains(points[part]) @ responses
                least = _margins(L, omega, self._problem.loop.is_sampled)
                found[part] = np.minimum(found[part], least)
        return found

    def _gains(self, points: Array) -> Array:
        """All gains of the controller, free and fixed, one row a loop."""
        gains = self._problem.loop.controller.gains
        columns = [
            points[:, self._problem.free.index(name)]
            if name in self._problem.free
            else np.full(len(points), value)
            for name, value in gains.items()
        ]
        return np.column_stack(columns)

    def _responses(self, scenario: Scenario) -> Complex:
        """L_i: the loop gain with one gain of one and the others zero."""
        key = tuple(scenario.values())
        if key not in self._kept:
            names = self._problem.loop.controller.gains
            self._kept[key] = np.array(
                [
                    self._problem.loop.replace(
                        **scenario, **{name: float(name == alone) for name in names}
                    ).frequency_response(self._omega)
                    for alone in names
                ]
            )
        return self._kept[key]


def _frequencies(problem: Problem) -> Array:
    """From far below any crossover to beyond a few turns of the delay, or half the samples."""
    loop = problem.loop
    numbers = loop.parameters
    delay = problem.intervals["delay"][1]
    times = [delay, numbers.get("lag", 0.0), abs(numbers.get("time_constant", 0.0))]
    times += [loop.sample_time or 0.0, 1.0 / numbers["omega"] if "omega" in numbers else 0.0]
    slowest = max(times) or 1.0
    if loop.sample_time is not None:
        high = np.pi / loop.sample_time
    else:
        # Beyond the corner of the filter and some turns of the delay only the chains are left.
        shortest = min(time for time in (*times, slowest) if time > 0.0)
        high = max(2.0 * np.pi * _TURNS / (delay or slowest), 20.0 / shortest)
    low = min(1e-3 / slowest, 1e-3 * high)
    even = np.linspace(low, high, int(min(high * delay / _STEP, _MOST_FREQUENCIES)) + 2)
    return np.unique(np.concatenate([np.geomspace(low, high, _FREQUENCIES), even]))


def _margins(L: Complex, omega: Array, sampled: bool) -> Array:
    """Gain, phase and delay margin of each row, crossings by straight lines in between."""
    size, angle = np.log(np.abs(L)), np.angle(-L)
    grown, turned = np.diff(size, axis=1), np.diff(angle, axis=1)
    turned = np.mod(turned + np.pi, 2.0 * np.pi) - np.pi
    step = np.diff(np.log(omega))

    found = np.full((len(L), 3), np.inf)
    row, place = np.nonzero(size[:, :-1] * size[:, 1:] <= 0.0)
    part = -size[row, place] / np.where(grown[row, place] == 0.0, 1.0, grown[row, place])
    left = angle[row, place] + part * turned[row, place]
    at = omega[place] * np.exp(part * step[place])
    np.minimum.at(found[:, 1], row, np.degrees(np.abs(np.mod(left + np.pi, 2.0 * np.pi) - np.pi)))
    np.minimum.at(found[:, 2], row, np.mod(left, 2.0 * np.pi) / at)

    first, last = angle[:, :-1], angle[:, :-1] + turned
    row, place = np.nonzero(first * last <= 0.0)
    slope = turned[row, place]
    part = -first[row, place] / np.where(slope == 0.0, 1.0, slope)
    factor = np.exp(-(size[row, place] + part * grown[row, place]))
    np.minimum.at(found[:, 0], row, np.where(factor > 1.0, factor, np.inf))
    # At half the sampling rate L is real; chains of roots bound the gain of a neutral loop.
    ending = (L[:, -1].real < 0.0) if sampled else np.ones(len(L), dtype=bool)
    factor = np.exp(-size[:, -1])
    beyond = np.where(ending & (factor > 1.0), factor, np.inf)
    found[:, 0] = np.minimum(found[:, 0], beyond)
    return found
