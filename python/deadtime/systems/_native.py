"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    LinearSystem as LinearSystem,
    Margins as Margins,
    Signal as Signal,
    first_duration as first_duration,
    fitted_series as fitted_series,
    hinf_norm as hinf_norm,
    loop_margins as loop_margins,
    ratio as ratio,
)
