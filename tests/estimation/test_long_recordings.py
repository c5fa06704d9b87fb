"""Long recordings: the search on a part, the maximum on all rows, intervals from the curvature."""

from functools import cache

import deadtime as dtm
import numpy as np
import pytest

TRUTH = dtm.ControlLoop(
    dtm.Integrator(0.85, 0.1), dtm.P(1.6), delay=0.3, sample_time=0.05, limit=1.0
)
FREE = ("delay", "gain", "lag")


@cache
def recorded(count, quiet=0, seed=3):
    """Steps of the reference every 5 s, after `quiet` rows at rest, with noise in the loop."""
    random = np.random.default_rng(seed)
    time = np.arange(count) * TRUTH.sample_time
    reference = np.repeat(random.choice([0.0, 1.0], count // 100 + 1), 100)[:count]
    reference[:quiet] = 0.0
    noise = random.normal(0.0, 0.005, count)
    run = TRUTH.simulate(time, reference - noise, reference_time=time, initial_output=0.0)
    return dtm.Recording(time, reference, run.outputs + noise, run.inputs)


def test_a_long_recording_tells_delay_gain_and_lag():
    fit = dtm.estimate_delay(recorded(20_000), TRUTH.replace(delay=None), free=FREE)
    assert fit.verdict == "reliable", fit.message
    for name, true in (("delay", 0.3), ("gain", 0.85), ("lag", 0.1), ("delay+lag", 0.4)):
        low, high = fit.ci(0.99, name)
        assert low < true < high
        # As wide as four times as many rows as those of the search allow.
        assert high - low == pytest.approx(2 * 2.576 * fit.stderr[name], rel=1e-3)
    part = dtm.estimate_delay(
        recorded(20_000), TRUTH.replace(delay=None), free=FREE, window=(0.0, 249.0)
    )
    assert fit.stderr["delay"] == pytest.approx(0.5 * part.stderr["delay"], rel=0.15)


def test_the_search_on_a_part_ends_at_the_maximum_of_all_rows():
    fit = dtm.estimate_delay(recorded(6000), TRUTH.replace(delay=None), free=FREE)
    found = fit._profile.fit
    whole, _ = found.with_numbers(lambda _: (found.plant, found.runs), [])
    for name, value in (("delay", whole.numbers.delay), ("gain", whole.gain)):
        assert getattr(fit, name) == pytest.approx(value, abs=0.05 * fit.stderr[name])
    assert fit.lag == pytest.approx(whole.numbers.lags[0], abs=0.05 * fit.stderr["lag"])
    # The interval is that of the profile where the likelihood is a parabola.
    for name in FREE:
        low, high = fit.ci(0.95, name)
        for end in (low, high):
            reach = np.sqrt(fit._profile.statistic(name, end))
            assert reach == pytest.approx(1.96, abs=0.1)


@pytest.mark.long
@pytest.mark.survey
def test_a_long_recording_whose_plant_lacks_a_lag_is_an_indication():
    known = TRUTH.replace(delay=None, lag=0.0)
    fit = dtm.estimate_delay(recorded(20_000), known)
    assert fit.verdict != "reliable"
    assert "a further lag" in fit.message


@pytest.mark.long
@pytest.mark.survey
def test_rows_that_were_lost_before_the_part_are_no_unknowns_of_it():
    recording = recorded(7000)
    kept = np.random.default_rng(1).random(7000) > 0.05
    some = (recording.time, recording.reference, recording.output, recording.command)
    fit = dtm.estimate_delay(
        dtm.Recording(*(column[kept] for column in some)),
        TRUTH.replace(delay=None, lag=0.1),
        free=FREE[:2],
    )
    low, high = fit.ci(0.999, "delay")
    assert low < 0.3 < high
    assert high - low < 0.03
