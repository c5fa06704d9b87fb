"""Gains with a demanded gain margin from records with small faults, on the true linear plants.

A record of each kind is without a fault or has one of the small ones of its plant, in turn. P has
the low end of the interval of the largest stable gain over the margin. PI and PV, of plants that
integrate, are from `design`, each for some of the records. An actuator with play or stiction
counts by its linear part.
"""

from __future__ import annotations

import math
import os
import time
import warnings

import deadtime as dtm
import numpy as np
from deadtime.estimation import PlantEstimate
from deadtime.loops import Controller
from reality.table import pool_of

from strangers.estimates import known, recording_of
from strangers.faults import Fault, nothing
from strangers.gains import batches, sensitivity
from strangers.linear import Linear
from strangers.plants import KINDS, drawn, random_of
from strangers.rows import lot
from strangers.simulate import logged
from strangers.sizes import size_of

#: The gain margin that is asked for, least share of the true loops that have it, and how many may
#: be unstable.
DEMANDED, MET, UNSTABLE = 2.5, 0.93, 2

#: Factors of the gain between one and the margin with which a loop has to be stable.
FACTORS = np.linspace(1.0, DEMANDED * (1.0 - 1e-9), 4)

#: PI and PV are designed for one of so many records, PV of plants that integrate.
EACH = {"PI": 10, "PV": 5}

#: The row of all plants together.
ALL = "all plants"


def margin_met(plant: Linear, controller: Controller) -> tuple[bool, bool]:
    """Whether the true loop is stable, and whether it is with every gain up to the margin."""
    stable = [math.isfinite(sensitivity(plant, controller, factor)) for factor in FACTORS]
    return stable[0], all(stable)


def designed(
    fit: PlantEstimate, plant: Linear, names: list[str]
) -> dict[str, tuple[bool, bool] | None]:
    """What the true loops do with the gains of each controller; None where none were found."""
    out: dict[str, tuple[bool, bool] | None] = dict.fromkeys(names)
    for name in names:
        try:
            out[name] = margin_met(plant, gains(fit, name))
        except (dtm.DeadtimeError, ValueError):
            continue  # no gains were found
    return out


def gains(fit: PlantEstimate, name: str) -> Controller:
    """A controller of this name with the demanded margin."""
    if name == "P":
        return dtm.P(fit.ci(name="largest_gain")[0] / DEMANDED)
    return dtm.design(fit, controller=getattr(dtm, name), gain_margin=DEMANDED).loop.controller


def tried(kind: str, seed: int, which: range) -> list[dict[str, tuple[bool, bool] | None]]:
    """The designs from these records of a kind that are reliable; this runs in other processes."""
    faults: list[Fault | None] = [None, *lot()[kind]]
    out = []
    for number in which:
        runs = drawn(KINDS[kind], [f"{seed} margins {kind} {number}"])
        chain, fault = nothing(runs), faults[number % len(faults)]
        if fault is not None:
            size = size_of(runs.kind, fault, "small")["size"]
            fault.change(chain, np.array([size]), [random_of(runs.names[0], fault.name, "0")])
        turn = number // len(faults)
        names = ["P", *(name for name, each in EACH.items() if turn % each == 0)]
        if "PV" in names and not runs.linear.integrators:
            names.remove("PV")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about feedback
            try:
                fit = dtm.estimate_delay(
                    recording_of(runs, logged(runs, chain), 0), **known(runs, 0)
                )
            except (dtm.NotIdentifiableError, dtm.RecordingError):
                continue
            if fit.verdict == "reliable":
                out.append(designed(fit, runs.linear, names))
    return out


def line(label: str, name: str, found: list[dict[str, tuple[bool, bool] | None]]) -> str:
    """A row of the table: the designs of one controller. What is demanded is so of all plants."""
    made = [one[name] for one in found if name in one]
    known_loops = [one for one in made if one is not None]
    met = sum(one[1] for one in known_loops)
    unstable = sum(not one[0] for one in known_loops)
    share = 100.0 * met / len(known_loops) if known_loops else math.nan
    text = f"{label:16}{name:4}{len(made):>9}{len(made) - len(known_loops):>10}{unstable:>10}"
    misses = ["unstable"] * (unstable > UNSTABLE) + ["met"] * (share < 100.0 * MET)
    misses = misses if label == ALL else []
    return f"{text}{share:>9.1f}  {', '.join(misses)}".rstrip()


def print_margins(runs: int, seed: int, processes: int) -> None:
    """Design from so many records of all plants together, and print how the true loops do."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")  # the processes are enough
    print(
        f"{f'gain margin {DEMANDED:g}':20}{'reliable':>9}{'no gains':>10}{'unstable':>10}"
        f"{'met, %':>9}  misses"
    )
    begin = time.perf_counter()
    each = max(1, runs // len(KINDS))
    pool = pool_of(processes)
    try:
        waiting = batches(pool, tried, KINDS, seed, each)
        found = {
            kind: [one for part in parts for one in part.result()]
            for kind, parts in waiting.items()
        }
    finally:
        pool.shutdown(cancel_futures=True)
    for name in ("P", *EACH):
        for kind, own in found.items():
            if any(name in one for one in own):
                print(line(kind, name, own))
        print(line(ALL, name, [one for own in found.values() for one in own]))
    print(f"{time.perf_counter() - begin:.0f} s")
