"""The test for whiteness is that of Ljung and Box, by an independent computation."""

import numpy as np
import pytest
from deadtime.estimation._least_squares import whiteness_of
from scipy import stats


def ljung_box(pieces, parameters):
    """Statistic and probability, by the distribution with the variance of short recordings."""
    statistic, freedom, excess = 0.0, -parameters, 0.0
    for piece in pieces:
        n, lags = piece.size, max(1, min(20, piece.size // 4))
        rho = np.correlate(piece - piece.mean(), piece - piece.mean(), "full")[n - 1 :]
        rho = rho[1 : lags + 1] / rho[0]
        statistic += n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1)))
        freedom, excess = freedom + lags, excess + 1.6 * lags**2 / n
    wider = 1.0 + excess / freedom
    return statistic, stats.gamma.sf(statistic, 0.5 * freedom / wider, scale=2.0 * wider)


@pytest.mark.parametrize("sizes", [(9,), (60,), (400,), (90, 33), (5000,)])
@pytest.mark.parametrize("colour", [0.0, 0.1, 0.6])
def test_the_probability_is_that_of_an_independent_computation(sizes, colour):
    random = np.random.default_rng(sum(sizes))
    pieces = [random.standard_normal(size) for size in sizes]
    for piece in pieces:
        for i in range(1, piece.size):
            piece[i] += colour * piece[i - 1]
    found = whiteness_of(np.concatenate(pieces), 1, sizes)
    statistic, p_value = ljung_box(pieces, 1)
    assert found.statistic == pytest.approx(statistic, rel=1e-10)
    assert found.p_value == pytest.approx(p_value, rel=1e-8)
