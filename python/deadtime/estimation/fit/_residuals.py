"""Test of residuals for whiteness.

Least squares gives the covariance ``σ² (JᵀJ)⁻¹`` only for residuals that are white. Coloured
ones (an incomplete model, sensor noise that the controller acts on) carry less information than
their number suggests. The kernel has both covariances (`least_squares/covariance.rs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._native import LEVEL_OF_TESTS, whiteness


@dataclass(frozen=True)
class Whiteness:
    """Ljung and Box's (1978) portmanteau test of residuals.

    Attributes
    ----------
    statistic : float
        Q, chi-squared with `lags` degrees of freedom (less the fitted parameters, summed over
        recordings) for white residuals.
    p_value : float
        Probability that white residuals have a statistic at least as large.
    lags : int
        Number of autocorrelations in Q, of one recording.
    autocorrelation : float
        The autocorrelation at lag one.
    """

    statistic: float
    p_value: float
    lags: int
    autocorrelation: float

    @property
    def white(self) -> bool:
        """Whether the residuals pass for white at the 1 % level."""
        return self.p_value > LEVEL_OF_TESTS


def whiteness_of(
    residuals: Array, parameters: int = 0, sizes: Sequence[int] | None = None
) -> Whiteness:
    """Test the residuals of a fit with this number of `parameters` for whiteness.

    Residuals of several recordings, of these `sizes`, are tested one recording at a time, and
    the statistics are added. Residuals of zero pass.
    """
    return Whiteness(*whiteness(pieces_of(residuals, sizes), parameters))


def pieces_of(values: Array, sizes: Sequence[int] | None) -> list[Array]:
    """Rows that belong to recordings of these sizes."""
    return [values] if sizes is None else np.split(values, np.cumsum(sizes)[:-1])
