"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    DelayPieces,
    DelayRun,
    solve_dde,
)

__all__ = [
    "DelayPieces",
    "DelayRun",
    "solve_dde",
]
