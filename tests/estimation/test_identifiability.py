"""The Cramér-Rao bound of a planned experiment: closed forms, and the errors of estimates."""

import copy
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from deadtime._base.digits import stated
from deadtime.estimation import Overshoot
from deadtime.estimation._native import HeldResponse
from deadtime.estimation.planning._planned_bound import from_the_command, from_the_reference
from hypothesis import given, settings, strategies as st
from loops import TS, held_loop

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))


# --- sensitivities --------------------------------------------------------------------------


@settings(max_examples=25)
@given(
    delay=st.floats(0.0, 0.6),
    lag=st.one_of(st.just(0.0), st.floats(0.01, 0.5)),
    gain=st.floats(0.3, 2.0),
    seed=st.integers(0, 1000),
)
def test_sensitivities_of_the_plant_are_those_of_the_held_response(delay, lag, gain, seed):
    loop = held_loop(1.0, delay, lag, gain)
    recording = dtm.Experiment.prbs(5.0, 0.4, 0.4, seed=seed).run(loop)
    found = from_the_command(loop, recording, ("delay", "gain", "lag"), offset=True)
    truth = HeldResponse(recording.time, recording.command).at(
        recording.time - delay - 1e-9 * TS, lag
    )
    np.testing.assert_allclose(found["delay"], -gain * truth.rate, atol=1e-7)
    np.testing.assert_allclose(found["gain"], truth.value, atol=1e-8)
    np.testing.assert_allclose(found["lag"], gain * truth.by_lag, atol=1e-7)
    assert (found["initial output"] == 1.0).all()


def test_sensitivities_of_any_plant_are_difference_quotients():
    plant = dtm.FirstOrder(1.4, time_constant=0.7)
    loop = dtm.ControlLoop(plant, dtm.P(1.2), delay=0.2, sample_time=0.05)
    experiment = dtm.Experiment.square(6.0, 1.0, 1.1, sample_time=0.05)
    recording = experiment.run(loop)
    found = from_the_command(loop, recording, ("delay", "gain", "time_constant"), offset=False)

    def answer(delay=0.2, gain=1.4, time_constant=0.7):
        system = dtm.FirstOrder(gain, time_constant).transfer_function() * dtm.delay(delay)
        return system.simulate(recording.time, recording.command, input_time=recording.time).outputs

    step = 1e-6
    # The delay is a whole number of samples, so only an increase has a derivative.
    slope = (answer(delay=0.2 + step) - answer(delay=0.2)) / step
    np.testing.assert_allclose(found["delay"], slope, atol=1e-5)
    for name in ("gain", "time_constant"):
        value = loop.parameters[name]
        slope = (answer(**{name: value + step}) - answer(**{name: value - step})) / (2 * step)
        np.testing.assert_allclose(found[name], slope, atol=1e-8)


def test_sensitivities_of_the_loop_are_difference_quotients_also_by_the_start():
    loop, experiment = held_loop(lag=0.1), dtm.Experiment.square(5.0, 0.6, 0.9)
    found = from_the_reference(loop, experiment, ("delay", "gain", "lag"), True, noise=0.01)

    def output(start=0.0, **numbers):
        return (
            loop.replace(**numbers)
            .simulate(
                experiment.time,
                experiment.reference,
                reference_time=experiment.time,
                initial_output=start,
            )
            .outputs
        )

    step = 1e-6
    for name in ("delay", "gain", "lag"):
        value = loop.parameters[name]
        high, low = output(**{name: value + step}), output(**{name: value - step})
        np.testing.assert_allclose(found[name], (high - low) / (2 * step), atol=1e-4)
    slope = (output(step) - output(-step)) / (2 * step)
    np.testing.assert_allclose(found["initial output"], slope, atol=1e-6)
    assert found["initial output"][0] == pytest.approx(1.0)


# --- bounds ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("noise", "alone", "with_gain_and_offset"),
    [(0.003, 0.81e-3, 1.07e-3), (0.01, 2.70e-3, 3.58e-3), (0.03, 8.10e-3, 10.7e-3)],
)
def test_the_bounds_of_a_step_are_those_of_the_closed_form(noise, alone, with_gain_and_offset):
    loop, step = held_loop(), dtm.Experiment.step(5.0)
    known = dtm.identifiability(loop, step, noise=noise, free=("delay",), initial_output=0.0)
    assert known.stderr["delay"] == pytest.approx(alone, rel=0.006)
    # The closed form: sigma over the root of the sum of the squares of the command that arrives.
    arriving = HeldResponse(known.recording.time, known.recording.command).at(
        known.recording.time - 0.36 - 1e-9
    )
    assert known.stderr["delay"] == pytest.approx(
        noise / np.sqrt(np.sum(arriving.rate**2)), rel=1e-6
    )
    fitted = dtm.identifiability(loop, step, noise=noise, free=("delay", "gain"))
    assert fitted.stderr["delay"] == pytest.approx(with_gain_and_offset, rel=0.006)
    assert fitted.bound.free == ("delay", "gain", "initial output")


@pytest.mark.parametrize(
    ("loop", "noise", "expected"),
    [
        (held_loop(limit=None, sample_time=None), 0.01, 0.88),
        (held_loop(3.0, limit=None, sample_time=None), 0.01, 0.16),
        (held_loop(sample_time=None), 0.003, 0.77),
        (held_loop(3.0), 0.01, 2.09),
        (held_loop(3.0, limit=None), 0.01, 0.94),
        (held_loop(0.8), 0.01, 3.44),
        (held_loop(4.0, 0.05, sample_time=0.01), 0.01, 1.05),
        (held_loop(delay=0.30, lag=0.06), 0.01, 2.76),
    ],
)
def test_the_bounds_of_other_loops_are_the_published_ones(loop, noise, expected):
    # The continuous loops without a limit are logged every 10 ms.
    between = loop.sample_time or (0.01 if loop.limit is None else TS)
    step = dtm.Experiment.step(5.0, sample_time=between)
    plan = dtm.identifiability(loop, step, noise=noise, free=("delay",), initial_output=0.0)
    assert 1e3 * plan.stderr["delay"] == pytest.approx(expected, abs=0.006)


def over_sequences(duration):
    return [dtm.Experiment.prbs(duration, 0.4, 0.4, seed=seed) for seed in range(8)]


@pytest.mark.parametrize(
    ("experiments", "Kp", "expected", "tolerance"),
    [
        ([dtm.Experiment.step(5.0)], 1.31, (2.66, 18.3, 2.81), 0.005),
        # One sample more or less in the record changes the bound by 0.7 %.
        ([dtm.Experiment.relay(5.0, 0.5)], 1.31, (2.61, 13.2, 2.87), 0.01),
        ([dtm.Experiment.square(20.0, 0.25, 0.8)], 3.0, (0.65, 3.8, 0.72), 0.02),
        # A binary sequence is one of many: the mean over eight of them, whose bounds scatter by
        # 5 to 13 % in 5 s and 2 to 4 % in 20 s, against one that is not known.
        (over_sequences(5.0), 1.31, (1.86, 9.2, 1.99), 0.15),
        (over_sequences(20.0), 1.31, (1.04, 4.0, 1.09), 0.08),
        (over_sequences(20.0), 3.0, (0.72, 3.1, 0.75), 0.08),
    ],
)
def test_designs_have_the_published_bounds(experiments, Kp, expected, tolerance):
    loop = held_loop(Kp, lag=0.06)
    found = []
    for experiment in experiments:
        options = {"noise": 0.01, "initial_output": 0.0}
        alone = dtm.identifiability(loop, experiment, free=("delay",), **options).stderr["delay"]
        free = dtm.identifiability(loop, experiment, **options).stderr
        found.append([alone, free["delay"], free["delay+lag"]])
    mean = 1e3 * np.mean(found, axis=0)
    # Half of the last printed digit is not an error.
    np.testing.assert_allclose(
        mean, expected, rtol=tolerance, atol=0.05 if max(expected) > 3 else 0
    )


def test_a_longer_step_gives_no_more_information():
    short, long = (
        dtm.identifiability(
            held_loop(lag=0.06),
            dtm.Experiment.step(duration),
            noise=0.01,
            free=("delay",),
            initial_output=0.0,
        ).stderr["delay"]
        for duration in (5.0, 20.0)
    )
    assert short == pytest.approx(long, rel=1e-4)


def test_the_sum_of_delay_and_lag_is_known_where_the_parts_are_not():
    plan = dtm.identifiability(held_loop(lag=0.06), dtm.Experiment.step(), noise=0.01)
    assert plan.correlation < -0.98
    assert plan.stderr["delay"] > 5 * plan.stderr["delay+lag"]
    # The error of the sum follows from those of its parts and their correlation.
    of = plan.stderr
    sum_of_squares = of["delay"] ** 2 + of["lag"] ** 2
    mixed = 2 * plan.correlation * of["delay"] * of["lag"]
    assert of["delay+lag"] == pytest.approx(np.sqrt(sum_of_squares + mixed))


def test_the_mean_information_of_noisy_runs_is_near_that_of_the_noise_free_run():
    for experiment, change in (
        (dtm.Experiment.step(), 0.02),
        (dtm.Experiment.relay(5.0, 0.5), 0.2),
    ):
        quiet, noisy = (
            dtm.identifiability(
                held_loop(lag=0.06), experiment, noise=0.01, initial_output=0.0, runs=runs
            ).stderr["delay"]
            for runs in (0, 20)
        )
        assert quiet == pytest.approx(noisy, rel=change)
        assert quiet != noisy


def test_a_continuous_loop_has_the_bound_of_its_reference_alone():
    loop = held_loop(lag=0.06).continuous()
    experiment = dtm.Experiment.step(5.0, sample_time=0.01)
    plan = dtm.identifiability(loop, experiment, noise=0.01)
    assert plan.command_logged is None
    assert plan.bound is plan.reference_only
    assert "continuous" in plan.summary()


def test_a_sampled_filter_has_only_the_bound_with_the_command():
    smooth = dtm.DerivativeFilter(20.0, discretisation="tustin")
    loop = held_loop(lag=0.06).replace(controller=dtm.PV(1.3, 0.1, smooth))
    plan = dtm.identifiability(loop, dtm.Experiment.step(), noise=0.01)
    assert plan.reference_only is None
    assert "samples" in plan.remarks[0]
    assert plan.stderr["delay"] > 0.0


def test_a_plan_has_a_summary_and_plots():
    plan = dtm.identifiability(held_loop(lag=0.06), dtm.Experiment.step(), noise=0.01)
    text = plan.summary()
    for part in ("step of 1", "command logged", "reference only", "delay+lag ", "-0.9"):
        assert part in text
    # The assumed value to the digits that the least standard error leaves.
    whole = stated(plan.loop.delay + 0.06, plan.stderr["delay+lag"], "s")
    assert whole in text
    assert whole in repr(plan)
    assert len(plan.plot()) == 3
    alone = dtm.identifiability(held_loop(), dtm.Experiment.step(), noise=0.01, free=("delay",))
    axes = alone.plot()
    assert len(axes) == 2
    assert alone.plot(axes) == axes
    with pytest.raises(ValueError, match="give 2"):
        alone.plot(axes[1:])
    with pytest.raises(ValueError, match="is not free"):
        plan.bound.correlation("delay", "offset")
    again = copy.deepcopy(plan.bound)
    with pytest.raises(ValueError, match="read-only"):
        again.cov[0, 0] = 1.0


# --- estimates agree with the plan ----------------------------------------------------------


def test_estimates_scatter_as_the_bound_says_for_any_number_of_processes():
    plan = dtm.identifiability(
        held_loop(), dtm.Experiment.step(), noise=0.01, free=("delay",), initial_output=0.0
    )
    seen = []
    here = plan.monte_carlo(40, processes=1, seed=3, progress=seen.append)
    # 40 runs: the root mean square is known to 11 %.
    assert here.rmse["delay"] == pytest.approx(plan.stderr["delay"], rel=0.25)
    assert here.mean_bound["delay"] == pytest.approx(plan.stderr["delay"], rel=0.05)
    assert here.coverage["delay"] >= 0.88
    assert abs(here.bias["delay"]) < 4 * plan.stderr["delay"] / np.sqrt(40)
    assert seen[-1] == 40
    assert "coverage" in here.summary()
    # The error of the root mean square of 40 runs is 11.2 % of it.
    assert stated(here.rmse["delay"], 0.1118 * here.rmse["delay"], "s") in here.summary()
    assert "rmse" in repr(here)
    shared = plan.monte_carlo(6, processes=2, seed=3)
    np.testing.assert_array_equal(here.estimates["delay"][:6], shared.estimates["delay"])
    assert (
        plan.monte_carlo(1, processes=1, seed=4).estimates["delay"][0] != here.estimates["delay"][0]
    )


def test_the_gain_alone_is_estimated_with_the_true_delay():
    plan = dtm.identifiability(
        held_loop(), dtm.Experiment.step(), noise=0.01, free=("gain",), initial_output=0.0
    )
    assert plan.correlation is None
    tried = plan.monte_carlo(60, progress=True)
    # An estimator that does not know that there is no air cannot reach the bound of white noise.
    assert 0.7 * plan.stderr["gain"] < tried.rmse["gain"] < 4.0 * plan.stderr["gain"]
    assert set(tried.rmse) == {"gain"}


@pytest.mark.parametrize("lag", [0.0, 0.06])
def test_coverage_counts_the_intervals_that_contain_the_true_value(lag):
    loop, level = held_loop(lag=lag), 0.5
    free = ("delay", "gain", "lag") if lag else ("delay", "gain")
    plan = dtm.identifiability(loop, dtm.Experiment.prbs(8.0, 0.4, 0.2), noise=0.01, free=free)
    tried = plan.monte_carlo(12, level=level, seed=5)
    held = dict.fromkeys(tried.coverage, 0)
    for i in range(12):
        seed = np.random.SeedSequence(5, spawn_key=(i,))
        recording = plan.experiment.run(loop, 0.01, seed)
        fit = dtm.estimate_delay(recording, loop.replace(delay=None), free=free)
        for name in held:
            low, high = fit.ci(level, name)
            held[name] += low <= tried.truth[name] <= high
    assert {name: count / 12 for name, count in held.items()} == tried.coverage
    assert 0 < sum(held.values()) < 12 * len(held)


def test_other_methods_are_tried_by_name():
    plan = dtm.identifiability(
        held_loop(lag=0.06), dtm.Experiment.step(rest=1.04), noise=0.01, free=("delay", "gain")
    )
    tried = plan.monte_carlo(6, "waveform", known=held_loop().replace(delay=None))
    # The model without a lag attributes it to the delay.
    assert tried.bias["delay"] == pytest.approx(0.06, abs=0.02)
    assert tried.bias["delay+lag"] == pytest.approx(0.0, abs=0.02)


def test_refusals_are_counted_by_their_reason():
    # Next to Kp Td = 1/e the overshoot is of the size of the noise: about half show one.
    loop = held_loop(Kp=0.95)
    step = dtm.Experiment.step(12.0, rest=1.0)
    plan = dtm.identifiability(loop, step, noise=1e-3, free=("delay",))
    tried = plan.monte_carlo(40, Overshoot(map="dominant"), noise_in_loop=False)
    refused = sum(tried.failures.values())
    assert 0 < refused < 40
    assert refused + tried.estimates["delay"].size == 40
    assert tried.mean_bound == tried.coverage == {}
    assert f"{refused} were refused" in tried.summary()


def test_a_method_that_always_refuses_reports_why():
    loop = held_loop(Kp=0.5)
    step = dtm.Experiment.step(12.0, rest=1.0)
    plan = dtm.identifiability(loop, step, noise=1e-5, free=("delay",))
    with pytest.raises(dtm.NotIdentifiableError, match=r"all 10 runs.*overshoot"):
        plan.monte_carlo(10, "overshoot")


INTERRUPTED = """
import deadtime as dtm

if __name__ == "__main__":
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0)
    plan = dtm.identifiability(loop, dtm.Experiment.step(), noise=0.01, free=("delay",))
    try:
        plan.monte_carlo(50_000, processes=2, progress=lambda done: print(done, flush=True))
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""


@pytest.mark.usefixtures("listens_to_ctrl_c")
@pytest.mark.skipif(os.name == "nt", reason="signals to a group of processes are of POSIX")
def test_an_interrupt_ends_all_processes_cleanly(tmp_path):
    script = tmp_path / "long.py"
    script.write_text(INTERRUPTED)
    run = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert run.stdout.readline()  # The processes are running.
    # A terminal sends the signal to all of them.
    os.killpg(run.pid, signal.SIGINT)
    begin = time.monotonic()
    output, errors = run.communicate(timeout=60)
    assert output.splitlines()[-1] == "interrupted", errors
    assert "Traceback" not in errors
    assert time.monotonic() - begin < 60


def test_a_script_without_a_main_guard_gets_an_error_with_advice(tmp_path):
    script = tmp_path / "unguarded.py"
    plain = INTERRUPTED.replace('if __name__ == "__main__":', "if True:").replace("50_000", "200")
    script.write_text(plain)
    run = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=60
    )
    assert run.returncode != 0
    # Python itself may add that the processes it ended left semaphores behind.
    last = [line for line in run.stderr.splitlines() if "resource_tracker" not in line][-1]
    assert "processes=1" in last


def test_the_parameters_of_the_loop_are_free_by_default():
    experiment = dtm.Experiment.step()
    plain = dtm.identifiability(held_loop(), experiment, noise=0.01)
    assert plain.free == ("delay", "gain")
    lagging = dtm.identifiability(held_loop(lag=0.1), experiment, noise=0.01)
    assert lagging.free == ("delay", "gain", "lag")


# --- refusals -------------------------------------------------------------------------------


def flat(value=0.0):
    return dtm.Experiment(np.arange(40) * TS, np.full(40, value))


@pytest.mark.parametrize(
    ("loop", "experiment", "options", "match"),
    [
        (held_loop(lag=0.1), flat(), {}, "does not excite"),
        (held_loop(lag=0.1), flat(1e3), {}, "stays at its limit, 1"),
        (
            held_loop(delay=3.0),
            dtm.Experiment.step(2.0, 0.5),
            {"free": ("delay",)},
            "make the experiment longer",
        ),
        (
            held_loop(),
            dtm.Experiment.step(),
            {"free": ("delay", "gain", "lag")},
            "Assume a lag",
        ),
        (
            dtm.ControlLoop(
                dtm.RationalPlant([1.0, 2.0], [1.0, 1.0]), dtm.P(0.5), delay=0.3, sample_time=TS
            ),
            dtm.Experiment.step(),
            {"free": ("delay",)},
            "direct feedthrough",
        ),
    ],
)
def test_what_an_experiment_cannot_identify_is_refused_with_the_reason(
    loop, experiment, options, match
):
    with pytest.raises(dtm.NotIdentifiableError, match=match):
        dtm.identifiability(loop, experiment, noise=0.01, **options)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"noise": 0.0}, "noise"),
        ({"free": ("delay", "offset")}, "choose one or more from"),
        ({"initial_output": 1.0}, "an output of zero"),
        ({"flights": -1}, "flights"),
        ({"loop": held_loop().replace(delay=None), "free": ("delay",)}, "delay"),
        ({"loop": dtm.Integrator()}, "give a ControlLoop"),
        ({"experiment": np.zeros(9)}, "give an Experiment"),
    ],
)
def test_invalid_arguments_are_refused(change, match):
    given = {"loop": held_loop(lag=0.1), "experiment": dtm.Experiment.step(), "noise": 0.01}
    given |= change
    with pytest.raises((ValueError, TypeError), match=match):
        dtm.identifiability(given.pop("loop"), given.pop("experiment"), **given)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"runs": 0}, "runs"),
        ({"level": 1.0}, "level"),
        ({"processes": 0}, "processes"),
        ({"method": "guess"}, "not one of"),
    ],
)
def test_invalid_arguments_of_repeated_runs_are_refused(options, match):
    plan = dtm.identifiability(
        held_loop(), dtm.Experiment.step(), noise=0.01, free=("delay",), initial_output=0.0
    )
    with pytest.raises(ValueError, match=match):
        plan.monte_carlo(**({"runs": 4, "processes": 1} | options))
