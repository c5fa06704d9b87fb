"""The joint confidence region of an estimate, as the scenarios of a design.

The region of the level p is the ellipsoid

    (x - x0)' C^-1 (x - x0) <= chi2_n(p)

of the n fitted numbers x of the plant around their estimates x0. C has the correlations of the
covariance of the estimate. Its standard errors are the wider half of each interval of the level p,
over the quantile of the normal distribution: a profile interval may be wider than the covariance
says. Where delay and lag are both fitted, their sum takes the place of the delay in x, because it
is much better known than either, which errors in two separate widths would hide.

The ellipsoid is represented by points around it whose convex hull holds it, so that a margin that
is linear in x and large enough at the points is so in all of the ellipsoid. Times below zero become
zero, and the sum of delay and lag is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import Range
from deadtime._base.verdicts import Verdict
from deadtime.estimation import DelayEstimate

#: Numbers of the plant that a design can take as not known.
NUMBERS = ("delay", "gain", "lag", "time_constant")

#: Points around the ellipsoid for one, two and three numbers, and for points at distance one the
#: least distance of the faces of their convex hull from the centre.
_POINTS = {1: 2, 2: 16, 3: 64}
_INSIDE = {1: 1.0, 2: math.cos(math.pi / 16.0), 3: 0.942}

#: Least time constant, as a part of the estimate: one of zero is no plant of first order.
_LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class ConfidenceRegion(ReadOnlyArrays):
    """Where the delay, gain and lag of a loop lie together, by an estimate.

    Attributes
    ----------
    level : float
        Probability that it holds the true numbers, if the model of the estimate is right.
    verdict : {"reliable", "indication"}
        That on the estimate: of an indication the probability is not known.
    estimate : dict of str to float
        The centre: the estimated numbers.
    extremes, points : tuple of dict of str to float
        Points at which one number has its largest or smallest value, and points all around.
    """

    level: float
    verdict: Verdict
    estimate: dict[str, float]
    extremes: tuple[dict[str, float], ...]
    points: tuple[dict[str, float], ...]

    @property
    def intervals(self) -> dict[str, Range]:
        """Smallest and largest value of each number."""
        return {
            name: (min(case[name] for case in self.points), max(case[name] for case in self.points))
            for name in self.estimate
        }


def region_of(fit: DelayEstimate, level: float, allow_indication: bool) -> ConfidenceRegion:
    """The joint region of an estimate, refused where its level would say nothing."""
    from scipy import special

    if not fit.calibrated:
        raise ValueError(f"the estimate has no confidence region: {fit.uncalibrated}")
    if fit.verdict != "reliable" and not allow_indication:
        raise ValueError(
            f"the estimate is only an indication ({fit.reason}), so the margins of a design "
            "based on this estimate are not known. Fit a model that is reliable, or give "
            "allow_indication=True for gains without known margins"
        )
    names = [name for name in fit.free if name in NUMBERS]
    known = {name: fit.loop.parameters[name] for name in ("delay", *names)}
    if not names:
        raise ValueError(
            f"the estimate has fitted {', '.join(fit.free)}, which is not a parameter of the plant"
        )
    sums = _sums(names)
    labels = [_label(names, row) for row in sums]
    centre = sums @ [known[name] for name in names]
    spread = _spread(fit, names, sums, labels, centre, level)
    radius = math.sqrt(special.chdtri(len(names), 1.0 - level))

    def scenario(offset: Array) -> dict[str, float]:
        moved = np.linalg.solve(sums, centre + offset)
        return known | _feasible(dict(zip(names, moved.tolist(), strict=True)), known)

    # Every number, and the delay beside its sum with the lag.
    ways = np.unique(np.vstack([np.eye(len(names)), np.linalg.inv(sums)]), axis=0)
    tangents = [spread @ _unit(spread.T @ way) for way in ways]
    around = _directions(len(names)) @ spread.T / _INSIDE[len(names)]
    region = ConfidenceRegion(
        level=level,
        verdict=fit.verdict,
        estimate=known,
        extremes=tuple(scenario(sign * radius * axis) for axis in tangents for sign in (-1.0, 1.0)),
        points=(known, *(scenario(radius * axis) for axis in around)),
    )
    low, high = region.intervals.get("gain", (1.0, 1.0))
    if low * high <= 0.0:
        raise ValueError(
            f"the gain may be zero, because its interval is {low:.3g} to {high:.3g}, and a loop "
            "without gain has no design. Record a step with less noise, or a larger step"
        )
    return region


def _sums(names: list[str]) -> Array:
    """Rows of the numbers x: the names, with the sum in the place of the delay beside a lag."""
    rows = np.eye(len(names))
    slow = [name for name in ("lag", "time_constant") if name in names]
    if slow and "delay" in names:
        rows[names.index("delay"), names.index(slow[0])] = 1.0
    return rows


def _label(names: list[str], row: Array) -> str:
    """The name of a number or of a sum, as an estimate has it."""
    used = [name for name, part in zip(names, row, strict=True) if part]
    return "+".join(sorted(used))  # delay, then lag or time_constant


def _spread(
    fit: DelayEstimate,
    names: list[str],
    sums: Array,
    labels: list[str],
    centre: Array,
    level: float,
) -> Array:
    """A square root of C."""
    from scipy import special

    place = [fit.free.index(name) for name in names]
    cov = sums @ fit.cov[np.ix_(place, place)] @ sums.T
    quantile = float(special.ndtri(0.5 + level / 2.0))
    errors = []
    for label, value in zip(labels, centre, strict=True):
        low, high = fit.ci(level, label)
        if not math.isfinite(low + high):
            raise ValueError(
                f"the interval of {label} has an open end, {low:g} to {high:g}: fix this parameter"
            )
        errors.append(max(high - value, value - low) / quantile)
    deviations = np.sqrt(np.diag(cov))
    deviations[deviations == 0.0] = np.inf  # at its bound: no correlations
    correlation = cov / np.outer(deviations, deviations)
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(np.array(errors)[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _feasible(moved: dict[str, float], known: dict[str, float]) -> dict[str, float]:
    """Times of zero or more, with the same sum of delay and lag where that is not below zero."""
    for slow in ("lag", "time_constant"):
        if slow in moved:
            least = _LEAST * known[slow] if slow == "time_constant" else 0.0
            total = max(moved.get("delay", 0.0) + moved[slow], 0.0)
            moved[slow] = max(moved[slow], least)
            if "delay" in moved:
                moved[slow] = max(min(moved[slow], total), least)
                moved["delay"] = total - moved[slow]
    if "delay" in moved:
        moved["delay"] = max(moved["delay"], 0.0)
    return moved


def _unit(way: Array) -> Array:
    size = float(np.linalg.norm(way))
    return way / size if size else way


def _directions(count: int) -> Array:
    """Unit vectors all around, shape (n, count): even on a circle, a spiral on a sphere."""
    points = _POINTS[count]
    if count == 1:
        return np.array([[-1.0], [1.0]])
    place = np.arange(points)
    if count == 2:
        angle = 2.0 * np.pi * place / points
        return np.column_stack([np.cos(angle), np.sin(angle)])
    height = 1.0 - (2.0 * place + 1.0) / points
    turn = np.pi * (1.0 + math.sqrt(5.0)) * place
    circle = np.sqrt(1.0 - height**2)
    return np.column_stack([circle * np.cos(turn), circle * np.sin(turn), height])
