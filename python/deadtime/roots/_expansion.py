"""A quasi-polynomial around a place, without its largest exponential."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class Expansion(ReadOnlyArrays):
    r"""Taylor coefficients :math:`a_k` at a place s; made by `QuasiPolynomial.expansion`.

    .. math:: h(s + t) = e^{-(s + t)\tau} \sum_k a_k t^k

    Attributes
    ----------
    coefficients : ndarray of complex, shape (order+1,)
        The :math:`a_k`, of the exact ones the nearest doubles but for `errors`.
    errors : ndarray of float, shape (order+1,)
        Bounds on the moduli of their errors, rounding to doubles included.
    delay : float
        The delay :math:`\tau` of the term that dominates at the place, in s.

    Notes
    -----
    All arrays are read-only.
    """

    coefficients: NDArray[np.complex128]
    errors: NDArray[np.float64]
    delay: float
