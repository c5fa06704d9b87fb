"""Estimates from rows that passed a known digital filter, and air that acts behind the lags."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import OutputError
from deadtime.estimation.methods._commanded_model import known_filter
from hypothesis import given, strategies as st
from marks import NIGHTLY
from scipy import signal

RATE = 1000.0
PT1 = ([0.4], [1.0, -0.6])
BIQUAD = signal.butter(2, 100.0, fs=RATE)
DELAY, LAG, GAIN = 0.0047, 0.028, 90.0


def rows(known, noise=0.0, torque=0.0, seed=3, count=3000):
    """Rates of a vehicle whose motors lag, read with noise and filtered; torques wander behind."""
    random = np.random.default_rng(seed)
    time = np.arange(count) / RATE
    command = np.repeat(random.choice([-0.1, 0.0, 0.1], count // 100 + 1), 100)[:count]
    since = np.maximum(time[:, None] - DELAY - time, 0.0)
    step = since + LAG * np.expm1(-since / LAG)
    rate = GAIN * step @ np.diff(command, prepend=0.0)
    wander = signal.lfilter([1.0], [1.0, -0.998], random.standard_normal(count))
    rate += torque * np.cumsum(wander) / RATE
    output = signal.lfilter(*known, rate + noise * random.standard_normal(count))
    return dtm.Recording(time, np.zeros(count), output, command)


def estimate(recording, known, **options):
    loop = dtm.ControlLoop(dtm.Integrator(50.0, 0.05), dtm.P(1.0), sample_time=1.0 / RATE)
    return dtm.estimate_delay(
        recording,
        loop,
        method=OutputError(output_filter=known, **options),
        free=("delay", "gain", "lag"),
    )


@pytest.mark.parametrize(
    ("known", "noise"),
    [
        (PT1, 1e-3),
        pytest.param(BIQUAD, 1e-3, marks=pytest.mark.survey),
        # The search takes a hundred times as long on rows without any noise.
        pytest.param(PT1, 0.0, marks=NIGHTLY),
        pytest.param(BIQUAD, 0.0, marks=NIGHTLY),
    ],
)
def test_with_hardly_any_noise_the_filter_takes_no_part(known, noise):
    recording = rows(known, noise, count=1500)
    found = estimate(recording, known)
    assert found.delay == pytest.approx(DELAY, abs=1e-4)
    assert found.lag == pytest.approx(LAG, abs=1e-4)
    assert found.gain == pytest.approx(GAIN, rel=1e-3)
    # The filter is a part of the delay where it is not told.
    whole = estimate(recording, ([1.0], [1.0]))
    late = known_filter(known).late / RATE
    assert whole.delay_plus_lag - found.delay_plus_lag == pytest.approx(late, abs=3e-4)


@pytest.mark.parametrize("known", [PT1, BIQUAD])
def test_filtered_noise_and_torques_are_told_from_the_vehicle(known):
    recording = rows(known, noise=0.02, torque=0.1)
    found = estimate(recording, known, air="vehicle")
    low, high = found.ci(0.95, "delay+lag")
    assert low < DELAY + LAG < high
    assert high - low < 0.01
    assert found.verdict == "reliable"


def test_noise_behind_the_filter_leaves_what_is_computed_nearly_white():
    # Noise of the sensor, and a tenth as much added behind the filter, as by digits.
    random = np.random.default_rng(1)
    known = known_filter(BIQUAD)
    output = signal.lfilter(*BIQUAD, random.standard_normal(200_000))
    output += 0.1 * np.std(output) * random.standard_normal(output.size)
    before = known.undone(output)[known.start :]
    count = before.size // known.together
    means = before[: count * known.together].reshape(count, -1).mean(axis=1)
    for lag in (1, 2, 3):
        assert abs(np.mean(means[lag:] * means[:-lag])) < 0.06 * np.var(means)


@given(st.floats(0.05, 0.95))
def test_a_first_order_filter_is_undone_exactly(k):
    x = np.random.default_rng(1).standard_normal(300)
    known = known_filter(([k], [1.0, k - 1.0]))
    undone = known.undone(signal.lfilter([k], [1.0, k - 1.0], x))
    np.testing.assert_allclose(undone[1:], x[1:], rtol=0, atol=1e-9)
    assert known.late == pytest.approx((1.0 - k) / k)
    assert known.remaining == 0.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (([1.0], [1.0, -1.2]), "not stable"),
        (([1.0, -1.0], [1.0]), "cannot be undone"),
        (([1.0, 2.0], [1.0]), "cannot be undone"),
        (([math.nan], [1.0]), "finite"),
        (([], [1.0]), "finite coefficients"),
        ((["b"], [1.0]), "give \\(b, a\\)"),
        (([1.0],), "give \\(b, a\\)"),
    ],
)
def test_filters_that_tell_nothing_are_refused(given, words):
    with pytest.raises((TypeError, ValueError), match=words):
        OutputError(output_filter=given)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="air"):
        OutputError(air="sideways")
    recording = rows(PT1)
    loop = dtm.ControlLoop(dtm.FirstOrder(1.0, 0.1), dtm.P(1.0), sample_time=1.0 / RATE)
    with pytest.raises(ValueError, match="air='vehicle' needs a plant such as Integrator"):
        dtm.estimate_delay(recording, loop, method=OutputError(air="vehicle"))
    gone = np.delete(np.arange(3000), slice(1000, 1200))
    holed = dtm.Recording(
        recording.time[gone],
        recording.reference[gone],
        recording.output[gone],
        recording.command[gone],
    )
    with pytest.raises(dtm.NotIdentifiableError, match="evenly spaced"):
        estimate(holed, PT1)
