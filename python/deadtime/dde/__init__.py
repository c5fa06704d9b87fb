"""Delay differential equations with the user's own right-hand side, constant delays and events.

`solve_dde` takes the right-hand side, the history and the delays; what it returns has the names of
`scipy.integrate.solve_ivp`.
"""

# The files. `_solve` is `solve_dde`, `_solution` its results, `_compiled` accepts functions
# compiled by numba.

from deadtime.dde._solution import DelayResult, DelaySolution
from deadtime.dde._solve import solve_dde

__all__ = ["DelayResult", "DelaySolution", "solve_dde"]
