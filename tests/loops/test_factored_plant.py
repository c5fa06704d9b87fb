"""Plants given by their factors."""

import deadtime as dtm
import numpy as np
import pytest
from numpy.testing import assert_allclose


@pytest.mark.parametrize("integrator", [False, True])
@pytest.mark.parametrize("lags", [(0.3,), (0.3, 0.1), (0.3, 0.1, 0.05)])
def test_the_transfer_function_is_the_product_of_the_factors(lags, integrator):
    plant = dtm.FactoredPlant(lags, gain=0.8, zero=-0.04, integrator=integrator)
    s = np.array([0.3 + 1.7j, -0.2 + 4.0j])
    expected = 0.8 * (1.0 - 0.04 * s) / (s if integrator else 1.0)
    for lag in lags:
        expected = expected / (lag * s + 1.0)
    num, den = plant.polynomials()
    assert_allclose(np.polyval(num, s) / np.polyval(den, s), expected, rtol=1e-13)
    assert plant.lag == pytest.approx(sum(lags) + 0.04)


@pytest.mark.parametrize("integrator", [False, True])
@pytest.mark.parametrize("lags", [(), (0.3, 0.1)])
def test_a_pair_of_complex_poles_is_a_factor(lags, integrator):
    plant = dtm.FactoredPlant(lags, 0.8, 0.05, integrator, pole_frequency=7.0, pole_damping=0.3)
    s = np.array([0.3 + 1.7j, -0.2 + 4.0j])
    expected = 0.8 * (1.0 + 0.05 * s) / (s if integrator else 1.0)
    expected = expected / ((s / 7.0) ** 2 + 2.0 * 0.3 * s / 7.0 + 1.0)
    for lag in lags:
        expected = expected / (lag * s + 1.0)
    num, den = plant.polynomials()
    assert_allclose(np.polyval(num, s) / np.polyval(den, s), expected, rtol=1e-13)
    assert plant.lag == pytest.approx(sum(lags) - 0.05 + 0.6 / 7.0)


def test_an_integrator_without_lags_is_an_integrator():
    plant = dtm.FactoredPlant(gain=0.9, integrator=True)
    assert plant.parameters == {"gain": 0.9}
    for one, other in zip(plant.polynomials(), dtm.Integrator(0.9).polynomials(), strict=True):
        assert_allclose(one, other)


def test_the_loop_is_that_of_the_same_rational_plant():
    plant = dtm.FactoredPlant([0.2, 0.05], gain=0.9, zero=0.03)
    loop = dtm.ControlLoop(plant, dtm.PI(2.0, 4.0), delay=0.1, sample_time=0.02)
    same = loop.replace(plant=dtm.RationalPlant(*plant.polynomials()))
    time = np.arange(100) * 0.02
    assert_allclose(loop.simulate(time, 1.0).outputs, same.simulate(time, 1.0).outputs, atol=1e-13)
    assert loop.margin().gain_margin == pytest.approx(same.margin().gain_margin)


def test_each_number_is_replaced_by_its_name():
    loop = dtm.ControlLoop(dtm.FactoredPlant([0.2, 0.1], zero=0.03), dtm.P(1.0), delay=0.1)
    moved = loop.replace(lag_2=0.07, zero=0.01, gain=0.5, Kp=2.0)
    assert moved.plant == dtm.FactoredPlant([0.2, 0.07], 0.5, 0.01)
    assert moved.parameters["lag_2"] == 0.07
    with pytest.raises(ValueError, match="lag_3: this loop has no such parameter"):
        loop.replace(lag_3=0.1)


def test_the_range_of_a_lag_ends_at_zero():
    plant = dtm.FactoredPlant([0.2, 0.02], integrator=True)
    loop = dtm.ControlLoop(plant, dtm.P(3.5), delay=0.1, sample_time=0.02)
    low, high = loop.stable_range("lag_2")
    assert low == 0.0 < 0.02 < high < 2.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "only a gain"),
        ({"lags": [0.1, -0.2]}, "lag_2=-0.2 is negative"),
        ({"lags": [0.1], "gain": 0.0}, "gain=0"),
        ({"lags": [0.1], "zero": np.inf}, "zero"),
        ({"zero": 0.1, "integrator": True}, "needs a lag above zero"),
        ({"pole_frequency": 3.0}, "give both or leave both out"),
        ({"pole_frequency": 3.0, "pole_damping": 0.0}, "pole_damping"),
    ],
)
def test_what_is_no_plant_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        dtm.FactoredPlant(**arguments)
