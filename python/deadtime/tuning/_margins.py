"""Margins of designs: those that are required, and exact ones.

The search takes the delay margin of a sampled loop from the turns at its gain crossovers. That
leaves out that the hold's share of a delay changes with it. What a design promises is exact: where
that is less than required, the search is repeated with the requirement raised by what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, positive
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._problem import Problem

#: Names of the margins, in the order of every array of them, and their units.
MARGINS = ("gain_margin", "phase_margin", "delay_margin")
UNITS = {"gain_margin": "", "phase_margin": "°", "delay_margin": " s"}


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
                f"gain_margin={required.gain_margin}: give a factor above 1, such as 2 for 6 dB"
            )
        if required.phase_margin >= 180.0:
            raise ValueError(
                f"phase_margin={required.phase_margin}: give an angle below 180 degrees"
            )
        return required

    @property
    def named(self) -> dict[str, float]:
        """The margins that are required, by name."""
        return {name: value for name, value in self._asdict().items() if value > 0.0}

    def without(self, name: str) -> RequiredMargins:
        """The other requirements."""
        return self._replace(**{name: 0.0})


def exact_margins(problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> Array:
    """Gain, phase and delay margin, Ms and Mt in each scenario, shape (scenarios, 5)."""
    return problem.candidates(scenarios).margins(gains.tolist(), True)


def least_margins(each: Array) -> Array:
    """Least of margins (scenarios, 3); none at all where a scenario is not stable."""
    return np.asarray(np.where(np.isnan(each), 0.0, each).min(axis=0))
