"""A delay that comes out at zero, its bound, because the plant lags more than the vehicle."""

import deadtime as dtm
import pytest

KNOWN = dtm.ControlLoop(
    dtm.Integrator(0.9, lag=0.2), dtm.P(1.0), delay=0.0, sample_time=0.065, limit=1.0
)
FREE = ("delay", "gain")
WORDS = "the likelihood still rises as the delay falls to zero"


def fitted(seed, **vehicle):
    flight = dtm.Experiment.step(8.0, rest=1.04).run(
        KNOWN.replace(**vehicle), noise=0.003, seed=seed
    )
    return dtm.estimate_delay(flight, KNOWN.replace(delay=None), free=FREE)


def test_a_delay_of_zero_is_reliable():
    fits = [fitted(seed) for seed in range(20)]
    assert any(fit.delay == 0.0 for fit in fits)
    assert sum(WORDS in fit.message for fit in fits) <= 2


@pytest.mark.parametrize("lag", [0.1, 0.17])
def test_a_vehicle_that_is_faster_than_its_plant_is_refused(lag):
    for seed in range(5):
        fit = fitted(seed, lag=lag)
        assert fit.delay == 0.0
        assert fit.verdict != "reliable"
        assert WORDS in fit.message


def test_where_the_delay_comes_out_at_zero_the_others_are_those_of_no_delay():
    # The sum of delay and lag is what is searched, so that the bound is one on both together.
    at_zero = 0
    for seed in range(12):
        flight = dtm.Experiment.step(8.0, rest=1.04).run(KNOWN, noise=0.003, seed=seed)
        fit = dtm.estimate_delay(flight, KNOWN.replace(delay=None), free=("delay", "gain", "lag"))
        if fit.delay == 0.0:
            at_zero += 1
            known = dtm.estimate_delay(flight, KNOWN, free=("gain", "lag"))
            assert fit.lag == pytest.approx(known.lag, abs=0.02 * known.stderr["lag"])
            assert fit.gain == pytest.approx(known.gain, abs=0.02 * known.stderr["gain"])
        else:
            assert fit.delay > 1e-6
    assert at_zero >= 3


@pytest.mark.parametrize(("delay", "seed"), [(0.26, 4), (0.195, 5)])
def test_a_lag_that_rows_do_not_tell_from_delay_is_none(delay, seed):
    vehicle = KNOWN.replace(plant=dtm.Integrator(0.9), delay=delay)
    flight = dtm.Experiment.step(8.0, rest=1.04).run(vehicle, noise=0.003, seed=seed)
    fit = dtm.estimate_delay(flight, KNOWN.replace(delay=None), free=("delay", "gain", "lag"))
    assert fit.lag == 0.0
    assert fit.delay == pytest.approx(delay, abs=0.004)
