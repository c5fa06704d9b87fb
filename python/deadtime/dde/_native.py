"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    DelayPieces as DelayPieces,
    DelayRun as DelayRun,
    solve_dde as solve_dde,
)
