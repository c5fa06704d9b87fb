"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    LinearSystem,
    Margins,
    Signal,
    legendre_tables,
    loop_margins,
    ratio,
)

__all__ = [
    "LinearSystem",
    "Margins",
    "Signal",
    "legendre_tables",
    "loop_margins",
    "ratio",
]
