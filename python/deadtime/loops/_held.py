"""Loops with a hold over two of their numbers, in rows along which a gain varies.

The feedback is linear in the gains of the controller, and the command in the gain of the plant.
Along a row one of these varies, if the map is over one of them; every other number may change from
row to row. Where it is none of them, every cell is a row of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.progress import Report
from deadtime.loops._controllers import Controller
from deadtime.loops._model import LoopModel, refuse_discretised
from deadtime.loops._native import (
    MapBoundary,
    MapCells,
    held_boundaries,
    held_map,
)
from deadtime.loops._plants import Plant


class HeldRows(NamedTuple):
    """Rows of loops u = (K + k K_slope) x + ...: arrays with one entry for all, or one a row."""

    rows: int
    #: Of the arrays; a row may use fewer of them, from the first on.
    states: int
    used: Array
    A: Array
    B: Array
    K: Array
    L: Array
    K_slope: Array
    L_slope: Array
    delay: Array
    sample_time: Array
    points: Array


class Feedback(NamedTuple):
    """u = K x + L w."""

    K: Array
    L: Array


class _Equations(NamedTuple):
    """Equations, one entry for all rows or one a row, and each gain's share of the feedback."""

    used: Array
    A: Array
    B: Array
    shares: dict[str, Feedback]


class Question(NamedTuple):
    """What is asked of every cell."""

    abscissa: bool
    decay: float
    damping: tuple[float, float] | None
    proof: str


@dataclass(frozen=True)
class HeldFamily:
    """A sampled loop of which two numbers vary."""

    plant: Plant
    controller: Controller
    #: Values of all numbers; those of the axes play no part.
    values: dict[str, float]
    axes: dict[str, Array]

    def __post_init__(self) -> None:
        refuse_discretised(self.controller, 1.0, "a map")
        for name in ("delay", "sample_time"):
            low = float(np.min(self.axes.get(name, np.array(self.values[name]))))
            if low < 0.0 or (name == "sample_time" and low == 0.0):
                raise ValueError(f"{name}={low}: delays are zero or more, sample times above zero")

    def cells(self, question: Question, threads: int | None, report: Report | None) -> MapCells:
        """Count (and abscissa) of every cell."""
        first, second = (len(points) for points in self.axes.values())
        return held_map(
            self._rows,
            self._column,
            question,
            shape=(first, second),
            as_columns=self.along == next(iter(self.axes)),
            threads=threads,
            progress=report,
        )

    def boundaries(self, decay: float, damping: tuple[float, float] | None) -> list[MapBoundary]:
        """Curves of crossings, found along a gain, and along the other number if that is one."""
        if self.along is None:
            raise ValueError(
                f"neither {' nor '.join(self.axes)} is a gain: the crossings of a sampled loop are "
                "found along a gain of its controller or plant"
            )
        (across,) = (name for name in self.axes if name != self.along)
        columns = None
        if across in self._gains:
            columns = self._held({self.along: self.axes[self.along]}, across, self.axes[across])
        along = (self.along, across)
        return held_boundaries(self._rows, columns, along=along, decay=decay, damping=damping)

    @cached_property
    def along(self) -> str | None:
        """The gain that varies along the rows: best one that moves a pole at z = 1."""
        names = [name for name in self.axes if name in self._gains]
        return max(
            names, key=lambda name: (self._moves_rest(name), len(self.axes[name])), default=None
        )

    @property
    def _gains(self) -> tuple[str, ...]:
        """The numbers in which the loop gain is linear."""
        return (*self.controller._gains(), "gain")

    def _moves_rest(self, name: str) -> bool:
        """Whether the feedback at rest depends on this gain."""
        if name == "gain":
            return True
        gains = self.controller._gains()
        alone = self.values | dict.fromkeys(gains, 0.0) | {name: 1.0}
        num, _ = self.controller._feedback(alone)
        return bool(num[-1] != 0.0)

    @cached_property
    def _rows(self) -> HeldRows:
        across = {name: points for name, points in self.axes.items() if name != self.along}
        grids = np.meshgrid(*across.values(), indexing="ij")
        moving = {name: grid.ravel() for name, grid in zip(across, grids, strict=True)}
        points = np.zeros(1) if self.along is None else self.axes[self.along]
        return self._held(moving, self.along, points)

    @cached_property
    def _column(self) -> HeldRows | None:
        """The loops of the middle of all rows, where the number across them is a gain too."""
        across = [name for name in self.axes if name != self.along]
        if self.along is None or across[0] not in self._gains:
            return None
        points = self.axes[self.along]
        middle = {self.along: points[len(points) // 2 : len(points) // 2 + 1]}
        return self._held(middle, across[0], self.axes[across[0]])

    def _held(self, moving: Mapping[str, Array], along: str | None, points: Array) -> HeldRows:
        """Rows with these values of what changes from row to row."""
        rows = max((len(points) for points in moving.values()), default=1)
        gains = self.controller._gains()
        fixed = {**self.values, "gain": self.values.get("gain", 1.0)}
        numbers = {name: np.array([value]) for name, value in fixed.items()} | dict(moving)
        equations = self._equations({n: v for n, v in moving.items() if n not in (*gains, "gain")})
        size = equations.B.shape[-1]
        K, L = np.zeros((1, size)), np.zeros(1)
        K_slope, L_slope = np.zeros((1, size)), np.zeros(1)
        gain = np.ones(1) if along == "gain" else numbers["gain"]
        for name, share in equations.shares.items():
            own = gain if name == along else gain * numbers[name]
            if along in ("gain", name):
                K_slope = K_slope + own[:, None] * share.K
                L_slope = L_slope + own * share.L
            else:
                K, L = K + own[:, None] * share.K, L + own * share.L
        return HeldRows(
            rows=rows,
            states=size,
            used=equations.used,
            A=equations.A,
            B=equations.B,
            K=K,
            L=L,
            K_slope=K_slope,
            L_slope=L_slope,
            delay=numbers["delay"],
            sample_time=numbers["sample_time"],
            points=points,
        )

    def _equations(self, moving: Mapping[str, Array]) -> _Equations:
        """Equations where numbers other than gains have these values, each combination once."""
        moving = {n: v for n, v in moving.items() if n not in ("delay", "sample_time")}
        if not moving:
            return self._equations_at({})
        columns = np.column_stack(list(moving.values()))
        distinct, place = np.unique(columns, axis=0, return_inverse=True)
        found = [
            self._equations_at(dict(zip(moving, row, strict=True))) for row in distinct.tolist()
        ]
        # With a lag of zero there is one state less.
        size = max(one.B.shape[-1] for one in found)
        spread = place.ravel()

        def joined(arrays: list[Array]) -> Array:
            return np.concatenate([_padded(array, size) for array in arrays])[spread]

        shares = {
            name: Feedback(
                joined([one.shares[name].K for one in found]),
                np.concatenate([one.shares[name].L for one in found])[spread],
            )
            for name in self.controller._gains()
        }
        return _Equations(
            np.concatenate([one.used for one in found])[spread],
            joined([one.A for one in found]),
            joined([one.B for one in found]),
            shares,
        )

    def _equations_at(self, changed: Mapping[str, float]) -> _Equations:
        gains = self.controller._gains()
        shares = {}
        for name in gains:
            alone = {**self.values, **changed, **dict.fromkeys(gains, 0.0), name: 1.0, "gain": 1.0}
            model = LoopModel.build(self.plant, self.controller, alone)
            shares[name] = Feedback(model.K[None, :], np.array([float(model.L)]))
        return _Equations(np.array([float(len(model.B))]), model.A[None], model.B[None], shares)


def _padded(array: Array, size: int) -> Array:
    """The array with zeros after the last entry of all axes but the first."""
    return np.pad(array, [(0, 0)] + [(0, size - array.shape[-1])] * (array.ndim - 1))
