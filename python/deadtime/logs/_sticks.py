"""The setpoint of a rate, from the sticks, in Blackbox logs that do not hold it.

Betaflight before 4.0 and Cleanflight log the sticks, rcCommand c, and the gyroscope g. Since
Betaflight 3.0 and Cleanflight 2.0 the head holds what makes a rate of c in deg/s
(`calculateSetpointRate` in betaflight `src/main/fc/fc_rc.c`, in 3.0 and 3.1 `src/main/fc/mw.c`):
with u = c/500, expo e, super rate s and rate r, of which the part above 2 counts 15.54 times,

    setpoint = 200 r u (e |u|^3 + 1 - e) / clip(1 - s |u|, 0.01, 1),   at most 1998 deg/s.

Firmware before that makes a rate b c, with a b for each of its controllers, and no b is in the head
(`src/main/flight/pid.c` of cleanflight). There b follows from the controller's own term,
P = k (b c - g), by least squares over the rows in which P is not at its limit. It is taken where
that holds to rounding, which it does not where sticks set angles or the rate is a curve of c.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from deadtime._base.arrays import Array

#: Largest setpoint of a rate, deg/s, where the head has none: SETPOINT_RATE_LIMIT.
LIMIT = 1998.0

#: rcCommand of a stick at its end.
FULL = 500.0

#: A rate above this counts `STEEPER` times more.
STEEP, STEEPER = 2.0, 14.54

#: Most of a super rate that is taken off 1, so that the quotient stays finite.
STEEPEST = 0.01

#: Largest variance of P that stick and gyroscope leave unexplained, as a share of the part of the
#: stick; and the standard deviation of its rounding, in its own unit, where that part is small.
UNEXPLAINED, ROUNDING = 1e-3, 1.0

#: Fewest rows to fit, and the share of the largest |P| from which it may be at its limit.
FEWEST, AT_LIMIT = 100, 0.98


def is_successor(firmware: str) -> bool:
    """Whether it is Betaflight since 3.0 or Cleanflight since 2.0, which have one controller."""
    found = re.match(r"(Betaflight|Cleanflight) (\d{1,4})\.", firmware, re.IGNORECASE)
    return found is not None and int(found[2]) >= (3 if found[1].lower() == "betaflight" else 2)


def has_rates(firmware: str, parameters: Mapping[str, float]) -> bool:
    """Whether the head holds the curves, and the firmware is one that has them."""
    if not is_successor(firmware) or parameters.get("rates_type"):  # another curve, since 4.0
        return False
    names = (f"{name}[{k}]" for name in ("rc_rates", "rc_expo", "rates") for k in range(3))
    return all(name in parameters for name in names)


def curve_of_head(parameters: Mapping[str, float], axis: int) -> Callable[[Array], Array]:
    """What makes a rate, deg/s, of rcCommand by the numbers of the head."""
    rate, expo, steep = (
        parameters[f"{name}[{axis}]"] / 100.0 for name in ("rc_rates", "rc_expo", "rates")
    )
    limit = parameters.get(f"rate_limits[{axis}]", LIMIT)
    rate += STEEPER * max(rate - STEEP, 0.0)

    def setpoint(sticks: Array) -> Array:
        u = sticks / FULL
        size = np.abs(u)
        bent = u * (expo * size**3 + 1.0 - expo)
        rates = 200.0 * rate * bent / np.clip(1.0 - steep * size, STEEPEST, 1.0)
        return np.clip(rates, -limit, limit)

    return setpoint


def setpoint_of_controller(sticks: Array, gyro: Array, proportional: Array) -> Array:
    """The setpoint that the term P was made of; NaN where stick and rate do not explain it."""
    unknown = np.full_like(sticks, np.nan)
    free = np.abs(proportional) < AT_LIMIT * np.max(np.abs(proportional), initial=0.0)
    if np.count_nonzero(free) < FEWEST:
        return unknown
    rows = np.column_stack([sticks, gyro])[free]
    (slope, against), _, rank, _ = np.linalg.lstsq(rows, proportional[free], rcond=None)
    if rank < 2 or against >= 0.0:
        return unknown
    rest = proportional[free] - rows @ (slope, against)
    explained = np.var(slope * rows[:, 0])
    if np.var(rest) > UNEXPLAINED * explained + ROUNDING**2:
        return unknown
    return np.asarray(-slope / against * sticks)
