"""Delay differential equations with the user's own right-hand side, constant delays and events.

`_solve` is `solve_dde`, `_solution` its results, `_compiled` accepts functions compiled by numba.
"""

from deadtime.dde._solution import DelayResult, DelaySolution
from deadtime.dde._solve import solve_dde

__all__ = ["DelayResult", "DelaySolution", "solve_dde"]
