"""The native functions and classes that this package uses."""

from deadtime import _deadtime as _deadtime
from deadtime._deadtime import (
    dde_roots as dde_roots,
    lambertw as lambertw,
    lambertw0 as lambertw0,
    lambertw0_number as lambertw0_number,
    lambertw_derivative as lambertw_derivative,
    lambertw_log as lambertw_log,
    lambertw_number as lambertw_number,
    lambertw_offset as lambertw_offset,
    lambertwm1 as lambertwm1,
    lambertwm1_number as lambertwm1_number,
    limit_threads as limit_threads,
    wrightomega as wrightomega,
)
