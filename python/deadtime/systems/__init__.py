"""Linear systems with delays: transfer functions, systems of matrices, and their responses.

A `TransferFunction` is a ratio of quasi-polynomials, a `DelaySystem` consists of matrices for each
delay. Both have poles, margins, frequency responses and responses over time. Transfer functions are
converted from and to those of other packages.
"""

# The files. `_transfer` and `_delay_system` are the systems, made of `_parts`, `_frequency_domain`
# and `_delay_matrices`; `_poles` and `_responses` hold what both are asked; `_margins` holds the
# margins of a loop; `_interchange` converts from and to other packages; `_realisation`, `_signals`
# and `_run` simulate; `_response` is the result.

from deadtime.systems._delay_system import DelaySystem
from deadtime.systems._interchange import polynomials_of as polynomials_of
from deadtime.systems._margins import Margins, margins as margins, margins_of as margins_of
from deadtime.systems._plots import plot_bode as plot_bode, plot_responses as plot_responses
from deadtime.systems._response import (
    Response,
    response_of as response_of,
    until_settled as until_settled,
)
from deadtime.systems._transfer import TransferFunction, feedback

__all__ = ["DelaySystem", "Margins", "Response", "TransferFunction", "feedback"]
