"""The family of plants: kinds, numbers and verdicts on records whose plant is known."""

import csv
from pathlib import Path

import made_records as made
import numpy as np
import pytest
from family_survey import fit, fit_rows, held, holds
from flights import flight_path
from scipy import signal

PROCESS = Path(__file__).resolve().parents[3] / "shared" / "data" / "process"


def table(path, *names):
    if not path.exists():
        pytest.skip(f"the table {path.name} is not beside the project")
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [np.array([float(row[name] or "nan") for row in rows]) for name in names]


def test_a_window_of_a_run_needs_no_rest_at_its_first_row():
    found = fit(made.slow_window(0))
    assert (found.verdict, found.candidates[0].plant) == ("reliable", "lag")
    assert not found.at_rest
    for name, value in [("delay", 0.3), ("gain", 1.0), ("lag", 5.0)]:
        assert holds(found.hull[name], value), name


def test_a_bump_test_is_a_process_that_comes_to_rest():
    record = made.bump_test(0)
    found = fit(record)
    assert (found.verdict, found.at_rest) == ("reliable", True)
    assert not found.candidates[0].integrating
    assert all(held(found, record).values())


@pytest.mark.parametrize(
    ("make", "seed"), [(made.bump_test, 5013), (made.bump_test, 5027), (made.process_loop, 5026)]
)
def test_a_zero_that_the_record_leaves_open_does_not_make_every_delay_likely(make, seed):
    record = make(seed)
    low, high = fit(record).hull["delay"][:2]
    assert low <= record.delay <= high
    assert high - low < 1.5 * record.delay


def test_a_lone_sine_tells_two_numbers_and_no_plant():
    record = made.lone_sine(0)
    assert (fit(record, plant="lag").verdict, fit(record, plant="lag").told) == ("none", 2)
    assert fit(record).verdict != "reliable"


def test_units_change_nothing():
    record = made.height_steps(1)
    found = fit(record)
    in_hours = fit_rows(
        record.time / 3600.0, 100.0 * record.command, 1000.0 * record.output, closed_loop=True
    )
    assert in_hours.candidates[0].plant == found.candidates[0].plant
    assert in_hours.verdict == found.verdict
    low, high = found.hull["delay_at_crossover"]
    np.testing.assert_allclose(
        in_hours.hull["delay_at_crossover"], [low / 3600.0, high / 3600.0], rtol=1e-3
    )


def test_a_missing_row_is_missing():
    record = made.slow_window(1)
    output = record.output.copy()
    output[50:60] = np.nan
    found = fit_rows(record.time, record.command, output, noise="arma11")
    best = found.candidates[0]
    assert np.isnan(best.residuals[0][50:60]).all()
    assert holds(found.hull["delay"], 0.3)


def test_a_signal_behind_a_delay_alone():
    random = np.random.default_rng(0)
    command = random.normal(size=200).cumsum()
    output = np.r_[np.zeros(6), command[:-6]] + random.normal(0.0, 0.01, 200)
    found = fit_rows(np.arange(200) * 0.1, command, output, between="samples")
    assert found.candidates[0].plant == "delay"
    assert holds(found.hull["delay"], 0.6)


def test_a_command_that_is_logged_late_is_moved():
    random = np.random.default_rng(1)
    command = np.repeat(random.choice([-1.0, 1.0], 60), 5)
    # Each command acts from the row before the one in which it is logged.
    acting = np.r_[command[1:], command[-1]]
    level, output = 0.0, np.zeros(300)
    for row in range(300):
        output[row] = level
        level += (acting[row] - level) * (1.0 - np.exp(-0.1 / 0.5))
    output += random.normal(0.0, 0.003, 300)
    found = fit_rows(np.arange(300) * 0.1, command, output)
    assert (found.shift, found.verdict, found.reason) == (-1, "indication", "command shifted")


def test_a_command_of_unknown_kind_has_the_intervals_of_both():
    record = made.height_steps(2)
    kinds = {kind: fit(record, between=kind) for kind in ("held", "straight", "undecided")}
    both = kinds["undecided"]
    if not both.kind_decided:
        parts = [kinds[kind].hull["delay"] for kind in ("held", "straight")]
        ends = (min(part[0] for part in parts), max(part[1] for part in parts))
        assert both.hull["delay"] == pytest.approx(ends, rel=1e-3)
    least = min(kinds[kind].candidates[0].deviance for kind in ("held", "straight"))
    assert both.candidates[0].deviance == pytest.approx(least, abs=0.01)


def test_a_command_of_a_controller_is_held_where_its_kind_is_as_likely():
    record = made.height_steps(60018)
    kinds = {kind: fit(record, between=kind) for kind in ("held", "straight", "undecided")}
    held, straight, both = (kinds[kind].candidates[0] for kind in kinds)
    assert held.deviance - 2.0 < straight.deviance < held.deviance
    assert kinds["undecided"].kind == "held"
    assert both.values[0] == held.values[0]


def test_a_command_that_ramps_is_straight_where_its_kind_is_as_likely():
    time = np.arange(300.0)
    command = np.interp(time, [30, 60, 130, 160, 230, 260], [0.0, 5.0, 5.0, -3.0, -3.0, 2.0])
    acting = np.interp(time - 12.3, time, command)
    _, output, _ = signal.lsim(([1.8], [40.0, 1.0]), acting, time)
    output += np.random.default_rng(1).normal(0.0, 0.3, time.size)
    found = fit_rows(time, command, output, between="undecided")
    assert (found.kind, found.kind_decided) == ("straight", False)


def test_a_command_that_jumps_is_held():
    record = made.slow_window(3)
    found = fit(record, between="undecided")
    assert (found.kind, found.kind_decided) == ("held", True)
    held = fit(record)
    assert found.hull == held.hull


def test_no_zero_imitates_another_kind():
    time, command, output = table(PROCESS / "loop.csv", "Time (s)", "OP", "PV")
    part = time < 600.0
    found = fit_rows(time[part], command[part], output[part] + 0.01 * time[part], closed_loop=True)
    best = found.candidates[0]
    for one in found.candidates:
        zero = dict(zip(one.names, one.values, strict=True)).get("zero", 0.0)
        assert abs(zero) < 0.3 * time[part][-1] or one.bic > best.bic
    assert not best.limit


def test_the_number_at_its_limit_is_named():
    random = np.random.default_rng(4)
    time, command = np.arange(300.0), np.repeat(random.choice([-1.0, 1.0], 30), 10)
    output = np.cumsum(command) * 0.1 + random.normal(0.0, 0.02, 300)
    # An integrator is a lag without an end.
    found = fit_rows(time, command, output, plant="lag")
    assert found.candidates[0].limit == "lag"
    assert found.reason in ("lag at its limit", "too few told")


def test_other_levels_need_no_second_fit():
    record = made.slow_window(2)
    found, wide = fit(record), fit(record, level=0.99)
    for name, ends in wide.hull.items():
        assert found.hull_at(0.99)[name] == pytest.approx(ends, rel=1e-9)
    assert found.hull_at(0.95) == found.hull
    with pytest.raises(ValueError, match=r"the level is 1\.5"):
        found.hull_at(1.5)


def test_an_output_without_noise_keeps_an_interval():
    time = np.arange(300) * 0.05
    command = np.repeat([0.0, 1.0, -1.0], 100)
    level, output = 0.0, np.zeros(300)
    for row in range(300):
        output[row] = level
        level += (command[max(row - 6, 0)] - level) * (1.0 - np.exp(-0.05 / 2.0))
    found = fit_rows(time, command, output)
    assert found.verdict == "reliable"
    for name, value in [("delay", 0.3), ("gain", 1.0), ("lag", 2.0)]:
        low, high = found.hull[name]
        assert low <= value <= high
        assert high > low


def test_noise_alone_is_no_response():
    random = np.random.default_rng(2)
    command = np.repeat(random.choice([-1.0, 1.0], 40), 5)
    found = fit_rows(np.arange(200) * 0.1, command, random.normal(size=200))
    assert found.verdict == "none"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time": np.zeros(40)}, "times must increase"),
        ({"command": np.full(40, np.nan)}, "commands must be finite"),
        ({"output": np.full(40, np.nan)}, "only 0 rows with a known output"),
        ({"largest_delay": -1.0}, "the largest delay is -1"),
        ({"plant": "lags"}, 'plant "lags" is not known'),
        ({"between": "steps"}, 'between "steps"'),
        ({"level": 2.0}, "the level is 2"),
    ],
)
def test_wrong_input_is_named(change, words):
    given = {"time": np.arange(40.0), "command": np.ones(40), "output": np.ones(40)} | change
    rows = [given.pop(name) for name in ("time", "command", "output")]
    with pytest.raises(ValueError, match=words):
        fit_rows(*rows, **given)


def test_the_bump_test_of_a_process():
    found = fit_rows(*table(PROCESS / "bump.csv", "sec", "OP", "PV"))
    assert found.verdict == "reliable"
    truth = made.Made(*[np.zeros(1)] * 3, (1.8,), (40.0, 1.0), 12.0, False)
    assert all(held(found, truth).values())
    assert abs(found.candidates[0].values[0] - 12.0) < 1.0


def test_a_process_in_a_loop_with_a_step_of_the_load():
    rows = table(PROCESS / "loop.csv", "Time (s)", "OP", "PV")
    found = fit_rows(*rows, closed_loop=True)
    assert found.verdict in ("reliable", "indication")
    # A zero of the length of the record would make an integrator of it.
    assert not found.candidates[0].integrating
    # White noise alone takes a shorter delay than coloured noise needs.
    assert found.reason != "delay at its limit"
    truth = made.Made(*[np.zeros(1)] * 3, (1.8,), (40.0, 1.0), 12.0, True)
    assert all(held(found, truth).values())
    assert abs(found.candidates[0].values[0] - 12.0) < 1.0


def test_one_step_from_an_unknown_state_tells_no_plant():
    time, command, output = table(PROCESS / "tclab_step_test.csv", "Time", "Q1", "T1")
    assert fit_rows(time[1:], command[1:], output[1:]).verdict != "reliable"


def test_one_step_does_not_tell_two_lags_from_a_dead_time():
    time, command, output = table(PROCESS / "tclab_step_test.csv", "Time", "Q1", "T1")
    # The first row, with the heater off, has the time of the second.
    time[0] = -1.0
    assert fit_rows(time, command, output, at_rest=True).verdict != "reliable"


@pytest.mark.parametrize("kind", ["held", "samples"])
def test_a_masked_sine_is_never_reliable(kind):
    rows = table(PROCESS / "lagd_masked.csv", "t", "u", "y")
    assert fit_rows(*rows, between=kind).verdict != "reliable"


@pytest.mark.parametrize(("name", "gain"), [("0_5_1_0", 0.5), ("2_4_0_25", 2.4)])
def test_the_servo_of_a_recorded_height_is_found(name, gain):
    path = flight_path(f"ardrone2_height_step_{name}.csv")
    time, reference, height = table(path, "t_s", "ref_m", "height_m")
    used = time <= 25.5
    command = np.clip(gain * (reference - height), -1.0, 1.0)
    found = fit_rows(
        time[used], command[used], height[used], closed_loop=True, earlier=int(np.sum(time < 13.0))
    )
    best, second = found.candidates[:2]
    assert best.plant == "integrator, two lags, zero"
    assert second.bic - best.bic > 10.0
    assert best.noise_std < 6.5e-3
