"""The generator and the bound of `benches/estimation.py --reality` are right."""

import ast
import math
import sys
from dataclasses import replace
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))

from reality import bound, oracle, table  # noqa: E402
from reality.conditions import CONDITIONS, LIMIT, MAY_REFUSE, SAMPLE, Condition  # noqa: E402
from reality.generator import air_response, ramp, record  # noqa: E402

NOISELESS = Condition("noise-free", white=0.0)
NAMED = {condition.name: condition for condition in CONDITIONS}


def test_names_differ_because_they_are_seeds():
    assert len(NAMED) == len(CONDITIONS)


def test_the_generator_does_not_use_the_package():
    for name in ("generator", "conditions", "bound", "oracle"):
        tree = ast.parse((BENCHES / "reality" / f"{name}.py").read_text(encoding="utf-8"))
        used = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        used += [one.name for n in ast.walk(tree) if isinstance(n, ast.Import) for one in n.names]
        assert not any(module.startswith("deadtime") for module in used)


@pytest.mark.parametrize(
    "condition",
    [
        NOISELESS,
        replace(NOISELESS, lag=True),
        replace(NOISELESS, lag=True, second_lag=0.03),
        replace(NOISELESS, rows=40, rest=(8, 8)),
    ],
)
def test_without_noise_the_run_is_that_of_the_exact_simulation(condition):
    saturated = 0
    for number in range(8):
        run = record(condition, number)
        vehicle = run.vehicle
        denominator = np.array([1.0, 0.0])
        for lag in vehicle.lags:
            denominator = np.polymul(denominator, [lag, 1.0])
        loop = dtm.ControlLoop(
            dtm.RationalPlant([vehicle.gain], denominator),
            dtm.P(vehicle.Kp),
            delay=vehicle.delay,
            sample_time=SAMPLE,
            limit=LIMIT,
        )
        exact = loop.simulate(run.times, run.reference, reference_time=run.times)
        np.testing.assert_allclose(run.path, exact.outputs, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(run.measured, run.path)
        saturated += np.max(np.abs(run.command)) == LIMIT
        assert loop.is_stable()
        assert len(vehicle.lags) == condition.lag + (condition.second_lag > 0)
    assert saturated > 0


@pytest.mark.parametrize("gust", [None, (0.1, 0.3)])
@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_the_air_has_the_covariance_of_the_bound(gust, lag):
    condition = Condition("air", air=0.0 if gust else 0.05, gust=gust)
    times = SAMPLE * np.arange(0, 60, 3)
    random = np.random.default_rng(1)
    drawn = np.array([air_response(condition, lag, times, random) for _ in range(2500)])[:, 1:]
    claimed = bound.air_covariance(condition, lag, times)[1:, 1:]
    for D in (np.eye(19), np.diff(np.eye(19), axis=0)):  # positions, then movements between rows
        expected = D @ claimed @ D.T
        found = D @ (drawn.T @ drawn / len(drawn)) @ D.T
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        # An element is known to sqrt(2 / 2500) = 0.028.
        np.testing.assert_allclose(found / scale, expected / scale, atol=0.12)


def test_the_covariance_of_the_air_is_that_of_the_closed_forms():
    times = SAMPLE * np.arange(30)
    first, last = np.minimum.outer(times, times), np.maximum.outer(times, times)
    walk = bound.air_covariance(Condition("", air=0.05), 0.0, times)
    np.testing.assert_allclose(walk, 0.05**2 * (first**2 * last / 2 - first**3 / 6), atol=1e-14)
    sd, T = 0.1, 0.3
    gust = bound.air_covariance(Condition("", gust=(sd, T)), 0.0, times)
    exact = 2 * sd**2 * T * (times - T * (1 - np.exp(-times / T)))
    np.testing.assert_allclose(np.diag(gust), exact, atol=1e-14)


def test_a_run_depends_on_its_number_alone():
    for condition in CONDITIONS:
        one, same, other = record(condition, 3), record(condition, 3), record(condition, 4)
        np.testing.assert_array_equal(one.measured, same.measured)
        np.testing.assert_array_equal(one.logged, same.logged)
        assert one.vehicle == same.vehicle
        assert one.vehicle != other.vehicle
    errors = [one.errors for one in estimated("white", range(3))]
    assert errors[2:] == [one.errors for one in estimated("white", range(2, 3))]


def estimated(name, numbers):
    return table.outcomes(NAMED[name], numbers, NAMED[name].free)


def runs(name, count=40):
    return [record(NAMED[name], number) for number in range(count)]


def test_rows_are_lost_as_the_conditions_say():
    for share, name in ((0.05, "rows lost 5 %"), (0.2, "rows lost 20 %")):
        lost = np.mean([~run.logged for run in runs(name)])
        assert abs(lost - share) < 4 * math.sqrt(share * (1 - share) / 4800)
    for run in runs("half rate", 3):
        np.testing.assert_array_equal(np.flatnonzero(run.logged), np.arange(0, 120, 2))
        assert len(table.recording_of(NAMED["half rate"], run)) == 60
    for run in runs("hole of 1 s", 5):
        times = table.recording_of(NAMED["hole of 1 s"], run).time
        begin = times[np.argmax(np.diff(times))]
        assert 1.0 <= np.max(np.diff(times)) <= 1.0 + 2 * SAMPLE
        assert 0.0 < begin - run.times[np.argmax(run.reference != 0)] < 0.6


def test_clocks_are_as_the_conditions_say():
    nominal = SAMPLE * np.arange(120)
    np.testing.assert_allclose(runs("clock off 1 %", 1)[0].stamps, 1.01 * nominal)
    hidden, shown = runs("jitter 20 ms nominal", 1)[0], runs("jitter 20 ms logged", 1)[0]
    np.testing.assert_array_equal(hidden.stamps, nominal)
    np.testing.assert_array_equal(shown.stamps, shown.times)
    for run in (hidden, shown):
        assert 0.06 < np.ptp(np.diff(run.times)) < 0.08
    stamps = runs("stamps jitter 10 ms", 1)[0]
    np.testing.assert_array_equal(stamps.times, nominal)
    assert 0.009 < np.max(np.abs(stamps.stamps - nominal)) < 0.01


def test_delays_change_as_the_conditions_say():
    for run in runs("delay ramps 100 ms", 5):
        delays = run.arrivals - run.times
        np.testing.assert_allclose(np.diff(delays), 0.1 / 119)
        assert delays[0] < run.vehicle.delay < delays[-1]
    wandered = np.array([run.arrivals - run.times for run in runs("delay wanders 30 ms", 200)])
    wandered -= wandered.mean(axis=1, keepdims=True)
    # Over 7.8 s, the mean of a run takes a part of the variance of 30 ms with it.
    assert 0.022 < wandered.std() < 0.03


def test_a_vehicle_without_commands_moves_with_the_air_alone():
    still = record(replace(NAMED["white"], commands_lost=1.0, trim=-0.05), 0)
    np.testing.assert_allclose(still.path, -0.05 * still.times, atol=1e-15)
    assert np.max(np.abs(still.command)) > 0.3


def test_sensors_are_as_the_conditions_say():
    run = runs("quantised 1 cm", 1)[0]
    np.testing.assert_allclose(run.measured, 0.01 * np.round(100 * run.measured), atol=1e-12)
    assert abs(np.mean([one.outlying for one in runs("outliers 3 %")]) - 0.03) < 0.01
    for one in runs("outliers 3 %", 3):
        errors = np.abs(one.measured - one.path)
        assert np.all((errors > 0.04) == one.outlying)
    noise = np.array([run.measured - run.path for run in runs("sensor AR 0.9", 200)])
    assert abs(np.var(noise) / (0.005**2 + 0.002**2) - 1) < 0.1
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1]) / (0.9 * 0.005**2) - 1) < 0.12


def test_the_bound_of_white_noise_is_that_of_the_package():
    for name in ("white", "lag free white", "jitter 20 ms logged", "short"):
        condition = NAMED[name]
        for run in runs(name, 3):
            fit = dtm.estimate_delay(
                table.recording_of(condition, run),
                table.given_loop(condition, run, condition.free),
                method="output_error",
                free=condition.free,
            )
            scale = condition.white / fit.crb.noise.white
            if fit.noise.air or fit.noise.trim or fit.noise.sensor:
                continue  # the bound of another process
            # The package takes the derivatives at the estimate instead of the truth.
            assert bound.bounds(condition, run, condition.free)[0] == pytest.approx(
                scale * fit.crb.stderr["delay"], rel=0.2 if condition.lag else 0.03
            )


def without_noise_of_unlogged_rows(run):
    """The output if the rows that are not logged had no error, and their errors."""
    noise = (run.measured - run.path)[~run.logged]
    return bound.outputs(run, {}, -noise[None, :])[0], noise


@pytest.mark.parametrize("name", ["half rate", "rows lost 20 %"])
def test_the_noise_of_unlogged_rows_moves_the_output_as_the_bound_says(name):
    for run in runs(name, 10):
        without, noise = without_noise_of_unlogged_rows(run)
        np.testing.assert_allclose(
            bound.outputs(run, {}, 0.0 * noise[None, :])[0], run.path, atol=1e-12
        )
        moved = noise @ bound.differences(run, {}, np.eye(noise.size))
        # Not linear in the few rows in which the command comes to its limit.
        assert np.std(run.path - without - moved) < 0.3 * np.std(moved)


#: Conditions whose bound is known, every fourth of them in each run and the others in the survey.
KNOWN = [one for one in CONDITIONS if bound.is_defined(one, one.free) and not one.quantum]


@pytest.mark.parametrize(
    "condition",
    [
        pytest.param(one, id=one.name, marks=[pytest.mark.survey] if number % 4 else [])
        for number, one in enumerate(KNOWN)
    ],
)
def test_what_is_not_the_mean_has_the_covariance_of_the_bound(condition):
    squares, rows = 0.0, 0
    for number in range(8):
        run = record(condition, number)
        _, V = bound.linearised(condition, run, [])
        without, _ = without_noise_of_unlogged_rows(run)
        commanded = bound.response(run.times, run.arrivals, run.command, run.vehicle.lags)
        air = run.path - run.vehicle.gain * commanded - condition.trim * run.times
        error = (run.measured - without + air)[run.logged & ~run.outlying]
        squares += error @ np.linalg.solve(V, error)
        rows += error.size
    assert squares / rows == pytest.approx(1.0, abs=5 * math.sqrt(2 / rows))


def test_the_bound_has_no_value_where_the_log_is_wrong():
    free = ("delay", "gain", "lag")
    run = record(NAMED["lag left out 5 mm"], 0)
    assert math.isnan(bound.bounds(NAMED["lag left out 5 mm"], run, free[:2])[0])
    assert bound.bounds(NAMED["lag left out 5 mm"], run, free)[0] > 0.0
    for name in ("clock off 1 %", "second lag 30 ms", "commands lost 5 %", "delay ramps 100 ms"):
        assert math.isnan(bound.bounds(NAMED[name], record(NAMED[name], 0), free)[0])


def outcome(reliable=True, held=True, error=1e-3, status=table.ANSWERED):
    return table.Outcome(status, reliable, (error,) * 3, (held,) * 3, (1e-3, 1e-3), 1e-2)


def test_demands():
    good = [outcome(held=number >= 5) for number in range(100)]
    row = table.summary(NAMED["white"], good)
    assert row["missed"] == []
    assert row["met"] == ["reliable", "delay", "gain", "sum", "error"]
    assert row["reliable_covers_gain"] == pytest.approx(95.0)
    assert "95     95     95" in table.line(row)

    always = table.summary(NAMED["white"], [outcome(error=1.06e-3)] * 100)
    assert always["missed"] == ["delay", "gain", "sum", "error"]
    assert "error" in table.summary(NAMED["air 0.02"], [outcome(error=1.06e-3)] * 100)["met"]

    few = table.summary(NAMED["white"], [outcome()] * 19 + [outcome(reliable=False)] * 81)
    assert math.isnan(few["reliable_covers_delay"])
    assert few["all_covers_delay"] == pytest.approx(100.0)
    assert few["missed"] == ["reliable", "delay", "gain", "sum"]


def test_a_refusal_counts_where_it_is_allowed():
    refused = [outcome(status=table.NOT_IDENTIFIABLE)] * 60
    refused += [outcome(status=table.BAD_RECORDING)] * 36 + [outcome()] * 4
    row = table.summary(NAMED["clock off 1 %"], refused)
    assert NAMED["clock off 1 %"].demand == MAY_REFUSE
    assert (row["not_identifiable"], row["bad_recording"]) == (60.0, 36.0)
    assert row["met"] == ["refused or not reliable"]
    assert "reliable" in table.summary(NAMED["air 0.02"], refused)["missed"]
    failed = table.summary(NAMED["clock off 1 %"], [outcome(status=table.FAILED)] * 100)
    assert "no failure" in failed["missed"]


def test_rows_and_free_parameters_are_chosen_by_name():
    assert table.chosen([]) == CONDITIONS
    assert table.chosen(["short", "white"]) == [NAMED["short"], NAMED["white"]]
    with pytest.raises(ValueError, match="no row 'tall'"):
        table.chosen(["tall"])
    with pytest.raises(ValueError, match="delay,gain,lag"):
        table.free_of("limit")


@pytest.mark.survey  # as `benches/estimation.py --reality --quick`
def test_every_condition_is_estimated():
    for condition in CONDITIONS:
        (one,) = table.outcomes(condition, range(1), condition.free)
        assert one.status != table.FAILED, one.message


def test_ramp_is_continuous_in_its_lags():
    age = np.linspace(-1.0, 3.0, 9)
    np.testing.assert_allclose(ramp(age, (0.1, 1e-9)), ramp(age, (0.1,)), atol=1e-8)


@pytest.mark.parametrize(
    ("name", "unknown"),
    [
        ("white", False),
        ("hole of 1 s", False),
        ("half rate", False),
        ("quantised 1 cm", False),
        ("trim -0.02", False),
        ("lag free white", False),
        ("sensor AR 0.9", True),
    ],
)
def test_the_oracle_is_near_the_bound(name, unknown):
    found = oracle.oracle_estimate(NAMED[name], 0, unknown)
    assert abs(found.errors[0]) < 4.0 * found.bounds[0]
    assert abs(found.errors[2]) < 4.0 * found.bounds[1]


def test_the_likelihood_of_rounded_rows_has_the_derivative_of_its_difference_quotient():
    condition, random = NAMED["quantised 1 cm"], np.random.default_rng(0)
    mean = random.normal(0.0, 0.03, 40)
    rounded = condition.quantum * np.round(mean / condition.quantum)
    rounded[::7] += condition.quantum  # improbable rows, beyond the half of a step
    _, slope = oracle.rounded_likelihood(condition, rounded, mean)
    for i, step in enumerate(1e-7 * np.eye(40)):
        up, down = (
            oracle.rounded_likelihood(condition, rounded, mean + s)[0] for s in (step, -step)
        )
        assert slope[i] == pytest.approx((up - down) / 2e-7, rel=1e-5, abs=1e-3)


def test_the_oracle_tries_each_sample_at_which_the_reference_may_have_changed():
    condition = replace(NAMED["white"], every=2)
    counts = {len(list(oracle.references(record(condition, number)))) for number in range(6)}
    assert counts == {2}
    assert len(list(oracle.references(record(NAMED["white"], 0)))) == 1
