"""Control loops with a delay: plant, controller, hold and limit.

`ControlLoop` joins a plant, such as `Integrator`, and a controller, such as `PV`, and answers
questions about poles, margins and responses. `sweep` simulates many loops, `simulate_fixed_step`
imitates block diagrams that are run in fixed steps.
"""

# The files. `_control_loop` is the loop, `_plants`, `_controllers` and `_derivative_filter` are its
# parts. `_specification` checks them and hands them to the kernel; `_in_time`, `_poles` and `_gain`
# hold the questions that a loop answers, `_inputs` its loads and noise, `_load_response` the
# response to a step of one. `_held` makes maps of sampled loops, `_sweep` runs many loops,
# `_fixed_step` imitates block diagrams in fixed steps.

from deadtime._base.explorer import Explorer
from deadtime.loops._control_loop import ControlLoop
from deadtime.loops._controllers import (
    PD,
    PI,
    PID,
    PV,
    BackCalculation,
    ConditionalIntegration,
    Controller,
    P,
)
from deadtime.loops._derivative_filter import (
    PAPER_FILTER as PAPER_FILTER,
    DerivativeFilter,
    discretised as discretised,
)
from deadtime.loops._explored import explorer_of as explorer_of
from deadtime.loops._factored_plant import PAIR, FactoredPlant
from deadtime.loops._fixed_step import simulate_fixed_step
from deadtime.loops._given_plants import PlantWithDelays
from deadtime.loops._held import Question as Question, held_plane as held_plane
from deadtime.loops._load_response import LoadResponse
from deadtime.loops._model import LoopModel as LoopModel
from deadtime.loops._open_run import open_response as open_response
from deadtime.loops._parametric_plant import ParametricPlant
from deadtime.loops._plants import (
    FirstOrder,
    Integrator,
    Plant,
    RationalPlant,
    kit_plant,
    realise as realise,
    rest as rest,
    steady_lag as steady_lag,
)
from deadtime.loops._rate_limits import RateLimited
from deadtime.loops._runs import LoopRun as LoopRun
from deadtime.loops._specification import numbers_of as numbers_of
from deadtime.loops._sweep import Sweep, SweepStatus, sweep

__all__ = [
    "PAIR",
    "PD",
    "PI",
    "PID",
    "PV",
    "BackCalculation",
    "ConditionalIntegration",
    "ControlLoop",
    "Controller",
    "DerivativeFilter",
    "Explorer",
    "FactoredPlant",
    "FirstOrder",
    "Integrator",
    "LoadResponse",
    "P",
    "ParametricPlant",
    "Plant",
    "PlantWithDelays",
    "RateLimited",
    "RationalPlant",
    "Sweep",
    "SweepStatus",
    "kit_plant",
    "simulate_fixed_step",
    "sweep",
]
