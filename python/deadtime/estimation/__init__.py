"""Estimate the delay of a control loop from a recording, with a confidence interval.

`estimate_delay` chooses and runs a method, `compare_methods` runs several, and `choose_plant`
tries several plants. `identifiability` says before an experiment what it will tell.
`shared_number` combines estimates of one number. `OnlineEstimator` follows the delay row by row
while the loop runs. Each method is a class that holds its options.
"""

# `_estimate` chooses and runs a method, `_compare` runs several, and `_choose` tries several
# plants. `_result` is what they return, `_felt` what a loop feels of it, and `_plots` draws it.
# `_shared` combines several. `evidence` finds the plant of a recording without a loop. `methods`
# holds the methods, and `data` what they read from a recording. `_least_squares` has models,
# profiles and residuals, and `_plant` has plant and noise as the kernel takes them. `planning` has
# the bounds of planned experiments, and `running` what is estimated while a loop runs.

from deadtime.estimation._choose import (
    PLANT_COLUMNS as PLANT_COLUMNS,
    PlantChoice,
    choose_plant,
    likeliest as likeliest,
)
from deadtime.estimation._compare import (
    COLUMNS as COLUMNS,
    Comparison,
    MethodDifference,
    compare_methods,
    truth_row as truth_row,
)
from deadtime.estimation._estimate import (
    JOINT as JOINT,
    METHODS as METHODS,
    automatic_method as automatic_method,
    estimate_delay,
)
from deadtime.estimation._least_squares import Whiteness
from deadtime.estimation._plots import (
    estimate_axes as estimate_axes,
    plot_estimate as plot_estimate,
    plot_fits as plot_fits,
)
from deadtime.estimation._result import CramerRaoBound, DelayEstimate, FittedRun
from deadtime.estimation._shared import SharedNumber, shared_number
from deadtime.estimation.evidence._estimate import Advice, PlantEstimate
from deadtime.estimation.evidence._find import refit as refit
from deadtime.estimation.evidence._found import Cause, PlantCandidate, SensorFault
from deadtime.estimation.evidence._numbers import FittedRecording, LoopView
from deadtime.estimation.evidence._question import PLANTS as PLANTS
from deadtime.estimation.methods._flight_conclusion import unseen_in_words as unseen_in_words
from deadtime.estimation.methods._frequency import Frequency
from deadtime.estimation.methods._input_output import GCC, ARXScan
from deadtime.estimation.methods._method import Method
from deadtime.estimation.methods._oscillation import Decrement, Relay
from deadtime.estimation.methods._output_error import OutputError
from deadtime.estimation.methods._step_response import (
    Decay,
    Graphical,
    Overshoot,
    OvershootMap as OvershootMap,
    damping_ratio,
    dominant_x as dominant_x,
    exact_x as exact_x,
)
from deadtime.estimation.methods._waveform import CTA, Grid, NoisePath as NoisePath, Waveform
from deadtime.estimation.planning._identifiability import Identifiability, identifiability
from deadtime.estimation.planning._monte_carlo import MonteCarlo
from deadtime.estimation.planning._planned_bound import PlannedBound
from deadtime.estimation.running._bank import OnlineEstimate
from deadtime.estimation.running._estimator import OnlineEstimator
from deadtime.estimation.running._track import DelayTrack, online

__all__ = [
    "CTA",
    "GCC",
    "ARXScan",
    "Advice",
    "Cause",
    "Comparison",
    "CramerRaoBound",
    "Decay",
    "Decrement",
    "DelayEstimate",
    "DelayTrack",
    "FittedRecording",
    "FittedRun",
    "Frequency",
    "Graphical",
    "Grid",
    "Identifiability",
    "LoopView",
    "Method",
    "MethodDifference",
    "MonteCarlo",
    "OnlineEstimate",
    "OnlineEstimator",
    "OutputError",
    "Overshoot",
    "PlannedBound",
    "PlantCandidate",
    "PlantChoice",
    "PlantEstimate",
    "Relay",
    "SensorFault",
    "SharedNumber",
    "Waveform",
    "Whiteness",
    "choose_plant",
    "compare_methods",
    "damping_ratio",
    "estimate_delay",
    "identifiability",
    "online",
    "shared_number",
]
