"""The plant of a recording without a loop: what the result holds, and what is refused."""

import pickle
from functools import cache

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import PLANTS
from deadtime.estimation.evidence._question import shows_controller
from flights import flight_path
from made_processes import DEAD, GAIN, SLOW, bump, sine


@pytest.fixture(scope="module")
def fit():
    time, command, output = bump()
    return dtm.estimate_delay(dtm.Recording(time, None, output, command))


def test_a_bump_test_needs_no_loop_and_no_plant(fit):
    assert fit.verdict == "reliable"
    assert fit.reason == ""
    assert isinstance(fit.plant, dtm.FirstOrder)
    for name, truth in (("delay", DEAD), ("gain", GAIN), ("lag", SLOW)):
        low, high = fit.ci(0.999, name)
        assert low < truth < high
        assert low <= fit.value(name) <= high


def test_what_a_loop_feels_holds_the_truth(fit):
    proportional = dtm.ControlLoop(dtm.FirstOrder(GAIN, SLOW), dtm.P(1.0), delay=DEAD)
    low, high = fit.ci(0.999, "largest_gain")
    assert low < proportional.margin().gain_margin < high
    view = fit.at([0.5 * fit.crossover, fit.crossover])
    true = proportional.frequency_response(view.omega)
    late = -np.unwrap(np.angle(true)) / view.omega
    # Two half widths of 95 % hold all but one in ten thousand.
    for value, ends, truth in (
        (view.gain, view.gain_ci, abs(true)),
        (view.delay, view.delay_ci, late),
    ):
        assert np.all(abs(truth - value) < ends[1] - ends[0])
        assert np.all((ends[0] <= value) & (value <= ends[1]))
    assert view.delay[1] == pytest.approx(fit.delay_at_crossover, rel=1e-6)
    half = fit.largest_gain / 2.0
    assert half * fit.gain_at_crossover == pytest.approx(1.0, rel=1e-6)


def test_a_wider_level_has_a_wider_interval(fit):
    (low, high), (lower, higher) = fit.ci(0.8), fit.ci(0.99)
    assert lower < low < high < higher


def test_an_interval_is_of_one_piece_where_one_minimum_is_left(fit):
    assert fit.pieces("gain") == (fit.ci(0.95, "gain"),)
    assert fit.pieces("lag", 0.8) == (fit.ci(0.8, "lag"),)
    with pytest.raises(ValueError, match="'zeros' has no interval"):
        fit.pieces("zeros")


def test_delays_a_period_apart_are_pieces():
    # A square wave whose period varies by little, through a delay alone.
    rng = np.random.default_rng(0)
    halves = 10 + (rng.random(14) < 0.1)
    command = np.repeat((-1.0) ** np.arange(14), halves)[:130].astype(float)
    output = np.r_[np.zeros(6), command[:-6]] + rng.normal(0.0, 0.8, 130)
    recording = dtm.Recording(0.1 * np.arange(130), None, output, command)
    found = dtm.estimate_delay(recording, plant="delay", between="held", largest_delay=3.5)
    if found.verdict != "none":
        pieces = found.pieces()
        assert pieces[0][0] == found.ci()[0]
        assert pieces[-1][1] == found.ci()[1]
        assert any(low <= 0.6 <= high for low, high in pieces)


def loop_logged(late, seed=1, rows=400, step=0.065):
    """A height under P control, with the command logged `late` rows late."""
    vehicle = dtm.ControlLoop(
        dtm.Integrator(0.9, 0.3), dtm.P(1.2), delay=0.2, sample_time=step, limit=1.0
    )
    rng = np.random.default_rng(seed)
    reference = np.repeat(rng.choice([0.0, 0.3, 0.8], rows // 40), 40)
    time = step * np.arange(rows)
    flown = vehicle.simulate(time, reference, reference_time=time)
    output = flown.outputs + rng.normal(0.0, 0.004, rows)
    command = np.clip(1.2 * (reference - output), -1.0, 1.0)
    return dtm.Recording(time, reference, output, np.roll(command, late))


@cache
def estimate_of_rows(late):
    return dtm.estimate_delay(loop_logged(late), controller=dtm.P(1.2), plant="integrator, lag")


@pytest.mark.parametrize(("late", "words"), [(0, None), (1, "late"), (-1, "early")])
def test_a_command_that_is_a_row_late_or_early_is_moved(late, words):
    found, right = estimate_of_rows(late), estimate_of_rows(0)
    assert found.shift == -late
    assert found.delay == pytest.approx(right.delay, abs=0.01)
    line = [line for line in found.summary().splitlines() if "row" in line and "shifted" in line]
    assert bool(line) == (words is not None)
    assert words is None or f"1 row {words}" in line[0]


def test_the_loop_has_the_plant_and_its_dead_time(fit):
    loop = fit.loop(dtm.PI(0.5, 0.01), sample_time=1.0, limit=100.0)
    assert loop.plant == fit.plant
    assert loop.parameters["delay"] == fit.delay
    assert loop.is_stable()


def test_the_summary_begins_with_the_verdict_and_says_what_came_second(fit):
    first, *rest = fit.summary().splitlines()
    assert first == fit.headline()
    assert first.startswith("reliable: dead time 1")
    assert "a process that comes to rest, time constant" in first
    assert any(line.strip().startswith("second best: ") for line in rest)
    assert rest[-1].strip() == fit.advice().statement
    statement = fit.advice().statement
    found = eval(statement, {"dtm": dtm, "fit": fit})
    assert found.loop.is_stable()


def test_a_pickled_estimate_answers_the_same(fit):
    other = pickle.loads(pickle.dumps(fit))
    assert other == fit
    assert other.at(0.02) == fit.at(0.02)


def test_nothing_depends_on_units(fit):
    time, command, output = bump()
    scaled = dtm.estimate_delay(dtm.Recording(time, None, 1e3 * output, 1e-2 * command))
    assert [one.name for one in scaled.candidates] == [one.name for one in fit.candidates]
    assert scaled.delay == pytest.approx(fit.delay, rel=1e-6)
    assert scaled.largest_gain == pytest.approx(1e-5 * fit.largest_gain, rel=1e-6)


def test_the_sign_of_the_output_changes_nothing(fit):
    time, command, output = bump()
    turned = dtm.estimate_delay(dtm.Recording(time, None, -output, command))
    assert turned.delay == pytest.approx(fit.delay, rel=1e-6)
    for name in ("gain", "largest_gain"):
        assert turned.value(name) == pytest.approx(-fit.value(name), rel=1e-6)
        assert turned.ci(0.95, name)[::-1] == pytest.approx(
            [-end for end in fit.ci(0.95, name)], rel=1e-6
        )


def test_the_words_of_each_kind_of_plant(fit):
    assert len(fit.candidates) > 4
    assert all(one.name in PLANTS for one in fit.candidates)
    for one in fit.candidates:
        words = one.in_words()
        assert ("integrates" in words) == one.name.startswith("integrator") == one.integrates
        assert ("zero" in words) == one.name.endswith("zero")
        # The formula is that of the plant.
        omega = 0.03
        value = eval(one.formula(), {"s": 1j * omega})
        around = dtm.ControlLoop(one.plant, dtm.P(1.0), delay=0.0)
        assert around.frequency_response([omega])[0] == pytest.approx(value, rel=1e-4)


def test_an_indication_claims_no_interval_in_its_words():
    time, command, output = sine()
    fit = dtm.estimate_delay(dtm.Recording(time, None, output, command))
    assert fit.verdict != "reliable"
    assert "95 %" not in fit.headline()
    assert fit.reason in fit.headline()
    if fit.verdict == "none":
        with pytest.raises(ValueError, match="no interval: "):
            fit.ci()
        with pytest.raises(ValueError, match="no plant: "):
            fit.loop(dtm.P(1.0))


def test_a_moving_reference_says_that_a_controller_is_in_the_loop():
    time, command, output = bump(rows=150)
    moving, still = np.where(time < 70, 55.0, 60.0), np.full(150, 55.0)
    for reference, expected in ((None, False), (command, False), (moving, True), (still, False)):
        assert shows_controller(dtm.Recording(time, reference, output, command)) is expected


def test_a_known_controller_gives_the_command_and_its_crossover():
    vehicle = dtm.ControlLoop(
        dtm.Integrator(0.9, 0.3), dtm.P(1.2), delay=0.3, sample_time=0.065, limit=1.0
    )
    flight = dtm.Experiment.step(8.0, rest=1.04).run(vehicle, noise=0.004, seed=3)
    bare = dtm.Recording(flight.time, flight.reference, flight.output)
    fit = dtm.estimate_delay(bare, controller=dtm.P(1.2), limit=1.0, plant="integrator, lag")
    logged = dtm.estimate_delay(flight, controller=dtm.P(1.2), plant="integrator, lag")
    assert fit.delay == pytest.approx(logged.delay, abs=0.02)
    assert fit.delay + fit.best.lags[0] == pytest.approx(0.6, abs=0.06)
    true = vehicle.continuous().margin().gain_crossovers[-1]
    assert fit.crossover_in_loop == pytest.approx(true, rel=0.05)
    assert "with its controller, the loop has its crossover at" in fit.summary()


@pytest.mark.parametrize("name", ["2_4_0_25", "0_5_1_0"])
def test_the_height_servo_is_found_without_being_named(name):
    flight = dtm.read_recording(
        flight_path(f"ardrone2_height_step_{name}.csv"),
        time="t_s",
        reference="ref_m",
        output="height_m",
    )
    gain = float(name[:3].replace("_", "."))
    fit = dtm.estimate_delay(flight, controller=dtm.P(gain), limit=1.0, window=(13, 25.5))
    assert fit.best.name == "integrator, two lags, zero"
    assert fit.noise_std < 0.0065


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"limit": 1.0}, "limit=1.0 is a limit of the controller"),
        ({"controller": dtm.PI(1.0, 0.1)}, "only for a P controller"),
        ({"plant": "two poles"}, "plant='two poles' is not one of 'delay', 'lag'"),
        ({"largest_delay": 0.0}, "largest_delay"),
        ({"method": "gcc"}, "method and free are for an estimate with a loop"),
        ({"free": ("delay",)}, "method and free are for an estimate with a loop"),
        ({"window": (5, 2)}, "5"),
    ],
)
def test_what_cannot_be_is_refused(options, words):
    time, command, output = bump(rows=150)
    with pytest.raises((ValueError, dtm.RecordingError), match=words):
        dtm.estimate_delay(
            dtm.Recording(time, None, output, None if "controller" in options else command),
            **options,
        )


def test_a_recording_without_a_command_and_options_of_the_other_way_are_refused(fit):
    time, command, output = bump(rows=150)
    with pytest.raises(dtm.RecordingError, match="no command, so nothing shows"):
        dtm.estimate_delay(dtm.Recording(time, command, output))
    loop = dtm.ControlLoop(dtm.FirstOrder(), dtm.P(1.0))
    with pytest.raises(ValueError, match="at_rest is only for an estimate without a loop"):
        dtm.estimate_delay(dtm.Recording(time, command, output, command), loop, at_rest=True)
    with pytest.raises(ValueError, match="no recording was given"):
        dtm.estimate_delay([])
    with pytest.raises(ValueError, match="omega=-1 rad/s: give frequencies above zero"):
        fit.at([-1.0])
    with pytest.raises(ValueError, match="'zeros' has no interval"):
        fit.ci(0.95, "zeros")


def test_the_picture_has_the_verdict(fit):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    upper, lower = fit.plot()
    assert upper.get_title().startswith("reliable")
    # It was drawn on a figure that `pyplot.show()` did not know.
    assert pyplot.fignum_exists(upper.figure.number)
    pyplot.close(upper.figure)
    assert lower.get_xlabel() == "time / s"


def step_at_the_second_row(seed=3):
    """A process with 12 s of dead time and 60 s of time constant, from rest, over 600 s."""
    time = np.arange(600.0)
    level = 1.8 * 5.0 * (1.0 - np.exp(-np.maximum(time - 13.0, 0.0) / 60.0))
    level += np.random.default_rng(seed).normal(0.0, 0.05, time.size)
    return dtm.Recording(time, None, level, np.where(time < 1.0, 0.0, 5.0))


def test_a_command_that_moves_at_the_beginning_alone_takes_the_plant_at_rest():
    record = step_at_the_second_row()
    fit = dtm.estimate_delay(record)
    assert fit.verdict == "indication"
    assert "assumed at rest at the first row" in fit.reason
    assert fit.delay + fit.value("lag") == pytest.approx(72.0, rel=0.05)
    assert "at_rest=True" in fit.advice().statement
    said = dtm.estimate_delay(record, at_rest=True)
    assert said.candidates[0].name == fit.candidates[0].name
    assert said.delay == fit.delay
    unknown = dtm.estimate_delay(record, at_rest=False)
    assert unknown.verdict == "none"
    assert "before the rows that are fitted" in unknown.reason
    assert "at_rest=True" in unknown.advice().statement


def test_a_number_of_a_loop_around_the_plant_has_an_interval(fit):
    def overshoot(loop):
        return loop.step_response().info()["overshoot"]

    controller = dtm.PI(1.2, 0.04)
    value, (low, high) = fit.in_loop(controller, overshoot)
    assert low < value < high
    truth = dtm.ControlLoop(dtm.FirstOrder(GAIN, SLOW), controller, delay=DEAD)
    # Twice as far as 95 %: one in ten thousand is beyond.
    assert low - (value - low) < overshoot(truth) < high + (high - value)
