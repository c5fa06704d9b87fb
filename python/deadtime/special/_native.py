"""The native functions and classes that this package uses."""

from deadtime import _deadtime as module
from deadtime._deadtime import (
    dde_roots,
    lambertw,
    lambertw0,
    lambertw0_number,
    lambertw_derivative,
    lambertw_log,
    lambertw_number,
    lambertw_offset,
    lambertwm1,
    lambertwm1_number,
    limit_threads,
    wrightomega,
)

__all__ = [
    "dde_roots",
    "lambertw",
    "lambertw0",
    "lambertw0_number",
    "lambertw_derivative",
    "lambertw_log",
    "lambertw_number",
    "lambertw_offset",
    "lambertwm1",
    "lambertwm1_number",
    "limit_threads",
    "module",
    "wrightomega",
]
