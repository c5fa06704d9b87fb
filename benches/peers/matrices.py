"""The spectral abscissa of x' + N x'(t - 0.3) = A0 x(t) + A1 x(t - 0.3), beside numpy.

The peer replaces the delay by a polynomial of degree 20 at Chebyshev points and takes the rightmost
eigenvalue of the collocation matrix, corrected by Newton's method (Breda, Maset and Vermiglio
2005): no proof, and no statement about what the polynomial leaves out. Ours is the whole call on a
new `DelaySystem`. Fifty systems are drawn for each size, of five kinds: entries of size 1 and -2 on
the diagonal; norms from 0.3 to 4 and a shift that leaves them stable or not; few entries; equal
lags in a ring; neutral ones. CPU times, the least of three runs each; "worst" is that of all draws.
A refusal is an error, "far" an answer that differs from the peer's by more than 1e-6. Run
``OPENBLAS_NUM_THREADS=1 python benches/peers/matrices.py [--quick] [--draws K] [N ...]``.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable

import deadtime as dtm
import numpy as np
from numpy.typing import NDArray

DELAY = 0.3
DEGREE = 20
RUNS = 3
KINDS = ("plain", "scaled", "sparse", "ring", "neutral")
Matrix = NDArray[np.float64]


def drawn(n: int, seed: int) -> tuple[Matrix, Matrix, Matrix]:
    """A0, A1 and N."""
    rng = np.random.default_rng(1000 * n + seed)
    kind = KINDS[seed % len(KINDS)]
    one, none = np.eye(n), np.zeros((n, n))
    if kind == "plain":
        return rng.normal(size=(n, n)) - 2 * one, rng.normal(size=(n, n)), none
    size = rng.uniform(0.3, 4.0, 2) / math.sqrt(n)
    A0, A1 = size[0] * rng.normal(size=(n, n)), size[1] * rng.normal(size=(n, n))
    A0 -= rng.uniform(0.0, 6.0) * one
    if kind == "sparse":
        A0 = np.where((rng.uniform(size=(n, n)) < 3.0 / n) | (one > 0), A0, 0.0)
        A1 = np.where(rng.uniform(size=(n, n)) < 3.0 / n, A1, 0.0)
    if kind == "ring":
        ahead = np.roll(one, 1, axis=1)
        A0, A1 = -rng.uniform(0.1, 1.0) * one, rng.uniform(0.1, 3.0) * (ahead - one)
    if kind == "neutral":
        return A0, A1, rng.uniform(0.1, 0.8) / math.sqrt(n) * rng.normal(size=(n, n))
    return A0, A1, none


def collocation(A0: Matrix, A1: Matrix, N: Matrix) -> Matrix:
    """The generator of the solutions, on Chebyshev points of the interval of the delay."""
    n, k = len(A0), np.arange(DEGREE + 1)
    x = np.cos(np.pi * k / DEGREE)
    weights = np.r_[2.0, np.ones(DEGREE - 1), 2.0] * (-1.0) ** k
    gaps = x[:, None] - x + np.eye(DEGREE + 1)
    D = weights[:, None] / weights / gaps
    D -= np.diag(D.sum(axis=1))
    D *= 2 / DELAY
    whole = np.kron(D, np.eye(n))
    whole[:n] = -np.kron(D[-1], N)
    whole[:n, :n] += A0
    whole[:n, -n:] += A1
    return whole


def by_numpy(A0: Matrix, A1: Matrix, N: Matrix) -> float:
    values = np.linalg.eigvals(collocation(A0, A1, N))
    s, one = complex(values[values.real.argmax()]), np.eye(len(A0))
    for _ in range(3):
        turn = np.exp(-DELAY * s)
        slope = one + (N + DELAY * (A1 - s * N)) * turn
        s -= 1 / np.trace(np.linalg.solve(s * one - A0 + (s * N - A1) * turn, slope))
    return s.real


def by_deadtime(A0: Matrix, A1: Matrix, N: Matrix) -> float:
    late = {DELAY: N} if N.any() else None
    return dtm.DelaySystem({0.0: A0, DELAY: A1}, N=late).spectral_abscissa()


def least(function: Callable[..., float], *arguments: Matrix) -> tuple[float, float]:
    """The result, NaN for a refusal, and the least CPU time in s."""
    best, result = math.inf, math.nan
    for _ in range(RUNS):
        begun = time.process_time()
        try:
            result = function(*arguments)
        except (ValueError, dtm.DeadtimeError):
            result = math.nan
        best = min(best, time.process_time() - begun)
    return result, best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("states", nargs="*", type=int, help="numbers of states")
    parser.add_argument("--draws", type=int, default=50, help="systems of each size")
    parser.add_argument("--quick", action="store_true", help="8 states, for a check that it runs")
    given = parser.parse_args()
    sizes, draws = given.states or [8, 10, 16, 20, 40], given.draws
    if given.quick:
        sizes, draws = [8], len(KINDS)
    print("states | ours, ms: median, worst | numpy, ms | ratios | worst of a kind | refused | far")
    for n in sizes:
        mine, peer, kinds = [], [], dict.fromkeys(KINDS, 0.0)
        refused = far = 0
        for seed in range(draws):
            arguments = drawn(n, seed)
            ours, time_of_ours = least(by_deadtime, *arguments)
            theirs, time_of_theirs = least(by_numpy, *arguments)
            mine.append(1e3 * time_of_ours)
            peer.append(1e3 * time_of_theirs)
            kind = KINDS[seed % len(KINDS)]
            kinds[kind] = max(kinds[kind], mine[-1])
            refused += math.isnan(ours)
            far += abs(ours - theirs) > 1e-6
        middle, worst, other = np.median(mine), max(mine), np.median(peer)
        each = ", ".join(f"{kind} {slowest:.1f}" for kind, slowest in kinds.items())
        print(
            f"{n} | {middle:.2f}, {worst:.1f} | {other:.1f} | "
            f"{middle / other:.2f}, {worst / other:.2f} | {each} | {refused} | {far}"
        )


if __name__ == "__main__":
    main()
