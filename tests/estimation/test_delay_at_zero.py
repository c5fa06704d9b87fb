"""A delay that comes out at zero, its bound, because the plant lags more than the vehicle."""

import deadtime as dtm
import pytest

KNOWN = dtm.ControlLoop(
    dtm.Integrator(0.9, lag=0.2), dtm.P(1.0), delay=0.0, sample_time=0.065, limit=1.0
)
FREE = ("delay", "gain")
WORDS = "below zero the recording would be likelier"


def fitted(seed, **vehicle):
    flight = dtm.Experiment.step(8.0, rest=1.04).run(
        KNOWN.replace(**vehicle), noise=0.003, seed=seed
    )
    return dtm.estimate_delay(flight, KNOWN.replace(delay=None), free=FREE)


def test_a_delay_of_zero_is_adequate():
    fits = [fitted(seed) for seed in range(20)]
    assert any(fit.delay == 0.0 for fit in fits)
    assert sum(WORDS in fit.message for fit in fits) <= 2


@pytest.mark.parametrize("lag", [0.1, 0.17])
def test_a_vehicle_that_is_faster_than_its_plant_is_refused(lag):
    for seed in range(5):
        fit = fitted(seed, lag=lag)
        assert fit.delay == 0.0
        assert not fit.adequate
        assert WORDS in fit.message
