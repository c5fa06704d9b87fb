"""Outliers are found by their neighbours, also where the recording begins and ends."""

import numpy as np
import pytest
from deadtime.estimation.likelihood._rows import spikes


@pytest.mark.parametrize("places", [(1, 2), (0, 1), (60, 61), (117, 118), (118, 119), (0, 3, 119)])
def test_outliers_beside_each_other_are_found_and_no_others(places):
    residuals = np.random.default_rng(4).normal(0.0, 0.005, 120)
    residuals[list(places)] += 0.2
    np.testing.assert_array_equal(np.flatnonzero(spikes(residuals, 0.0)), places)


def test_where_many_rows_are_far_away_none_is_an_outlier():
    assert not spikes(np.array([0.0, 0.001, 5.0, -0.001]), 0.0).any()
