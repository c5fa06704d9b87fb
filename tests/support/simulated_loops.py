"""Loops with loads, limits and anti-windup, simulated by collocation and by matrix exponentials.

Nothing here is shared with the package. A loop is written as its block diagram; that it is linear
in each mode is used by evaluating the diagram at unit vectors. In continuous time an element of
time is solved by Chebyshev collocation, and ends where a mode does; in a sampled loop the states go
from event to event by matrix exponentials.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev
from scipy.linalg import expm
from scipy.signal import tf2ss

#: Degree of the polynomials, and longest element of time, s.
DEGREE = 15
LONGEST = 0.1

NODES = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
TO_SERIES = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE))
#: Values at the nodes to the derivative there.
SLOPE = np.array([chebyshev.chebval(NODES, chebyshev.chebder(row)) for row in TO_SERIES.T]).T


@dataclass(frozen=True)
class Diagram:
    """A loop by the numbers of its blocks; jumps are lists of (time, value)."""

    num: tuple
    den: tuple
    Kp: float
    Ki: float = 0.0
    Kd: float = 0.0
    #: Of the filter of the derivative: omega, damping; None for the derivative of the output
    #: itself.
    smooth: tuple | None = None
    #: Weights of the reference: proportional, derivative; and its gain past the controller.
    weight: float = 1.0
    derivative_weight: float = 1.0
    feed_forward: float = 0.0
    delay: float = 0.0
    is_measured: bool = False
    sample_time: float | None = None
    low: float = -math.inf
    high: float = math.inf
    rate: float = math.inf
    #: None, a tracking time in s, or "stop".
    windup: float | str | None = None
    reference: tuple = ()
    load: tuple = ()
    output: tuple = ()
    noise: tuple = ()
    space: tuple = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        if len(self.den) == 1:
            A, B, C, D = np.zeros((0, 0)), np.zeros(0), np.zeros(0), self.num[-1] / self.den[0]
        else:
            A, B, C, D = tf2ss(self.num, self.den)
            B, C, D = B[:, 0], C[0], D[0, 0]
        object.__setattr__(self, "space", (A, B, C, float(D)))

    @property
    def size(self):
        """Plant, integral, two states of a filter, the command behind its rate limit."""
        return len(self.space[1]) + 4

    def signals(self, z, late, mode, inputs, is_on=1.0):
        """z', u, v, y and what is delayed; `late` is what arrives and its slope, inputs r, d, q, n.

        `is_on` is 1, or 0 for what is linear in z and `late` alone.
        """
        A, B, C, D = self.space
        x, (integral, smooth, slope, behind) = z[: len(B)], z[len(B) :]
        side, stops, slew = mode[:3]
        r, d, q, n = (is_on * value for value in inputs)
        (arrived, arrived_slope) = late

        def command(y, y_slope):
            u = self.Kp * (self.weight * r - y) + self.Ki * integral + self.feed_forward * r
            return u + (self.Kd * slope if self.smooth else -self.Kd * y_slope)

        def issued(u):
            if slew:
                return behind
            return u if side == 0 else is_on * (self.high if side > 0 else self.low)

        if self.is_measured:
            seen, seen_slope = arrived + n, arrived_slope
            u = command(seen, seen_slope)
            v = w = issued(u)
            y = C @ x + D * (w + d) + q
            moved = A @ x + B * (w + d)
        else:
            delayed = self.delay > 0.0
            w = arrived
            if not delayed:
                # Without a direct path the output does not wait for the command.
                u = command(C @ x + q + n, C @ (A @ x + B * d))
                if not self.smooth and mode[0] == mode[2] == 0:
                    u /= 1.0 + self.Kd * (C @ B)
                w = issued(u)
            y = C @ x + D * (w + d) + q
            moved = A @ x + B * (w + d)
            seen, seen_slope = y + n, C @ moved
            u = command(seen, seen_slope)
            v = issued(u)
        error = r - seen
        goal = self.derivative_weight * r - seen
        bent = 0.0
        if self.smooth:
            omega, damping = self.smooth
            bent = omega**2 * (goal - smooth) - 2 * damping * omega * slope
        runs = error
        if isinstance(self.windup, float) and self.Ki:
            runs = error + (v - u) / (self.windup * self.Ki)
        drift = -self.Kp * seen_slope + (self.Kd * bent if self.smooth else 0.0)
        if stops == "stops":
            runs = 0.0
        elif stops == "slides":
            runs = -drift / self.Ki
        rates = np.concatenate(
            [moved, [runs, slope, bent, slew * self.rate * is_on if slew else 0.0]]
        )
        return rates, np.array([u, v, y, v if not self.is_measured else y, self.Ki * error, drift])

    def linear(self, mode, inputs):
        """z' and signals as matrices of (z, what arrives, its slope, 1)."""
        size = self.size
        columns = []
        for i in range(size + 2):
            unit = np.zeros(size + 2)
            unit[i] = 1.0
            columns.append(self.signals(unit[:size], unit[size:], mode, inputs, 0.0))
        columns.append(self.signals(np.zeros(size), (0.0, 0.0), mode, inputs, 1.0))
        return tuple(np.array([column[part] for column in columns]).T for part in (0, 1))


def held(jumps, t, before=0.0):
    """The value that holds at t."""
    for when, value in jumps:
        if when <= t + 1e-12:
            before = value
    return before


def inputs_at(loop, t):
    return [held(jumps, t) for jumps in (loop.reference, loop.load, loop.output, loop.noise)]


def simulated(loop, times):
    """Outputs and commands at times, from rest at zero at time 0."""
    return (continuous if loop.sample_time is None else sampled)(loop, np.asarray(times))


def continuous(loop, times):
    end, t, z = float(times[-1]), 0.0, np.zeros(loop.size)
    jumps = sorted(
        {when for part in (loop.reference, loop.load, loop.output, loop.noise) for when, _ in part}
    )
    if loop.is_measured:
        jumps = sorted({*jumps, *(when + loop.delay for when, _ in loop.output)})
    #: Start, end, length of the element and the series over it of y, v and what is delayed.
    pieces = [(-math.inf, 0.0, 1.0, np.zeros((3, DEGREE + 1)))]
    place, is_new, mode, stuck = 0, True, (0, "runs", 0), 0
    while t <= end:
        while loop.delay and pieces[place][1] + loop.delay <= t + 1e-12:
            place += 1
        stops = [t + LONGEST, *(when for when in jumps if when > t + 1e-12)]
        if loop.delay:
            stops.append(pieces[place][1] + loop.delay)
        h = min(stops) - t
        when = t + 0.5 * h * (NODES + 1.0)
        late = np.zeros((2, DEGREE + 1))
        if loop.delay and pieces[place][0] > -math.inf:
            start, _, length, series = pieces[place]
            sigma = 2.0 * (when - loop.delay - start) / length - 1.0
            late[0] = chebyshev.chebval(sigma, series[2])
            late[1] = chebyshev.chebval(sigma, chebyshev.chebder(series[2])) * 2.0 / length
        inputs = inputs_at(loop, t)
        if is_new:
            mode = settled(loop, z, late[:, 0], mode, inputs)
        if mode[2] == 0 and np.isfinite(loop.rate):
            z[-1] = loop.signals(z, late[:, 0], mode, inputs)[1][1]
        rates, found = loop.linear(mode, inputs)
        forced = np.vstack([late, np.ones(DEGREE + 1)])
        Z = collocated(rates, z, forced, h)
        signals = found @ np.vstack([Z, forced])
        cut, after = changed(loop, mode, signals, h, late, stuck)
        if cut == 0.0:
            stuck += 1
            mode, is_new = crossed(loop, z, late[:, 0], mode, after, inputs), False
            continue
        stuck, is_new = 0, False
        series = signals[1:4] @ TO_SERIES.T
        series = series[[1, 0, 2]]
        pieces.append((t, t + cut * h, h, series))
        at = 2.0 * cut - 1.0
        z = chebyshev.chebval(at, (Z @ TO_SERIES.T).T)
        last = chebyshev.chebval(at, (late @ TO_SERIES.T).T)
        t += cut * h
        if np.isfinite(loop.rate):
            z[-1] = chebyshev.chebval(at, series[1])
        if after is not None:
            mode = crossed(loop, z, last, mode, after, inputs)
        is_new = any(abs(t - when) < 1e-12 for when in jumps)
    return read(pieces, times)


def read(pieces, times):
    """y and v at times."""
    out = np.empty((2, len(times)))
    starts = np.array([piece[0] for piece in pieces])
    for i, t in enumerate(times):
        start, _, length, series = pieces[np.searchsorted(starts, t + 1e-12, side="right") - 1]
        sigma = 0.0 if start == -math.inf else 2.0 * (t - start) / length - 1.0
        out[:, i] = chebyshev.chebval(sigma, series[:2].T)
    return out


def collocated(rates, z, forced, h):
    """z at the nodes of an element, whose derivative is right at all of them but the first."""
    size = len(z)
    A, F = rates[:, :size], rates[:, size:] @ forced
    system = np.kron(SLOPE * 2.0 / h, np.eye(size)) - np.kron(np.eye(DEGREE + 1), A)
    right = F.T.ravel().copy()
    system[:size] = 0.0
    system[:size, :size] = np.eye(size)
    right[:size] = z
    return np.linalg.solve(system, right).reshape(DEGREE + 1, size).T


def settled(loop, z, late, mode, inputs):
    """The mode after a jump."""
    slewing = np.isfinite(loop.rate)
    u = loop.signals(z, late, (0, "runs", 1 if slewing else 0), inputs)[1][0]
    side = int(u > loop.high) - int(u < loop.low)
    slew = 0
    if slewing:
        slew = int(np.sign(round(float(np.clip(u, loop.low, loop.high) - z[-1]), 13)))
    stops = "runs"
    if loop.windup == "stop" and side:
        drive = loop.signals(z, late, (side, "runs", slew), inputs)[1][4]
        stops = "stops" if drive * side > 0 else "runs"
    return side, stops, slew


def changed(loop, mode, signals, h, late, stuck):
    """Where on an element the mode ends, and what follows."""
    side, stops, slew = mode
    u, v, _, _, drive, drift = signals
    guards = []
    if stops != "slides":
        for way, bound in ((1, loop.high), (-1, loop.low)):
            if np.isfinite(bound) and side in (0, way):
                room = way * (bound - u) if side == 0 else way * (u - bound)
                guards.append((room, (way if side == 0 else 0, "runs", slew)))
    if loop.windup == "stop" and side:
        if stops == "runs":
            guards.append((-side * drive, (side, "stops", slew)))
        elif stops == "stops":
            guards.append((side * drive, (side, "runs", slew)))
        else:
            guards.append((-side * drift, (side, "stops", slew)))
            guards.append((side * (drift + drive), (0, "free", slew)))
    if np.isfinite(loop.rate):
        if slew:
            aim = u if side == 0 else np.full_like(u, loop.high if side > 0 else loop.low)
            guards.append((slew * (aim - v), (side, stops, 0)))
        elif side == 0:
            slope = SLOPE @ u * 2.0 / h
            for way in (1, -1):
                guards.append((loop.rate - way * slope, (side, stops, way)))
    best, after = 1.0, None
    for values, to in guards:
        at = first_below(values, stuck)
        if at is not None and at < best:
            best, after = at, to
    return best, after


def first_below(values, stuck):
    """Where a polynomial, given at the nodes, becomes negative by more than rounding."""
    noise = 1e-12 * (1.0 + np.abs(values).max())
    fine = np.linspace(-1.0, 1.0, 201)
    series = TO_SERIES @ values
    shown = chebyshev.chebval(fine, series)
    if shown.min() >= -noise:
        return None
    zeros = chebyshev.chebroots(series)
    zeros = np.sort(zeros.real[(np.abs(zeros.imag) < 1e-9) & (np.abs(zeros.real) < 1.0)])
    edges = np.concatenate([[-1.0], zeros, [1.0]])
    for low, high in itertools.pairwise(edges):
        inside = chebyshev.chebval(low + np.array([0.25, 0.5, 0.75, 1.0]) * (high - low), series)
        if inside.min() < -noise and (low > -1.0 or stuck < 5):
            return 0.5 * (low + 1.0) if low + 1.0 > 1e-13 else 0.0
    return None


def crossed(loop, z, late, mode, after, inputs):
    """The mode that follows at a bound, of an integral that may stop."""
    if after is None:
        return mode
    side, stops, slew = after
    if loop.windup != "stop" or stops == "free":
        return side, "runs" if stops == "free" else stops, slew
    if side == mode[0]:
        return after
    at = side or mode[0]
    *_, drive, drift = loop.signals(z, late, (at, "runs", slew), inputs)[1]
    drive, drift = at * drive, at * drift
    if drive <= 0.0:
        return (side, "runs", slew) if side == 0 else (at, "runs", slew)
    if drift > 0.0:
        return at, "stops", slew
    return (at, "slides", slew) if drift + drive > 0.0 else (0, "runs", slew)


def sampled(loop, times):
    """Sample by sample; states move by matrix exponentials from event to event."""
    assert not loop.is_measured
    Ts, T, end = loop.sample_time, loop.delay, float(times[-1])
    samples = [k * Ts for k in range(int(end / Ts + 1e-9) + 2)]
    jumps = {when for part in (loop.load, loop.output, loop.noise) for when, _ in part}
    kinds = [(when, 0, "jump") for when in jumps]
    # A controller sees what was before a command that arrives at its sample.
    kinds += [(when, 1, "sample") for when in samples]
    kinds += [(when + T, 2, "arrive") for when in samples if T > 0.0]
    kinds += [(float(when), 3, "read") for when in times]
    kinds.sort(key=lambda kind: (round(kind[0], 11), kind[1]))
    A, B, C, D = loop.space
    n = len(B)
    z, t, w, u, v = np.zeros(loop.size), 0.0, 0.0, 0.0, 0.0
    waiting, out = [], np.empty((2, len(times)))
    stopped, excess, r, at = False, 0.0, 0.0, 0

    def inputs():
        return [r, held(loop.load, t), held(loop.output, t), held(loop.noise, t)]

    def rates(z, inputs, is_on):
        """The continuous states between samples, under a command w."""
        r, d, q, noise = (is_on * value for value in inputs)
        x, (_, smooth, slope, _) = z[:n], z[n:]
        y = C @ x + D * (w * is_on + d) + q
        look = y + noise
        bent = 0.0
        if loop.smooth:
            omega, damping = loop.smooth
            bent = (
                omega**2 * (loop.derivative_weight * r - look - smooth)
                - 2 * damping * omega * slope
            )
        runs = r - look
        if isinstance(loop.windup, float) and loop.Ki:
            runs += is_on * excess / (loop.windup * loop.Ki)
        if stopped:
            runs = 0.0
        return np.concatenate([A @ x + B * (w * is_on + d), [runs, slope, bent, 0.0]])

    def output():
        return C @ z[:n] + D * (w + held(loop.load, t)) + held(loop.output, t)

    for when, _, kind in kinds:
        h = when - t
        if h > 1e-12:
            put = inputs()
            size = loop.size
            M = np.zeros((size + 1, size + 1))
            for i in range(size):
                M[:size, i] = rates(np.eye(size)[i], put, 0.0)
            M[:size, size] = rates(np.zeros(size), put, 1.0)
            z = (expm(M * h) @ np.append(z, 1.0))[:size]
        t = when
        if kind == "sample":
            r = held(loop.reference, t)
            y = output() + held(loop.noise, t)
            u = loop.Kp * (loop.weight * r - y) + loop.Ki * z[n] + loop.feed_forward * r
            if loop.smooth:
                u += loop.Kd * z[n + 2]
            else:
                u -= loop.Kd * (C @ (A @ z[:n] + B * (w + held(loop.load, t))))
            bounded = float(np.clip(u, loop.low, loop.high))
            v = float(np.clip(bounded, v - loop.rate * Ts, v + loop.rate * Ts))
            excess = v - u
            stopped = loop.windup == "stop" and (u - bounded) * loop.Ki * (r - y) > 0.0
            waiting.append(v)
            if T == 0.0:
                w = waiting.pop(0)
        elif kind == "arrive":
            w = waiting.pop(0)
        elif kind == "read":
            out[:, at] = output(), v
            at += 1
    return out


def transition(loop):
    """One sample of the linear loop as a matrix, of its states and the commands on their way."""
    Ts, size, n = loop.sample_time, loop.size, len(loop.space[1])
    whole, part = divmod(loop.delay / Ts, 1.0)
    # A command arrives `part` of a sample after a sample, `whole` samples late.
    waiting = int(whole) + 1
    A, B, C, D = loop.space

    def rates(z, w):
        x, (_, smooth, slope, _) = z[:n], z[n:]
        look = C @ x + D * w
        bent = 0.0
        if loop.smooth:
            omega, damping = loop.smooth
            bent = omega**2 * (-look - smooth) - 2 * damping * omega * slope
        return np.concatenate([A @ x + B * w, [-look, slope, bent, 0.0]])

    def moved(z, w, h):
        M = np.zeros((size + 1, size + 1))
        for i in range(size):
            M[:size, i] = rates(np.eye(size)[i], 0.0)
        M[:size, size] = rates(np.zeros(size), w)
        return (expm(M * h) @ np.append(z, 1.0))[:size]

    columns = []
    for unit in np.eye(size + waiting):
        z, late = unit[:size], list(unit[size:])  # the newest last; the oldest has arrived
        w = late[0]
        u = -loop.Kp * (C @ z[:n] + D * w) + loop.Ki * z[n]
        u += loop.Kd * (z[n + 2] if loop.smooth else -(C @ (A @ z[:n] + B * w)))
        late.append(u)
        z = moved(moved(z, w, part * Ts), late[1], (1.0 - part) * Ts)
        columns.append(np.concatenate([z, late[1:]]))
    matrix = np.array(columns).T
    # States of what the loop lacks rest: integral, filter, limited rate.
    resting = [n + 3, *([] if loop.Ki else [n]), *([] if loop.smooth else [n + 1, n + 2])]
    moving = np.delete(np.arange(len(matrix)), resting)
    return matrix[np.ix_(moving, moving)]


def characteristic(loop, s):
    """den + num C e^(-delay s) at points s, times the denominator of the controller."""
    above, below = loop.Kp, 1.0
    if loop.Kd:
        above = loop.Kp + loop.Kd * s
        if loop.smooth:
            omega, damping = loop.smooth
            below = s**2 + 2 * damping * omega * s + omega**2
            above = loop.Kp * below + loop.Kd * omega**2 * s
    if loop.Ki:
        above, below = above * s + loop.Ki * below, below * s
    G = np.polyval(loop.num, s) * np.exp(-loop.delay * s)
    return np.polyval(loop.den, s) * below + G * above


def zeros_in(loop, left, right, up):
    """Zeros of the characteristic function between these real parts, and up to an imaginary part.

    Half of a rectangle is walked, whose other half is its mirror: by steps that turn little.
    """
    corners = [complex(right, 0.0), complex(right, up), complex(left, up), complex(left, 0.0)]
    turned = 0.0
    for begin, end in itertools.pairwise(corners):
        at = np.linspace(0.0, 1.0, 2001)
        for _ in range(40):
            values = characteristic(loop, begin + (end - begin) * at)
            steps = np.angle(values[1:] / values[:-1])
            wide = np.flatnonzero(np.abs(steps) > 0.5)
            if not wide.size:
                break
            at = np.insert(at, wide + 1, 0.5 * (at[wide] + at[wide + 1]))
        assert not wide.size
        turned += float(steps.sum())
    return round(turned / math.pi)
