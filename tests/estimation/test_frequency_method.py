"""Maximum likelihood in the frequency domain: periods, single records, bias, coverage, refusals."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import Frequency
from hypothesis import given, settings, strategies as st
from step_recordings import (
    TS,
    delay_errors,
    noise_for_output,
    record_step,
    replace_signals,
    root_mean_square,
)

PERIOD = 5.2


def multisine(lag=0.0, noise=0.0, seed=0, periods=5, lines=12, gain=1.0, delay=0.36, offset=0.0):
    """A periodic recording, and the known part of its loop."""
    loop = dtm.ControlLoop(dtm.Integrator(gain, lag), dtm.P(1.31), delay=delay, sample_time=TS)
    wave = dtm.Experiment.multisine(0.4, PERIOD, lines, periods)
    recording = wave.run(loop, noise=noise, seed=seed)
    if offset:
        recording = replace_signals(
            recording, output=recording.output + offset, reference=recording.reference + offset
        )
    return recording, loop.replace(delay=None, lag=0.0, gain=1.0)


def estimate(recording, known, free=("delay", "gain"), period=PERIOD, window=None, **options):
    method = Frequency(period=period, **options)
    return dtm.estimate_delay(recording, known, method=method, free=free, window=window)


# --- exactness ------------------------------------------------------------------------------


@settings(max_examples=15)
@given(st.floats(0.0, 0.8), st.floats(0.4, 1.5), st.sampled_from([0.0, 0.1]))
def test_one_record_without_noise_is_exact(delay, gain, lag):
    recording, known = record_step(delay, gain, lag)
    free = ("delay", "gain", "lag") if lag else ("delay", "gain")
    fit = estimate(recording, known.replace(gain=1.0), free, None)
    assert fit.delay == pytest.approx(delay, abs=1e-6)
    assert fit.gain == pytest.approx(gain, abs=1e-6)
    assert fit.lag == pytest.approx(lag, abs=1e-6)


@pytest.mark.parametrize("lag", [0.0, 0.06])
def test_periods_without_noise_are_exact(lag):
    recording, known = multisine(lag, gain=0.8, offset=2.0, periods=8)
    fit = estimate(recording, known, ("delay", "gain", "lag") if lag else ("delay", "gain"))
    # What is left of the transient after one period: 1e-8, and delay against lag magnify it.
    assert fit.delay == pytest.approx(0.36, abs=1e-5)
    assert fit.gain == pytest.approx(0.8, abs=1e-5)
    assert fit.delay_plus_lag == pytest.approx(0.36 + lag, abs=1e-6)


# --- noise ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("case", "published"),
    [
        ("continuous, Kp 1.31", 4.8),
        ("continuous, Kp 3", 3.8),
        ("continuous, limit, 65 ms, 0.3 %", 13.4),
        ("0.3 %", 1.7),
        ("1 %", 5.7),
        ("3 %", 17.2),
        ("1 %, Kp 3", 3.4),
        ("1 %, Kp 0.8", 9.1),
        ("10 ms, Kp 4, Td 0.05", 5.4),
    ],
)
def test_the_benchmark_of_single_records(case, published):
    errors, _ = delay_errors(case, 20, "frequency")
    assert root_mean_square(errors) < published


@pytest.mark.survey
def test_intervals_of_single_records_cover_with_gain_and_start_unknown():
    errors, found = delay_errors("1 %", 150, "frequency", free=("delay", "gain"))
    # The bound with gain and offset free is 3.58 ms.
    assert root_mean_square(errors) == pytest.approx(3.58, rel=0.2)
    held = [low <= 0.36 <= high for low, high in (fit.ci() for fit in found)]
    # 142.5 of 150 expected, with a deviation of 2.7.
    assert sum(held) >= 134
    assert sum(fit.verdict == "reliable" for fit in found) >= 140


@pytest.mark.survey
@pytest.mark.parametrize("free", [("delay", "gain"), ("delay", "gain", "lag")])
def test_intervals_of_periodic_records_cover(free):
    lag = 0.06 if "lag" in free else 0.0
    held, errors, stderrs, reliable = 0, [], [], 0
    runs = 60 if lag else 120
    for seed in range(runs):
        recording, known = multisine(lag, noise=0.01, seed=seed)
        fit = estimate(recording, known, free)
        low, high = fit.ci()
        held += low <= 0.36 <= high
        reliable += fit.verdict == "reliable"
        errors.append(fit.delay - 0.36)
        stderrs.append(fit.stderr["delay"])
    # 95 % expected, with a deviation of 2.0 or 2.8 %.
    assert held >= 0.88 * runs
    assert reliable >= 0.88 * runs
    assert root_mean_square(errors) == pytest.approx(np.mean(stderrs), rel=0.25)


def test_an_absent_lag_is_estimated_at_its_bound():
    at_bound = 0
    for seed in range(20):
        recording, known = multisine(noise=0.01, seed=seed)
        fit = estimate(recording, known, ("delay", "gain", "lag"))
        at_bound += fit.lag == 0.0
        assert fit.ci(0.95, "lag")[0] == 0.0
        assert fit.delay_plus_lag == pytest.approx(0.36, abs=0.012)
    # In half of the recordings noise would make the lag negative.
    assert 4 <= at_bound <= 16


def test_the_profile_reaches_the_t_quantile_at_the_ends_of_the_interval():
    recording, known = multisine(0.06, noise=0.01, seed=2)
    fit = estimate(recording, known, ("delay", "gain", "lag"))
    for name in ("delay", "lag", "delay+lag"):
        ends = fit.ci(0.95, name)
        _, t = fit.profile(name, ends)
        inside = [value for value, end in zip(t, ends, strict=True) if end > 0.0]
        np.testing.assert_allclose(inside, 2.07, rtol=0.05)  # t quantile of 21 degrees of freedom


def test_p_values_of_the_right_model_are_neither_small_nor_large():
    # The variances are estimated from four periods, which widens the statistic by 3/2.
    found = [estimate(*multisine(noise=0.01, seed=seed)) for seed in range(20)]
    # The mean of 20 uniform numbers has a deviation of 0.065.
    assert np.mean([fit.details["p_value_of_model"] for fit in found]) == pytest.approx(
        0.5, abs=0.2
    )


def test_a_lag_missing_from_the_model_is_detected():
    recording, known = multisine(0.2, noise=0.003, periods=9)
    fit = estimate(recording, known)
    assert fit.verdict != "reliable"
    assert "lag" in fit.message
    assert fit.details["p_value_of_model"] < 1e-3
    assert estimate(recording, known, ("delay", "gain", "lag")).verdict == "reliable"


def test_high_lines_can_be_excluded():
    recording, known = multisine(noise=0.003)
    fit = estimate(recording, known, highest=1.0)
    assert fit.details["lines"] == "5 of 4 periods"
    assert fit.delay == pytest.approx(0.36, abs=0.02)
    assert estimate(recording, known, period=None, highest=1.0).delay == pytest.approx(
        0.36, abs=0.02
    )


def test_a_continuous_loop_has_no_interval():
    recording, known = record_step(ts=None, dt=0.02, limit=None)
    fit = estimate(recording, known, period=None)
    assert fit.delay == pytest.approx(0.36, abs=1e-3)
    with pytest.raises(ValueError, match="continuous loop"):
        fit.ci()


# --- refusals -------------------------------------------------------------------------------


def test_what_cannot_be_estimated_is_refused():
    recording, known = multisine(noise=0.003)
    refused = dtm.NotIdentifiableError
    with pytest.raises(refused, match="does not repeat"):
        estimate(recording, known, period=60 * TS)
    with pytest.raises(refused, match="is constant"):
        estimate(replace_signals(recording, reference=np.zeros(len(recording))), known)
    with pytest.raises(refused, match="1 periods"):
        estimate(recording, known, window=(0.0, 12.0))
    with pytest.raises(ValueError, match="whole number"):
        estimate(recording, known, period=5.21)
    with pytest.raises(refused, match=r"command is 0\.5 throughout"):
        estimate(replace_signals(recording, command=np.full(len(recording), 0.5)), known)
    with pytest.raises(refused, match="output is 0 throughout"):
        estimate(replace_signals(recording, output=np.zeros(len(recording))), known)
    with pytest.raises(refused, match="too few"):
        estimate(recording, known, highest=0.2)
    with pytest.raises(refused, match="too few"):
        estimate(recording, known, period=None, highest=0.05)
    with pytest.raises(refused, match=r"[Ll]og the command"):
        estimate(
            replace_signals(recording, command=None), known.replace(controller=dtm.PV(1.0, 0.1))
        )
    with pytest.raises(ValueError, match="for an Integrator"):
        estimate(recording, known.replace(plant=dtm.FirstOrder()), ("delay",))
    with pytest.raises(ValueError, match="choose one or more from"):
        estimate(recording, known, ("delay", "offset"))
    uneven = recording.time + 0.02 * np.sin(np.arange(len(recording)))
    with pytest.raises(refused, match="even"):
        estimate(replace_signals(recording, time=uneven), known)


@pytest.mark.parametrize("period", [PERIOD, None])
def test_noise_alone_is_refused(period):
    recording, known = multisine()
    refused = 0
    for seed in range(20):
        try:
            estimate(noise_for_output(recording, seed), known, period=period)
        except dtm.NotIdentifiableError:
            refused += 1
    assert refused >= 18
