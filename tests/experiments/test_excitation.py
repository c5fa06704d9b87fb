"""Experiments: their spectra and levels, and that a run is the simulated loop."""

import copy
import pickle

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, strategies as st

TS = 0.065


def held_loop(controller, delay=0.36, **fields):
    return dtm.ControlLoop(
        dtm.Integrator(0.9), controller, delay=delay, sample_time=TS, **({"limit": 1.0} | fields)
    )


# --- references -----------------------------------------------------------------------------


def test_a_step_begins_at_the_first_sample_or_after_its_rest():
    at_once = dtm.Experiment.step(duration=5.0)
    assert len(at_once) == 77
    assert (at_once.reference == 1.0).all()
    later = dtm.Experiment.step(duration=5.0, rest=1.3)
    assert later.time[np.argmax(later.reference > 0)] == pytest.approx(1.3)


def test_a_hold_that_is_not_a_multiple_of_the_sample_time_ends_at_the_next_sample():
    wave = dtm.Experiment.square(2.0, 1.0, hold=0.2)
    changes = wave.time[1:][np.diff(wave.reference) != 0]
    np.testing.assert_allclose(changes, np.ceil(0.2 * np.arange(1, 10) / TS) * TS)
    assert wave.period is None
    assert dtm.Experiment.square(2.0, 1.0, hold=0.13).period == pytest.approx(0.26)


@pytest.mark.parametrize("hold", [TS, 2 * TS, 0.4])
def test_a_prbs_holds_its_value_and_has_both_levels(hold):
    wave = dtm.Experiment.prbs(20.0, 0.4, hold, seed=5)
    assert set(wave.reference) == {-0.4, 0.4}
    changes = wave.time[1:][np.diff(wave.reference) != 0]
    assert np.diff(changes).min() >= hold - TS
    other = dtm.Experiment.prbs(20.0, 0.4, hold, seed=6)
    assert (wave.reference != other.reference).any()


def test_a_whole_period_of_a_prbs_is_nearly_white():
    bits = 6
    wave = dtm.Experiment.prbs((2**bits - 1) * TS, 1.0, TS)
    power = np.abs(np.fft.rfft(wave.reference)) ** 2
    # One level occurs once more than the other, and all harmonics are equal: the circular
    # autocorrelation of a maximum-length sequence is -1 at all shifts but 0.
    np.testing.assert_allclose(power, [1.0] + [2.0**bits] * (power.size - 1), rtol=1e-9)
    assert wave.period == pytest.approx((2**bits - 1) * TS)


@given(
    lines=st.sets(st.integers(1, 39), min_size=1),
    phases=st.sampled_from(["random", "schroeder"]),
    periods=st.integers(1, 3),
)
def test_a_multisine_has_the_given_lines(lines, phases, periods):
    wave = dtm.Experiment.multisine(0.4, 80 * TS, sorted(lines), periods, phases=phases)
    assert len(wave) == 80 * periods
    size = np.abs(np.fft.rfft(wave.reference[-80:]))
    present = size > 1e-6 * size.max()
    assert set(np.flatnonzero(present)) == lines
    np.testing.assert_allclose(size[present], size[present][0])
    assert np.abs(wave.reference).max() == pytest.approx(0.4)


def test_a_number_of_lines_means_all_lines_up_to_it():
    few = dtm.Experiment.multisine(1.0, 80 * TS, np.int64(3))
    np.testing.assert_array_equal(
        few.reference, dtm.Experiment.multisine(1.0, 80 * TS, [1, 2, 3]).reference
    )


def test_a_multisine_can_have_odd_lines_only_and_low_peaks():
    odd = dtm.Experiment.multisine(1.0, 80 * TS, 10, odd=True)
    size = np.abs(np.fft.rfft(odd.reference))
    assert set(np.flatnonzero(size > 1e-9)) == {1, 3, 5, 7, 9}

    def crest(**choice):
        wave = dtm.Experiment.multisine(1.0, 80 * TS, 20, **choice).reference
        return 1.0 / np.sqrt(np.mean(wave**2))

    random = np.mean([crest(seed=seed) for seed in range(20)])
    assert crest(phases="schroeder") < 0.85 * random


# --- running ---------------------------------------------------------------------------------


def test_the_logged_command_is_that_of_the_controller():
    recording = dtm.Experiment.prbs(10.0, 0.4, 0.4).run(held_loop(dtm.P(2.0)), noise=0.02, seed=4)
    made = np.clip(2.0 * (recording.reference - recording.output), -1.0, 1.0)
    np.testing.assert_allclose(recording.command, made, atol=1e-12)


def by_hand(controller, experiment, error, delay_samples, gain=0.9, limit=1.0):
    """A sampled loop of an integrator in plain recursions, its filter sampled."""
    smooth = controller.filter
    omega, damping = smooth.omega, smooth.damping
    y, seen, commands, outputs = 0.0, 0.0, [], []
    filtered = np.zeros(2)
    # Backward Euler of x' = A x + b v with d = x[1] omega, implicit in both.
    A = np.array([[0.0, omega], [-omega, -2 * damping * omega]])
    implicit = np.linalg.inv(np.eye(2) - TS * A)
    for k, reference in enumerate(experiment.reference):
        seen = y + error[k]
        filtered = implicit @ (filtered + TS * np.array([0.0, omega]) * seen)
        u = controller.Kp * (reference - seen) - controller.Kv * omega * filtered[1]
        commands.append(float(np.clip(u, -limit, limit)))
        outputs.append(seen)
        late = commands[k - delay_samples] if k >= delay_samples else 0.0
        y += gain * TS * late
    return np.array(outputs), np.array(commands)


def test_noise_in_the_loop_passes_the_filter_of_a_pv_controller():
    smooth = dtm.DerivativeFilter(12.0, 0.8, discretisation="backward")
    controller = dtm.PV(1.5, 0.2, smooth)
    experiment = dtm.Experiment.square(5.0, 0.3, 0.8)
    error = np.random.default_rng(7).normal(0.0, 0.03, len(experiment))
    outputs, commands = by_hand(controller, experiment, error, delay_samples=4)
    recording = experiment.run(held_loop(controller, 4 * TS), noise=0.03, seed=7)
    np.testing.assert_allclose(recording.output, outputs, atol=1e-12)
    np.testing.assert_allclose(recording.command, commands, atol=1e-11)


def test_a_continuous_filter_receives_held_noise():
    # A filter so fast that it differentiates over one sample does not give the difference quotient
    # at the samples: the held value is that of a fine simulation of the filter.
    smooth = dtm.DerivativeFilter(20.0, 1.0)
    loop = held_loop(dtm.PV(1.5, 0.2, smooth), limit=None)
    quiet = dtm.Experiment.step(3.0)
    recording = quiet.run(loop, noise=0.03, seed=2)
    error = np.random.default_rng(2).normal(0.0, 0.03, len(quiet))
    # The same loop with PD, which takes held noise as its reference.
    both = loop.replace(controller=dtm.PD(1.5, 0.2, smooth)).simulate(
        quiet.time, -error, reference_time=quiet.time, reference_before=0.0, initial_output=0.0
    )
    alone = quiet.run(loop)
    np.testing.assert_allclose(recording.output - error - alone.output, both.outputs, atol=1e-12)


@pytest.mark.parametrize(
    "controller",
    [dtm.P(2.0), dtm.PI(1.2, 0.3), dtm.PD(1.5, 0.1, dtm.DerivativeFilter(20.0))],
)
def test_noise_outside_the_loop_does_not_change_the_loop(controller):
    loop, experiment = held_loop(controller), dtm.Experiment.step(5.0)
    clean = experiment.run(loop)
    logged = experiment.run(loop, noise=0.01, seed=1, noise_in_loop=False)
    np.testing.assert_array_equal(clean.command, logged.command)
    error = np.random.default_rng(1).normal(0.0, 0.01, len(experiment))
    np.testing.assert_allclose(logged.output - clean.output, error, atol=1e-15)
    assert (experiment.run(loop, noise=0.01, seed=1).command != clean.command).any()


def test_a_relay_gives_the_limit_cycle_of_theory():
    delay, size = 0.36, 0.5
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(3.0), delay=delay, limit=2.0)
    recording = dtm.Experiment.relay(20.0, size, sample_time=0.005, reference=1.0).run(loop)
    assert set(np.abs(recording.command)) == {size}
    rises = recording.time[1:][(recording.command[1:] > 0) & (recording.command[:-1] < 0)]
    np.testing.assert_allclose(np.diff(rises[1:]), 4 * delay, atol=0.006)
    late = recording.output[recording.time > 5.0]
    assert (late.max() - late.min()) / 2 == pytest.approx(size * delay, rel=0.02)


def test_a_relay_in_a_sampled_loop_switches_at_samples_only():
    recording = dtm.Experiment.relay(10.0, 0.5).run(held_loop(dtm.P(1.0), delay=0.36, limit=1.0))
    np.testing.assert_array_equal(
        recording.command, np.where(recording.reference - recording.output >= -1e-9, 0.5, -0.5)
    )


def test_the_recording_is_the_same_wherever_the_delay_is():
    loop = held_loop(dtm.P(2.0))
    other = loop.replace(delay_path="measurement")
    experiment = dtm.Experiment.prbs(5.0, 0.4, 0.4)
    one, two = experiment.run(loop, 0.01, seed=3), experiment.run(other, 0.01, seed=3)
    np.testing.assert_array_equal(one.output, two.output)
    np.testing.assert_array_equal(one.command, two.command)


def test_copies_are_equal_and_read_only():
    experiment = dtm.Experiment.multisine(0.4, 80 * TS, 12, 2)
    for again in (copy.deepcopy(experiment), pickle.loads(pickle.dumps(experiment))):
        np.testing.assert_array_equal(again.reference, experiment.reference)
        assert (again.name, again.period) == (experiment.name, experiment.period)
        with pytest.raises(ValueError, match="read-only"):
            again.time[0] = 1.0


# --- refusals --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: dtm.Experiment([0, 1, 2], [0, 1, 1]), "at least 8"),
        (lambda: dtm.Experiment(range(9), range(8)), "one value for each time"),
        (lambda: dtm.Experiment(range(9), [np.nan] * 9), "finite"),
        (lambda: dtm.Experiment([0] * 9, [0] * 9), "increasing"),
        (lambda: dtm.Experiment(range(9), [0] * 9, period=-1.0), "period"),
        (lambda: dtm.Experiment.step(0.3), "8 samples"),
        (lambda: dtm.Experiment.step(1e12), "seconds"),
        (lambda: dtm.Experiment.multisine(1.0, 5.2, 2.5), "whole number"),
        (lambda: dtm.Experiment.step(5.0, rest=9.0), "after the end"),
        (lambda: dtm.Experiment.step(5.0, sample_time=0.0), "sample_time"),
        (lambda: dtm.Experiment.square(5.0, 1.0, hold=0.01), "shorter than a sample"),
        (lambda: dtm.Experiment.prbs(5.0, np.inf, hold=0.4), "amplitude"),
        (lambda: dtm.Experiment.multisine(1.0, 5.0, 10), "4.94|5.005"),
        (lambda: dtm.Experiment.multisine(1.0, 5.2, 40), "1 to 39"),
        (lambda: dtm.Experiment.multisine(1.0, 5.2, [2, 4], odd=True), "odd"),
        (lambda: dtm.Experiment.multisine(1.0, 5.2, [1.5]), "whole numbers"),
        (lambda: dtm.Experiment.multisine(1.0, 5.2, 4, phases="flat"), "schroeder"),
        (lambda: dtm.Experiment.multisine(1.0, 5.2, 4, periods=0), "periods"),
        (lambda: dtm.Experiment.relay(5.0, 0.0), "relay_amplitude"),
    ],
)
def test_invalid_experiments_are_refused(make, match):
    with pytest.raises((ValueError, TypeError), match=match):
        make()


@pytest.mark.parametrize(
    ("experiment", "loop", "options", "match"),
    [
        (
            dtm.Experiment.step(5.0, sample_time=0.05),
            held_loop(dtm.P(1.0)),
            {},
            "sample_time=0.065",
        ),
        (dtm.Experiment.step(), held_loop(dtm.P(1.0)).replace(delay=None), {}, "delay"),
        (dtm.Experiment.relay(5.0, 2.0), held_loop(dtm.P(1.0)), {}, "exceeds the limit"),
        (dtm.Experiment.step(), held_loop(dtm.P(1.0)), {"noise": -1.0}, "noise"),
        (dtm.Experiment.step(), held_loop(dtm.PV(1.0, 0.1)), {"noise": 0.1}, "DerivativeFilter"),
        (
            dtm.Experiment.step(),
            held_loop(dtm.PV(1.0, 0.1, dtm.DerivativeFilter(20.0))).continuous(),
            {"noise": 0.1},
            "sample_time",
        ),
        (
            dtm.Experiment.step(),
            held_loop(dtm.PV(0.0, 0.1, dtm.DerivativeFilter(20.0))),
            {"noise": 0.1},
            "Kp=0",
        ),
    ],
)
def test_experiments_that_cannot_be_run_are_refused_with_the_reason(
    experiment, loop, options, match
):
    with pytest.raises(ValueError, match=match):
        experiment.run(loop, **options)
