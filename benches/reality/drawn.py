"""Flights whose commands waited for drawn times, estimated from the log of the vehicle alone.

Each session flies without an added wait first and last, and waits drawn between 0 and `LONGEST`
seconds between. Two answers rise by the wait. One is the sum of delay and lag of the plant behind
the limits of the vehicle. The other is the equivalent delay of a plant that nobody named, behind
the limits that the parameters of the vehicle say. The mean of each without a wait is taken from
the others. What is left is held against how long commands
waited on the clock of the vehicle. The estimates do not know that.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import deadtime as dtm
import numpy as np

from reality.dataflash import recording_of, waited
from reality.firmware import Estimated, estimated, facts_of, fly, line
from reality.flights import GAINS, SHAPING, WINDS, Flight

#: Longest wait that is drawn, s.
LONGEST = 0.4

#: Frequencies at which the equivalent delay is compared, rad/s.
FREQUENCIES = (1.0, 2.0)

#: The sum and the equivalent delays have to rise by the wait within this, s.
SUM_WITHIN, DELAY_WITHIN = 0.011, 0.015


@dataclass(frozen=True)
class Answers:
    """What a flight says; times in s, NaN where there is no answer.

    Attributes
    ----------
    waited : float
        How long commands waited on the clock of the vehicle.
    named : Estimated
        With the plant behind the limits of the vehicle.
    verdict, plant : str
        Without a named plant.
    delays : tuple of float
        Equivalent delays at `FREQUENCIES`.
    ends : tuple of (float, float)
        Their intervals.
    """

    flight: Flight
    waited: float
    named: Estimated
    verdict: str
    plant: str
    delays: tuple[float, ...]
    ends: tuple[tuple[float, float], ...]

    @property
    def values(self) -> tuple[float, ...]:
        """The sum, and the equivalent delays."""
        return (self.named.total, *self.delays)


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


def answers(folder: Path, flight: Flight) -> Answers:
    """Estimate one flight, with a named plant and without; this runs in other processes."""
    warnings.simplefilter("ignore")  # about feedback
    facts = facts_of(folder, flight)
    log = folder / facts["log"]
    wait = waited(log, facts["number"], flight.axis)
    recording = recording_of(log, facts["number"], flight.axis)
    verdict, plant = "none", ""
    delays = tuple(math.nan for _ in FREQUENCIES)
    ends = tuple((math.nan, math.nan) for _ in FREQUENCIES)
    try:
        acceleration, jerk = (facts["parameters"][name] for name in SHAPING[flight.axis])
        fit = dtm.estimate_delay(recording.behind_limits(0.01 * acceleration, jerk))
        verdict, plant = fit.verdict, fit.best.name
        if verdict != "none":
            view, omega = fit.at(FREQUENCIES), np.array(FREQUENCIES)
            # Less the quarter turn of the integrator.
            delays = tuple((-(view.phase + 0.5 * np.pi) / omega).tolist())
            high, low = (-(view.phase_ci + 0.5 * np.pi) / omega).tolist()
            ends = tuple(zip(low, high, strict=True))
    except dtm.NotIdentifiableError:
        pass
    named = estimated(folder, flight, "limits", True)
    return Answers(flight, wait, named, verdict, plant, delays, ends)


def rises(found: list[Answers]) -> list[tuple[float, list[float]]]:
    """By how much commands waited longer than without a drawn wait, and each answer is larger, s.

    One for each of these flights of one axis in one wind that had a drawn wait.
    """
    rows = np.array([(one.waited, *one.values) for one in found])
    added = np.array([one.flight.added > 0.0 for one in found])
    above = rows[added] - np.nanmean(rows[~added], axis=0)
    return [(float(row[0]), row[1:].tolist()) for row in above]


def run(read: Path | None, keep: Path | None, processes: int, count: int, seed: int | None) -> None:
    """Fly, unless logs are to be read, and print what the answers rise by."""
    with tempfile.TemporaryDirectory() as own:
        folder = read or keep or Path(own)
        if read is None:
            folder.mkdir(parents=True, exist_ok=True)
            fly(folder, drawn(count, seed, tuple(GAINS), tuple(WINDS)))
        flights = sorted(Flight.of(path.stem) for path in folder.glob("*.json"))
        print_rises(folder, flights, processes)


def text(one: Answers) -> str:
    """The answer without a named plant."""
    pairs = zip(FREQUENCIES, one.delays, one.ends, strict=True)
    own = ", ".join(
        f"{delay:.3f} s ({low:.3f} to {high:.3f}) at {omega:g} rad/s"
        for omega, delay, (low, high) in pairs
    )
    return f"{one.flight.name:24}{one.verdict}: {one.plant}, equivalent delay {own}"


def print_rises(folder: Path, flights: list[Flight], processes: int) -> None:
    """Print the estimates, then the rises beside the waits."""
    found = []
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        waiting = [(one, pool.submit(answers, folder, one)) for one in flights]
        for flight, one in waiting:
            try:
                found.append(one.result())
            except ValueError as error:  # the log does not hold what was commanded
                print(f"{flight.name}: {error}", flush=True)
                continue
            print(line(found[-1].named), text(found[-1]), sep="\n", flush=True)
    titles = ["sum", *(f"at {omega:g}" for omega in FREQUENCIES)]
    print(f"\n{'axis, wind':20}{'waited s':>10}" + "".join(f"{f'{t}: off ms':>16}" for t in titles))
    within = np.array([SUM_WITHIN, *(DELAY_WITHIN for _ in FREQUENCIES)])
    met, total = np.zeros(within.size, dtype=int), 0
    for axis, wind in product(GAINS, WINDS):
        some = [one for one in found if one.flight[:2] == (axis, wind)]
        if not any(one.flight.added == 0.0 for one in some):
            continue
        for wait, rise in rises(some):
            off = np.array(rise) - wait
            print(f"{f'{axis}, {wind}':20}{wait:10.4f}" + "".join(f"{1e3 * x:16.1f}" for x in off))
            met += np.abs(off) <= within
            total += 1
    for title, count, most in zip(titles, met, within, strict=True):
        print(f"{title}: {count} of {total} within {1e3 * most:.0f} ms")
    reliable = sum(one.verdict == "reliable" for one in found)
    print(f"reliable without a named plant: {reliable} of {len(found)}")
