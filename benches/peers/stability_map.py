"""Stability maps beside numpy with scipy's Lambert W, and beside our own pointwise loop.

The map is that of s + Kp exp(-s T) over Kp and T. Its rightmost root is W0(-Kp T)/T, so numpy can
do it in one line; that way ends where a second gain or lag comes in, which is why the velocity
loop s + (Kp + Kv s) exp(-0.36 s) has only the pointwise loop to be compared with. Disagreeing
cells are stable one way and not ours; ratios are to our map with abscissa. Run
``python benches/peers/stability_map.py [--quick]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import deadtime as dtm
import numpy as np
import scipy.special
from deadtime import ParametricQuasiPolynomial, delay, s

#: Ranges whose points are not on the boundary.
INTEGRATOR = {"Kp": (0.011, 20.0), "T": (0.013, 2.0)}
VELOCITY = {"Kp": (0.011, 6.0), "Kv": (-0.93, 0.93)}


def by_lambertw(ranges: dict[str, tuple[float, float]], side: int) -> np.ndarray:
    """Abscissa by numpy arrays."""
    gains, delays = (np.linspace(*ends, side) for ends in ranges.values())
    gain, time_ = np.meshgrid(gains, delays, indexing="ij")
    return scipy.special.lambertw(-gain * time_).real / time_


def pointwise(
    family: ParametricQuasiPolynomial, ranges: dict[str, tuple[float, float]], side: int
) -> np.ndarray:
    """Abscissa by a loop over the cells."""
    (first, x), (second, y) = ((name, np.linspace(*ends, side)) for name, ends in ranges.items())
    cells = [[family.at(**{first: a, second: b}).spectral_abscissa() for b in y] for a in x]
    return np.array(cells)


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def row(
    name: str, cells: int, ways: dict[str, tuple[Callable[[], np.ndarray], int]], rounds: int
) -> None:
    """Time all ways in turn; the first one is ours."""
    found = {way: call() for way, (call, _) in ways.items()}
    times = [
        [seconds(call) if i % every == 0 else np.inf for call, every in ways.values()]
        for i in range(rounds)
    ]
    ours, *_ = found.values()
    stable = ours < 0
    best = np.min(times, axis=0) / cells * 1e6
    print(name)
    for way, spent in zip(ways, best, strict=True):
        other = found[way]
        mask = other if other.dtype == bool else other < 0
        disagreeing = int((mask != stable).sum())
        distance = "" if mask is other else f"{np.abs(other - ours).max():.2e}"
        print(f"  {way:24s}{spent:10.3f}{spent / best[0]:10.2f}{disagreeing:12d}{distance:>14s}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    quick = parser.parse_args().quick
    side, rounds = (40, 3) if quick else (200, 7)
    Kp, Kv, T = dtm.parameters("Kp Kv T")
    cells = side * side

    print(f"{side} by {side} cells, minimum of {rounds} alternated rounds, ours on one thread")
    print(f"  {'way':24s}{'us/cell':>10s}{'ratio':>10s}{'disagreeing':>12s}{'max |diff|':>14s}")
    integrator = s + Kp * delay(T)
    velocity = s + (Kp + Kv * s) * delay(0.36)
    for name, family, ranges in (
        ("integrator", integrator, INTEGRATOR),
        ("velocity", velocity, VELOCITY),
    ):
        shape = (side, side)

        def chart(
            abscissa: bool,
            family: ParametricQuasiPolynomial = family,
            ranges: dict[str, tuple[float, float]] = ranges,
            shape: tuple[int, int] = shape,
        ) -> dtm.StabilityMap:
            return dtm.stability_map(family, ranges, shape, abscissa=abscissa, threads=1)

        ways: dict[str, tuple[Callable[[], np.ndarray], int]] = {
            "ours, abscissa": (lambda chart=chart: chart(True).abscissa, 1),
            "ours, counts alone": (lambda chart=chart: chart(False).stable, 1),
            "our pointwise loop": (
                lambda family=family, ranges=ranges: pointwise(family, ranges, side),
                rounds,
            ),
        }
        if name == "integrator":
            ways["numpy + scipy lambertw"] = (lambda: by_lambertw(INTEGRATOR, side), 1)
        row(name, cells, ways, rounds)


if __name__ == "__main__":
    main()
