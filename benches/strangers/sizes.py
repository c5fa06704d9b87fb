"""How large a fault must be to do harm: the sizes that move an answer by 1 and 5 standard errors.

A fit of the true structure to responses without noise is moved by the fault. The size is that at
which the median over some runs is 1 or 5 standard errors of the clean fit, of gain or equivalent
delay at crossover, whichever moves more. The sizes are kept in `sizes.json`; a pair of plant and
fault that is not in it is found and added.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from strangers.faults import Fault
from strangers.least_squares import data_of, fitted, standard_errors
from strangers.linear import Array
from strangers.plants import Kind, Runs, drawn
from strangers.simulate import logged

#: Where sizes are kept, and the seed of the runs they are found on.
FILE, SEED = Path(__file__).with_name("sizes.json"), 7001

#: Errors by which the two sizes move an answer.
MOVES = {"small": 1.0, "large": 5.0}

#: Runs, sizes that are tried at once, the least as a share of the largest, and rounds.
RUNS, TRIED, LEAST, ROUNDS = 12, 9, 3e-4, 3


def moved(runs: Runs, fault: Fault, sizes: Array) -> Array:
    """Errors by which each of the sizes moves the answer, in the median over the runs."""
    kind, omega = runs.kind, runs.linear.crossover()
    clean = logged(runs)
    data = data_of(kind, runs.dt, clean.command, clean.output)
    errors = standard_errors(runs.linear, data, runs.deviation, omega)[:, :2]
    many = _repeated(runs, sizes.size)
    logs = logged(many, fault.chain(many, np.repeat(sizes, len(runs))))
    faulty = data_of(kind, many.dt, logs.command, logs.output)
    felt = fitted(many.linear, faulty).felt(np.tile(omega, sizes.size))[:, :2]
    shifts = (felt.reshape(sizes.size, -1, 2) - runs.linear.felt(omega)[:, :2]) / errors
    return np.asarray(np.median(np.abs(shifts).max(axis=2), axis=1))


def _repeated(runs: Runs, times: int) -> Runs:
    """All runs, so many times one after the other."""
    names = ("dt", "deviation", "Kp", "Ki", "reference", "noise")
    arrays = {name: np.concatenate([getattr(runs, name)] * times) for name in names}
    return replace(runs, linear=runs.linear.repeated(times), names=runs.names * times, **arrays)


def found(kind: Kind, fault: Fault, goal: float) -> dict[str, float]:
    """The least size that moves the answer so far, and by how much it does.

    The largest where none does. A bracket is divided into parts, again and again.
    """
    if fault.name == "shifted column":
        return {"size": 1.0, "moves": float(moved(_runs(kind), fault, np.ones(1))[0])}
    low, high = LEAST * fault.largest, fault.largest
    runs = _runs(kind)
    for _ in range(ROUNDS):
        sizes = np.geomspace(low, high, TRIED)
        moves = moved(runs, fault, sizes)
        if not (moves >= goal).any():
            break
        first = int((moves >= goal).argmax())
        low, high = sizes[max(first - 1, 0)], sizes[first]
    place = int((moves >= goal).argmax()) if (moves >= goal).any() else -1
    return {"size": float(f"{sizes[place]:.4g}"), "moves": float(f"{moves[place]:.3g}")}


def _runs(kind: Kind) -> Runs:
    return drawn(kind, [f"{SEED} {kind.name} {i}" for i in range(RUNS)]).quiet


def size_of(kind: Kind, fault: Fault, which: str) -> dict[str, float]:
    """The small or the large size of a fault, and by how many errors it moves an answer."""
    known = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    own = known.setdefault(kind.name, {}).setdefault(fault.name, {})
    if which not in own:
        own[which] = found(kind, fault, MOVES[which])
        FILE.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return dict(own[which])
