"""Flights whose commands waited for drawn times, estimated from the log of the vehicle alone.

Each session flies without an added wait first and last, and waits drawn between 0 and `LONGEST`
seconds between. The mean sum of delay and lag without a wait is taken from the others; what is left
is held against how long commands waited on the clock of the vehicle. The estimate is not told that.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from reality.dataflash import waited
from reality.firmware import WITHIN, Estimated, estimated, facts_of, fly, line
from reality.flights import GAINS, WINDS, Flight

#: Longest wait that is drawn, s.
LONGEST = 0.4


def drawn(
    count: int, seed: int | None, axes: tuple[str, ...], winds: tuple[str, ...]
) -> list[Flight]:
    """So many flights of each axis in each wind with a drawn wait, between two without."""
    random = np.random.default_rng(seed)
    flights = []
    for wind, axis in product(winds, axes):
        waits = [round(float(wait), 3) for wait in random.uniform(0.0, LONGEST, count)]
        for repeat, wait in enumerate([0.0, *waits, 0.0], start=1):
            flights.append(Flight(axis, wind, wait, repeat))
    return flights


def rises(folder: Path, found: list[Estimated]) -> list[tuple[float, float]]:
    """By how much commands waited longer than without a drawn wait, and the sum is larger, s.

    One pair for each of these flights of one axis in one wind that had a drawn wait.
    """
    pairs = np.array([(wait_of(folder, one.flight), one.total) for one in found])
    added = np.array([one.flight.added > 0.0 for one in found])
    above = pairs[added] - pairs[~added].mean(axis=0)
    return [(float(wait), float(rise)) for wait, rise in above]


def wait_of(folder: Path, flight: Flight) -> float:
    """How long commands waited on the clock of the vehicle, s."""
    facts = facts_of(folder, flight)
    return waited(folder / facts["log"], facts["number"], flight.axis)


def run(read: Path | None, keep: Path | None, processes: int, count: int, seed: int | None) -> None:
    """Fly, unless logs are to be read, and print what the sums rise by."""
    with tempfile.TemporaryDirectory() as own:
        folder = read or keep or Path(own)
        if read is None:
            folder.mkdir(parents=True, exist_ok=True)
            fly(folder, drawn(count, seed, tuple(GAINS), tuple(WINDS)))
        flights = sorted(Flight.of(path.stem) for path in folder.glob("*.json"))
        print_rises(folder, flights, processes)


def print_rises(folder: Path, flights: list[Flight], processes: int) -> None:
    """Print the estimates, then the rises beside the waits."""
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        waiting = [pool.submit(estimated, folder, one, True, True) for one in flights]
        found = []
        for one in waiting:
            found.append(one.result())
            print(line(found[-1]), flush=True)
    print(f"\n{'axis, wind':20}{'waited s':>10}{'rise s':>9}{'off ms':>8}")
    met = total = 0
    for axis, wind in product(GAINS, WINDS):
        some = [one for one in found if one.flight[:2] == (axis, wind)]
        for wait, rise in rises(folder, some):
            print(f"{f'{axis}, {wind}':20}{wait:10.4f}{rise:9.4f}{1e3 * (rise - wait):8.1f}")
            met += abs(rise - wait) <= WITHIN
            total += 1
    print(f"{met} of {total} within {1e3 * WITHIN:.0f} ms")
