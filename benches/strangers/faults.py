"""What is wrong with a plant, its actuator, its sensor or the log, in a size from zero.

A size is a share: of the usual command for what acts on it, of the usual output for what acts on
that, of the gain, the delay, the record. Everything drawn is drawn for each run, apart from the
size, so that a larger size is more of the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from strangers.linear import Array
from strangers.plants import Kind, Runs, random_of


@dataclass
class Chain:
    """What stands in the way from the command to the log; nothing is wrong at first.

    Attributes
    ----------
    times : ndarray, shape (runs, parts)
        Middles of the parts of the rows, as shares of the record.
    late : ndarray, shape (runs, rows)
        Delay of each command, s.
    actuator : str
        ``"dead zone"``, ``"play"``, ``"stiction"``, ``"unequal limits"`` or none, with its `width`.
    gain, load : ndarray, shape (runs, parts)
        Factor of the command that arrives, and what is added to it then.
    level, drag : ndarray, shape (runs,)
        Relative change of the gain with the output, and the share of v|v| taken from the command.
    added : ndarray, shape (runs, rows)
        What the sensor adds to the output.
    stale : ndarray of bool, shape (runs, rows)
        Rows whose reading is the last one.
    smoothed : ndarray, shape (runs,)
        Rows by which the mean that is logged is wider than one.
    shifted : int
        Rows by which the command is logged late.
    """

    runs: Runs
    times: Array
    late: Array
    gain: Array
    load: Array
    level: Array
    drag: Array
    added: Array
    stale: NDArray[np.bool_]
    smoothed: Array
    actuator: str = ""
    width: Array = field(default_factory=lambda: np.zeros(0))
    shifted: int = 0

    @property
    def span(self) -> Array:
        """Usual change of the output."""
        kind = self.runs.kind
        size = np.abs(self.runs.linear.gain) if kind.controller == "open" else 1.0
        return np.broadcast_to(kind.move[1] * size, len(self.runs)).astype(float)


def nothing(runs: Runs) -> Chain:
    """A chain in which nothing is wrong."""
    kind, number = runs.kind, len(runs)
    parts = kind.rows * kind.parts
    return Chain(
        runs,
        np.broadcast_to((np.arange(parts) + 0.5) / parts, (number, parts)),
        np.repeat(runs.linear.delay[:, None], kind.rows, axis=1),
        np.ones((number, parts)),
        np.zeros((number, parts)),
        np.zeros(number),
        np.zeros(number),
        np.zeros((number, kind.rows)),
        np.zeros((number, kind.rows), dtype=bool),
        np.zeros(number),
    )


#: Changes a chain by sizes of shape (runs,), with random numbers for each run.
Change = Callable[[Chain, Array, list[np.random.Generator]], None]


@dataclass(frozen=True)
class Fault:
    """A fault.

    Attributes
    ----------
    change : callable
        Puts it into a chain.
    largest : float
        The largest size that is taken.
    cause : str
        The name that an estimate should give, empty if it has none.
    in_loop : bool
        Whether it is part of what a loop feels, so that the truth is a range.
    moving : bool
        Whether the plant changes while it is recorded.
    """

    name: str
    change: Change
    largest: float
    cause: str = ""
    in_loop: bool = False
    moving: bool = False

    def suits(self, kind: Kind) -> bool:
        """Whether there is such a thing: some need a command around zero, a speed or a loop.

        Of open steps, stiction leaves no trace as long as it is smaller than the steps.
        """
        if self.name in ("dead zone", "unequal limits"):
            return kind.at[0] == 0.0
        if self.name == "drag":
            return kind.at[0] == 0.0 and kind.name != "internet loop"
        return self.name not in ("shifted column", "stiction") or kind.controller != "open"

    def chain(self, runs: Runs, sizes: Array, time: int = 0) -> Chain:
        """The chain with the fault in these sizes; other times draw other random numbers."""
        chain = nothing(runs)
        self.change(chain, sizes, [random_of(name, self.name, str(time)) for name in runs.names])
        return chain


def _each(random: list[np.random.Generator], low: float, high: float) -> Array:
    return np.array([one.uniform(low, high) for one in random])


def _signs(random: list[np.random.Generator]) -> Array:
    return np.array([one.choice([-1.0, 1.0]) for one in random])


def _coloured(random: list[np.random.Generator], keep: Array, size: int) -> Array:
    """Stationary noise of deviation one, x[k+1] = keep x[k] + white."""
    out = np.array([one.standard_normal(size) for one in random])
    fresh = np.sqrt(1.0 - keep**2)
    for k in range(1, size):
        out[:, k] = keep * out[:, k - 1] + fresh * out[:, k]
    return out


def _load(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    begin = _each(random, 0.3, 0.7)[:, None]
    size = sizes * _signs(random) * chain.runs.kind.swing
    chain.load = size[:, None] * (chain.times >= begin)


def _actuator(name: str, chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    chain.actuator = name
    chain.width = sizes * chain.runs.kind.swing


def _drag(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    kind = chain.runs.kind
    speed = chain.span if kind.filtered else chain.runs.linear.gain * kind.swing
    chain.drag = sizes * kind.swing / speed**2


def _ramp(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    chain.gain = 1.0 + (sizes * _signs(random))[:, None] * (chain.times - 0.5)


def _level(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    chain.level = sizes * _signs(random) / chain.span


def _swing(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    turns, start = _each(random, 3.0, 7.0), _each(random, 0.0, 1.0)
    angle = 2.0 * np.pi * (turns[:, None] * chain.times + start[:, None])
    chain.gain = 1.0 + sizes[:, None] * np.sin(angle)


def _delay_change(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    rows = chain.late.shape[1]
    after = np.arange(rows) >= rows * _each(random, 0.3, 0.7)[:, None]
    chain.late = chain.late * (1.0 + sizes[:, None] * after)


def _wander(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    rows = chain.late.shape[1]
    noise = _coloured(random, np.full(len(random), np.exp(-10.0 / rows)), rows)
    chain.late = np.maximum(chain.late * (1.0 + sizes[:, None] * noise), 0.0)


def _jitter(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    noise = np.array([one.standard_normal(chain.late.shape[1]) for one in random])
    chain.late = np.maximum(chain.late * (1.0 + sizes[:, None] * noise), 0.0)


def _repeated(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    chain.stale = np.array([one.random(chain.late.shape[1]) for one in random]) < sizes[:, None]


def _frozen(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    rows = chain.late.shape[1]
    first = np.round(rows * _each(random, 0.15, 0.6))[:, None]
    last = first + np.round(rows * sizes)[:, None]
    chain.stale = (np.arange(rows) >= first) & (np.arange(rows) < last)


def _glitches(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    rows = np.arange(chain.late.shape[1])
    for _ in range(2):
        first, long = _each(random, 0.1, 0.9) * rows.size, _each(random, 3.0, 8.0)
        glitch = (rows >= first[:, None]) & (rows < (first + long)[:, None])
        chain.added += (sizes * _signs(random) * chain.span)[:, None] * glitch


def _jump(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    rows = np.arange(chain.late.shape[1])
    after = rows >= rows.size * _each(random, 0.3, 0.7)[:, None]
    chain.added = (sizes * _signs(random) * chain.span)[:, None] * after


def _smoothed(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    chain.smoothed = sizes


def _shifted(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    chain.shifted = round(float(sizes.max(initial=0.0)))


def _wave(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    runs = chain.runs
    omega, start = runs.linear.crossover() * _each(random, 0.5, 1.2), _each(random, 0.0, 6.28)
    time = np.arange(chain.late.shape[1]) * runs.dt[:, None]
    wave = np.sin(omega[:, None] * time + start[:, None])
    chain.added = (sizes * chain.span)[:, None] * wave


def _drift(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    rows = chain.late.shape[1]
    steps = np.array([one.standard_normal(rows) for one in random]) / np.sqrt(rows)
    chain.added = (sizes * chain.span)[:, None] * np.cumsum(steps, axis=1)


def _wind(chain: Chain, sizes: Array, random: list[np.random.Generator]) -> None:
    runs = chain.runs
    time = _each(random, 0.7, 3.0) / runs.linear.crossover()
    keep = np.exp(-runs.dt / runs.kind.parts / time)
    noise = _coloured(random, keep, chain.load.shape[1])
    chain.load = (sizes * runs.kind.swing)[:, None] * noise


FAULTS = {
    fault.name: fault
    for fault in (
        Fault("load", _load, 0.6, "load"),
        Fault("dead zone", partial(_actuator, "dead zone"), 0.6, "dead zone", in_loop=True),
        Fault("play", partial(_actuator, "play"), 0.8, "play", in_loop=True),
        Fault("stiction", partial(_actuator, "stiction"), 0.6, "stiction", in_loop=True),
        Fault(
            "unequal limits",
            partial(_actuator, "unequal limits"),
            0.9,
            "unequal limits",
            in_loop=True,
        ),
        Fault("drag", _drag, 2.0, "drag", in_loop=True),
        Fault("gain ramp", _ramp, 1.2, "gain ramp", in_loop=True),
        Fault("gain by level", _level, 0.8, "gain by level", in_loop=True),
        Fault("gain swing", _swing, 0.8, in_loop=True, moving=True),
        Fault("delay change", _delay_change, 1.0, "delay change", in_loop=True),
        Fault("delay wander", _wander, 0.8, in_loop=True, moving=True),
        Fault("delay jitter", _jitter, 0.8, in_loop=True, moving=True),
        Fault("repeated readings", _repeated, 0.8, in_loop=True),
        Fault("frozen", _frozen, 0.3),
        Fault("glitches", _glitches, 3.0),
        Fault("offset jump", _jump, 1.5, "output step"),
        Fault("smoothed", _smoothed, 30.0),
        Fault("shifted column", _shifted, 1.0, "shifted column"),
        Fault("wave", _wave, 0.6),
        Fault("drift", _drift, 1.0),
        Fault("wind", _wind, 0.8),
    )
}


def named_size(fault: Fault, chain: Chain, sizes: Array, output: Array) -> Array:
    """The size in the units in which an estimate gives that of its cause, from logged outputs.

    Load: what is added to the command. Output step: the step. Dead zone: command on each side that
    has no effect. Play and stiction: width between the two sides. Unequal limits: the nearer limit.
    Drag: the factor of v|v|, taken from the command. Ramp: relative change of the gain over the
    record. Level: that over the range of the output. Delay change: s. Column: rows.
    """
    if fault.name == "load":
        return np.asarray(np.abs(chain.load).max(axis=1))
    if fault.name == "offset jump":
        return sizes * chain.span
    if fault.name == "unequal limits":
        return chain.runs.kind.swing - chain.width
    if chain.actuator:
        return chain.width
    if fault.name == "drag":
        return chain.drag
    if fault.name == "gain by level":
        return np.asarray(np.abs(chain.level) * np.ptp(output, axis=1))
    if fault.name == "delay change":
        return sizes * chain.runs.linear.delay
    return sizes
