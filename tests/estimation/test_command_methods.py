"""Methods that relate the output to the command: correlation, ARX models, feedback."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import GCC, ARXScan
from deadtime.estimation._native import HeldResponse
from deadtime.estimation.data._simulated import commands_over_samples
from deadtime.estimation.methods._input_output import (
    F_TEST_LEVEL,
    FEEDBACK,
    _check_loss,
    feedback_p_value,
)
from hypothesis import given, settings, strategies as st
from scipy.optimize import brentq
from scipy.stats import kstest
from step_recordings import (
    CASES,
    TS,
    delay_errors,
    noise_for_output,
    record_step,
    replace_signals,
    root_mean_square,
)

METHODS = ("gcc", "arx_scan")


def open_loop(seed, hold=1, noise=0.01, delay=0.36, samples=300):
    """A command that does not depend on the output, and the response to it."""
    random = np.random.default_rng(seed)
    time = np.arange(samples) * TS
    command = np.repeat(random.choice([-0.5, 0.5], samples // hold), hold)
    output = HeldResponse(time, command).at(time - delay).value
    output = output + random.normal(0.0, noise, samples) if noise else output
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=TS)
    return dtm.Recording(time, 0.0 * time, output, command), known


# --- exactness ------------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.floats(TS, 0.9), st.integers(0, 2**31))
def test_an_arx_scan_with_the_plant_model_is_exact(delay, seed):
    recording, known = open_loop(seed, noise=0.0, delay=delay)
    fit = dtm.estimate_delay(recording, known, method=ARXScan(fractional=True))
    assert fit.delay == pytest.approx(delay, abs=1e-9)
    # The integer scan gives the number of samples below the delay, unless the delay is a multiple.
    whole = dtm.estimate_delay(recording, known, method="arx_scan")
    assert -1e-9 <= delay - whole.delay <= TS + 1e-9


@pytest.mark.parametrize("weighting", ["none", "scot", "phat", "prewhitened"])
@pytest.mark.parametrize("part", [0.0, 0.25, 0.5, 0.75])
def test_a_correlation_peak_between_samples_is_located(weighting, part):
    # A white command's correlation is a triangle, which is how whitened peaks are read; a parabola
    # through it, or weights of averaged spectra, would be wrong by up to a tenth of a sample.
    delay = (5 + part) * TS
    found = []
    for seed in range(8):
        recording, known = open_loop(seed, noise=0.0, delay=delay, samples=600)
        fit = dtm.estimate_delay(recording, known, method=GCC(weighting=weighting))
        found.append(fit.delay - delay)
    within = {"none": 0.2, "scot": 0.2, "phat": 0.15, "prewhitened": 0.1}[weighting]
    assert abs(np.mean(found)) < within * TS


def test_a_first_order_plant_is_compensated():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.P(0.3), delay=4 * TS, sample_time=TS)
    recording = dtm.Experiment.prbs(20.0, 0.5, 2 * TS).run(loop)
    fit = dtm.estimate_delay(recording, loop.replace(delay=None), method=ARXScan(fractional=True))
    assert fit.delay == pytest.approx(4 * TS, abs=1e-9)
    assert fit.verdict == "reliable"


def test_other_plants_are_correlated_without_compensation():
    plant = dtm.RationalPlant([1.0], [0.01, 0.2, 1.0])
    loop = dtm.ControlLoop(plant, dtm.P(0.5), delay=0.36, sample_time=TS)
    recording = dtm.Experiment.prbs(20.0, 0.5, 2 * TS).run(loop)
    fit = dtm.estimate_delay(recording, loop.replace(delay=None), method="gcc")
    assert 0.36 < fit.delay < 0.36 + 0.3
    assert "not inverted" in fit.message
    with pytest.raises(ValueError, match="RationalPlant"):
        dtm.estimate_delay(recording, loop, method=ARXScan(fractional=True))


def test_the_mean_command_of_a_continuous_loop_stops_before_a_jump():
    recording, known = record_step(ts=None, dt=0.05, limit=None, duration=3.0)
    fine, _ = record_step(ts=None, dt=0.001, limit=None, duration=3.0)
    means, source = commands_over_samples(recording, known)
    whole = np.interp(recording.time, fine.time, np.cumsum(fine.command) * 0.001)
    np.testing.assert_allclose(means[:-1], np.diff(whole) / 0.05, atol=0.03)
    assert source == "logged"


# --- the rows of the benchmark --------------------------------------------------------------

#: Root-mean-square errors in ms of an independent study, by case: correlation, ARX models.
ROWS = {
    "continuous, Kp 1.31": (10.6, 29.5),
    "continuous, Kp 3": (3.5, 6.2),
    "continuous, limit, 65 ms, 0.3 %": (7.1, 4.3),
    "0.3 %": (10.2, 3.8),
    "1 %": (16.5, 15.9),
    "3 %": (45.0, 90.0),
    "1 %, Kp 3": (11.0, 12.2),
    "1 %, Kp 3, no limit": (4.2, 3.8),
    "1 %, Kp 0.8": (21.4, 22.1),
}


@pytest.mark.parametrize("case", ROWS)
def test_the_errors_of_correlation_are_those_of_the_benchmark(case):
    errors, _ = delay_errors(case, 60, "gcc")
    assert root_mean_square(errors) < 1.2 * ROWS[case][0]


@pytest.mark.parametrize("case", [case for case in ROWS if case != "3 %"])
def test_the_errors_of_arx_models_are_those_of_the_benchmark(case):
    runs = 20 if CASES[case].get("dt") == 0.01 else 60
    errors, _ = delay_errors(case, runs, ARXScan(fractional=True))
    assert root_mean_square(errors) < 1.2 * ROWS[case][1]


def test_a_whole_number_of_samples_causes_an_error_of_half_a_sample():
    # 0.36 s are 5.54 samples, and the model with both coefficients begins at 5.
    _, found = delay_errors("0.3 %", 5, "arx_scan")
    assert {fit.details["samples"] for fit in found} == {5.0}


# --- feedback -------------------------------------------------------------------------------


def test_feedback_is_detected_in_closed_loops_only():
    closed_loop = [record_step(noise=0.01, seed=seed, duration=10.0)[0] for seed in range(20)]
    assert all(feedback_p_value(recording) < FEEDBACK for recording in closed_loop)
    held = [open_loop(seed, hold=1 + seed % 4)[0] for seed in range(60)]
    # One false detection in a thousand is expected.
    assert sum(feedback_p_value(recording) < FEEDBACK for recording in held) <= 2


def test_without_feedback_all_p_values_are_equally_likely():
    random = np.random.default_rng(5)
    time, values = np.arange(80) * TS, []
    for _ in range(200):
        command, output, reference = random.normal(size=(3, time.size))
        values.append(feedback_p_value(dtm.Recording(time, reference, output, command)))
    # The distribution function of 200 uniform numbers is off by 0.12 in one of 200 cases.
    assert kstest(values, "uniform").statistic < 0.12


def test_feedback_is_reported():
    recording, known = record_step(noise=0.01)
    fit = dtm.estimate_delay(recording, known, method="gcc")
    assert fit.details["feedback"]
    assert "depends on the output" in fit.message
    assert "depends on the output" in fit.uncalibrated
    # A command that is computed from the output depends on it by construction.
    fit = dtm.estimate_delay(replace_signals(recording, command=None), known, method="gcc")
    assert fit.details["feedback_p_value"] == 0.0
    recording, known = open_loop(1)
    fit = dtm.estimate_delay(recording, known, method="gcc")
    assert not fit.details["feedback"]
    assert "depends on the output" not in fit.message


def test_noise_that_returns_without_delay_is_not_taken_for_the_response():
    # At 10 ms and Kp 4 the noise peak at shift 0 is higher than that of the response.
    for method in METHODS:
        errors, _ = delay_errors("10 ms, Kp 4, Td 0.05", 15, method)
        assert np.median(errors) > -45.0


# --- refusals -------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_recordings_without_a_response_to_the_command_are_refused(method):
    recording, known = record_step(noise=0.003)

    def estimate(recording, loop=known, **options):
        return dtm.estimate_delay(recording, loop, method=method, **options)

    with pytest.raises(dtm.NotIdentifiableError, match=r"command is 0\.5 throughout"):
        estimate(replace_signals(recording, command=np.full(len(recording), 0.5)))
    with pytest.raises(dtm.NotIdentifiableError, match="did not move"):
        estimate(replace_signals(recording, output=np.full(len(recording), 2.0)))
    with pytest.raises(dtm.NotIdentifiableError, match="too few"):
        estimate(recording, window=(0.0, 0.9))
    uneven = recording.time + 0.02 * np.sin(np.arange(len(recording)))
    with pytest.raises(dtm.NotIdentifiableError, match="even"):
        estimate(replace_signals(recording, time=uneven))
    with pytest.raises(dtm.NotIdentifiableError, match=r"[Ll]og the command"):
        estimate(
            replace_signals(recording, command=None), known.replace(controller=dtm.PV(1.0, 0.1))
        )
    with pytest.raises(ValueError, match="delay"):
        estimate(recording, known.replace(delay=0.3), free=("gain",))
    refused = 0
    for seed in range(40):
        try:
            estimate(noise_for_output(recording, seed))
        except dtm.NotIdentifiableError:
            refused += 1
    assert refused >= 38


def test_the_significance_of_the_command_has_a_closed_form():
    # For two coefficients and f degrees of freedom p is (least/none)^(f/2), for four
    # x^(f/2) (1 + f/2 (1 - x)) with x = least/none.
    freedom, none = 86, 3.0
    two = F_TEST_LEVEL ** (2.0 / freedom)
    half = freedom / 2.0
    four = brentq(lambda x: x**half * (1.0 + half * (1.0 - x)) - F_TEST_LEVEL, 1e-6, 1.0)
    for tested, share in ((2, two), (4, four)):
        _check_loss(0.999 * none * share, none, freedom, tested)
        with pytest.raises(dtm.NotIdentifiableError, match="as it does for noise"):
            _check_loss(1.001 * none * share, none, freedom, tested)


def test_options_are_checked():
    recording, known = record_step()
    with pytest.raises(ValueError, match="not one of"):
        dtm.estimate_delay(recording, known, method=GCC(weighting="roth"))
    with pytest.raises(ValueError, match="nb"):
        dtm.estimate_delay(recording, known, method=ARXScan(nb=0))


@pytest.mark.parametrize("method", METHODS)
def test_no_interval_is_given_and_the_error_names_a_method_that_has_one(method):
    recording, known = record_step(noise=0.003)
    fit = dtm.estimate_delay(recording, known, method=method)
    with pytest.raises(ValueError, match="output_error"):
        fit.ci()
    assert fit.to_dict()["stderr"]["delay"] is None


def test_a_command_at_its_limit_throughout_has_no_peak():
    # The correlation of two steps is flat up to the delay, so its first value is not a peak.
    recording, known = record_step(Kp=2.0, limit=0.05, duration=8.0, rest=1.0)
    with pytest.raises(dtm.NotIdentifiableError, match="because of its limit"):
        dtm.estimate_delay(recording, known, method="gcc")
    fit = dtm.estimate_delay(recording, known, method="output_error")
    assert fit.delay == pytest.approx(0.36, abs=1e-9)


def test_noise_that_the_controller_receives_is_not_a_response():
    # A step of the command must not be fitted to the offset that the first noise sample leaves.
    recording, known = record_step(Kp=2.0, duration=8.0, rest=1.0)
    for seed in range(30):
        noise = 0.05 * noise_for_output(recording, seed).output
        command = np.clip(2.0 * (recording.reference - noise), -1.0, 1.0)
        for method in METHODS:
            with pytest.raises(dtm.NotIdentifiableError):
                dtm.estimate_delay(
                    replace_signals(recording, output=noise, command=command), known, method=method
                )
