"""Plants whose coefficients are functions of named numbers."""

import deadtime as dtm
import numpy as np
import pytest
from numpy.testing import assert_allclose

VALUES = {"m": 1.5, "c": 0.3}


def drag(m, c):
    return [1.0], [m, c, 0.0]


def loop_with(plant, **known):
    return dtm.ControlLoop(plant, dtm.PD(2.0, 1.0), delay=0.2, **known)


@pytest.mark.parametrize("known", [{}, {"sample_time": 0.05, "limit": 1.0}])
def test_the_loop_is_that_of_the_same_rational_plant(known):
    loop = loop_with(dtm.ParametricPlant(drag, VALUES, gain=0.8), **known).replace(m=2.0, Kp=1.0)
    same = loop.replace(plant=dtm.RationalPlant([0.8], [2.0, 0.3, 0.0]))
    assert loop.parameters | {"m": 2.0, "c": 0.3, "gain": 0.8} == loop.parameters
    time = np.arange(100) * 0.05
    assert_allclose(loop.simulate(time, 1.0).outputs, same.simulate(time, 1.0).outputs, atol=1e-12)
    assert loop.spectral_abscissa() == pytest.approx(same.spectral_abscissa(), abs=1e-12)


def test_a_map_over_its_numbers_is_that_of_single_loops():
    loop = loop_with(dtm.ParametricPlant(drag, VALUES))
    chart = dtm.stability_map(loop, {"m": (0.05, 3.0), "c": (-1.0, 1.0)}, shape=(7, 5))
    for i, m in enumerate(np.linspace(0.05, 3.0, 7)):
        for j, c in enumerate(np.linspace(-1.0, 1.0, 5)):
            cell = chart.unstable[j, i] if chart.unstable.shape == (5, 7) else chart.unstable[i, j]
            assert cell == loop.replace(m=m, c=c).count(re=(0, None)), (m, c)


def test_the_range_of_a_number_ends_where_stability_does():
    loop = loop_with(dtm.ParametricPlant(drag, VALUES))
    low, high = loop.stable_range("m")
    assert 0.0 < low < 1.5
    assert high == np.inf
    assert loop.replace(m=1.001 * low).is_stable()
    assert not loop.replace(m=0.999 * low).is_stable()


def test_the_total_lag_is_that_of_the_expansion_at_zero():
    plant = dtm.ParametricPlant(lambda a, b: ([a, 3.0], [0.1, b, 2.0, 0.0]), {"a": 0.6, "b": 0.5})
    # (3 + 0.6 s)/(2 s + 0.5 s^2 + ...): 0.5/2 - 0.6/3
    assert plant.lag == pytest.approx(0.05)


def test_plants_with_the_same_function_and_numbers_are_equal():
    one = dtm.ParametricPlant(drag, VALUES)
    assert one == dtm.ParametricPlant(drag, dict(VALUES))
    assert hash(one) == hash(dtm.ParametricPlant(drag, dict(VALUES)))
    assert one != dtm.ParametricPlant(drag, VALUES | {"m": 2.0})


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((drag, {}), ValueError, "give a name and a value"),
        ((drag, {"m": 1.0}), TypeError, r"polynomials\(m\) failed"),
        ((drag, {"m": np.nan, "c": 1.0}), ValueError, "m="),
        ((drag, {"m": 1.0, "Kp": 1.0}), ValueError, "'Kp' is already a parameter of the loop"),
        ((drag, VALUES, 0.0), ValueError, "gain=0"),
        ((lambda a: ([a, 0.0], [1.0]), {"a": 1.0}), ValueError, "cannot differentiate"),
        ((lambda a: (a, 1.0, 2.0), {"a": 1.0}), ValueError, "must return two lists"),
    ],
)
def test_what_is_no_plant_is_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        dtm.ParametricPlant(*arguments)
