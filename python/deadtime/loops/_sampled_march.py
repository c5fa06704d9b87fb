"""The first loss of stability of a sampled loop as one of its numbers varies.

The loop has as many poles outside the unit circle at p' as at p if the loop gain L on the circle
can be moved from the one to the other in straight lines without touching -1 (the argument
principle; the poles of L outside are as many at both). From a stable p the march takes steps for
which that holds at every frequency it looks at, with the part `_CLEAR` of the distance to -1 to
spare, so that it comes to the first loss of stability in steps that shrink with the distance, and
over none, however soon stability is regained. It ends in Newton's iteration for 1 + L = 0.

Between frequencies the curve is taken for known: they separate the poles and zeros of L and the
turns of the delay, and crowd where L comes near -1. That is dense, but no proof.

The size of a delay costs nothing: e^(-j m angle) turns L through m whole samples of delay in closed
form, and where abs(L) < 1 at p and p' nothing need be known of its turns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime.loops._sampled_gain import SampledLoopGain

__all__ = ["Loss", "first_loss"]

Vector = NDArray[np.float64]
Gains = Callable[[float], SampledLoopGain]

#: Part of the distance to -1 that a step leaves.
_CLEAR = 0.3

#: Part of the distance to -1 by which the way between two values may bend.
_BEND = 0.2

#: From steps as small as this part of the value on Newton's iteration is tried, and with the last
#: ones the march ends.
_NEAR, _SMALL = 1e-2, 1e-12

#: Steps after which the march gives up.
_STEPS = 3000

#: Where a step is looked at.
_LOOKS = (0.5, 1.0)

#: Newton's steps to a pole next to the circle.
_NEWTON = 6

#: Distances at which frequencies crowd around a place next to -1, as parts of the distance to it.
_CROWD = np.array([-4.0, -2.0, -1.0, -0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6, 1.0, 2.0, 4.0])


@dataclass(frozen=True)
class Loss:
    """Where stability is lost: the number, and the angle of the pole on the unit circle."""

    value: float
    angle: float


@dataclass(frozen=True, eq=False)
class _Curve:
    """L at one value, on frequencies that resolve it."""

    value: float
    warped: Vector
    points: NDArray[np.complex128]
    at_one: float

    @property
    def distance(self) -> Vector:
        return np.abs(1.0 + self.points)


def first_loss(
    gains: Gains,
    start: float,
    end: float,
    step: float,
    *,
    jumps: Callable[[float, float], Collection[float]] = lambda low, high: (),
    longest: Callable[[float], float] = lambda value: math.inf,
) -> Loss | None:
    """Search from `start`, where the loop is stable, towards `end`, which may be infinite.

    Parameters
    ----------
    gains : callable
        The loop gain at a value.
    start, end, step : float
        Where to begin and to end, and the length of the first step.
    jumps : callable
        The values in (low, high] at which L may change suddenly, next to which it is looked at.
    longest : callable
        The longest step from a value.

    Returns
    -------
    Loss or None
        None where the loop stays stable up to `end`.

    Raises
    ------
    ValueError
        If the march is not done after very many steps.
    """
    sign = math.copysign(1.0, end - start)
    here = _curve(gains, start)
    smallest = _SMALL * max(abs(start), step)
    for _ in range(_STEPS):
        if here.value == end:
            return None
        left = abs(end - here.value)
        step = min(step, longest(here.value), left)
        ahead = end if step >= left else here.value + sign * step
        there = _curve(gains, ahead)
        zero = _zero_at_one(gains, here, there)
        if zero is not None and abs(zero - here.value) <= max(smallest, _SMALL * abs(zero)):
            return Loss(zero, 0.0)
        if zero is not None:
            # Up to just before it, and then it is met.
            ahead = zero - 0.5 * sign * max(smallest, _SMALL * abs(zero))
            step, there = abs(ahead - here.value), _curve(gains, ahead)
        if _reaches(gains, here, there, jumps):
            here, step = there, 2.0 * step
            smallest = max(smallest, _SMALL * abs(here.value))
            continue
        step *= 0.4
        if step < _NEAR / _SMALL * smallest:
            found = _met(gains, here, sign, 10.0 * step, jumps)
            if found is not None:
                return found
        if step < smallest:
            return _stalled(here, gains(here.value), sign, step, jumps)
    raise ValueError(
        f"no loss of stability was met from {start:.6g} to {here.value:.6g} in {_STEPS} steps, and "
        "none beyond is ruled out: narrow the question, or look at single values with is_stable()"
    )


def _warped(angle: Vector) -> Vector:
    with np.errstate(divide="ignore"):
        return np.asarray(np.tan(0.5 * angle))


def _curve(gains: Gains, value: float) -> _Curve:
    gain = gains(value)
    angle = gain.resolved
    angle = _crowded(gain, angle, gain.at(angle))
    closed = gain.T + np.outer(gain.b, gain.c)
    at_one = float(np.linalg.det(np.eye(len(closed)) - closed))
    return _Curve(value, _warped(angle) / gain.sample_time, gain.at(angle), at_one)


def _crowded(gain: SampledLoopGain, angle: Vector, points: NDArray[np.complex128]) -> Vector:
    """More frequencies where a pole of the closed loop is near the circle."""
    distance = np.append(np.inf, np.append(np.abs(1.0 + points), np.inf))
    lowest = (distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:])
    near = np.flatnonzero(lowest & (distance[1:-1] < 1.0))
    if not near.size:
        return angle
    # Newton's iteration for 1 + L = 0, from the circle to the pole.
    turn = angle[near].astype(np.complex128)
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON):
            small = 1e-6 * np.abs(turn)
            both = gain.at(np.concatenate([turn, turn + small]))
            value, slope = 1.0 + both[: len(turn)], (both[len(turn) :] - both[: len(turn)]) / small
            move = -value / slope
            # No farther than to the neighbours by much, or it is another pole.
            turn = np.where(np.abs(move) < 0.5 * np.abs(turn), turn + move, turn)
    more = (turn.real[:, None] + np.abs(turn.imag)[:, None] * _CROWD).ravel()
    more = more[np.isfinite(more) & (more > angle[0]) & (more < angle[-1])]
    return np.unique(np.append(angle, more))


def _zero_at_one(gains: Gains, here: _Curve, there: _Curve) -> float | None:
    """A value between two at which a pole stands at z = 1."""
    from scipy.optimize import brentq

    if here.at_one * there.at_one > 0.0:
        return None
    if there.at_one == 0.0:
        return there.value

    def at_one(value: float) -> float:
        gain = gains(value)
        return float(np.linalg.det(np.eye(len(gain.b)) - gain.T - np.outer(gain.b, gain.c)))

    size = max(abs(here.value), abs(there.value))
    zero = float(brentq(at_one, here.value, there.value, xtol=1e-15 * size, rtol=1e-15))
    return 0.0 if abs(zero) < 1e-13 * size else zero


def _reaches(
    gains: Gains,
    here: _Curve,
    there: _Curve,
    jumps: Callable[[float, float], Collection[float]],
    apart: tuple[float, float] = (math.inf, math.inf),
) -> bool:
    """Whether a step keeps the number of poles outside, at its end and at what is between.

    What lies in the range `apart` of frequencies is left out.
    """
    warped = np.union1d(here.warped, there.warped)
    warped = warped[(warped < apart[0]) | (warped > apart[1])]
    start = _at(gains, here.value, warped)
    clear = np.minimum(np.abs(1.0 + start), 1.0)
    length = there.value - here.value
    seen = [_at(gains, here.value + share * length, warped) for share in _LOOKS[:-1]]
    seen.append(_at(gains, there.value, warped))
    if not all(_passes(start, points, clear) for points in seen):
        return False
    bend = np.abs(seen[0] - 0.5 * (start + seen[-1]))
    # Within the unit circle a curve may bend as it likes.
    inside = np.max(np.abs([start, *seen]), axis=0) < 1.0
    if (bend > _BEND * np.abs(1.0 + start))[~inside].any():
        return False
    low, high = sorted((here.value, there.value))
    for jump in jumps(low, high):
        for value in (math.nextafter(jump, -math.inf), jump):
            if not _passes(start, _at(gains, value, warped), clear):
                return False
    return True


def _at(gains: Gains, value: float, warped: Vector) -> NDArray[np.complex128]:
    gain = gains(value)
    return gain.at(2.0 * np.arctan(warped * gain.sample_time))


def _passes(start: NDArray[np.complex128], end: NDArray[np.complex128], clear: Vector) -> bool:
    """Whether the straight lines from `start` to `end` keep away from -1."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        way = end - start
        square = np.abs(way) ** 2
        share = np.where(square > 0.0, -np.real((1.0 + start) * np.conj(way)) / square, 0.0)
        nearest = np.abs(1.0 + start + np.clip(share, 0.0, 1.0) * way)
    inside = (np.abs(start) < 1.0) & (np.abs(end) < 1.0)
    finite = np.isfinite(nearest)
    return bool((inside | ~finite | (nearest > _CLEAR * clear)).all())


def _met(
    gains: Gains,
    here: _Curve,
    sign: float,
    far: float,
    jumps: Callable[[float, float], Collection[float]],
) -> Loss | None:
    """The loss of stability within `far` of a value, if nothing else can be lost before it."""
    angle, value = _lowest(here, gains(here.value)), here.value
    if jumps(*sorted((value, value + sign * far))):
        return None

    def missing(at: float, turn: float) -> complex:
        return complex(1.0 + gains(at).at(np.array([turn]))[0])

    small_turn, small_value = 1e-6 * angle, 1e-4 * far
    for _ in range(12):
        now = missing(value, angle)
        by_turn = (missing(value, angle - small_turn) - now) / -small_turn
        by_value = (missing(value - sign * small_value, angle) - now) / (-sign * small_value)
        jacobian = np.array([[by_value.real, by_turn.real], [by_value.imag, by_turn.imag]])
        if not np.isfinite(jacobian).all() or abs(np.linalg.det(jacobian)) == 0.0:
            return None
        change = np.linalg.solve(jacobian, [-now.real, -now.imag])
        value, angle = value + float(change[0]), min(angle + float(change[1]), math.pi)
        if not (0.0 <= sign * (value - here.value) <= far) or angle <= 0.0:
            return None
        if abs(change[0]) <= 4e-16 * abs(value):
            break
    else:
        if abs(change[0]) > 1e-12 * abs(value):
            return None
    there = _curve(gains, value)
    period = gains(value).sample_time
    width = max(20.0 * abs(value - here.value) / abs(value), 1e-3)
    highest = angle * (1.0 + width)
    apart = (
        math.tan(0.5 * angle * (1.0 - width)) / period,
        math.tan(0.5 * highest) / period if highest < math.pi else math.inf,
    )
    if width > 0.5 or not _reaches(gains, here, there, jumps, apart):
        return None
    return Loss(value, angle)


def _stalled(
    here: _Curve,
    gain: SampledLoopGain,
    sign: float,
    step: float,
    jumps: Callable[[float, float], Collection[float]],
) -> Loss:
    """What a march ends at that can go no farther: a jump next to it, or the value itself."""
    for jump in jumps(*sorted((here.value, here.value + sign * 10.0 * step))):
        return Loss(jump, _lowest(here, gain))
    return Loss(here.value, _lowest(here, gain))


def _lowest(here: _Curve, gain: SampledLoopGain) -> float:
    """The angle at which L comes next to -1."""
    lowest = int(np.argmin(here.distance))
    return float(2.0 * np.arctan(here.warped[lowest] * gain.sample_time))
