"""Counts of unstable roots over two gains: our map beside peers and beside our own brute force.

(a) qpmr and tdcpy solve one equation at a time. For a few cells, drawn at random, they find the
    roots in a region that by our bounds contains all unstable roots of these cells and is little
    larger. The time of a map is their time per cell times the number of cells. Each has made a
    first call before. A cell for which a peer raises an error counts as disagreeing.
(b) numpy with scipy's Lambert W, for the one family that has such a formula, s + Kp exp(-s T).
(c) Our own methods: every cell counted alone (``proof="cells"``) and a loop of pointwise counts.

Ratios are the time of a map by that method divided by ours, counts alone, on one thread. Run
``python benches/peers/stability_map.py [--quick]``.
"""

from __future__ import annotations

import argparse
import logging
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import deadtime as dtm
import numpy as np
import scipy.special
from deadtime import delay, s
from deadtime.roots import ParametricQuasiPolynomial

Ranges = dict[str, tuple[float, float]]
Region = tuple[float, float, float, float]
Count = Callable[[dtm.QuasiPolynomial, Region], int]

Kp, Kv, Ki, Kd, K1, K2, T, T1 = dtm.parameters("Kp Kv Ki Kd K1 K2 T T1")
CORNER = s**2 + 76.0 * s + 1444.0

#: The neutral one within the gains for which its chains are stable, clear of those that touch them.
FAMILIES: dict[str, tuple[ParametricQuasiPolynomial, Ranges]] = {
    "PV": (s + (Kp + Kv * s) * delay(0.36), {"Kp": (0.011, 6.0), "Kv": (-0.93, 0.93)}),
    "PV, filtered": (
        s * CORNER + (Kp * CORNER + 1444.0 * Kv * s) * delay(0.36),
        {"Kp": (0.011, 6.0), "Kv": (-1.0, 1.0)},
    ),
    "PD, pendulum": (
        s**2 - 1.0 + (Kp + Kd * s) * delay(0.3),
        {"Kp": (0.011, 8.0), "Kd": (0.0, 6.0)},
    ),
    "PI, first order": (
        s * (2.0 * s + 1.0) + 1.5 * (Kp * s + Ki) * delay(0.5),
        {"Kp": (-1.0, 8.0), "Ki": (0.011, 8.0)},
    ),
    "two delays": (
        s + K1 * delay(0.3) + K2 * delay(1.1),
        {"K1": (-6.0, 6.0), "K2": (-6.0, 6.003)},
    ),
    "both delays free": (
        s + 1.2 * delay(T1) + 0.8 * delay(T),
        {"T1": (0.01, 6.0), "T": (0.01, 6.0)},
    ),
    "P, delay free": (s + Kp * delay(T), {"Kp": (0.011, 20.0), "T": (0.013, 2.0)}),
}


def with_qpmr(h: dtm.QuasiPolynomial, region: Region) -> int:
    import qpmr

    return in_pairs(qpmr.qpmr(h.coefficients, h.delays, region=region)[0])


def with_tdcpy(h: dtm.QuasiPolynomial, region: Region) -> int:
    import tdcpy
    from tdcpy.common.quasipoly import qp_to_ndde

    a, delays_a, g, delays_g = qp_to_ndde(h.coefficients, h.delays)
    neutral = g is not None and np.size(g) > 0
    system = tdcpy.NDDE(a, delays_a, g, delays_g) if neutral else tdcpy.RDDE(a, delays_a)
    return in_pairs(tdcpy.roots(system, r=list(region))[0])


def in_pairs(roots: Any) -> int:
    """Unstable roots of both half planes, given those of the upper one."""
    found = np.atleast_1d(np.asarray(roots, complex)).ravel()
    found = found[(found.real > 0.0) & (found.imag > -1e-9)]
    return int(np.where(found.imag > 1e-9, 2, 1).sum())


def by_count(h: dtm.QuasiPolynomial, region: Region) -> int:
    return h.count(re=(0.0, None))


PEERS: dict[str, Count] = {"qpmr": with_qpmr, "tdcpy": with_tdcpy}


def by_lambertw(ranges: Ranges, side: int) -> np.ndarray:
    """Which cells are stable, by numpy arrays."""
    gain, time_ = np.meshgrid(
        *(np.linspace(*ends, side) for ends in ranges.values()), indexing="ij"
    )
    return scipy.special.lambertw(-gain * time_).real < 0.0


def seconds(call: Callable[[], Any], rounds: int = 1) -> tuple[Any, float]:
    """The result of a call and the least of its times."""
    least = np.inf
    for _ in range(rounds):
        start = time.perf_counter()
        found = call()
        least = min(least, time.perf_counter() - start)
    return found, least


def unstable_region(members: list[dtm.QuasiPolynomial]) -> Region:
    """A region, little larger than needed, that contains the unstable roots of all members."""
    roots = np.concatenate([h.rightmost(h.count(re=(0.0, None)) or 1).roots for h in members])
    unstable = roots[roots.real > 0.0]
    right, top = unstable.real.max(initial=0.0), unstable.imag.max(initial=0.0)
    return 0.0, 1.05 * float(right) + 0.1, 0.0, 1.05 * float(top) + 0.1


def cell_by_cell(
    chart: dtm.stability.StabilityMap, count: Count, cells: list[tuple[int, int]], limit: float
) -> tuple[float, int, int]:
    """Mean seconds per cell, number of cells, and number of cells that disagree."""
    (first, x), (second, y) = chart.axes.items()
    family = chart.family
    assert family is not None
    region = unstable_region([family.at(**{first: x[i], second: y[j]}) for i, j in cells])
    spent, asked, wrong = 0.0, 0, 0
    for index, (i, j) in enumerate([cells[0], *cells]):
        h = family.at(**{first: x[i], second: y[j]})
        start = time.perf_counter()
        try:
            found = count(h, region)
        except Exception:
            found = -9
        took = time.perf_counter() - start
        if index == 0:
            continue  # the first call imports and warms up
        spent, asked = spent + took, asked + 1
        wrong += found != int(chart.unstable[i, j])
        if spent > limit:
            break
    return spent / asked, asked, wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    quick = parser.parse_args().quick
    side, small, points, limit = (200, 60, 20, 1.0) if quick else (1000, 200, 200, 20.0)
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    np.seterr(all="ignore")
    peers = {}
    for name, count in PEERS.items():
        try:
            __import__(name)
        except ImportError:
            print(f"{name} is missing: pip install {name}")
        else:
            peers[name] = count
    draw = np.random.default_rng(1)

    print(
        f"ours: counts of {side} by {side} cells, one thread; every cell alone: {small} by {small}"
    )
    print(f"{'':18s}{'way':22s}{'us a cell':>12s}{'ratio':>12s}{'cells':>9s}{'disagree':>10s}")
    for name, (family, ranges) in FAMILIES.items():

        def chart(
            shape: int,
            family: ParametricQuasiPolynomial = family,
            ranges: Ranges = ranges,
            **more: Any,
        ) -> dtm.stability.StabilityMap:
            shapes = (shape, shape)
            return dtm.stability_map(
                family, ranges, shapes, **{"abscissa": False, "threads": 1} | more
            )

        ours, spent = seconds(lambda: chart(side), 5)
        base = spent / side**2

        def line(
            way: str,
            cell: float,
            cells: int,
            wrong: int | str,
            name: str = name,
            base: float = base,
        ) -> None:
            numbers = f"{cell * 1e6:12.4f}{cell / base:12.1f}{cells:9d}{wrong:>10}"
            print(f"{name:18s}{way:22s}{numbers}", flush=True)

        line("ours, counts", base, side**2, "")
        with_abscissa, spent = seconds(lambda: chart(small, abscissa=True))
        counted = chart(small)
        wrong = int((with_abscissa.unstable != counted.unstable).sum())
        line("ours, abscissa", spent / small**2, small**2, wrong)
        alone, spent = seconds(lambda: chart(small, proof="cells"))
        wrong = int((alone.unstable != counted.unstable).sum())
        line('ours, proof="cells"', spent / small**2, small**2, wrong)
        known = np.argwhere(ours.unstable >= 0)
        chosen = [tuple(map(int, cell)) for cell in draw.choice(known, points, replace=False)]
        for way, count in {"our pointwise loop": by_count, **peers}.items():
            cell, asked, wrong = cell_by_cell(ours, count, chosen, limit)
            line(way, cell, asked, wrong)
        if name == "P, delay free":
            stable, spent = seconds(partial(by_lambertw, ranges, side), 3)
            line("numpy + lambertw", spent / side**2, side**2, int((stable != ours.stable).sum()))


if __name__ == "__main__":
    main()
