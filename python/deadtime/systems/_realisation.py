"""Linear systems with delays in the form for the native simulation.

    x'(t) + sum N_j x'(t - tau_j) = sum A_j x(t - tau_j) + sum B_j u(t - tau_j),
    y(t) = sum C_j x(t - tau_j) + sum F_j x'(t - tau_j) + sum D_j u(t - tau_j).

A transfer function num/den with den of degree n is y = num(s) w, den(s) w = u, with the states
w, w', ..., w^(n-1): the terms s^n e^{-s tau_j} of den make it neutral, those of num are the F_j.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime.roots import QuasiPolynomial, Ratio
from deadtime.systems._native import LinearSystem

Group = Mapping[float, NDArray[np.float64]]
_Terms: TypeAlias = Sequence[tuple[float, NDArray[np.float64]]]


@dataclass(frozen=True, eq=False)
class Realisation:
    """The native system, and its properties that a simulation needs."""

    native: LinearSystem
    states: int
    inputs: int
    outputs: int
    #: Matrix of the state without delay.
    A: NDArray[np.float64]
    #: The longest delay, s.
    longest: float
    #: Length of the history of the state that is needed, s.
    memory: float
    #: Whether the derivative of the history is needed.
    needs_slopes: bool
    #: Whether the states are those of the user's system.
    has_states: bool
    #: If not: the state at rest under an input of one; None if there is no such state.
    rest: NDArray[np.float64] | None = None
    #: Rate of the fastest growing mode that does not show in the outputs, 1/s; 0 without one.
    hidden_rate: float = 0.0


class Realisable(Protocol):
    """A system that can be simulated."""

    def _realised(self) -> Realisation: ...

    def _gains_at_rest(self) -> NDArray[np.float64] | None:
        """Steady-state gains, shape (n_outputs, n_inputs); None if there are none."""


class Differentiable(Protocol):
    """A system whose impulse response is the step response of its derivative."""

    def _differentiated(self) -> Realisable:
        """Give the system whose outputs are the derivatives of those of this one."""


@dataclass(frozen=True, eq=False)
class SystemMatrices:
    """The arguments of the native system: each group is a list of matrices with their delays."""

    states: int
    inputs: int
    outputs: int
    A: _Terms = ()
    N: _Terms = ()
    B: _Terms = ()
    C: _Terms = ()
    F: _Terms = ()
    D: _Terms = ()


def _realised(
    states: int,
    inputs: int,
    outputs: int,
    *,
    has_states: bool,
    rest: NDArray[np.float64] | None = None,
    hidden_rate: float = 0.0,
    **groups: Group,
) -> Realisation:
    """Give the native form of the groups A, N, B, C, F and D; those left out are zero."""
    terms = {
        name: [(tau, matrix) for tau, matrix in group.items() if matrix.any()]
        for name, group in groups.items()
    }
    matrices = SystemMatrices(states, inputs, outputs, **terms)
    delays = {name: [tau for tau, _ in group] for name, group in terms.items()}
    state_delays = [tau for name in "ANCF" for tau in delays.get(name, ())]
    return Realisation(
        native=LinearSystem(matrices),
        states=states,
        inputs=inputs,
        outputs=outputs,
        A=groups.get("A", {}).get(0.0, np.zeros((states, states))),
        longest=max((tau for group in delays.values() for tau in group), default=0.0),
        memory=max(state_delays, default=0.0),
        needs_slopes=bool(matrices.N or matrices.F),
        has_states=has_states,
        rest=rest,
        hidden_rate=hidden_rate,
    )


def of_matrices(
    E: NDArray[np.float64],
    a: Group,
    n: Group,
    b: Group,
    c: Group,
    d: Group,
    inputs: int,
    outputs: int,
    *,
    differentiated: bool = False,
) -> Realisation:
    """Realise the matrices of a system by solving for x', which needs an invertible E.

    With `differentiated` the outputs are the derivatives: their matrices multiply x' instead of x.
    """
    size = len(E)
    if not np.array_equal(E, np.eye(size)):
        rank = int(np.linalg.matrix_rank(E))
        if rank < size:
            raise ValueError(_singular(rank, size, bool(n)))
        a, n, b = (
            {tau: np.asarray(np.linalg.solve(E, m), np.float64) for tau, m in group.items()}
            for group in (a, n, b)
        )
    C, F = ({}, c) if differentiated else (c, {})
    return _realised(size, inputs, outputs, has_states=True, A=a, N=n, B=b, C=C, F=F, D=d)


def _singular(rank: int, size: int, is_neutral: bool) -> str:
    missing = size - rank
    equations = "an algebraic equation" if missing == 1 else f"{missing} algebraic equations"
    text = (
        f"E has rank {rank} but {size} rows, so the system contains {equations} besides "
        "differential equations. Such a system cannot be simulated"
    )
    if is_neutral:
        text += (
            ". With N, derivatives of the past would determine the state itself (an advanced "
            "equation), so every jump would return steeper than before"
        )
    return text + ". Eliminate the states that have no derivative"


@lru_cache(maxsize=64)
def of_ratio(num: QuasiPolynomial, den: QuasiPolynomial) -> Realisation:
    """Realise a proper, causal num/den; its states are derivatives of an auxiliary signal."""
    n = den.degree
    first = float(den.delays[0])
    leading = float(den.coefficients[0, n]) if n < den.coefficients.shape[1] else 0.0
    if n == 0 and len(den.delays) > 1:
        raise ValueError(
            f"1/({den!r}) is a difference equation without a derivative, and such an equation "
            "cannot be simulated"
        )

    def rows(h: QuasiPolynomial, power: slice, scale: float) -> dict[float, NDArray[np.float64]]:
        coefficients = h.coefficients
        padded = np.zeros((len(coefficients), n + 1))
        width = min(n + 1, coefficients.shape[1])
        padded[:, :width] = coefficients[:, :width]
        delays = (float(tau) - first for tau in h.delays)
        return {tau: scale * row[None, power] for tau, row in zip(delays, padded, strict=True)}

    lower, highest = slice(0, n), slice(n, n + 1)
    if n == 0:
        direct = rows(num, highest, 1.0 / leading)
        return _realised(0, 1, 1, has_states=False, rest=np.zeros(0), D=direct)

    def last_row(group: Group) -> dict[float, NDArray[np.float64]]:
        return {tau: np.vstack([np.zeros((n - 1, n)), row]) for tau, row in group.items()}

    def last_column(group: Group) -> dict[float, NDArray[np.float64]]:
        return {tau: np.hstack([np.zeros((1, n - 1)), row]) for tau, row in group.items()}

    a = last_row(rows(den, lower, -1.0 / leading))
    a[0.0] = a[0.0] + np.diag(np.ones(n - 1), 1)
    neutral = last_row(last_column(rows(den, highest, 1.0 / leading)))
    neutral.pop(0.0)
    b = np.zeros((n, 1))
    b[-1] = 1.0 / leading
    f = last_column(rows(num, highest, 1.0))
    c = rows(num, lower, 1.0)
    constant = float(den.coefficients[:, 0].sum())
    rest = np.append(1.0 / constant, np.zeros(n - 1)) if constant else None
    groups: dict[str, Group] = {"A": a, "N": neutral, "B": {0.0: b}, "C": c, "F": f}
    rate = max(Ratio(num, den).hidden_unstable().real, default=0.0)
    return _realised(n, 1, 1, has_states=False, rest=rest, hidden_rate=float(rate), **groups)
