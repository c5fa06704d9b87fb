"""Estimation of the delay of a loop from a recording of it, one file a method."""

from deadtime._estimation.compare import Comparison, compare_methods
from deadtime._estimation.estimate import estimate_delay
from deadtime._estimation.identifiability import Identifiability, identifiability
from deadtime._estimation.monte_carlo import MonteCarlo
from deadtime._estimation.overshoot import damping_ratio
from deadtime._estimation.planned_bound import PlannedBound
from deadtime._estimation.residuals import Whiteness
from deadtime._estimation.result import CramerRaoBound, DelayEstimate, Flight

__all__ = [
    "Comparison",
    "CramerRaoBound",
    "DelayEstimate",
    "Flight",
    "Identifiability",
    "MonteCarlo",
    "PlannedBound",
    "Whiteness",
    "compare_methods",
    "damping_ratio",
    "estimate_delay",
    "identifiability",
]
