"""Plant and controller put together as the equations that the stepper takes.

x' = A x + B w + E r, u = K x + L w + M r, y = C x + D w, w(t) = sat(u(t - Td)): the plant's states
come first in x, the controller's after them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deadtime._controllers import Controller
from deadtime._deadtime import LinearLoop
from deadtime._plants import Plant, realise, rest

__all__ = ["LoopModel", "state_at_rest"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LoopModel:
    """The matrices of a loop with numbers in the place of every parameter."""

    A: Vector
    B: Vector
    E: Vector
    K: Vector
    L: float
    M: float
    C: Vector
    D: float
    impulse: float

    @classmethod
    def build(cls, plant: Plant, controller: Controller, values: Mapping[str, float]) -> LoopModel:
        """Close the loop around `plant`, numbers taken from `values`."""
        p = realise(*plant._polynomials(values))
        c = controller._equations(values)
        if c.q != 0.0 and p.D != 0.0:
            raise ValueError(
                f"the plant passes its command straight to its output (D={p.D}), so its output "
                "has no ideal derivative: give the controller a DerivativeFilter"
            )
        n, m = len(p.B), len(c.B)
        A = np.zeros((n + m, n + m))
        A[:n, :n] = p.A
        A[n:, :n] = np.outer(c.B, p.C)
        A[n:, n:] = c.A
        return cls(
            A=A,
            B=np.concatenate([p.B, c.B * p.D]),
            E=np.concatenate([np.zeros(n), c.E]),
            K=np.concatenate([c.p * p.C + c.q * (p.C @ p.A), c.C]),
            L=float(c.p * p.D + c.q * (p.C @ p.B)),
            M=float(c.M),
            C=np.concatenate([p.C, np.zeros(m)]),
            D=p.D,
            impulse=float(c.impulse),
        )

    def native(
        self, delay: float, sample_time: float | None = None, limit: float | None = None
    ) -> LinearLoop:
        """Return the loop as the stepper holds it."""
        return LinearLoop(
            self.A,
            self.B,
            self.E,
            self.K,
            self.L,
            self.M,
            self.C,
            self.D,
            delay,
            sample_time,
            limit,
            self.impulse,
        )

    @cached_property
    def rest_gains(self) -> tuple[float, float] | None:
        """Output and command at rest under a unit reference, None where there is no such rest."""
        n = len(self.B)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = self.A
        matrix[:n, n] = self.B
        matrix[n, :n] = self.K
        matrix[n, n] = self.L - 1.0
        scale = np.abs(matrix).sum(axis=1)
        if not scale.all():
            return None
        matrix /= scale[:, None]
        right = -np.append(self.E, self.M) / scale
        if np.linalg.cond(matrix) > 1e13:
            return None
        x = np.linalg.solve(matrix, right)
        return float(self.C @ x[:n] + self.D * x[n]), float(x[n])


def state_at_rest(
    plant: Plant,
    controller: Controller,
    values: Mapping[str, float],
    output: float,
    reference: float,
) -> tuple[Vector, float]:
    """State of a loop whose plant rests at `output`, and the command that holds it there."""
    state, command = rest(*plant._polynomials(values), output)
    return np.concatenate([state, controller._rest(values, output, reference, command)]), command
