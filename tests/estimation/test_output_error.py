"""Output error with the logged command: it reaches the Cramér-Rao bound and covers with a lag."""

import deadtime as dtm
import numpy as np
import pytest
import step_recordings
from deadtime.estimation import OutputError
from deadtime.estimation._native import HeldResponse
from flights import flight_path
from hypothesis import given, settings, strategies as st
from marks import NIGHTLY
from scipy.signal import lsim

TS = 0.065


def record_step(delay=0.36, gain=1.0, lag=0.0, Kp=1.31, noise=0.0, seed=0, limit=1.0, duration=6.0):
    """A recording with sensor noise in the loop and a logged command, and its loop as known."""
    loop = dtm.ControlLoop(
        dtm.Integrator(gain, lag), dtm.P(Kp), delay=delay, sample_time=TS, limit=limit
    )
    time = np.arange(0.0, duration, TS)
    reference = np.where(time < 1.0 - 1e-9, 0.0, 1.0)
    error = np.random.default_rng(seed).normal(0.0, noise, time.size) if noise else 0.0 * time
    run = loop.simulate(time, reference - error, reference_time=time, initial_output=0.0)
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), sample_time=TS, limit=limit)
    return dtm.Recording(time, reference, run.outputs + error, run.inputs), known


# --- the response to a held command ---------------------------------------------------------


@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_the_response_is_that_of_a_fine_simulation(lag):
    time = np.array([0.0, 0.3, 0.4, 1.1])
    command = np.array([1.0, -0.5, 2.0, 0.0])
    fine = np.linspace(0.0, 2.0, 20001)
    held = command[np.searchsorted(time, fine, side="right") - 1]
    system = ([1.0], [lag, 1.0, 0.0] if lag else [1.0, 0.0])
    # lsim interpolates linearly between samples, so a jump is smeared over one step of 1e-4.
    truth = lsim(system, held, fine)[1]
    found = HeldResponse(time, command).at(fine, lag)
    np.testing.assert_allclose(found.value, truth, rtol=0, atol=2e-4)


@pytest.mark.parametrize("lag", [0.003, 0.06, 2.0])
def test_equidistant_and_other_commands_give_the_same_response(lag):
    # With one command slightly late the recursion is used instead of the filters.
    time = TS * np.arange(200)
    command = np.random.default_rng(0).normal(size=200)
    late = time + np.where(np.arange(200) == 150, 1e-10, 0.0)
    even, uneven = (HeldResponse(t, command).at(time + 0.4 * TS, lag) for t in (time, late))
    for name in ("value", "rate", "by_lag"):
        one, other = getattr(even, name), getattr(uneven, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7)


@given(
    steps=st.lists(st.floats(0.01, 1.0), min_size=2, max_size=8),
    lag=st.one_of(st.just(0.0), st.floats(0.02, 2.0)),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_derivatives_are_those_of_the_response(steps, lag, seed):
    random = np.random.default_rng(seed)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    response = HeldResponse(time, random.normal(size=time.size))
    # Away from the corners that a response without lag has at every command.
    places = time[:-1] + 0.5 * np.diff(time)
    change = 1e-6
    later, now, before = (response.at(places + d, lag) for d in (change, 0.0, -change))
    # Central differences: the third derivative, up to 1/lag^2, and rounding over the change.
    tolerance = 1e-12 / max(lag, 0.02) ** 2 * 100 + 1e-8
    np.testing.assert_allclose(now.rate, (later.value - before.value) / 2e-6, atol=tolerance)
    if lag:
        longer, shorter = (response.at(places, lag * (1 + d)) for d in (1e-6, -1e-6))
        slope = (longer.value - shorter.value) / (2e-6 * lag)
        np.testing.assert_allclose(now.by_lag, slope, atol=1e-7 / lag + 1e-7)


# --- estimates ------------------------------------------------------------------------------


@settings(max_examples=25)
@given(delay=st.floats(0.0, 0.8), gain=st.floats(0.3, 2.0), lag=st.floats(0.02, 0.5))
def test_a_noise_free_recording_is_recovered_exactly(delay, gain, lag):
    plain, known = record_step(delay, gain)
    fit = dtm.estimate_delay(plain, known)
    assert fit.method == "output_error"  # the default for a logged command
    # The model is exact, so the delay is recovered to the rounding of the clock.
    assert fit.delay == pytest.approx(delay, abs=1e-9)
    assert fit.gain == pytest.approx(gain, abs=1e-9)
    assert fit.verdict == "reliable"
    lagging, known = record_step(delay, gain, lag)
    fit = dtm.estimate_delay(lagging, known, free=("delay", "gain", "lag"))
    # Delay and lag are nearly confounded: the valley is flat, its floor known to rounding.
    assert fit.delay == pytest.approx(delay, abs=1e-5)
    assert fit.lag == pytest.approx(lag, abs=1e-5)
    assert fit.delay_plus_lag == pytest.approx(delay + lag, abs=1e-6)


@pytest.mark.survey
@pytest.mark.parametrize(
    ("free", "start"),
    [(("delay",), 0.0), (("delay", "gain"), None)],
)
def test_the_error_is_the_cramer_rao_bound_and_intervals_cover(free, start):
    errors, bounds, held = [], [], 0
    for seed in range(200):
        flight, known = record_step(noise=0.01, seed=seed)
        fit = dtm.estimate_delay(flight, known, method=OutputError(start), free=free)
        errors.append(fit.delay - 0.36)
        bounds.append(fit.crb.stderr["delay"])
        low, high = fit.ci()
        held += low <= 0.36 <= high
    ratio = np.sqrt(np.mean(np.square(errors))) / np.mean(bounds)
    # 200 runs: the root mean square itself is known to 5 %, so 15 % is three of its deviations.
    assert ratio == pytest.approx(1.0, abs=0.15)
    # 190 of 200 expected, with a deviation of 3.1.
    assert 180 <= held <= 199


def test_the_bound_of_a_pure_delay_is_the_closed_form():
    flight, known = record_step(noise=0.01, seed=3)
    fit = dtm.estimate_delay(flight, known, method=OutputError(initial_output=0.0), free=("delay",))
    arriving = HeldResponse(flight.time, flight.command).at(flight.time - fit.delay).rate
    bound = fit.crb.noise.white / np.sqrt(np.sum(arriving**2))
    assert fit.crb.stderr["delay"] == pytest.approx(bound, rel=1e-9)
    assert fit.crb.free == ("delay",)


@pytest.mark.survey
def test_intervals_cover_where_the_lag_is_at_its_bound():
    held = {"delay": 0, "lag": 0, "delay+lag": 0}
    truth = {"delay": 0.36, "lag": 0.0, "delay+lag": 0.36}
    runs = 40
    for seed in range(runs):
        flight, known = record_step(noise=0.01, seed=seed)
        fit = dtm.estimate_delay(flight, known, free=("delay", "gain", "lag"))
        for name, value in truth.items():
            low, high = fit.ci(0.95, name)
            held[name] += low - 1e-9 <= value <= high
    # 38 of 40 expected, with a deviation of 1.4.
    assert all(count >= 34 for count in held.values()), held


def test_the_sum_of_delay_and_lag_is_known_when_the_parts_are_not():
    flight, known = record_step(0.30, lag=0.06, noise=0.01, seed=5)
    fit = dtm.estimate_delay(flight, known, free=("delay", "gain", "lag"))
    assert fit.stderr["delay"] > 4 * fit.stderr["delay+lag"]
    assert fit.delay_plus_lag == pytest.approx(0.36, abs=3 * fit.stderr["delay+lag"])


def test_the_profile_reaches_the_t_quantile_at_the_ends_of_the_interval():
    flight, known = record_step(0.30, lag=0.06, noise=0.01, seed=5)
    fit = dtm.estimate_delay(flight, known, free=("delay", "gain", "lag"))
    from scipy.special import stdtrit

    for name in ("delay", "gain", "delay+lag"):
        ends = fit.ci(0.95, name)
        _, t = fit.profile(name, ends)
        # The variance of the noise is estimated too; air that may be there takes freedom away.
        freedom = fit._profile.freedom_of(name)
        assert 4 <= freedom <= len(flight) - 4
        # Held fits near the bound of the lag have several minima, and searches from either side end
        # up to a few hundredths of t apart.
        np.testing.assert_allclose(t, stdtrit(freedom, 0.975), rtol=2e-2)
    values, t = fit.profile()
    assert values.shape == t.shape == (41,)
    assert t.min() < 0.2


def test_the_profile_agrees_with_the_normal_interval_where_both_are_valid():
    flight, known = record_step(noise=0.01, seed=7)
    fit = dtm.estimate_delay(flight, known)
    low, high = fit.ci()
    _, t = fit.profile("delay", [low, high])
    # Nearly linear in the delay, except that corners of the response at samples bend the profile.
    np.testing.assert_allclose(t, 1.99, rtol=0.1)


def test_a_window_that_begins_in_motion_uses_the_commands_before_it():
    flight, known = record_step(0.36, 0.9)
    fit = dtm.estimate_delay(flight, known, window=(1.4, 4.0))
    assert (fit.delay, fit.gain) == pytest.approx((0.36, 0.9), abs=1e-9)


# --- refusals -------------------------------------------------------------------------------


@pytest.mark.parametrize(("Kp", "known"), [(1.31, 1.50), (3.0, 2.6)])
@pytest.mark.parametrize("runs", [12, pytest.param(40, marks=NIGHTLY)])
def test_a_continuous_command_is_not_treated_as_held(Kp, known, runs):
    # Treated as held it would shift by half a sample, with errors of 1.50 and 2.6 ms; the bounds
    # are 0.88 and 0.16 ms.
    errors = []
    for seed in range(runs):
        flight, loop = step_recordings.record_step(
            Kp=Kp, noise=0.01, seed=seed, ts=None, dt=0.01, limit=None, noise_in_loop=False
        )
        fit = dtm.estimate_delay(
            flight, loop, method=OutputError(initial_output=0.0), free=("delay",)
        )
        errors.append(1e3 * (fit.delay - 0.36))
    assert np.sqrt(np.mean(np.square(errors))) < 0.8 * known


def test_a_lag_missing_from_the_model_is_detected():
    flight, known = record_step(0.30, lag=0.15, noise=0.002, seed=1)
    fit = dtm.estimate_delay(flight, known)
    assert fit.verdict != "reliable"
    assert "free=('delay', 'gain', 'lag')" in fit.message
    # The delay includes the lag.
    assert fit.delay == pytest.approx(0.45, abs=0.03)


def refused(**change):
    time = np.arange(0.0, 6.0, TS)
    flight, known = record_step(noise=0.001)
    arrays = {"reference": flight.reference, "output": flight.output, "command": flight.command}
    arrays |= {name: value for name, value in change.items() if name in arrays}
    loop = change.get("loop", known)
    recording = dtm.Recording(time, arrays["reference"], arrays["output"], arrays["command"])
    return dtm.estimate_delay(
        recording,
        loop,
        method="output_error",
        free=change.get("free", ("delay", "gain")),
        window=change.get("window"),
    )


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"command": np.full(93, 0.5)}, "command is 0.5 throughout"),
        ({"output": np.full(93, 2.0)}, "output is 2 throughout"),
        ({"window": (0.0, 0.3)}, "at least 8"),
        ({"window": (0.0, 0.55), "free": ("delay", "gain", "lag")}, "too few"),
        ({"free": ("delay", "offset")}, "choose one or more from"),
        ({"free": ()}, "one or more"),
        ({"free": ("gain",)}, "unknown"),
        (
            {
                "loop": dtm.ControlLoop(dtm.FirstOrder(), dtm.P(1.0)),
                "free": ("delay", "gain", "lag"),
            },
            "no lag that could be fitted",
        ),
        (
            {"command": None, "loop": dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.1))},
            "[Ll]og the",
        ),
    ],
)
def test_what_cannot_be_estimated_is_refused_with_the_reason(change, match):
    with pytest.raises((ValueError, dtm.DeadtimeError), match=match):
        refused(**change)


@pytest.mark.parametrize("method", ["output_error", "waveform"])
@pytest.mark.parametrize("free", [("delay",), ("delay", "gain"), ("delay", "gain", "lag")])
def test_noise_alone_is_not_taken_for_a_response(method, free):
    flight, known = record_step(noise=0.001)
    for seed in range(3):
        output = np.random.default_rng(seed).normal(size=len(flight))
        noise = dtm.Recording(flight.time, flight.reference, output, flight.command)
        with pytest.raises(
            dtm.NotIdentifiableError, match=r"no response|does not respond|ends at|told|depend"
        ):
            dtm.estimate_delay(noise, known, method=method, free=free)


def test_an_estimate_without_a_profile_raises():
    flight, known = record_step(noise=0.001, Kp=2.0)
    fit = dtm.estimate_delay(flight, known, method="overshoot")
    with pytest.raises(ValueError, match="output_error"):
        fit.profile()


@pytest.mark.parametrize(
    ("sample_time", "words"),
    [(None, "continuous controller"), (0.02, "cannot be computed from such rows")],
)
def test_a_command_that_rows_do_not_determine_is_not_computed(sample_time, words):
    flight, known = record_step(noise=0.001)
    silent = dtm.Recording(flight.time, flight.reference, flight.output)
    loop = known.replace(sample_time=sample_time)
    with pytest.raises(dtm.NotIdentifiableError, match=words):
        dtm.estimate_delay(silent, loop, method="output_error")


# --- real flights ---------------------------------------------------------------------------


def test_a_real_flight_with_its_command_computed():
    name = "ardrone2_height_step_2_4_0_25.csv"
    flight = dtm.read_recording(flight_path(name), time="t_s", reference="ref_m", output="height_m")
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.4), sample_time=TS, limit=1.0)
    fit = dtm.estimate_delay(flight, loop, method="output_error", window=(13, 25.5))
    assert fit.delay == pytest.approx(0.394, abs=1e-3)
    assert fit.gain == pytest.approx(0.705, abs=1e-3)
    assert fit.verdict != "reliable"
    assert fit.details["command"] == "computed from reference and output"


def test_other_intervals_wait_until_they_are_asked_for():
    loop = dtm.ControlLoop(dtm.Integrator(0.85, lag=0.1), dtm.P(1.6), delay=0.3, sample_time=0.065)
    flight = dtm.Experiment.step(8.0).run(loop, noise=0.005, seed=4)
    found = [
        dtm.estimate_delay(
            flight,
            loop.replace(delay=None),
            method=dtm.estimation.OutputError(intervals=which),
            free=("delay", "gain", "lag"),
        )
        for which in ("all", "sum")
    ]
    whole, total = found
    *_, ends = total._profile.__reduce__()[1]
    assert [found[:2] for found in ends] == [("delay+lag", 0.95)]
    for name in whole.stderr:
        assert total.ci(0.95, name) == pytest.approx(whole.ci(0.95, name), abs=1e-4)
    with pytest.raises(ValueError, match="intervals"):
        dtm.estimation.OutputError(intervals="none")


@pytest.mark.parametrize("kind", [dtm.Integrator, dtm.FirstOrder])
def test_a_subclass_of_a_plant_is_fitted_like_it(kind):
    class Own(kind):
        pass

    lag = "lag" if kind is dtm.Integrator else "time_constant"
    found = []
    for plant in (kind, Own):
        loop = dtm.ControlLoop(plant(1.0, **{lag: 0.3}), dtm.P(0.7), delay=0.25, sample_time=0.065)
        time = np.arange(300) * 0.065
        reference = np.where((time > 2.0) & (time < 10.0), 1.0, 0.0)
        run = loop.simulate(time, reference, reference_time=time)
        for output in (run.outputs, np.round(run.outputs, 2)):
            recording = dtm.Recording(time, reference, output, run.inputs)
            fit = dtm.estimate_delay(
                recording, loop.replace(delay=None), free=("delay", "gain", lag)
            )
            found.append((fit.verdict, [fit.ci(0.95, name) for name in fit.free]))
    assert found[:2] == found[2:]
