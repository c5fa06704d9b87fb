"""Fifty plants of five classical families, as Åström and Hägglund (2006, section 7.2) have them."""

from __future__ import annotations

import deadtime as dtm
import numpy as np


def _product(*factors):
    found = np.array([1.0])
    for factor in factors:
        found = np.convolve(found, factor)
    return found.tolist()


def _equal_lags(n):
    return dtm.RationalPlant([1.0], _product(*[[1.0, 1.0]] * n)), 0.0


def _lags_in_ratio(ratio):
    return dtm.RationalPlant([1.0], _product(*([ratio**k, 1.0] for k in range(4)))), 0.0


def _lag_and_dead_time(lag):
    return dtm.FirstOrder(1.0, lag), 1.0


def _integrating(lag):
    return dtm.Integrator(1.0, lag), 1.0 - lag


def _non_minimum_phase(zero):
    return dtm.RationalPlant([-zero, 1.0], _product(*[[1.0, 1.0]] * 3)), 0.0


FAMILIES = {
    "equal lags": (_equal_lags, (3, 4, 5, 6, 7, 8, 9, 10, 12, 15)),
    "lags in ratio": (_lags_in_ratio, (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)),
    "lag and dead time": (_lag_and_dead_time, (0.05, 0.1, 0.3, 0.5, 1.0, 2.0, 5.0, 10, 20, 50)),
    "integrating": (_integrating, (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9)),
    "non-minimum phase": (_non_minimum_phase, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1)),
}

#: Family, number, and the loop around the plant under PI control.
PLANTS = [
    (family, value, dtm.ControlLoop(plant, dtm.PI(1.0, 1.0), delay=delay))
    for family, (make, values) in FAMILIES.items()
    for value in values
    for plant, delay in [make(value)]
]
