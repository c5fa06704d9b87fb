"""The margins that a design must have, and the exact ones that a loop has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from deadtime._base.validation import finite, positive
from deadtime.tuning._problem import Problem, Scenario, Vector

__all__ = ["MARGINS", "UNITS", "RequiredMargins", "exact_margins"]

#: Names of the margins, in the order of every array of them, and their units.
MARGINS = ("gain_margin", "phase_margin", "delay_margin")
UNITS = {"gain_margin": "", "phase_margin": "°", "delay_margin": " s"}

#: What is added to a requirement, as a multiple of what the exact margins miss of it.
_RAISED = 1.1


@dataclass(frozen=True)
class RequiredMargins:
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
        return {
            name: value for name, value in zip(MARGINS, astuple(self), strict=True) if value > 0.0
        }

    @property
    def vector(self) -> Vector:
        return np.array(astuple(self))

    def without(self, name: str) -> RequiredMargins:
        """The other requirements."""
        return replace(self, **{name: 0.0})

    def scaled(self, factor: float) -> RequiredMargins:
        """All requirements multiplied by a factor."""
        return RequiredMargins(*(factor * self.vector).tolist())

    def raised(self, missing: Vector) -> RequiredMargins:
        """Each requirement raised by what is missing, and a little more."""
        return RequiredMargins(*(self.vector + _RAISED * missing).tolist())

    def shortfall(self, margins: Vector) -> Vector:
        """Sum of the relative shortfalls of margins (..., 3); 1 for a margin that is NaN."""
        required = self.vector
        with np.errstate(divide="ignore", invalid="ignore"):
            missing = np.where(required > 0.0, 1.0 - margins / required, 0.0)
        missing = np.where(np.isnan(missing), 1.0, missing)
        return np.asarray(np.maximum(missing, 0.0).sum(axis=-1))


def exact_margins(problem: Problem, gains: Vector, scenarios: Sequence[Scenario]) -> Vector:
    """Gain, phase and delay margin in each scenario, shape (scenarios, 3)."""
    found = [problem.at(gains, one).margin() for one in scenarios]
    return np.array([[getattr(one, name) for name in MARGINS] for one in found])
