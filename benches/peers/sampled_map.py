"""Maps of sampled loops: ours beside eigenvalues and beside the Schur-Cohn recursion.

For loops of 7, 38 and 74 states (one drone sampled every 65, 10 and 5 ms): the time of a cell of
our counts, with and without the abscissa, of numpy's eigenvalues of the transition matrices in one
stack, and of the Schur-Cohn recursion on the characteristic polynomial with one cell in each entry
of a numpy array; ``cargo bench --bench stability_map -- sampled`` has it with one cell in
each lane. Then cells drawn at random, whose counts are compared with those of the eigenvalues, and
single loops at 1 kHz. Run
``python benches/peers/sampled_map.py [--quick]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import deadtime as dtm
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
RANGES = {"Kp": (0.1, 6.0), "Kv": (-0.9, 0.9)}


def loop_of(sample_time: float) -> dtm.ControlLoop:
    """The drone under PV control, as in the paper but for the sample time."""
    return dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.1), delay=0.36, sample_time=sample_time)


def least_time(work: Callable[[], object], rounds: int) -> float:
    """Shortest of several runs, s."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def matrices(loop: dtm.ControlLoop, Kp: Floats, Kv: Floats) -> Floats:
    """Transition matrices for many gains: the newest command alone depends on them."""
    bare = loop.replace(Kp=1.0, Kv=0.0).transition_matrix()
    with_kv = loop.replace(Kp=1.0, Kv=1.0).transition_matrix()
    found = np.broadcast_to(bare, (len(Kp), *bare.shape)).copy()
    found[:, 1, :] = Kp[:, None] * bare[1] + Kv[:, None] * (with_kv[1] - bare[1])
    return found


def by_eigenvalues(stack: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Number of eigenvalues outside the unit circle, and the distance of the closest from it."""
    sizes = np.abs(np.linalg.eigvals(stack))
    return (sizes > 1.0).sum(axis=1), np.abs(sizes - 1.0).min(axis=1)


def schur_cohn(coefficients: Floats) -> NDArray[np.int64]:
    """Zeros outside the unit circle; descending powers in the first axis, one cell an entry.

    Reduction p -> (p_0 p - p_n p*)/z (Jury 1964): a step with abs(p_n) > abs(p_0) exchanges inside
    and outside.
    """
    p = coefficients.copy()
    sign = np.ones(p.shape[1], dtype=np.int64)
    outside = np.zeros(p.shape[1], dtype=np.int64)
    for _ in range(len(p) - 1):
        first, last = p[0], p[-1]
        sign = np.where(np.abs(last) > np.abs(first), -sign, sign)
        outside += sign < 0
        p = (first * p - last * p[::-1])[:-1]
        p /= np.abs(p).max(axis=0)
    return outside


def polynomials(loop: dtm.ControlLoop, Kp: Floats, Kv: Floats) -> Floats:
    """Characteristic polynomials in z: affine in both gains."""

    def one(kp: float, kv: float) -> Floats:
        return np.poly(loop.replace(Kp=kp, Kv=kv).transition_matrix())

    base, unit = one(1.0, 0.0), one(2.0, 0.0)
    constant, by_kv = 2.0 * base - unit, one(1.0, 1.0) - base
    return constant[:, None] + (unit - base)[:, None] * Kp + by_kv[:, None] * Kv


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few cells, for a check that it runs")
    quick = parser.parse_args().quick
    rng = np.random.default_rng(5)
    side, drawn, rounds = (101, 500, 1) if quick else (1000, 100_000, 5)
    print("microseconds a cell, one thread; ratios to our counts")
    print(f"{'states':>6} {'counts':>9} {'abscissa':>9} {'eigenvalues':>17} {'Schur-Cohn':>17}")
    for sample_time in (0.065, 0.01, 0.005):
        loop = loop_of(sample_time)
        timed(loop, side, rounds, rng, quick)
        compared(loop, side, drawn // 3, rng)
    single_loops(3 if quick else 40)


def single_loops(rounds: int) -> None:
    """Print times of loops at 1 kHz with a delay of 0.36 s (362 states), made anew each time."""
    lagging = dtm.PV(2.0, 0.1, filter=dtm.DerivativeFilter(20.0))
    for name, plant, controller in (
        ("P", dtm.Integrator(), dtm.P(2.0)),
        ("filtered PV behind a lag", dtm.Integrator(1.0, 0.1), lagging),
    ):
        loop = dtm.ControlLoop(plant, controller, delay=0.36, sample_time=0.001)
        stable = least_time(lambda loop=loop: loop.replace(delay=0.36).is_stable(), rounds)
        margin = least_time(lambda loop=loop: loop.replace(delay=0.36).margin(), rounds)
        print(f"1 kHz, {name}: is_stable {stable * 1e3:.3f} ms, margin {margin * 1e3:.3f} ms")


def timed(
    loop: dtm.ControlLoop, side: int, rounds: int, rng: np.random.Generator, quick: bool
) -> None:
    """Print the row of one loop."""
    small, cells = (11, 100) if quick else (101, 2000)

    def mapped(side: int, abscissa: bool) -> object:
        return dtm.stability_map(loop, RANGES, (side, side), abscissa=abscissa, threads=1)

    counts = least_time(lambda: mapped(side, False), rounds) / side**2
    abscissa = least_time(lambda: mapped(small, True), 1) / small**2
    Kp, Kv = (rng.uniform(*RANGES[name], cells) for name in ("Kp", "Kv"))
    stack, polynomial = matrices(loop, Kp, Kv), polynomials(loop, Kp, Kv)
    eigenvalues = least_time(lambda: np.linalg.eigvals(stack), rounds) / cells
    recursion = least_time(lambda: schur_cohn(polynomial), rounds) / cells
    print(
        f"{stack.shape[-1]:6d} {counts * 1e6:9.4f} {abscissa * 1e6:9.3f} "
        f"{eigenvalues * 1e6:9.2f} {eigenvalues / counts:6.0f}x "
        f"{recursion * 1e6:9.3f} {recursion / counts:6.1f}x"
    )


def compared(loop: dtm.ControlLoop, side: int, drawn: int, rng: np.random.Generator) -> None:
    """Compare cells drawn at random with eigenvalues; stop at the first that differ."""
    chart = dtm.stability_map(loop, RANGES, (side, side), abscissa=False)
    agree = close = 0
    for _ in range(0, drawn, 1000):
        i, j = rng.integers(0, side, (2, 1000))
        stack = matrices(loop, chart.axes["Kp"][i], chart.axes["Kv"][j])
        truth, distance = by_eigenvalues(stack)
        sure = distance > 1e-9
        wrong = int((chart.unstable[i, j] != truth)[sure].sum())
        if wrong:
            raise SystemExit(f"{wrong} counts differ from those of the eigenvalues")
        agree += int(sure.sum())
        close += int((~sure).sum())
    print(f"       {agree} cells equal those of the eigenvalues, {close} too close to tell")


if __name__ == "__main__":
    main()
