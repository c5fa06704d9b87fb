"""Plant and controller put together as the equations that the stepper takes.

x' = A x + B w + E r, u = K x + L w + M r, y = C x + D w, w(t) = sat(u(t - Td)): the plant's states
come first in x, the controller's after them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, increasing, real_array
from deadtime.loops._controllers import Controller, FilterUpdate
from deadtime.loops._entries import Each, number, vector, zeros
from deadtime.loops._native import LinearLoop
from deadtime.loops._plants import Plant, StateSpace, realise, rest


class SampleUpdate(NamedTuple):
    """What a sample does to the states: x becomes J x + G w + H r."""

    states: Array
    command: Array
    reference: Array


class LoopRun(NamedTuple):
    """Where a run starts, and its reference, as the stepper takes them."""

    state: Array
    #: Before the start.
    command: float
    reference_before: float = 0.0
    #: A number, to which the reference steps at the start, or values that hold from their times on.
    reference: float | Array = 0.0
    reference_time: Array | None = None
    #: Commands at the samples before the start, the latest one last.
    command_history: Array | None = None
    sample_phase: float = 0.0


class RunArguments(NamedTuple):
    """The arguments of `ControlLoop.simulate`, as they were given."""

    time: ArrayLike
    reference: ArrayLike
    initial_output: float = 0.0
    reference_before: float | None = None
    reference_time: ArrayLike | None = None
    command_history: ArrayLike = ()
    sample_phase: float = 0.0
    sensitivities: Sequence[str] = ()

    def rest(self) -> tuple[float, float]:
        """Output and reference before the start."""
        initial = finite("initial_output", self.initial_output)
        if self.reference_before is None:
            return initial, initial
        return initial, finite("reference_before", self.reference_before)


class ReferenceJumps(NamedTuple):
    """A reference that holds `values` from `times` on, and `before` until the first of them."""

    times: Array
    values: Array
    before: float

    def at(self, times: Array) -> Array:
        place = np.searchsorted(self.times, times, side="right")
        return np.concatenate([[self.before], self.values])[place]

    def just_before(self, time: float) -> float:
        """The value from which it jumps, if it does, at `time`."""
        return float(self.at(np.array([np.nextafter(time, -np.inf)]))[0])


@dataclass(eq=False)
class LoopModel:
    """The matrices of a loop with numbers in the place of every parameter.

    Entries may be `Each`: the numbers of many loops. It never changes, but is not frozen either:
    that would take three times as long to make.
    """

    A: Array
    B: Array
    E: Array
    K: Array
    L: Any
    M: Any
    C: Array
    D: Any
    impulse: Any
    #: What a sample does to the states, where a discretised filter has some.
    update: SampleUpdate | None = None
    #: The plant alone.
    plant: StateSpace | None = None

    @classmethod
    def build(cls, plant: Plant, controller: Controller, values: Mapping[str, Any]) -> LoopModel:
        """Close the loop around `plant`, numbers taken from `values`."""
        p = realise(*plant._polynomials(values))
        c = controller._equations(values)
        if c.q != 0.0 and p.D != 0.0:
            raise ValueError(
                f"the plant passes its command straight to its output (D={p.D}), so its output "
                "has no ideal derivative: give the controller a DerivativeFilter"
            )
        n, m = len(p.B), len(c.B)
        # The first state of a plant is y - D w.
        K, L = vector([c.p, *[0.0] * (n - 1)]) if n else p.C, c.p * p.D
        if c.q != 0.0:
            K, L = K + c.q * (p.C @ p.A), L + c.q * (p.B @ p.C)
        A, B, E, C = p.A, p.B, np.zeros(n), p.C
        if m > 0:
            A = zeros((n + m, n + m), p.A, c.A, c.B)
            A[:n, :n] = p.A
            A[n:, :n] = c.B[:, None] * p.C
            A[n:, n:] = c.A
            B, E = np.concatenate([p.B, c.B * p.D]), np.concatenate([E, c.E])
            K, C = np.concatenate([K, c.C]), np.concatenate([p.C, np.zeros(m)])
        return cls(
            A=A,
            B=B,
            E=E,
            K=K,
            L=number(L),
            M=number(c.M),
            C=C,
            D=p.D,
            impulse=number(c.impulse),
            update=None if c.update is None else _update(p, c.update, n + m),
            plant=p,
        )

    def row(self, delay: Any, sample_time: Any = None, limit: Any = None) -> NDArray[Any]:
        """Write the loop as one row of numbers for the native part.

        Returns
        -------
        ndarray, shape (n * n + 4 n + 7,)
            A, B, E, K, C, L, M, D, impulse, the delay, the sample time (0 for none) and the limit
            (infinite for none).
        """
        period = 0.0 if sample_time is None else sample_time
        bound = np.inf if limit is None else limit
        numbers = vector([self.L, self.M, self.D, self.impulse, delay, period, bound])
        return np.concatenate([self.A.ravel(), self.B, self.E, self.K, self.C, numbers])

    def entries(
        self, delay: Any, sample_time: Any = None, limit: Any = None
    ) -> list[float | Array]:
        """`row` for many loops: each entry one number for all, or an array of one for each."""
        row = self.row(delay, sample_time, limit).tolist()
        return [entry.numbers if isinstance(entry, Each) else entry for entry in row]

    def native(
        self,
        delay: float,
        sample_time: float | None = None,
        limit: float | None = None,
        is_ahead: bool = False,
    ) -> LinearLoop:
        """Return the loop as the stepper holds it; `is_ahead`: the delay is in the measurement."""
        return LinearLoop(self, delay, sample_time, limit, is_ahead)

    @cached_property
    def rest_gains(self) -> tuple[float, float] | None:
        """Output and command at rest under a unit reference, None where there is no such rest."""
        n = len(self.B)
        matrix = np.zeros((n + 1, n + 1))
        A, B, E = self.A, self.B, self.E
        if self.update is not None:
            # What a sample moves rests where the sample does not move it.
            A = A + self.update.states - np.eye(n)
            B, E = B + self.update.command, E + self.update.reference
        matrix[:n, :n] = A
        matrix[:n, n] = B
        matrix[n, :n] = self.K
        matrix[n, n] = self.L - 1.0
        scale = np.abs(matrix).sum(axis=1)
        if not scale.all():
            return None
        matrix /= scale[:, None]
        right = -np.append(E, self.M) / scale
        if np.linalg.cond(matrix) > 1e13:
            return None
        x = np.linalg.solve(matrix, right)
        return float(self.C @ x[:n] + self.D * x[n]), float(x[n])


def _update(plant: StateSpace, update: FilterUpdate, size: int) -> SampleUpdate:
    """What a sample does to all states: the filter reads the output, its states come last."""
    states, command, reference = np.eye(size), np.zeros(size), np.zeros(size)
    n = len(plant.B)
    states[-2:, -2:] = update.F
    states[-2:, :n] = np.outer(update.G, plant.C)
    command[-2:] = update.G * plant.D
    reference[-2:] = update.H
    return SampleUpdate(states, command, reference)


def refuse_discretised(controller: Controller, sample_time: float | None, what: str) -> None:
    """Raise where a filter runs in samples, which `what` cannot do."""
    smooth = controller._filter
    if sample_time is not None and smooth is not None and smooth.discretisation is not None:
        raise ValueError(
            f"{what} cannot run a filter in samples (discretisation={smooth.discretisation!r}): "
            "leave its discretisation out, or take loops one by one"
        )


def rest_of(plant: Plant, controller: Controller, values: Mapping[str, Any]) -> tuple[Any, Any]:
    """Output and command at rest under a unit reference, NaN where there is no such rest.

    `LoopModel.rest_gains` of many loops: with plant b/a, feedback f/g and reference path q/g they
    are b q / (a g + b f) and a q / (a g + b f) at s = 0.
    """
    b, a = (part[-1] for part in plant._polynomials(values))
    f, g = (part[-1] for part in controller._feedback(values))
    q = controller._reference(values)[0][-1]
    total = a * g + b * f
    exists = np.abs(total) > 1e-13 * (np.abs(a * g) + np.abs(b * f))
    total = np.where(exists, total, np.nan)
    return b * q / total, a * q / total


def state_at_rest(
    plant: Plant,
    controller: Controller,
    values: Mapping[str, Any],
    output: float,
    reference: float,
    space: StateSpace | None = None,
) -> tuple[Array, Any]:
    """State of a loop whose plant rests at `output`, and the command that holds it there.

    `space` is the plant's state space, where that is known.
    """
    state, command = rest(*plant._polynomials(values), output, space)
    return np.concatenate([state, controller._rest(values, output, reference, command)]), command


def reference_jumps(
    times: Array, reference: ArrayLike, reference_time: ArrayLike | None, before: float
) -> ReferenceJumps:
    """The reference as jumps: one number steps at the first of `times`."""
    values = real_array("reference", reference)
    if values.ndim == 0:
        if reference_time is not None:
            raise ValueError(
                f"reference={values} is one number, so reference_time has no meaning: give an "
                "array of as many values as there are times"
            )
        return ReferenceJumps(times[:1], values.reshape(1), before)
    where = times if reference_time is None else increasing("reference_time", reference_time)
    if values.shape != where.shape or values.size == 0:
        raise ValueError(
            f"reference has shape {values.shape} and its times {where.shape}: give one value for "
            "each element of reference_time (or of time, without reference_time), at least one"
        )
    return ReferenceJumps(where, values, before)
