"""Lambert W on all its branches, as NumPy ufuncs, and the forms it is used in.

`lambertw` takes every branch, `lambertw0` and `lambertwm1` are the real ones. Further forms keep
their digits where W itself cannot: of the logarithm of the argument, next to the branch point, and
the derivative. `low_level_callable` serves compiled callers.
"""

# The files. `_lambertw` holds the function and its C pointers for compiled callers, `_forms` its
# derivative, logarithm and offset forms, `_ufunc` what the ufuncs share.

from deadtime.special._forms import (
    OffsetW,
    lambertw_derivative,
    lambertw_log,
    lambertw_offset,
    wrightomega,
)
from deadtime.special._lambertw import lambertw, lambertw0, lambertwm1, low_level_callable
from deadtime.special._ufunc import (
    UfuncOptions as UfuncOptions,
    apply as apply,
    branches as branches,
    finite as finite,
    foreign as foreign,
    refuse as refuse,
)

__all__ = [
    "OffsetW",
    "lambertw",
    "lambertw0",
    "lambertw_derivative",
    "lambertw_log",
    "lambertw_offset",
    "lambertwm1",
    "low_level_callable",
    "wrightomega",
]
