"""The spectral abscissa of x' = A0 x(t) + A1 x(t - 0.3) with many states, beside numpy.

The peer replaces the delay by a polynomial of degree 20 at Chebyshev points and takes the rightmost
eigenvalue of the collocation matrix, corrected by Newton's method (Breda, Maset and Vermiglio
2005): no proof, and no statement about what the polynomial leaves out. Ours is the whole call on a
new `DelaySystem`. The ceiling is a fixed number of factorisations and inversions of M(s) by LAPACK,
40: those that a line and two roots take. CPU times, the least of several runs. Run
``OPENBLAS_NUM_THREADS=1 python benches/peers/matrices.py [--quick] [N ...]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import deadtime as dtm
import numpy as np
from numpy.typing import NDArray

DELAY = 0.3
DEGREE = 20
FACTORISATIONS = 40
Matrix = NDArray[np.float64]


def matrices(n: int, seed: int = 1) -> tuple[Matrix, Matrix]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, n)) - 2 * np.eye(n), rng.normal(size=(n, n))


def collocation(A0: Matrix, A1: Matrix) -> Matrix:
    """The generator of the solutions, on Chebyshev points of the interval of the delay."""
    n, k = len(A0), np.arange(DEGREE + 1)
    x = np.cos(np.pi * k / DEGREE)
    weights = np.r_[2.0, np.ones(DEGREE - 1), 2.0] * (-1.0) ** k
    gaps = x[:, None] - x + np.eye(DEGREE + 1)
    D = weights[:, None] / weights / gaps
    D -= np.diag(D.sum(axis=1))
    whole = np.kron(2 / DELAY * D, np.eye(n))
    whole[:n] = 0.0
    whole[:n, :n], whole[:n, -n:] = A0, A1
    return whole


def by_numpy(A0: Matrix, A1: Matrix) -> float:
    values = np.linalg.eigvals(collocation(A0, A1))
    s, one = complex(values[values.real.argmax()]), np.eye(len(A0))
    for _ in range(3):
        late = A1 * np.exp(-DELAY * s)
        s -= 1 / np.trace(np.linalg.solve(s * one - A0 - late, one + DELAY * late))
    return s.real


def by_deadtime(A0: Matrix, A1: Matrix) -> float:
    return dtm.DelaySystem({0.0: A0, DELAY: A1}).spectral_abscissa()


def ceiling(A0: Matrix, A1: Matrix) -> float:
    M = 1j * np.eye(len(A0)) - A0 - A1 * np.exp(-1j * DELAY)
    for _ in range(FACTORISATIONS):
        np.linalg.inv(M)
    return 0.0


def least(function: Callable[[Matrix, Matrix], float], *arguments: Matrix) -> tuple[float, float]:
    """The result and the least CPU time of a few calls in s."""
    best, start, result = np.inf, time.perf_counter(), 0.0
    while True:
        begun = time.process_time()
        result = function(*arguments)
        best = min(best, time.process_time() - begun)
        if time.perf_counter() - start > 2.0:
            return result, best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("states", nargs="*", type=int, help="numbers of states")
    parser.add_argument("--quick", action="store_true", help="8 states, for a check that it runs")
    given = parser.parse_args()
    sizes = given.states or ([8] if given.quick else [8, 40, 80])
    print("states | ours, ms | numpy, ms, ratio | ceiling, ms, ratio | difference")
    for n in sizes:
        arguments = matrices(n)
        ours, mine = least(by_deadtime, *arguments)
        theirs, peer = least(by_numpy, *arguments)
        _, floor = least(ceiling, *arguments)
        print(
            f"{n} | {1e3 * mine:.3f} | {1e3 * peer:.1f}, {peer / mine:.1f} | "
            f"{1e3 * floor:.3f}, {floor / mine:.2f} | {abs(ours - theirs):.1e}"
        )


if __name__ == "__main__":
    main()
