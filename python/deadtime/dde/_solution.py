"""What `solve_dde` returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays, equal
from deadtime._base.validation import real_array
from deadtime.dde._native import DelayPieces


class DelaySolution:
    """A solution as a function of time: piecewise polynomials, its history included.

    Attributes
    ----------
    t_min, t_max : float
        First and last time at which it may be called.

    Examples
    --------
    >>> import deadtime as dtm
    >>> found = dtm.solve_dde(lambda t, y, z: -z[0], (0, 3), 1.0, 1.0, dense_output=True)
    >>> print(found.sol(0.5), found.sol([-0.5, 1.0], nu=1))
    [0.5] [[ 0. -1.]]
    """

    def __init__(self, pieces: DelayPieces) -> None:
        self._pieces = pieces
        self.t_min, self.t_max = pieces.span

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DelaySolution):
            return NotImplemented
        return equal(self._pieces.__reduce__()[1], other._pieces.__reduce__()[1])

    def __hash__(self) -> int:
        return hash((self.t_min, self.t_max, self._pieces.count))

    def __repr__(self) -> str:
        return (
            f"<DelaySolution: {self._pieces.count} polynomials, t from {self.t_min:g} to "
            f"{self.t_max:g}>"
        )

    def __call__(self, t: SupportsFloat | ArrayLike, nu: int = 0) -> Array:
        """Return y, or its derivative, at some times.

        Parameters
        ----------
        t : float or array_like
            Times from `t_min` to `t_max`.
        nu : {0, 1}
            1 for the derivative.

        Returns
        -------
        ndarray, shape (dim,) or (dim, ...)
            The shape of `t` comes after the components. Where y or its derivative jumps, the
            value after the jump.

        Raises
        ------
        ValueError
            If a time is outside, or `nu` is neither 0 nor 1.
        """
        if nu not in (0, 1):
            raise ValueError(f"nu={nu!r}: give 0 for values, or 1 for derivatives")
        times = real_array("t", t)  # type: ignore[arg-type]
        values = self._pieces.evaluate(np.ascontiguousarray(times.ravel()), nu)
        return values.reshape(values.shape[0], *times.shape)


@dataclass(frozen=True, eq=False)
class DelayResult(ReadOnlyArrays):
    """Result of `solve_dde`, with the names of `scipy.integrate.solve_ivp`.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times: `t_eval` as far as the run went, or all nodes of all elements. A time at which y
        jumps is there twice in the latter case.
    y : ndarray, shape (dim, n)
        y at these times.
    sol : DelaySolution or None
        The solution as a function, where `dense_output` was asked for.
    t_events : list of ndarray or None
        Times of the crossings of each event.
    y_events : list of ndarray or None
        y at them, shape (crossing, dim).
    breaks : ndarray
        Breaking points after the start at which elements end.
    nfev : int
        Calls of the right-hand side; with a vectorised one each call serves many nodes.
    n_nodes : int
        Nodes at which the right-hand side was evaluated.
    n_elements : int
        Polynomials of the solution.
    n_rejected : int
        Elements tried in vain.
    status : int
        0: the end of `t_span` was reached; 1: a terminal event; -1: the run could not go on.
    message : str
        The same in words, with what to do.
    success : bool
        Whether `status` is 0 or 1.
    """

    t: Array
    y: Array
    sol: DelaySolution | None
    t_events: list[Array] | None
    y_events: list[Array] | None
    breaks: Array
    nfev: int
    n_nodes: int
    n_elements: int
    n_rejected: int
    status: int
    message: str
    success: bool

    def __repr__(self) -> str:
        return (
            f"<DelayResult: {self.message} {len(self.t)} times, {self.n_elements} elements, "
            f"{self.nfev} calls>"
        )
