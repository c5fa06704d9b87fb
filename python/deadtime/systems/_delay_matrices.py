r"""The matrices of a linear system with delays, checked, and their values over s.

E x'(t) + sum_j N_j x'(t - tau_j) = sum_j A_j x(t - tau_j) + sum_j B_j u(t - tau_j),
y(t) = sum_j C_j x(t - tau_j) + sum_j D_j u(t - tau_j).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array, Complex
from deadtime._base.frozen import Immutable, equal
from deadtime._base.validation import non_negative, real_array, unmasked

#: One matrix, without delay, or matrices by their delays in s.
Matrices: TypeAlias = ArrayLike | Mapping[float, ArrayLike]


class DelayMatrices(Immutable):
    """Base of `DelaySystem`, whose documentation says what the matrices are."""

    __slots__ = ("_A", "_B", "_C", "_D", "_E", "_N")

    _A: dict[float, Array]
    _B: dict[float, Array]
    _C: dict[float, Array]
    _D: dict[float, Array]
    _E: Array
    _N: dict[float, Array]

    def __init__(
        self,
        A: Matrices,
        B: Matrices | None = None,
        C: Matrices | None = None,
        D: Matrices | None = None,
        *,
        E: ArrayLike | None = None,
        N: Mapping[float, ArrayLike] | None = None,
    ) -> None:
        state = _by_delay("A", A)
        n = len(next(iter(state.values()))) if state else 0
        if n == 0:
            raise ValueError("A is empty: give at least one matrix, with at least one row")
        inputs = {} if B is None else _by_delay("B", B)
        outputs = _by_delay("C", np.eye(n) if C is None else C)
        direct = {} if D is None else _by_delay("D", D)
        p = next(iter(inputs.values())).shape[1] if inputs else 0
        if direct and not inputs:
            p = next(iter(direct.values())).shape[1]
        q = len(next(iter(outputs.values()))) if outputs else 0
        derivative = _matrix("E", np.eye(n) if E is None else E)
        if N is not None and not isinstance(N, Mapping):
            raise TypeError(
                "N: give a dict of matrices, whose keys are their delays in s, all above zero"
            )
        late = {} if N is None else _by_delay("N", N)
        if any(tau == 0.0 for tau in late):
            raise ValueError(
                "N has a matrix with delay 0, but the matrix of x'(t) is E: give this matrix as E"
            )
        for name, group, shape in (
            ("A", state, (n, n)),
            ("B", inputs, (n, p)),
            ("C", outputs, (q, n)),
            ("D", direct, (q, p)),
            ("E", {0.0: derivative}, (n, n)),
            ("N", late, (n, n)),
        ):
            for tau, matrix in group.items():
                if matrix.shape != shape:
                    raise ValueError(
                        f"{name} with delay {tau:g} s has shape {matrix.shape}, but it must "
                        f"have shape {shape}: A has {n} rows, one for each state, and there are "
                        f"{p} inputs and {q} outputs"
                    )
        # Of one state, any single input has a B like this.
        if 1 < n == p and C is None and D is None and not isinstance(B, Mapping):
            _refuse_delayed_state(n, any(tau > 0.0 for group in (state, late) for tau in group))
        values = (state, inputs, outputs, direct, derivative, late)
        for name, value in zip(DelayMatrices.__slots__, values, strict=True):
            object.__setattr__(self, name, value)

    @property
    def A(self) -> dict[float, Array]:
        """Matrices on the state by their delays in s; read-only arrays."""
        return dict(self._A)

    @property
    def B(self) -> dict[float, Array]:
        """Matrices on the input by their delays in s."""
        return dict(self._B)

    @property
    def C(self) -> dict[float, Array]:
        """Matrices from state to output by their delays in s."""
        return dict(self._C)

    @property
    def D(self) -> dict[float, Array]:
        """Matrices from input to output by their delays in s."""
        return dict(self._D)

    @property
    def E(self) -> Array:
        """Factor on the derivative of the state, shape (n, n)."""
        return self._E

    @property
    def N(self) -> dict[float, Array]:
        """Factors on earlier derivatives by their delays in s."""
        return dict(self._N)

    @property
    def n_states(self) -> int:
        """Number of components of the state."""
        return len(self._E)

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        group = self._B or self._D
        return next(iter(group.values())).shape[1] if group else 0

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return len(next(iter(self._C.values()))) if self._C else 0

    @property
    def delays(self) -> Array:
        """Every delay above zero, in s, ascending."""
        groups = (self._A, self._B, self._C, self._D, self._N)
        return np.array(sorted({tau for group in groups for tau in group} - {0.0}))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DelayMatrices):
            return NotImplemented
        return equal(self._matrices(), other._matrices())

    def __hash__(self) -> int:
        return hash((self.n_states, self.n_inputs, self.n_outputs, tuple(self.delays.tolist())))

    def _matrices(self) -> list[Any]:
        return [getattr(self, name) for name in ("_A", "_B", "_C", "_D", "_E", "_N")]

    def __repr__(self) -> str:
        listed = ", ".join(f"{tau:g}" for tau in self.delays)
        delays = f", delays {listed} s" if listed else ""
        return (
            f"<DelaySystem: {self.n_states} states, {self.n_inputs} inputs, "
            f"{self.n_outputs} outputs{delays}>"
        )

    def characteristic_matrix(self, s: ArrayLike) -> Complex:
        """Value of M(s) = s E + sum (s N_j - A_j) exp(-s tau_j).

        Parameters
        ----------
        s : array_like of complex
            In 1/s.

        Returns
        -------
        ndarray of complex, shape ``(*s.shape, n, n)``

        Examples
        --------
        >>> import deadtime as dtm
        >>> print(dtm.DelaySystem({0.0: [[0, 1], [-4, -0.4]]}).characteristic_matrix(1j).round(1))
        [[ 0. +1.j -1. +0.j]
         [ 4. +0.j  0.4+1.j]]
        """
        points = np.asarray(unmasked("s", s), dtype=np.complex128)
        shape = (*points.shape, self.n_states, self.n_states)
        late = _sum_at(self._N, points, shape) + self._E
        return points[..., None, None] * late - _sum_at(self._A, points, shape)

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Response to sinusoidal inputs, C M^{-1} B + D at s = j omega.

        Solved with the matrices as they are, for any number of states.

        Parameters
        ----------
        omega : array_like of float
            Frequencies in rad/s.

        Returns
        -------
        ndarray of complex, shape ``(n_outputs, n_inputs, *omega.shape)``

        Raises
        ------
        numpy.linalg.LinAlgError
            If one of the frequencies is exactly a pole.

        Examples
        --------
        >>> import deadtime as dtm
        >>> system = dtm.DelaySystem(A={0.36: -2.0}, B={0.36: 2.0})
        >>> print(system.frequency_response([0.0, 2.0])[0, 0].round(4))
        [1. +0.j     0.5-1.1036j]
        """
        points = np.asarray(1j * real_array("omega", omega), dtype=np.complex128)
        n, p, q = self.n_states, self.n_inputs, self.n_outputs
        inputs = _sum_at(self._B, points, (*points.shape, n, p))
        outputs = _sum_at(self._C, points, (*points.shape, q, n))
        direct = _sum_at(self._D, points, (*points.shape, q, p))
        values = outputs @ np.linalg.solve(self.characteristic_matrix(points), inputs) + direct
        return np.moveaxis(values, (-2, -1), (0, 1))

    def _entry(self, i: int, j: int) -> dict[tuple[int, float], float]:
        """One entry of M by power of s and delay."""
        entry = {(0, tau): -float(matrix[i, j]) for tau, matrix in self._A.items()}
        entry |= {(1, tau): float(matrix[i, j]) for tau, matrix in self._N.items()}
        entry[1, 0.0] = float(self._E[i, j])
        return {key: value for key, value in entry.items() if value != 0.0}

    @property
    def _states(self) -> range:
        return range(self.n_states)


def _refuse_delayed_state(n: int, has_delay: bool) -> None:
    """Raise for a square B of a system without any delay: most people mean a delayed state."""
    if not has_delay:
        raise ValueError(
            f"A and B both have shape {(n, n)} and no delay, so their meaning is not clear. If "
            "the state also acts tau seconds late, give DelaySystem({0: A0, tau: A1}). If "
            "there are as many inputs as states, give B={0: B}"
        )


def _by_delay(name: str, given: Matrices) -> dict[float, Array]:
    """Matrices sorted by delay, frozen."""
    pairs = given.items() if isinstance(given, Mapping) else [(0.0, given)]
    found: dict[float, Array] = {}
    for tau, matrix in pairs:
        time = non_negative(f"delay of {name}", tau) + 0.0
        found[time] = _matrix(name, matrix)
    return dict(sorted(found.items()))


def _matrix(name: str, given: ArrayLike) -> Array:
    matrix = real_array(name, given)
    if matrix.ndim == 0:
        matrix = matrix.reshape(1, 1)
    if matrix.ndim != 2:
        raise ValueError(f"{name} has shape {matrix.shape}: give a matrix, as a list of rows")
    if not np.isfinite(matrix).all():
        raise ValueError(f"{name} contains {matrix[~np.isfinite(matrix)][0]}: give finite numbers")
    matrix = matrix.copy()
    matrix.flags.writeable = False
    return matrix


def _sum_at(group: Mapping[float, Array], points: Complex, shape: tuple[int, ...]) -> Complex:
    total = np.zeros(shape, dtype=np.complex128)
    for tau, matrix in group.items():
        total += np.exp(-points * tau)[..., None, None] * matrix
    return total
