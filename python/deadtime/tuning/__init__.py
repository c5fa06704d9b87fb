"""Choose the gains of a loop whose delay is known up to an interval.

`design` looks for gains that are best in the worst case over delay and gain of the plant and keep
their margins there, and `design_filter` chooses the filter of the derivative. `rules` has the gains
by rules of thumb beside them, and `check_gains` is the gate before gains are set in a machine.
`adaptive_gains` makes a list of gains for a delay that moves, with a proof. `settings_of` writes
gains in the forms that people type in, `controller_of` reads them. `tune` goes from a recording to
such gains.
"""

# The files. `_problem` holds what is free and what is not known, `_region` the region of an
# estimate, `_stabilising` where to look for gains, `_objectives` what is made best, `_margins` what
# must hold. `_candidates` hands loops to the kernel. `_survey` maps the gains, `_exchange` has the
# best of them found by the kernel, with the scenarios in which they are worst, and `_made` puts the
# result together. `_responses` designs by responses under the demands of
# `_demands`, in one call of the kernel; `_rules` is the table of rules and `_gate` the gate.
# `_filter_choice` chooses the filter of the derivative.

from deadtime.tuning._design import design
from deadtime.tuning._filter_choice import design_filter
from deadtime.tuning._gate import Gate, check_gains
from deadtime.tuning._live import live_design as live_design
from deadtime.tuning._region import ConfidenceRegion
from deadtime.tuning._result import Design, FilterChoice, LeastMargins, Trade
from deadtime.tuning._rules import RuleFigures, RuleTable, rules
from deadtime.tuning._stabilising import critical_gain
from deadtime.tuning.adaptive import (
    Choice,
    GainFollower,
    GainSchedule,
    GainSet,
    SwitchingProof,
    adaptive_gains,
)
from deadtime.tuning.forms import (
    LOOPS_OF_FORMS as LOOPS_OF_FORMS,
    Form as Form,
    IdealForm,
    ParallelForm,
    SeriesForm,
    Settings,
    controller_of,
    one_pole_filter,
    proportional_band,
    settings_of,
)
from deadtime.tuning.proposal import Prediction, Proposal, tune

__all__ = [
    "Choice",
    "ConfidenceRegion",
    "Design",
    "FilterChoice",
    "GainFollower",
    "GainSchedule",
    "GainSet",
    "Gate",
    "IdealForm",
    "LeastMargins",
    "ParallelForm",
    "Prediction",
    "Proposal",
    "RuleFigures",
    "RuleTable",
    "SeriesForm",
    "Settings",
    "SwitchingProof",
    "Trade",
    "adaptive_gains",
    "check_gains",
    "controller_of",
    "critical_gain",
    "design",
    "design_filter",
    "one_pole_filter",
    "proportional_band",
    "rules",
    "settings_of",
    "tune",
]
