"""Gains proposed from records with small faults, on the linear plants that made the records.

A record of each kind has one of the small faults of its plant, heights have wind besides. `tune`
proposes gains from each reliable estimate, and its gate may refuse them. Stability and the largest
sensitivity of the true loop are taken from its frequency response. An actuator with play or
stiction counts by its linear part.
"""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import TypeVar

import deadtime as dtm
import numpy as np
from deadtime.loops import Controller
from reality.table import pool_of

from strangers.estimates import known, recording_of
from strangers.faults import FAULTS, Chain, nothing
from strangers.linear import Array, Linear
from strangers.plants import KINDS, Runs, drawn, random_of
from strangers.rows import lot
from strangers.simulate import logged
from strangers.sizes import size_of

#: What is proposed for each kind of record, and how it is called.
PROPOSED: dict[str, tuple[str, type[dtm.P] | type[dtm.PI]]] = {
    "open steps": ("bump test", dtm.PI),
    "process PI": ("PI loop", dtm.PI),
    "height lag": ("height steps in wind", dtm.P),
}

#: The sensitivity that is demanded, and the largest share of the proposals above it.
DEMANDED, ABOVE = 1.6, 0.07

#: Least share of the reliable estimates whose gains pass.
PASSED = 0.6

#: Size of the wind, as a share of the usual command.
WIND = 0.02

#: Frequencies at which the true loop is looked at, and decades around 1 / (sum of all times).
PLACES, DECADES = 40_000, 4.0

#: Records that a process makes at once.
BATCH = 10

T = TypeVar("T")


@dataclass(frozen=True)
class Proposed:
    """What came of one record.

    Attributes
    ----------
    verdict : str
        That of the estimate.
    passed : bool
        Whether gains were proposed.
    sensitivity : float
        Of the true loop; infinite of an unstable one, NaN without gains.
    """

    verdict: str
    passed: bool
    sensitivity: float
    seconds: float


def sensitivity(plant: Linear, controller: Controller, factor: float = 1.0) -> float:
    """Ms of a loop with one of the plants; infinite where it is unstable (Nyquist).

    `factor` multiplies the gains.

    The plant has no poles to the right. So 1 + L turns by a quarter turn for each pole at zero, or
    the loop has poles to the right.
    """
    w = 10.0 ** np.linspace(-DECADES, DECADES, PLACES)[None, :] / plant._time[:, None]
    size, angle = plant.response(w)
    s = 1j * w[0]
    Kp, Ki, Kv = (getattr(controller, name, 0.0) for name in ("Kp", "Ki", "Kv"))
    poles = plant.integrators + (Ki != 0.0)
    C = factor * (Kp + Ki / s + Kv * s)
    G = np.sign(plant.gain) * np.exp(size[0] + 1j * angle[0]) / 1j**plant.integrators
    difference = 1.0 + C * G
    turned = float(np.unwrap(np.angle(difference))[[0, -1]] @ [-1.0, 1.0])
    if round(2.0 * turned / math.pi) != poles:
        return math.inf
    return float(1.0 / np.abs(difference).min())


def proposed(kind: str, seed: int, which: range) -> list[Proposed]:
    """Make these records of a kind, and ask for gains; this runs in other processes."""
    faults = lot()[kind]
    out = []
    for number in which:
        fault = faults[number % len(faults)]
        runs = drawn(KINDS[kind], [f"{seed} gains {kind} {number}"])
        chain = nothing(runs)
        if kind == "height lag":
            blown(chain)
        size = size_of(runs.kind, fault, "small")["size"]
        fault.change(chain, np.array([size]), [random_of(runs.names[0], fault.name, "0")])
        out.append(answer(kind, runs, chain))
    return out


def blown(chain: Chain) -> None:
    """Wind."""
    random = [random_of(name, "wind", "0") for name in chain.runs.names]
    FAULTS["wind"].change(chain, np.full(len(random), WIND), random)


def answer(kind: str, runs: Runs, chain: Chain) -> Proposed:
    """The gains of one record on its true loop."""
    logs = logged(runs, chain)
    begin = time.process_time()
    verdict, found = "none", math.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about feedback
        try:
            fit = dtm.estimate_delay(recording_of(runs, logs, 0), **known(runs, 0))
            verdict = fit.verdict
            if verdict == "reliable":
                proposal = dtm.tune(fit, controller=PROPOSED[kind][1])
                if proposal.verdict != "none":
                    found = sensitivity(runs.linear, proposal.controller)
        except (dtm.DeadtimeError, ValueError):
            pass  # no answer, or no gains: nothing is proposed
    return Proposed(verdict, not math.isnan(found), found, time.process_time() - begin)


def line(kind: str, found: list[Proposed]) -> str:
    """A row of the table."""
    reliable = sum(one.verdict == "reliable" for one in found)
    ms: Array = np.array([one.sensitivity for one in found if one.passed])
    unstable = int(np.isinf(ms).sum())
    above = int((ms > DEMANDED * (1.0 + 1e-6)).sum())
    largest = float(ms.max(initial=0.0))
    misses = [
        name
        for name, missed in (
            ("unstable", unstable > 0),
            ("above", above > ABOVE * max(ms.size, 1)),
            ("passed", ms.size < PASSED * reliable),
        )
        if missed
    ]
    seconds = sum(one.seconds for one in found) / len(found)
    return (
        f"{PROPOSED[kind][0]:24}{len(found):>9}{reliable:>10}{ms.size:>8}{unstable:>10}{above:>10}"
        f"{largest:>12.3f}{seconds:>7.1f}  {', '.join(misses)}"
    ).rstrip()


def batches(
    pool: Executor,
    work: Callable[[str, int, range], list[T]],
    kinds: Iterable[str],
    seed: int,
    runs: int,
) -> dict[str, list[Future[list[T]]]]:
    """Work on so many records of each kind, `BATCH` of them at once, in the processes of a pool."""
    starts = range(0, runs, BATCH)
    return {
        kind: [pool.submit(work, kind, seed, range(i, min(i + BATCH, runs))) for i in starts]
        for kind in kinds
    }


def print_gains(runs: int, seed: int, processes: int) -> None:
    """Propose gains from so many records of each kind, and print how the true loops do."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")  # the processes are enough
    print(
        f"{'Ms of at most 1.6':24}{'records':>9}{'reliable':>10}{'passed':>8}{'unstable':>10}"
        f"{'Ms above':>10}{'largest Ms':>12}{'s':>7}  misses"
    )
    begin = time.perf_counter()
    pool = pool_of(processes)
    try:
        waiting = batches(pool, proposed, PROPOSED, seed, runs)
        for kind, parts in waiting.items():
            print(line(kind, [one for part in parts for one in part.result()]), flush=True)
    finally:
        pool.shutdown(cancel_futures=True)
    print(f"{time.perf_counter() - begin:.0f} s")
