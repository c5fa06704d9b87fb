"""How a characteristic root moves with the numbers of its equation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class RootSensitivity(ReadOnlyArrays):
    """Derivatives of a simple root; made by `QuasiPolynomial.root_sensitivity`.

    Attributes
    ----------
    root : complex
        The root, in 1/s, improved by Newton's iteration.
    coefficients : ndarray of complex, shape (m, d+1)
        Derivative by each coefficient, in 1/s per unit of the coefficient: row j belongs to
        ``delays[j]`` of the quasi-polynomial, column k to the power k of s. Coefficients that are
        zero are no exception.
    delays : ndarray of complex, shape (m,)
        Derivative by each delay, in 1/s per s.

    Notes
    -----
    All arrays are read-only.
    """

    root: complex
    coefficients: NDArray[np.complex128]
    delays: NDArray[np.complex128]
