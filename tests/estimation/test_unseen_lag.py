"""What an estimate says could not have been seen."""

import deadtime as dtm
import numpy as np
import pytest
from marks import NIGHTLY
from vehicles import answer

KNOWN = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), sample_time=0.065, limit=1.0)


def record_height(seed, lags=(), delay=0.3, noise=0.005, rows=120):
    """A step of 1 m under P control, with noise in the loop."""
    random = np.random.default_rng(seed)
    time = 0.065 * np.arange(rows)
    reference = np.where(time < 1.0, 0.0, 1.0)
    command, output = np.zeros(rows), np.zeros(rows)
    vehicle = {"delay": delay, "lags": lags, "gain": 0.85, "integrator": True}
    for k in range(rows):
        path = answer(time[k : k + 1], time[:k], command[:k], **vehicle)[0] if k else 0.0
        output[k] = path + noise * random.standard_normal()
        command[k] = np.clip(1.6 * (reference[k] - output[k]), -1.0, 1.0)
    return dtm.Recording(time, reference, output, command=command)


@pytest.mark.parametrize(
    ("flights", "least", "most"), [(8, 5, 8), pytest.param(30, 23, 29, marks=NIGHTLY)]
)
def test_a_lag_of_that_size_is_found_nine_times_in_ten(flights, least, most):
    lag = np.median(
        [dtm.estimate_delay(record_height(n), KNOWN).details["unseen_lag"] for n in range(5)]
    )
    found = 0
    for seed in range(flights):
        fit = dtm.estimate_delay(record_height(1000 + seed, (lag,), 0.3 - lag), KNOWN)
        found += "the recording is more likely, so the plant lacks a lag" in fit.message
    assert least <= found <= most


def test_less_noise_shows_shorter_lags():
    coarse, fine = (
        dtm.estimate_delay(record_height(3, noise=noise), KNOWN) for noise in (0.005, 0.0005)
    )
    ratio = coarse.details["unseen_lag"] / fine.details["unseen_lag"]
    # The effect of a short lag is of second order.
    assert 2.0 < ratio < 6.0
    assert f"a further lag below {fine.details['unseen_lag']:.2g} s" in fine.message
    assert fine.to_dict()["unseen_lag"] == fine.details["unseen_lag"]


def test_a_free_lag_hides_longer_ones():
    recording = record_height(5, (0.15,))
    known = KNOWN.replace(lag=0.15)
    held = dtm.estimate_delay(recording, known).details["unseen_lag"]
    free = dtm.estimate_delay(recording, known, free=("delay", "gain", "lag"))
    assert free.details["unseen_lag"] > 1.5 * held


def test_where_no_lag_would_be_seen_it_is_infinite():
    recording, known = record_height(5, (0.12,), rows=300), KNOWN.replace(lag=0.12)
    fit = dtm.estimate_delay(recording, known, free=("delay", "gain", "lag"))
    assert fit.verdict == "reliable", fit.message
    assert np.isinf(fit.details["unseen_lag"])
    assert "no further lag would have been seen" in fit.message
    # Nor is it: the fitted lag becomes the longer of both, and the delay takes the shorter.
    found = 0
    for seed, second in enumerate((0.06, 0.2, 0.5, 1.0)):
        both = record_height(20 + seed, (0.12, second), rows=300)
        fit = dtm.estimate_delay(both, known, free=("delay", "gain", "lag"))
        found += "the plant lacks a lag" in fit.message
    assert found <= 1


def test_two_recordings_show_more_than_one():
    recordings = [record_height(seed) for seed in (1, 2)]
    one = dtm.estimate_delay(recordings[0], KNOWN).details["unseen_lag"]
    both = dtm.estimate_delay(recordings, KNOWN).details["unseen_lag"]
    assert both == pytest.approx(one * 2**-0.25, rel=0.25)
    assert both < one
