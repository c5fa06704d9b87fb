"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    LinearSystem as LinearSystem,
    Margins as Margins,
    Signal as Signal,
    legendre_tables as legendre_tables,
    loop_margins as loop_margins,
    ratio as ratio,
)
