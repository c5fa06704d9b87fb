"""Gains for a loop with a delay: one job a file.

`problem` says what is free and what is not known, `stabilising` where to look for it, `objectives`
what is made best, `demands` what must hold, `survey` maps the gains, `search` finds the best of
them, `worst` looks for the delay at which they are worst, and `design` goes round until it finds
none that is worse.
"""

from deadtime._design.design import design
from deadtime._design.filter_choice import FilterChoice, design_filter
from deadtime._design.result import Design, LeastMargins, Trade
from deadtime._design.stabilising import critical_gain

__all__ = [
    "Design",
    "FilterChoice",
    "LeastMargins",
    "Trade",
    "critical_gain",
    "design",
    "design_filter",
]
