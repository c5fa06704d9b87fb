r"""Linear systems with delays in state, input and output, of any order.

    E x'(t) + sum_j N_j x'(t - tau_j) = sum_j A_j x(t - tau_j) + sum_j B_j u(t - tau_j),
    y(t) = sum_j C_j x(t - tau_j) + sum_j D_j u(t - tau_j).

With the characteristic matrix M(s) = s E + sum (s N_j - A_j) e^{-s tau_j}, the poles are the
roots of det M, and C M^{-1} B + D = det [[M, B], [-C, D]] / det M. Values are taken from the
matrices, for any order; roots from factorisations of M along contours, block by block.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import ContourError
from deadtime._base.validation import OpenRange
from deadtime.roots import (
    MatrixDeterminant,
    ParametricQuasiPolynomial,
    QuasiPolynomial,
    RootSet,
    RoundedExpansion,
    expanded,
    expanded_and_exact,
    family_of,
    margin_of_family,
)
from deadtime.systems._delay_matrices import DelayMatrices
from deadtime.systems._margins import Margins
from deadtime.systems._poles import Determinant, HasPoles, T
from deadtime.systems._realisation import Realisable, Realisation, of_matrices
from deadtime.systems._responses import HasResponses
from deadtime.systems._scaled_delays import scaled_family, smallest_delay
from deadtime.systems._transfer import TransferFunction


class DelaySystem(DelayMatrices, HasPoles, HasResponses):
    """A linear system with delays: any order, any number of inputs and outputs. Immutable.

    E x'(t) + N x'(t - tau) = A x + B u and y = C x + D u, where each product is a sum over delays.
    Every matrix is given as an array, which acts without delay, or as a dict of arrays by their
    delays in s; a number is a matrix with one entry.

    Parameters
    ----------
    A : array_like or dict, shape (n, n)
        What the state, now and earlier, does to its derivative.
    B : array_like or dict, shape (n, p), optional
        What the p inputs do; none by default.
    C : array_like or dict, shape (q, n), optional
        The q outputs from the state; all of it by default.
    D : array_like or dict, shape (q, p), optional
        The outputs from the inputs directly; zero by default.
    E : array_like, shape (n, n), optional
        Factor on the derivative; the identity by default. May be singular.
    N : dict, shape (n, n), optional
        Factors on earlier derivatives, on the side of E, by their delays, which are above zero;
        none by default.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite or a delay negative; if there is no delay and B
        is a square array of two rows or more without C and D, since
        ``DelaySystem({0: A0, tau: A1})`` is meant.
    TypeError
        If the numbers are not real.

    Examples
    --------
    An integrator under proportional control, its input 0.36 s late, closed in the state:

    >>> import deadtime as dtm
    >>> system = dtm.DelaySystem(A={0.36: -2.0}, B={0.36: 2.0})
    >>> system.characteristic()
    s + 2 exp(-0.36 s)
    >>> system.transfer_function()
    2 exp(-0.36 s) / (s + 2 exp(-0.36 s))

    An oscillator with delayed feedback of its position:

    >>> system = dtm.DelaySystem({0.0: [[0, 1], [-4, -0.4]], 0.5: [[0, 0], [1.5, 0]]})
    >>> system
    <DelaySystem: 2 states, 0 inputs, 2 outputs, delays 0.5 s>
    >>> system.is_stable()
    True

    Twenty cars on a ring road, each driver reacting 0.4 s late to the gap ahead:

    >>> import numpy as np
    >>> ahead = np.roll(np.eye(20), 1, axis=1)
    >>> zero, identity = np.zeros((20, 20)), np.eye(20)
    >>> cars = dtm.DelaySystem(
    ...     {
    ...         0.0: np.block([[zero, ahead - identity], [zero, -0.9 * identity]]),
    ...         0.4: np.block([[zero, zero], [0.2 * identity, zero]]),
    ...     }
    ... )
    >>> cars.count(re=(-1, 0.5), im=(0.01, 1))
    19
    """

    __slots__ = ("_expansion", "_realisation")

    #: The expanded determinant, and whether it is exact, or why there is none; from when it is
    #: asked for.
    _expansion: tuple[QuasiPolynomial, bool] | ValueError
    #: The form that is simulated; from when it is asked for.
    _realisation: Realisation

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._A, self._B, self._C, self._D, self._E, self._N)

    # Through the expanded determinant

    def _smallest_delay(self) -> float:
        return smallest_delay((*self.A, *self.N))

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial:
        """Characteristic function in which all delays grow in proportion to `delay`."""
        return family_of(scaled_family(self.characteristic(), self._smallest_delay()), names)

    def _delay_margin(self) -> float:
        """Further delay that the stable system bears, as growth of its least delay, s."""
        least = self._smallest_delay()
        family = scaled_family(self.characteristic(), least)
        return margin_of_family(family, {"delay": least})

    def characteristic(self) -> QuasiPolynomial:
        """Expand det M(s), while that is numerically safe.

        Returns
        -------
        QuasiPolynomial
            Every coefficient is the exact one, rounded once.

        Raises
        ------
        ValueError
            If there are more than 10 states or 1000 terms, if rounding the coefficients could
            move the determinant more than 10 000 times as far as rounding the entries of the
            matrices does, or if the determinant is zero for every s.

        Notes
        -----
        The last limit is measured on the imaginary axis, as the largest ratio of the sum of the
        moduli of all terms to sum_ij abs(M_ij) abs(cofactor_ij). Within it, and to first order, a
        root near the axis is one of a matrix whose entries differ by a relative 1e-12 at most.

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.DelaySystem({0.0: [[0, 1], [-4, -0.4]], 0.5: [[0, 0], [1.5, 0]]}).characteristic()
        4 + 0.4 s + s^2 - 1.5 exp(-0.5 s)
        """
        return self._expanded()[0]

    def _expanded(self) -> tuple[QuasiPolynomial, bool]:
        """Give det M, and whether no coefficient was rounded."""
        if not hasattr(self, "_expansion"):
            try:
                found: tuple[QuasiPolynomial, bool] | ValueError = expanded_and_exact(
                    [[self._entry(i, j) for j in self._states] for i in self._states]
                )
            except ValueError as error:
                found = error.with_traceback(None)
            object.__setattr__(self, "_expansion", found)
        if isinstance(self._expansion, ValueError):
            raise type(self._expansion)(*self._expansion.args)
        return self._expansion

    def transfer_function(self, output: int = 0, input: int = 0) -> TransferFunction:  # noqa: A002
        """Transfer function from one input to one output, while that is numerically safe.

        Parameters
        ----------
        output, input : int, default 0
            Which ones, from zero.

        Returns
        -------
        TransferFunction
            Over `characteristic`; modes that do not show between these two are in the numerator
            as well.

        Raises
        ------
        ValueError
            As in `characteristic`.
        IndexError
            If there is no such input or output.

        Examples
        --------
        >>> import deadtime as dtm
        >>> A, B, C = [[0, 1], [-4, -0.4]], [[0], [1]], [[1, 0]]
        >>> dtm.DelaySystem(A, {0.1: B}, C).transfer_function()
        exp(-0.1 s) / (4 + 0.4 s + s^2)
        """
        i, j = self._pair(output, input)
        states = self._states
        bordered = [
            *([*(self._entry(k, m) for m in states), _part(self._B, k, j)] for k in states),
            [*(_part(self._C, i, m, -1.0) for m in states), _part(self._D, i, j)],
        ]
        return TransferFunction(expanded(bordered, bordered=True), self.characteristic())

    def margin(self, output: int = 0, input: int = 0) -> Margins:  # noqa: A002
        """Gain, phase and delay margin of the loop closed from one output to one input.

        Parameters
        ----------
        output, input : int, default 0
            Which ones, from zero.

        Returns
        -------
        Margins
            As of `TransferFunction.margin`.

        Raises
        ------
        ValueError
            As in `characteristic` and in `TransferFunction.margin`.
        IndexError
            If there is no such input or output.
        """
        return self.transfer_function(output, input).margin()

    def hinf_norm(
        self,
        output: int | None = None,
        input: int | None = None,  # noqa: A002
    ) -> float:
        """Largest gain from one input to one output over all frequencies.

        Parameters
        ----------
        output, input : int, optional
            Which ones, from zero; to be given where there are several.

        Returns
        -------
        float
            As of `TransferFunction.hinf_norm`.

        Raises
        ------
        ValueError
            As in `characteristic` and in `TransferFunction.hinf_norm`; also if there are several
            inputs or outputs and none is chosen, since the norm over all of them is another number.
        IndexError
            If there is no such input or output.

        Examples
        --------
        >>> import deadtime as dtm
        >>> round(dtm.DelaySystem({0.36: -2.0}, {0.36: 2.0}).hinf_norm(), 4)
        1.3002
        """
        for name, chosen, count in (
            ("output", output, self.n_outputs),
            ("input", input, self.n_inputs),
        ):
            if chosen is None and count > 1:
                raise ValueError(
                    f"the system has {count} {name}s: choose one of them by {name}=. The norm "
                    "from all inputs to all outputs is not computed"
                )
        return self.transfer_function(output or 0, input or 0).hinf_norm()

    def zeros(
        self,
        re: OpenRange | None = None,
        im: OpenRange | None = None,
        *,
        output: int = 0,
        input: int = 0,  # noqa: A002
    ) -> RootSet:
        """Locate the zeros from one input to one output in a region with four closed sides.

        Parameters
        ----------
        re, im : tuple of (float, float)
            Ranges of the real part (1/s) and of the imaginary part (rad/s).
        output, input : int, default 0
            Which ones, from zero.

        Returns
        -------
        RootSet
            Roots of det [[M, B], [-C, D]]; modes that do not show between these two are among
            them, and among the poles.

        Raises
        ------
        ValueError, ContourError, CountMismatchError
            As in `poles`.
        IndexError
            If there is no such input or output.

        Examples
        --------
        >>> import deadtime as dtm
        >>> system = dtm.DelaySystem([[0, 1], [-4, -1]], [[0], [1]], [[3, 1]])
        >>> system.zeros(re=(-9, 9), im=(-9, 9)).roots.round(6).tolist()
        [(-3+0j)]
        """
        i, j = self._pair(output, input)
        n = self.n_states

        def bordered(corner: Array | None, groups: Any, tau: float) -> Array:
            matrix = np.zeros((n + 1, n + 1))
            if corner is not None:
                matrix[:n, :n] = corner
            inputs, outputs, direct = groups
            if tau in inputs:
                matrix[:n, n] = -inputs[tau][:, j]
            if tau in outputs:
                matrix[n, :n] = outputs[tau][i]
            if tau in direct:
                matrix[n, n] = -direct[tau][i, j]
            return matrix

        ports = (self._B, self._C, self._D)
        state = {
            tau: bordered(self._A.get(tau), ports, tau)
            for tau in sorted({0.0, *self._A, *self._B, *self._C, *self._D})
        }
        none: Any = ({}, {}, {})
        late = {tau: bordered(matrix, none, tau) for tau, matrix in self._N.items()}
        return MatrixDeterminant(bordered(self._E, none, 0.0), late, state).roots(re, im)

    def chain_enclosure(self) -> tuple[float, float]:
        r"""Enclose the real part that the chains of a neutral system can come to.

        The sigma at which the largest spectral radius of
        :math:`\sum_j E^{-1} N_j e^{-\sigma \tau_j + i \theta_j}` over all angles
        :math:`\theta_j` is one: the supremum over arbitrarily small changes of the delays [1]_.

        Returns
        -------
        low, high : float
            In 1/s, both proved; -inf for a system without delayed derivatives. With more than four
            different delays of derivatives `high` is only what norms say.

        Raises
        ------
        ValueError
            If E cannot be inverted.

        References
        ----------
        .. [1] J. K. Hale and S. M. Verduyn Lunel, "Strong stabilization of neutral functional
           differential equations", IMA Journal of Mathematical Control and Information 19 (2002).

        Examples
        --------
        >>> import deadtime as dtm
        >>> system = dtm.DelaySystem(-1.0, N={0.5: 0.25})
        >>> low, high = system.chain_enclosure()
        >>> round(low, 6), round(high, 6)
        (-2.772589, -2.772589)
        """
        return self._matrix().chain_enclosure()

    # Responses

    def _realised(self) -> Realisation:
        if not hasattr(self, "_realisation"):
            object.__setattr__(self, "_realisation", self._realise())
        return self._realisation

    def _realise(self, differentiated: bool = False) -> Realisation:
        return of_matrices(
            self._E,
            self._A,
            self._N,
            self._B,
            self._C,
            self._D,
            self.n_inputs,
            self.n_outputs,
            differentiated=differentiated,
        )

    def _differentiated(self) -> Realisable:
        if any(matrix.any() for matrix in self._D.values()):
            raise ValueError(
                "D is not zero, so the impulse response contains an impulse: leave D out, and "
                "add its part to the result"
            )
        return _Differentiated(self)

    def _gains_at_rest(self) -> Array | None:
        try:
            return self.frequency_response(0.0).real
        except np.linalg.LinAlgError:
            return None

    def _ask(self, question: Callable[[Determinant], T]) -> T:
        """Ask the matrices, and the expanded determinant where they do not answer."""
        matrix = self._matrix()
        try:
            return question(matrix)
        except (ValueError, ContourError) as error:
            # E cannot be inverted, a pole lies on the edge, or delays are taken as exact.
            try:
                h, exact = self._expanded()
            except ValueError:
                raise error from None
            if exact:
                return question(h)
            if isinstance(error, ContourError):
                raise
            return question(RoundedExpansion(h, matrix, error))

    def _exactly(self) -> QuasiPolynomial:
        try:
            h, exact = self._expanded()
        except ValueError:
            exact = False
        if not exact:
            raise ValueError(
                "a certificate needs an expanded determinant without rounded coefficients, "
                "which this system does not have. Use count(), which proves the same number of "
                "roots without a certificate"
            )
        return h

    def _matrix(self) -> MatrixDeterminant:
        return MatrixDeterminant(self._E, self._N, self._A)

    def _pair(self, output: int, input: int) -> tuple[int, int]:  # noqa: A002
        """Check an output and an input."""
        i, j = operator.index(output), operator.index(input)
        for name, index, size in (("output", i, self.n_outputs), ("input", j, self.n_inputs)):
            if not 0 <= index < size:
                raise IndexError(f"{name}={index}: the system has {size} of them, numbered from 0")
        return i, j


@dataclass(frozen=True, eq=False)
class _Differentiated:
    """A system with the derivatives of its outputs in their place."""

    system: DelaySystem

    def _realised(self) -> Realisation:
        return self.system._realise(differentiated=True)

    def _gains_at_rest(self) -> Array | None:
        """Zero where the system comes to rest."""
        gains = self.system._gains_at_rest()
        return None if gains is None else 0.0 * gains


def _restored(*parts: Any) -> DelaySystem:
    A, B, C, D, E, N = parts
    return DelaySystem(A, B or None, C, D or None, E=E, N=N or None)


def _part(
    group: Mapping[float, Array], i: int, j: int, sign: float = 1.0
) -> dict[tuple[int, float], float]:
    return {(0, t): sign * float(m[i, j]) for t, m in group.items() if m[i, j] != 0.0}
