"""Test of residuals for whiteness, and the covariance of a fit for white and coloured ones.

Least squares gives the covariance ``σ² (JᵀJ)⁻¹`` only for residuals that are white. Coloured
ones (an incomplete model, sensor noise that the controller acts on) carry less information than
their number suggests; the sandwich ``(JᵀJ)⁻¹ S (JᵀJ)⁻¹`` with Newey and
West's (1987) long-run covariance S of the scores ``J_t e_t`` stays valid for them. Its
bandwidth is Andrews' (1991, eq. 6.2 and 6.4) plug-in for the Bartlett kernel.
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


def white_covariance(jacobian: Array, residuals: Array) -> Array:
    """Covariance of the parameters for white residuals, ``σ² (JᵀJ)⁻¹``."""
    n, k = jacobian.shape
    variance = float(residuals @ residuals) / (n - k)
    return np.asarray(variance * _inverse_information(jacobian))


def robust_covariance(
    jacobian: Array, residuals: Array, sizes: Sequence[int] | None = None
) -> Array:
    """Covariance of the parameters that is also valid for autocorrelated residuals.

    Recordings, of these `sizes`, are independent of each other.
    """
    n, k = jacobian.shape
    spread = np.zeros((k, k))
    scored = pieces_of(jacobian * residuals[:, None], sizes)
    for scores, piece in zip(scored, pieces_of(residuals, sizes), strict=True):
        spread += scores.T @ scores
        bandwidth = _bandwidth(piece)
        for lag in range(1, bandwidth + 1):
            product = scores[lag:].T @ scores[:-lag]
            spread += (1.0 - lag / (bandwidth + 1)) * (product + product.T)
    bread = _inverse_information(jacobian)
    # n/(n-k): the small-sample factor that makes the white case agree with the usual estimate
    return np.asarray(bread @ spread @ bread * (n / (n - k)))


def _bandwidth(residuals: Array) -> int:
    """Andrews' bandwidth for the Bartlett kernel, residuals taken as an AR(1) process."""
    n = residuals.size
    power = float(residuals @ residuals)
    rho = float(residuals[1:] @ residuals[:-1]) / power if power > 0 else 0.0
    rho = float(np.clip(rho, -0.97, 0.97))
    alpha = 4 * rho**2 / ((1 - rho) ** 2 * (1 + rho) ** 2)
    return int(min(n // 4, np.ceil(1.1447 * (alpha * n) ** (1 / 3))))


def _inverse_information(jacobian: Array) -> Array:
    """``(JᵀJ)⁻¹`` through a QR decomposition of the scaled columns."""
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    r = np.linalg.qr(jacobian / scale, mode="r")
    inverse = np.linalg.inv(r)
    return np.asarray((inverse @ inverse.T) / np.outer(scale, scale))
