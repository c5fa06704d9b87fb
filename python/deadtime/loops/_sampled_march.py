"""The first loss of stability of a sampled loop as one of its numbers varies.

The loop has as many poles outside the unit circle at p' as at p if the loop gain L on the circle
can be moved from the one to the other in straight lines without touching -1 (the argument
principle; L has equally many poles outside at both). From a stable p the march takes steps for
which this holds at every evaluated frequency, keeping at least the fraction `_CLEAR` of the
distance to -1. The steps shrink with this distance, so that the march converges to the first loss
of stability and does not step over one, even if stability is regained soon after. It ends with
Newton's iteration for 1 + L = 0.

Between the evaluated frequencies the curve is not checked: they separate the poles and zeros of L
and the turns of the delay, and are denser where L is close to -1. This is no proof.

A long delay costs no more than a short one: e^(-j m angle) gives the effect of m whole samples of
delay on L in closed form, and where abs(L) < 1 at p and p' its turns need not be resolved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array, Complex
from deadtime.loops._sampled_gain import SampledLoopGain

Gains = Callable[[float], SampledLoopGain]

#: Fraction of the distance to -1 that a step must keep: a larger one makes shorter, safer steps.
_CLEAR = 0.3

#: Largest deviation of the path of L from a straight line, as a fraction of the distance to -1: a
#: smaller one makes shorter, safer steps.
_BEND = 0.2

#: Factors on the step after one that is accepted, and after one that is not.
_LONGER, _SHORTER = 2.0, 0.4

#: Step, relative to the value, below which Newton's iteration is tried: a larger one tries it
#: earlier, when it fails more often; and the step at which the march ends, its resolution.
_NEAR, _SMALL = 1e-2, 1e-12

#: Distance within which a loss of stability is expected after a step was refused, in steps.
_FAR = 10.0

#: Upper limit on the number of steps (bounds the time).
_STEPS = 3000

#: Number of Newton's steps towards a pole close to the circle, and their largest length relative to
#: the angle: a longer one could lead to another pole.
_NEWTON = 6
_LARGEST_MOVE = 0.5

#: Offsets of the additional frequencies around one at which L is close to -1, in units of the
#: distance of the pole from the circle: more resolve the curve better and take longer.
_OFFSETS = np.array([-4.0, -2.0, -1.0, -0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6, 1.0, 2.0, 4.0])

#: Newton's iteration for the loss of stability: upper limit on its steps; difference steps in the
#: angle, relative to it, and in the value, relative to the expected distance; relative change of
#: the value at which it ends, and the one that is accepted after the last step.
_NEWTON_TO_LOSS = 12
_ANGLE_STEP, _VALUE_STEP = 1e-6, 1e-4
_CONVERGED, _ACCEPTED = 4e-16, 1e-12

#: Range of angles around the loss that the final check leaves out, because L reaches -1 there:
#: relative half width per relative change of the value, its smallest value, and the largest, above
#: which the result is not accepted.
_LEFT_OUT, _LEAST_LEFT_OUT, _MOST_LEFT_OUT = 20.0, 1e-3, 0.5

#: Relative tolerances for a value at which a pole is at z = 1: of the search, and of a zero value.
_ZERO_TOLERANCE, _ZERO_VALUE = 1e-15, 1e-13


@dataclass(frozen=True)
class Loss:
    """Loss of stability: the value of the number, and the angle of the pole on the unit circle."""

    value: float
    angle: float


@dataclass(frozen=True, eq=False)
class _Curve:
    """L for one value of the number, at frequencies that resolve it."""

    value: float
    warped: Array
    points: Complex
    at_one: float

    @property
    def distance(self) -> Array:
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
        First and last value, and the length of the first step.
    jumps : callable
        The values in (low, high] at which L may be discontinuous; L is checked on both sides.
    longest : callable
        The longest step from a value.

    Returns
    -------
    Loss or None
        None if the loop stays stable up to `end`.

    Raises
    ------
    ValueError
        If the march has not ended after `_STEPS` steps.
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
            # Step to just before the zero; the next step ends at it.
            ahead = zero - 0.5 * sign * max(smallest, _SMALL * abs(zero))
            step, there = abs(ahead - here.value), _curve(gains, ahead)
        if _keeps_count(gains, here, there, jumps):
            here, step = there, _LONGER * step
            smallest = max(smallest, _SMALL * abs(here.value))
            continue
        step *= _SHORTER
        if step < _NEAR / _SMALL * smallest:
            found = _newton_loss(gains, here, sign, _FAR * step, jumps)
            if found is not None:
                return found
        if step < smallest:
            return _loss_at(here, gains(here.value), sign, step, jumps)
    raise ValueError(
        f"no loss of stability was met from {start:.6g} to {here.value:.6g} in {_STEPS} steps, and "
        "none beyond is ruled out: narrow the question, or look at single values with is_stable()"
    )


def _warped(angle: Array) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(np.tan(0.5 * angle))


def _curve(gains: Gains, value: float) -> _Curve:
    gain = gains(value)
    angle = gain.resolved
    angle = _refined(gain, angle, gain.at(angle))
    closed = gain.T + np.outer(gain.b, gain.c)
    at_one = float(np.linalg.det(np.eye(len(closed)) - closed))
    return _Curve(value, _warped(angle) / gain.sample_time, gain.at(angle), at_one)


def _refined(gain: SampledLoopGain, angle: Array, points: Complex) -> Array:
    """Add angles where a pole of the closed loop is close to the circle."""
    distance = np.append(np.inf, np.append(np.abs(1.0 + points), np.inf))
    lowest = (distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:])
    near = np.flatnonzero(lowest & (distance[1:-1] < 1.0))
    if not near.size:
        return angle
    # Newton's iteration for 1 + L = 0, from the circle to the pole.
    turn = angle[near].astype(np.complex128)
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON):
            small = _ANGLE_STEP * np.abs(turn)
            both = gain.at(np.concatenate([turn, turn + small]))
            value, slope = 1.0 + both[: len(turn)], (both[len(turn) :] - both[: len(turn)]) / small
            move = -value / slope
            turn = np.where(np.abs(move) < _LARGEST_MOVE * np.abs(turn), turn + move, turn)
    more = (turn.real[:, None] + np.abs(turn.imag)[:, None] * _OFFSETS).ravel()
    more = more[np.isfinite(more) & (more > angle[0]) & (more < angle[-1])]
    return np.unique(np.append(angle, more))


def _zero_at_one(gains: Gains, here: _Curve, there: _Curve) -> float | None:
    """A value between those of two curves at which a pole is at z = 1; None if there is none."""
    from scipy.optimize import brentq

    if here.at_one * there.at_one > 0.0:
        return None
    if there.at_one == 0.0:
        return there.value

    def at_one(value: float) -> float:
        gain = gains(value)
        return float(np.linalg.det(np.eye(len(gain.b)) - gain.T - np.outer(gain.b, gain.c)))

    size = max(abs(here.value), abs(there.value))
    tolerance = _ZERO_TOLERANCE
    zero = float(brentq(at_one, here.value, there.value, xtol=tolerance * size, rtol=tolerance))
    return 0.0 if abs(zero) < _ZERO_VALUE * size else zero


def _keeps_count(
    gains: Gains,
    here: _Curve,
    there: _Curve,
    jumps: Callable[[float, float], Collection[float]],
    left_out: tuple[float, float] = (math.inf, math.inf),
) -> bool:
    """Whether the number of poles outside the circle stays the same over a step, at jumps too.

    Frequencies in the range `left_out` are left out.
    """
    warped = np.union1d(here.warped, there.warped)
    warped = warped[(warped < left_out[0]) | (warped > left_out[1])]
    start = _at(gains, here.value, warped)
    clear = np.minimum(np.abs(1.0 + start), 1.0)
    length = there.value - here.value
    middle = _at(gains, here.value + 0.5 * length, warped)
    end = _at(gains, there.value, warped)
    if not (_passes(start, middle, clear) and _passes(start, end, clear)):
        return False
    bend = np.abs(middle - 0.5 * (start + end))
    # While abs(L) < 1, L cannot reach -1, whatever its path is.
    inside = np.max(np.abs([start, middle, end]), axis=0) < 1.0
    if (bend > _BEND * np.abs(1.0 + start))[~inside].any():
        return False
    low, high = sorted((here.value, there.value))
    for jump in jumps(low, high):
        for value in (math.nextafter(jump, -math.inf), jump):
            if not _passes(start, _at(gains, value, warped), clear):
                return False
    return True


def _at(gains: Gains, value: float, warped: Array) -> Complex:
    gain = gains(value)
    return gain.at(2.0 * np.arctan(warped * gain.sample_time))


def _passes(start: Complex, end: Complex, clear: Array) -> bool:
    """Whether the straight lines from `start` to `end` keep the distance `_CLEAR` to -1."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        way = end - start
        square = np.abs(way) ** 2
        share = np.where(square > 0.0, -np.real((1.0 + start) * np.conj(way)) / square, 0.0)
        nearest = np.abs(1.0 + start + np.clip(share, 0.0, 1.0) * way)
    inside = (np.abs(start) < 1.0) & (np.abs(end) < 1.0)
    finite = np.isfinite(nearest)
    return bool((inside | ~finite | (nearest > _CLEAR * clear)).all())


def _newton_loss(
    gains: Gains,
    here: _Curve,
    sign: float,
    far: float,
    jumps: Callable[[float, float], Collection[float]],
) -> Loss | None:
    """A loss of stability within `far` of a value, if stability is not lost before it; else None.

    By Newton's iteration for 1 + L = 0 in the value and the angle.
    """
    angle, value = _lowest(here, gains(here.value)), here.value
    if jumps(*sorted((value, value + sign * far))):
        return None

    def residual(at: float, turn: float) -> complex:
        return complex(1.0 + gains(at).at(np.array([turn]))[0])

    small_turn, small_value = _ANGLE_STEP * angle, _VALUE_STEP * far
    for _ in range(_NEWTON_TO_LOSS):
        now = residual(value, angle)
        by_turn = (residual(value, angle - small_turn) - now) / -small_turn
        by_value = (residual(value - sign * small_value, angle) - now) / (-sign * small_value)
        jacobian = np.array([[by_value.real, by_turn.real], [by_value.imag, by_turn.imag]])
        if not np.isfinite(jacobian).all() or abs(np.linalg.det(jacobian)) == 0.0:
            return None
        change = np.linalg.solve(jacobian, [-now.real, -now.imag])
        value, angle = value + float(change[0]), min(angle + float(change[1]), math.pi)
        if not (0.0 <= sign * (value - here.value) <= far) or angle <= 0.0:
            return None
        if abs(change[0]) <= _CONVERGED * abs(value):
            break
    else:
        if abs(change[0]) > _ACCEPTED * abs(value):
            return None
    there = _curve(gains, value)
    period = gains(value).sample_time
    width = max(_LEFT_OUT * abs(value - here.value) / abs(value), _LEAST_LEFT_OUT)
    highest = angle * (1.0 + width)
    left_out = (
        math.tan(0.5 * angle * (1.0 - width)) / period,
        math.tan(0.5 * highest) / period if highest < math.pi else math.inf,
    )
    if width > _MOST_LEFT_OUT or not _keeps_count(gains, here, there, jumps, left_out):
        return None
    return Loss(value, angle)


def _loss_at(
    here: _Curve,
    gain: SampledLoopGain,
    sign: float,
    step: float,
    jumps: Callable[[float, float], Collection[float]],
) -> Loss:
    """The loss of stability where no step is possible: at a jump close by, else at the value."""
    for jump in jumps(*sorted((here.value, here.value + sign * _FAR * step))):
        return Loss(jump, _lowest(here, gain))
    return Loss(here.value, _lowest(here, gain))


def _lowest(here: _Curve, gain: SampledLoopGain) -> float:
    """The angle at which L is closest to -1."""
    lowest = int(np.argmin(here.distance))
    return float(2.0 * np.arctan(here.warped[lowest] * gain.sample_time))
