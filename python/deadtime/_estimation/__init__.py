"""Estimation of the delay of a loop from a recording of it, one file a method."""

from deadtime._estimation.compare import Comparison, compare_methods
from deadtime._estimation.estimate import estimate_delay
from deadtime._estimation.overshoot import damping_ratio
from deadtime._estimation.residuals import Whiteness
from deadtime._estimation.result import CramerRaoBound, DelayEstimate

__all__ = [
    "Comparison",
    "CramerRaoBound",
    "DelayEstimate",
    "Whiteness",
    "compare_methods",
    "damping_ratio",
    "estimate_delay",
]
