"""Estimate the delay of a control loop from a recording, with a confidence interval.

`_estimate` chooses and runs a method, `_compare` runs several, `_result` is what they return.
`methods` holds one file a method, `data` what they read from a recording, `models` what they fit,
`fit` least squares, profiles and residuals, `planning` what an experiment will tell.
"""

from deadtime.estimation._compare import Comparison, compare_methods
from deadtime.estimation._estimate import estimate_delay
from deadtime.estimation._result import CramerRaoBound, DelayEstimate, Flight
from deadtime.estimation.fit._residuals import Whiteness
from deadtime.estimation.methods._overshoot import damping_ratio
from deadtime.estimation.planning._identifiability import Identifiability, identifiability
from deadtime.estimation.planning._monte_carlo import MonteCarlo
from deadtime.estimation.planning._planned_bound import PlannedBound

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
