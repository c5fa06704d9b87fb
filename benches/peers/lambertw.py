"""Lambert W beside scipy and FLINT: time per element, alternated in one process, errors beside it.

Errors are |w - W|/(|W| 2^-52) on a sample, with W from FLINT's ball arithmetic; correct rounding is
at most 0.5. Run ``python benches/peers/lambertw.py [--quick] [--threads N]``. The time of FLINT is
listed for orientation: it computes with proved bounds, one number at a time, in a Python loop.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import NamedTuple

import deadtime as dtm
import flint
import numpy as np
import scipy.special

INVERSE_E = 0.36787944117144233


class Case(NamedTuple):
    name: str
    z: np.ndarray
    k: int | np.ndarray
    ours: Callable[..., np.ndarray]


def cases(n: int, threads: int) -> list[Case]:
    rng = np.random.default_rng(2024)

    def spread(low: float, high: float) -> np.ndarray:
        return 10 ** rng.uniform(low, high, n) * np.exp(2j * np.pi * rng.random(n))

    def ours(z: np.ndarray, k: int | np.ndarray) -> np.ndarray:
        return dtm.lambertw(z, k, threads=threads)

    def principal(x: np.ndarray, k: int) -> np.ndarray:
        return dtm.lambertw0(x, threads=threads)

    def lower(x: np.ndarray, k: int) -> np.ndarray:
        return dtm.lambertwm1(x, threads=threads)

    mixed = rng.integers(-5, 6, n)
    square = rng.uniform(-3, 3, n) + 1j * rng.uniform(-3, 3, n)
    positive, negative = 10 ** rng.uniform(-3, 3, n), -INVERSE_E * rng.uniform(0.001, 0.999, n)
    return [
        Case("disc 1e-3..1e3, k=0", spread(-3, 3), 0, ours),
        Case("disc 1e-3..1e3, k=-1", spread(-3, 3), -1, ours),
        Case("disc 1e-3..1e3, k=3", spread(-3, 3), 3, ours),
        Case("disc 1e-3..1e3, k mixed", spread(-3, 3), mixed, ours),
        Case("square +-3, k=0", square, 0, ours),
        Case("square +-3, k=-1", square, -1, ours),
        Case("near -1/e, k=0", spread(-16, -1) - INVERSE_E, 0, ours),
        Case("near -1/e, k=-1", spread(-16, -1) - INVERSE_E, -1, ours),
        Case("wide 1e+-300, k=0", spread(-300, 300), 0, ours),
        Case("wide 1e+-300, k=-1", spread(-300, 300), -1, ours),
        Case("wide 1e+-300, k mixed", spread(-300, 300), mixed, ours),
        Case("real, k=0, complex result", positive, 0, ours),
        Case("real, k=0, lambertw0", positive, 0, principal),
        Case("real below 0, lambertw0", negative, 0, principal),
        Case("real, k=-1, complex result", negative, -1, ours),
        Case("real, k=-1, lambertwm1", negative, -1, lower),
    ]


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def alternated(rounds: int, *calls: Callable[[], object]) -> np.ndarray:
    """Shortest time of each call, taken in turns."""
    return np.min([[seconds(call) for call in calls] for _ in range(rounds)], axis=0)


def exact(z: np.ndarray, k: np.ndarray) -> list[flint.acb]:
    # FLINT has no signed zeros; points on a cut here have an imaginary part of +0, as in FLINT.
    points = [flint.acb(point.real, point.imag) for point in z.astype(complex)]
    return [point.lambertw(int(branch)) for point, branch in zip(points, k, strict=True)]


def largest_error(w: np.ndarray, truth: list[flint.acb]) -> float:
    worst = 0.0
    for value, ball in zip(w.astype(complex), truth, strict=True):
        if not np.isfinite(value):
            return float("nan")
        error = abs(flint.acb(value.real, value.imag) - ball) / abs(ball)
        worst = max(worst, float(error.mid()) * 2**52)
    return worst


def show(name: str, *columns: float | str) -> None:
    texts = [column if isinstance(column, str) else f"{column:.4g}" for column in columns]
    print(f"{name:28s}" + "".join(f"{text:>11s}" for text in texts))


def arrays(n: int, rounds: int, sample: int, threads: int) -> None:
    show("ns per element", "flint", "scipy", "ours", "ratio", "scipy err", "err")
    for name, z, k, ours in cases(n, threads):
        theirs = scipy.special.lambertw
        times = alternated(rounds, lambda: theirs(z, k), lambda: ours(z, k)) / n * 1e9  # noqa: B023
        some, branch = z[:sample], np.broadcast_to(k, z.shape)[:sample]
        flint.ctx.prec = 53
        few = min(sample, 300)
        (slow,) = alternated(2, lambda: exact(some[:few], branch[:few])) / few * 1e9  # noqa: B023
        flint.ctx.prec = 200
        truth = exact(some, branch)
        one_or_all = branch if isinstance(k, np.ndarray) else k
        errors = [largest_error(f(some, one_or_all), truth) for f in (theirs, ours)]
        show(name, slow, *times, times[0] / times[1], *errors)


def single_calls(rounds: int, calls: int) -> None:
    show("ns per call", "", "scipy", "ours", "ratio")
    for name, z, k in (
        ("1.0", 1.0, 0),
        ("1+2j, k=-1", 1 + 2j, -1),
        ("np.float64", np.float64(1), 0),
    ):
        functions = (scipy.special.lambertw, dtm.lambertw)

        def loop(function: Callable[..., object], z: complex = z, k: int = k) -> None:
            for _ in range(calls):
                function(z, k)

        times = alternated(rounds, *(lambda f=f: loop(f) for f in functions)) / calls * 1e9
        show(f"one number, {name}", "", *times, times[0] / times[1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    parser.add_argument("--threads", type=int, default=1, help="threads for ours (default 1)")
    arguments = parser.parse_args()
    quick, threads = arguments.quick, arguments.threads
    n, rounds, sample = (2_000, 3, 100) if quick else (50_000, 9, 2_000)
    print(
        f"scipy {scipy.__version__}, numpy {np.__version__}; {n} elements, threads={threads}, "
        f"minimum of {rounds} alternated rounds; errors on {sample} elements"
    )
    arrays(n, rounds, sample, threads)
    single_calls(rounds, 1_000 if quick else 20_000)


if __name__ == "__main__":
    main()
