"""How far gains and delays may move, all at once, without loss of stability: proved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import SupportsFloat

import deadtime.stability._native as native
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import Range, finite, positive
from deadtime.roots import HasFamily, family_of
from deadtime.stability._arguments import MOST_MOVING

#: Upper limit on the boxes of a search for a radius (bounds memory and time); what is proved until
#: then is the result.
_RADIUS_BOXES = 200_000


@dataclass(frozen=True, eq=False)
class StabilityRadius(ReadOnlyArrays):
    """How far parameters may move; made by `stability_radius`.

    Attributes
    ----------
    radius : float
        Proved: every member with each parameter within ``radius * scale`` is stable.
    upper : float
        The radius cannot exceed this: a member at this distance is not stable, or parameters
        cannot go further because a delay would be negative. Infinite if neither was met.
    witness : dict of str to float, or None
        That member.
    ranges : dict of str to (low, high)
        The proved box; delays end at 0.
    """

    radius: float
    upper: float
    witness: dict[str, float] | None
    ranges: dict[str, Range]


def stability_radius(
    family: HasFamily,
    point: Mapping[str, SupportsFloat],
    scales: Mapping[str, SupportsFloat] | None = None,
    *,
    at: Mapping[str, SupportsFloat] | None = None,
    tol: float = 1e-3,
) -> StabilityRadius:
    """How far gains and delays may move away from a point, all at once, without loss of stability.

    Parameters
    ----------
    family : ParametricQuasiPolynomial, ControlLoop, TransferFunction or DelaySystem
        What to judge, with the names that `deadtime.crossings` knows.
    point : mapping of str to float
        The parameters that move, one to three of them, and where they are: a stable point.
    scales : mapping of str to float, optional
        The unit in which each parameter moves; its modulus by default.
    at : mapping of str to float, optional
        Values of the other parameters; those of a loop have values, which these replace.
    tol : float
        Relative width of the interval from `radius` to `upper`.

    Returns
    -------
    StabilityRadius
        Every p with ``abs(p_i - point_i) <= radius * scale_i`` is proved stable, delays cut off
        at 0.

    Raises
    ------
    ValueError, TypeError
        As in `proved_boxes`; ValueError also if the point is not stable, or no parameter moves.

    Examples
    --------
    The gain and the delay of an integrator may both grow by a factor r with r**2 = pi / (2 K T):

    >>> import deadtime as dtm
    >>> K, T = dtm.parameters("K T")
    >>> found = dtm.stability_radius(dtm.s + K * dtm.delay(T), {"K": 2.0, "T": 0.36})
    >>> round(found.radius, 2), found.radius <= found.upper
    (0.48, True)
    """
    if not isinstance(point, Mapping) or not point:
        raise TypeError(f"point={point!r}: give a dict such as {{'Kp': 2.0, 'delay': 0.36}}")
    values = {name: finite(name, value) for name, value in point.items()}
    names = tuple(values)
    units = {name: abs(value) for name, value in values.items()}
    if scales is not None:
        if not isinstance(scales, Mapping):
            raise TypeError(f"scales={scales!r}: give a dict such as {{'Kp': 1.0}}")
        unknown = [name for name in scales if name not in values]
        if unknown:
            raise ValueError(
                f"scales contains {unknown[0]}, which is not a parameter of the point. Its "
                f"parameters are {', '.join(names)}"
            )
        units |= {name: positive(f"scale of {name}", scales[name]) for name in scales}
    for name, unit in units.items():
        if unit == 0.0 and name not in (scales or ()):
            raise ValueError(
                f"{name} is 0 at this point, so its size gives no scale: give "
                f"scales={{{name!r}: ...}}"
            )
    if len(names) > MOST_MOVING:
        raise ValueError(
            f"{len(names)} parameters vary, but at most {MOST_MOVING} can: give a value for the "
            "rest in at={...}"
        )
    known = family_of(family, names, at)
    found = native.stability_radius(
        known._family, values, units, tol=positive("tol", tol), max_boxes=_RADIUS_BOXES
    )
    # Parameters that a delay depends on.
    delays = {name for _, _, (_, slopes) in known._terms for name, _ in slopes}
    ranges = {}
    for name, value in values.items():
        reach = found.radius * units[name]
        # Rounded towards the point, so that no rounding leaves the proved box.
        low = min(math.nextafter(value - reach, math.inf), value)
        high = max(math.nextafter(value + reach, -math.inf), value)
        ranges[name] = (min(max(low, 0.0), value) if name in delays else low, high)
    return StabilityRadius(found.radius, found.upper, found.witness, ranges)
