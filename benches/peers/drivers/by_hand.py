"""Loops that a user writes by hand for numba: fixed steps, no estimate of the error.

Both run one equation y' = f(y, y(t - delay)) from a constant, with steps that divide the delay, so
that every breaking point is the end of a step.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from drivers.dde import Run, Values

try:
    from numba import njit
except ImportError:
    njit = None


def rk4(slope: Callable[[float, float], float], start: float, delay: float, parts: int) -> Run:
    """Runge and Kutta's method for y' = slope(y, y(t - delay)), so many steps a delay.

    The past stands in a ring, and follows from cubics between its points.
    """
    slope = njit(slope)

    @njit
    def run(times: Values, start: float, delay: float, parts: int) -> Values:
        h, n = delay / parts, parts + 1
        values = np.full(n, start)
        # Slopes from the right and from the left, which differ where the run starts.
        after, before = np.zeros(n), np.zeros(n)
        found = np.empty(times.size)
        done, k, old = 0, 0, 1
        y, early, k1 = start, start, slope(start, start)
        after[0] = k1
        while done < times.size:
            following = old + 1 if old + 1 < n else 0
            late = values[following]
            middle = 0.5 * (early + late) + 0.125 * h * (after[old] - before[following])
            k2 = slope(y + 0.5 * h * k1, middle)
            k3 = slope(y + 0.5 * h * k2, middle)
            k4 = slope(y + h * k3, late)
            new = y + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            end = slope(new, late)
            while done < times.size and times[done] <= (k + 1) * h * (1.0 + 1e-14):
                part = times[done] / h - k
                rest = 1.0 - part
                bend = (rest - part) * (new - y) + h * (part * end - rest * k1)
                found[done] = rest * y + part * new - part * rest * bend
                done += 1
            values[old], before[old], after[old] = new, end, end
            y, early, k1, old, k = new, late, end, following, k + 1
        return found

    return lambda times: run(times, start, delay, parts)[:, None]


def spectral(
    source: Callable[[float], float], rate: float, start: float, delay: float, degree: int
) -> Run:
    """Collocation of this degree on each delay, for y' = source(y(t - delay)) - rate y.

    The matrices are computed beforehand: the equation is linear in y, and every element is alike.
    """
    source = njit(source)
    angles = np.pi * np.arange(degree, -1, -1) / degree
    nodes = np.cos(angles)
    basis = np.cos(np.outer(angles, np.arange(degree + 1)))
    slopes = np.polynomial.chebyshev.chebder(np.linalg.inv(basis), axis=0)
    matrix = 2.0 / delay * np.polynomial.chebyshev.chebval(nodes, slopes).T
    matrix += rate * np.eye(degree + 1)
    matrix[0] = np.eye(degree + 1)[0]
    inverse = np.linalg.inv(matrix)
    from_start = inverse[:, 0].copy()
    columns = np.ascontiguousarray(inverse.T)

    # Of the barycentric formula.
    weights = np.where(np.arange(degree + 1) % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] *= 0.5

    @njit
    def run(times: Values, first: float) -> Values:
        late = np.full(degree + 1, first)
        forcing, here = np.empty(degree + 1), np.empty(degree + 1)
        found = np.empty(times.size)
        done, element = 0, 0
        while done < times.size:
            for i in range(degree + 1):
                forcing[i] = source(late[i])
            for i in range(degree + 1):
                here[i] = first * from_start[i]
            for j in range(1, degree + 1):
                for i in range(degree + 1):
                    here[i] += columns[j, i] * forcing[j]
            while done < times.size and times[done] <= (element + 1) * delay:
                place = 2.0 * (times[done] / delay - element) - 1.0
                above, below = 0.0, 0.0
                for i in range(degree + 1):
                    if place == nodes[i]:
                        above, below = here[i], 1.0
                        break
                    share = weights[i] / (place - nodes[i])
                    above, below = above + share * here[i], below + share
                found[done] = above / below
                done += 1
            first = here[-1]
            late, here = here, late
            element += 1
        return found

    return lambda times: run(times, start)[:, None]
