"""Lambert W beside scipy: time per element, alternated in one process, and errors beside it.

Errors are |w - W|/(|W| 2^-52) on a sample, with W from FLINT's ball arithmetic; correct rounding
is at most 0.5. Run ``python benches/peers/lambertw.py [--quick]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import deadtime as dtm
import flint
import numpy as np
import scipy.special

INVERSE_E = 0.36787944117144233


def cases(n: int) -> dict[str, tuple[np.ndarray, int | np.ndarray]]:
    rng = np.random.default_rng(2024)

    def spread(low: float, high: float) -> np.ndarray:
        return 10 ** rng.uniform(low, high, n) * np.exp(2j * np.pi * rng.random(n))

    mixed = rng.integers(-5, 6, n)
    square = rng.uniform(-3, 3, n) + 1j * rng.uniform(-3, 3, n)
    return {
        "disc 1e-3..1e3, k=0": (spread(-3, 3), 0),
        "disc 1e-3..1e3, k=-1": (spread(-3, 3), -1),
        "disc 1e-3..1e3, k=3": (spread(-3, 3), 3),
        "disc 1e-3..1e3, k mixed": (spread(-3, 3), mixed),
        "square +-3, k=0": (square, 0),
        "near -1/e, k=0": (spread(-16, -1) - INVERSE_E, 0),
        "near -1/e, k=-1": (spread(-16, -1) - INVERSE_E, -1),
        "wide 1e+-300, k=0": (spread(-300, 300), 0),
        "wide 1e+-300, k mixed": (spread(-300, 300), mixed),
    }


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def largest_error(w: np.ndarray, z: np.ndarray, k: np.ndarray) -> float:
    worst = 0.0
    for ours, point, branch in zip(w, z, k, strict=True):
        # FLINT has no signed zeros; none of the points is on a cut.
        exact = flint.acb(point.real, point.imag).lambertw(int(branch))
        if not np.isfinite(ours):
            return float("nan")
        error = abs(flint.acb(ours.real, ours.imag) - exact) / abs(exact)
        worst = max(worst, float(error.mid()) * 2**52)
    return worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    quick = parser.parse_args().quick
    n, rounds, sample = (2_000, 3, 100) if quick else (50_000, 9, 2_000)
    flint.ctx.prec = 200

    print(f"{n} elements, one thread, minimum of {rounds} alternated rounds; errors on {sample}")
    head = ("scipy ns", "ours ns", "ratio", "scipy err", "err")
    print(f"{'case':26s}" + "".join(f"{title:>11s}" for title in head))
    for name, (z, k) in cases(n).items():
        times = [
            (
                seconds(lambda z=z, k=k: scipy.special.lambertw(z, k)),
                seconds(lambda z=z, k=k: dtm.lambertw(z, k, threads=1)),
            )
            for _ in range(rounds)
        ]
        theirs, ours = np.min(times, axis=0) / n * 1e9
        some, branch = z[:sample], np.broadcast_to(k, z.shape)[:sample]
        errors = [
            largest_error(w, some, branch)
            for w in (scipy.special.lambertw(some, branch), dtm.lambertw(some, branch))
        ]
        print(
            f"{name:26s}{theirs:11.1f}{ours:11.1f}{theirs / ours:11.2f}"
            f"{errors[0]:11.3g}{errors[1]:11.3f}"
        )


if __name__ == "__main__":
    main()
