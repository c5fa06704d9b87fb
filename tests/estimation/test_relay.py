"""The limit cycle under a relay: period, hold, lag, noise, and refusals."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import Relay
from hypothesis import given, settings, strategies as st
from step_recordings import TS, noise_for_output, record_step, replace_signals, root_mean_square


def relay(delay=0.36, lag=0.0, ts=TS, noise=0.0, seed=0, duration=20.0, dt=0.02):
    """A recording with a relay of 0.5 m/s, and the known part of its loop."""
    loop = dtm.ControlLoop(dtm.Integrator(1.0, lag), dtm.P(1.31), delay=delay, sample_time=ts)
    recording = dtm.Experiment.relay(duration, 0.5, sample_time=ts or dt).run(
        loop, noise=noise, seed=seed, noise_in_loop=ts is not None
    )
    return recording, loop.replace(delay=None, lag=0.0)


@settings(max_examples=25)
@given(st.floats(0.1, 0.9))
def test_the_delay_of_a_sampled_loop_is_exact(delay):
    recording, known = relay(delay, duration=24 * (delay + TS))
    fit = dtm.estimate_delay(recording, known, method="relay")
    assert fit.delay == pytest.approx(delay, abs=1e-9)
    assert fit.verdict == "reliable"
    # The wait for the next sample counts, between zero and one sample time.
    assert 0.0 <= fit.details["wait_of_hold"] <= TS + 1e-12
    assert fit.details["period"] == pytest.approx(4 * (delay + fit.details["wait_of_hold"]))


def test_the_delay_is_a_quarter_of_the_period_without_a_hold():
    recording, known = relay(ts=None)
    fit = dtm.estimate_delay(recording, known, method="relay")
    assert fit.delay == pytest.approx(0.36, abs=1e-7)
    assert fit.details["period"] / 4 == pytest.approx(0.36, abs=1e-7)
    # the peak is the relay's speed for a delay, as far as samples show it
    assert fit.details["amplitude_expected"] == pytest.approx(0.5 * 0.36, rel=1e-6)
    assert fit.details["amplitude"] == pytest.approx(0.5 * 0.36, abs=0.5 * 0.02)


def test_a_lag_counts_as_delay_unless_it_is_known():
    # Period/4 = 0.420 = Td + lag with a lag of 0.06 s.
    recording, known = relay(lag=0.06, ts=None)
    fit = dtm.estimate_delay(recording, known, method="relay")
    assert fit.details["period"] / 4 == pytest.approx(0.420, abs=5e-4)
    assert fit.delay == pytest.approx(0.420, abs=5e-4)
    fit = dtm.estimate_delay(recording, known.replace(lag=0.06), method="relay")
    assert fit.delay == pytest.approx(0.36, abs=1e-5)
    assert fit.delay_plus_lag == pytest.approx(0.42, abs=1e-5)
    # With a longer lag a quarter period is less than the sum; with the lag known it is exact.
    recording, known = relay(delay=0.1, lag=0.06, ts=None, dt=0.01)
    assert dtm.estimate_delay(recording, known, method="relay").delay < 0.158
    fit = dtm.estimate_delay(recording, known.replace(lag=0.06), method="relay")
    assert fit.delay == pytest.approx(0.1, abs=1e-4)


def test_the_relay_s_command_may_be_missing():
    recording, known = relay()
    fit = dtm.estimate_delay(
        replace_signals(recording, command=None), known, method=Relay(amplitude=0.5)
    )
    assert fit.delay == pytest.approx(0.36, abs=1e-9)
    assert fit.details["slope"] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize(("ts", "within"), [(TS, 3.0), (None, 0.5)])
def test_noise_is_averaged_over_the_cycles(ts, within):
    errors, stderrs = [], []
    for seed in range(40):
        recording, known = relay(ts=ts, noise=0.01, seed=seed)
        fit = dtm.estimate_delay(recording, known, method="relay")
        errors.append(1e3 * (fit.delay - 0.36))
        stderrs.append(1e3 * fit.stderr["delay"])
    assert root_mean_square(errors) < within
    assert np.mean(stderrs) == pytest.approx(root_mean_square(errors), rel=0.5)
    with pytest.raises(ValueError, match="lag or a drift"):
        fit.ci()


def test_recordings_without_a_limit_cycle_are_refused():
    recording, known = relay()

    def estimate(recording, loop=known, **options):
        return dtm.estimate_delay(recording, loop, method="relay", **options)

    oscillating, its_loop = record_step(Kp=3.5, limit=None, duration=12.0)
    with pytest.raises(dtm.NotIdentifiableError, match="a relay command has two values"):
        estimate(oscillating, its_loop)
    with pytest.raises(dtm.NotIdentifiableError, match="decays from"):
        estimate(replace_signals(oscillating, command=None), its_loop)
    damped, its_loop = record_step(Kp=1.0)
    with pytest.raises(dtm.NotIdentifiableError, match="no limit cycle"):
        estimate(replace_signals(damped, command=None), its_loop)
    with pytest.raises(dtm.NotIdentifiableError, match="too short"):
        estimate(recording, window=(0.0, 3.0))
    with pytest.raises(dtm.NotIdentifiableError, match="does not move"):
        estimate(replace_signals(recording, output=np.zeros(len(recording))))
    for seed in range(10):
        with pytest.raises(dtm.NotIdentifiableError):
            estimate(noise_for_output(recording, seed))
    with pytest.raises(ValueError, match="for an Integrator"):
        estimate(recording, known.replace(plant=dtm.FirstOrder()))
    with pytest.raises(ValueError, match="delay"):
        estimate(recording, known.replace(delay=0.3), free=("gain",))
