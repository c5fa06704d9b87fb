"""Axes that share a delay and nothing else."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import shared_number
from flights import flight_path
from marks import NIGHTLY

SAMPLE, DELAY = 0.02, 0.06
LOOP = dtm.ControlLoop(dtm.FactoredPlant([0.1]), dtm.P(1.0), sample_time=SAMPLE)


def axis(seed, lag, delay=DELAY, gain=1.0, noise=0.004, rows=250):
    time = SAMPLE * np.arange(rows)
    told = 0.2 * np.sign(np.sin(3.7 * (time - 0.3) + 0.1 * seed)) * (time > 0.3)
    vehicle = gain * dtm.FactoredPlant([lag]).transfer_function() * dtm.delay(delay)
    angle = np.ravel(vehicle.simulate(time, told).outputs)
    angle = angle + noise * np.random.default_rng(seed).standard_normal(rows)
    recording = dtm.Recording(time, told, angle, command=told)
    return dtm.estimate_delay(recording, LOOP, free=("delay", "gain", "lag_1"))


def three(seed, **options):
    lags, gains = (0.04, 0.08, 0.15), (0.8, 1.0, 1.3)
    pairs = zip(lags, gains, strict=True)
    return [axis(3 * seed + i, lag, gain=gain, **options) for i, (lag, gain) in enumerate(pairs)]


def test_the_interval_is_that_of_the_summed_profiles_and_narrower_than_each():
    found = three(0)
    both = shared_number(found)
    assert both.agree
    assert both.verdict == "reliable"
    low, high = both.interval
    grid = np.linspace(low - 2e-4, high + 2e-4, 81)
    total = np.sum([one.profile("delay", grid)[1] ** 2 for one in found], axis=0)
    inside = grid[total <= total.min() + 1.96**2]
    step = grid[1] - grid[0]
    assert (inside[0], inside[-1]) == pytest.approx(both.interval, abs=1.1 * step)
    assert grid[np.argmin(total)] == pytest.approx(both.value, abs=1.1 * step)
    assert high - low < min(np.diff(one.ci())[0] for one in found)
    assert "delay of 3 estimates" in both.summary()
    assert both.to_dict()["agree"] is True


def test_values_between_two_minima_are_not_forgotten():
    """Rows 48 ms apart: the profiles of roll and pitch behind one lag have several minima each."""
    log = dtm.open_log(flight_path("px4_sitl_takeoff.ulg"))
    loop = dtm.ControlLoop(dtm.FactoredPlant([0.1]), dtm.P(1.0), delay=None)
    fits = []
    for name in ("roll", "pitch"):
        turn = log.loop(name).recording(20.7, 24.7, command="setpoint")
        free = ("delay", "gain", "lag_1")
        fits.append(dtm.estimate_delay(turn, loop, free=free, method="output_error"))
    both = shared_number(fits)
    low, high = both.interval
    grid = np.linspace(0.0, 0.1, 401)
    total = np.sum([one.profile("delay", grid)[1] ** 2 for one in fits], axis=0)
    inside = grid[total < total.min() + 1.96**2]
    assert (low, high) == pytest.approx((inside[0], inside[-1]), abs=5e-4)
    assert both.value == pytest.approx(grid[np.argmin(total)], abs=5e-4)
    # The minimum of roll alone, 54 ms, and that of pitch, 18 ms, are both about as likely.
    assert low < 0.020
    assert high > 0.055


@pytest.mark.parametrize(("sets", "misses"), [(5, 1), pytest.param(12, 3, marks=NIGHTLY)])
def test_the_interval_holds_the_truth(sets, misses):
    """Of 12 sets, 11 are expected; fewer than 9 have a probability below 1 %."""
    found = [shared_number(three(100 + seed)) for seed in range(sets)]
    assert sum(one.interval[0] <= DELAY <= one.interval[1] for one in found) >= sets - misses
    assert sum(one.agree for one in found) >= sets - min(misses, 2)


def test_a_number_that_is_not_shared_is_told():
    apart = shared_number([axis(1, 0.08), axis(2, 0.08, delay=DELAY + 0.04)])
    assert not apart.agree
    assert apart.verdict != "reliable"
    assert "contradict one another" in apart.summary()


def test_the_interval_of_no_delay_ends_at_zero():
    none = shared_number([axis(seed, 0.08, delay=0.0) for seed in (1, 2)])
    assert none.interval[0] == 0.0
    assert none.interval[1] < 0.01


def test_the_gain_of_one_vehicle_may_be_shared():
    alike = shared_number([axis(1, 0.05), axis(2, 0.1)], "gain", level=0.99)
    low, high = alike.interval
    assert low < 1.0 < high
    assert alike.level == 0.99


def test_what_cannot_be_combined_is_refused():
    one = axis(1, 0.08)
    with pytest.raises(ValueError, match="1 estimates were given"):
        shared_number([one])
    with pytest.raises(ValueError, match="'zero' was not fitted"):
        shared_number([one, one], "zero")
    with pytest.raises(ValueError, match=r"level=1\.5"):
        shared_number([one, one], level=1.5)
