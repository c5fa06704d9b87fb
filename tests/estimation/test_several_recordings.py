"""Several recordings of one vehicle, fitted with the same parameters."""

import deadtime as dtm
import numpy as np
import pytest
import step_recordings
from deadtime.estimation._least_squares import JointModel
from flights import flight_path

TS = 0.065


def record_step(Kp, noise, seed, size=1.0, lag=0.0, limit=1.0):
    flight, known = step_recordings.record_step(
        gain=0.9, lag=lag, Kp=Kp, noise=noise, seed=seed, limit=limit, size=size, rest=1.0
    )
    return flight, known.replace(gain=1.0)


@pytest.mark.parametrize("method", ["output_error", "waveform"])
@pytest.mark.parametrize("lag", [0.0, 0.12])
def test_noise_free_recordings_are_recovered_exactly(method, lag):
    flights, loops = zip(
        *(record_step(Kp, 0.0, 0, lag=lag) for Kp in (0.8, 1.31, 2.0)), strict=True
    )
    free = ("delay", "gain", "lag") if lag else ("delay", "gain")
    fit = dtm.estimate_delay(list(flights), list(loops), method=method, free=free)
    assert fit.delay == pytest.approx(0.36, abs=1e-6)
    assert fit.gain == pytest.approx(0.9, abs=1e-6)
    assert fit.lag == pytest.approx(lag, abs=1e-6)
    assert [one.loop.parameters["Kp"] for one in fit.runs] == [0.8, 1.31, 2.0]
    assert all(one.loop.delay == fit.delay for one in fit.runs)
    assert "3 recordings together" in fit.summary()


@pytest.mark.survey
def test_two_recordings_halve_the_variance_of_one():
    # The bound with white noise is 1/sqrt(2) of that of one recording, and the errors agree.
    errors, bounds, single = [], [], []
    for seed in range(60):
        pairs = [record_step(1.31, 0.01, 2 * seed + k) for k in range(2)]
        flights, loops = [p[0] for p in pairs], [p[1] for p in pairs]
        fit = dtm.estimate_delay(flights, loops)
        errors.append(fit.delay - 0.36)
        bounds.append(fit.crb.stderr["delay"])
        single.append(dtm.estimate_delay(flights[0], loops[0]).crb.stderr["delay"])
    assert np.mean(bounds) == pytest.approx(np.mean(single) / np.sqrt(2), rel=0.05)
    # 60 runs: the root mean square is known to 9 %.
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.mean(bounds), rel=0.3)


def test_a_recording_is_weighted_by_its_noise():
    quiet, loop = record_step(1.31, 0.002, 1)
    loud, _ = record_step(1.31, 0.05, 2)
    alone = dtm.estimate_delay(quiet, loop)
    both = dtm.estimate_delay([quiet, loud], loop)
    assert both.whiteness.white
    # Information adds: 1/625 of it comes from the recording with more noise.
    assert both.stderr["delay"] <= alone.stderr["delay"] * 1.02
    assert abs(both.delay - alone.delay) < 0.2 * alone.stderr["delay"]
    # Residuals are those of the recordings, not the weighted ones of the search.
    assert both.runs[1].residuals.std() == pytest.approx(0.05, rel=0.2)


def test_coloured_misfit_is_weighted_by_the_size_of_the_step():
    # The misfit of a missing lag is proportional to the step, so both steps give the same delay.
    small, loop = record_step(1.31, 0.0, 0, size=0.25, lag=0.3, limit=None)
    large, _ = record_step(1.31, 0.0, 0, size=1.0, lag=0.3, limit=None)
    alone = dtm.estimate_delay(small, loop)
    both = dtm.estimate_delay([small, large], loop)
    assert both.verdict != "reliable"
    assert both.delay == pytest.approx(alone.delay, abs=1e-6)


def test_the_joint_model_consists_of_the_models_of_its_recordings():
    from deadtime.estimation.methods._method import paired_runs
    from deadtime.estimation.methods._waveform import simulated_model

    pairs = [record_step(Kp, 0.01, 3) for Kp in (0.8, 2.0)]
    runs = paired_runs([p[0] for p in pairs], [p[1] for p in pairs])
    parts = tuple(simulated_model(run, ("delay", "gain")) for run in runs)
    joint = JointModel(parts, (1.0, 0.5))
    assert joint.labels[2:] == tuple(f"initial output of recording {k}" for k in (1, 2))
    point = np.array([0.4, 0.8, 0.01, -0.02])
    expected = np.r_[parts[0].misfit(point[:3]), 0.5 * parts[1].misfit(point[[0, 1, 3]])]
    np.testing.assert_array_equal(joint.misfit(point), expected)
    change = 1e-6 * np.eye(4)
    quotients = [(joint.misfit(point + d) - joint.misfit(point - d)) / 2e-6 for d in change]
    np.testing.assert_allclose(joint.problem.jacobian(point).T, quotients, atol=2e-5)


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        (([], None), ValueError, "no recording"),
        (("two", ["one loop"]), ValueError, "2 recordings and 1 of `loop`"),
        (("two", "loop", [None] * 3), ValueError, "2 recordings and 3 of `window`"),
        ((["text"], "loop"), TypeError, r"recording\[0\] must be a Recording, not str"),
        (("two", ["a", "b"]), TypeError, r"loop\[0\] must be a ControlLoop, not str"),
        (("two", "plants"), ValueError, "different plants"),
    ],
)
def test_inconsistent_arguments_are_refused(arguments, error, match):
    flight, loop = record_step(1.31, 0.01, 0)
    other = loop.replace(plant=dtm.FirstOrder())
    named = {"two": [flight, flight], "loop": loop, "plants": [loop, other]}

    def meant(value):
        return named.get(value, value) if isinstance(value, str) else value

    recording, its_loop, *window = (meant(value) for value in arguments)
    with pytest.raises(error, match=match):
        dtm.estimate_delay(recording, its_loop, window=window[0] if window else None)


def test_methods_for_one_recording_refuse_several():
    flight, loop = record_step(2.0, 0.001, 0)
    with pytest.raises(ValueError, match="one recording, but 2"):
        dtm.estimate_delay([flight, flight], loop, method="overshoot")


def test_the_two_real_flights_are_fitted_together():
    # Two independent fits put these at 0.424 s with gain 0.734, with a lag at 0.327 + 0.105 s with
    # gain 0.747, each to about two digits.
    flights, loops = [], []
    for name, Kp in (("2_4_0_25", 2.4), ("0_5_1_0", 0.5)):
        path = flight_path(f"ardrone2_height_step_{name}.csv")
        flights.append(dtm.read_recording(path, time="t_s", reference="ref_m", output="height_m"))
        loops.append(dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), sample_time=TS, limit=1.0))
    fit = dtm.estimate_delay(flights, loops, window=(13, 25.5))
    assert (fit.delay, fit.gain) == pytest.approx((0.424, 0.734), abs=0.002)
    lagged = dtm.estimate_delay(flights, loops, window=(13, 25.5), free=("delay", "gain", "lag"))
    assert (lagged.delay, lagged.lag) == pytest.approx((0.327, 0.105), abs=0.005)
    assert lagged.gain == pytest.approx(0.747, abs=0.002)
    # The misfit is coloured, so the intervals are the robust ones, wider than ± 0.003 s by far.
    assert fit.verdict != "reliable"
    low, high = fit.ci()
    assert high - low > 0.02
