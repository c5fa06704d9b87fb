"""From a recording to gains: what is proposed, predicted and refused."""

import math

import deadtime as dtm
import numpy as np
import pytest
from best_pi import Process
from deadtime.tuning import controller_of

TRUTH = dtm.FirstOrder(1.8, 40.0)
LATE = 12.0


@pytest.fixture(scope="module")
def bump():
    """A step of 5 through 1.8 exp(-12 s)/(40 s + 1), with noise."""
    time = np.arange(400.0)
    command = np.where(time < 60.0, 40.0, 45.0)
    output = 55.0 + 9.0 * (1.0 - np.exp(-np.maximum(time - 72.0, 0.0) / 40.0))
    output += np.random.default_rng(3).normal(0.0, 0.1, time.size)
    return dtm.Recording(time, None, output, command)


@pytest.fixture(scope="module")
def found(bump):
    return dtm.tune(bump, form="ideal")


def test_the_gains_hold_on_the_true_process(found):
    assert found.verdict == "reliable"
    assert not found.reasons
    truth = dtm.ControlLoop(TRUTH, found.controller, delay=LATE)
    assert truth.is_stable()
    assert truth.margin().gain_margin > 2.0
    assert truth.step_response().info()["overshoot"] < 25.0


def test_the_load_response_is_near_the_best_of_all_pi_controllers(found):
    truth, gains = Process(1.8, 40.0, LATE), found.controller.gains
    most = float(truth.sensitivity(gains["Kp"], gains["Ki"]))
    assert 1.4 < most < 1.65
    # Seen: 1.0; the integral of the error after a load is 1/Ki.
    assert 1.0 / gains["Ki"] < 1.15 * truth.best_load_ie(most)


def test_the_true_sensitivity_is_below_the_largest_of_the_possible_plants(found):
    truth, gains = Process(1.8, 40.0, LATE), found.controller.gains
    most = float(truth.sensitivity(gains["Kp"], gains["Ki"]))
    assert most < found.margins.max_sensitivity < 1.61


def test_an_objective_of_one_loop_refuses_several_plants_and_says_what_to_give(found):
    with pytest.raises(ValueError, match=r"'abscissa'.*PlantEstimate.*'load'.*loop\(controller\)"):
        dtm.design(found.fit, controller=dtm.PI, objective="abscissa")
    likeliest = found.fit.loop(dtm.PI(1.0, 0.01))
    assert dtm.design(likeliest, objective="abscissa").abscissa < 0.0


@pytest.mark.survey
def test_the_settling_time_is_near_the_best_of_all_pi_controllers(found):
    truth = Process(1.8, 40.0, LATE)
    gains = dtm.tune(found.fit, objective="set_point_settling").controller.gains
    most = float(truth.sensitivity(gains["Kp"], gains["Ki"]))
    own = float(truth.settling([gains["Kp"]], [gains["Ki"]], 40.0 * LATE)[0])
    assert own < 1.15 * truth.best_settling(most)


def test_what_is_typed_is_what_was_proposed(found):
    ideal = found.settings.values
    assert found.controller.gains["Kp"] == ideal["Kc"]
    assert found.controller.gains["Ki"] == pytest.approx(ideal["Kc"] / ideal["Ti"])
    assert controller_of("\n".join(found.settings.lines), "ideal") == found.controller
    assert "Kc = " in found.summary()


def test_the_true_response_to_the_set_point_lies_in_the_band(found):
    told = found.set_point
    truth = dtm.ControlLoop(TRUTH, found.controller, delay=LATE)
    outputs = 55.0 + truth.simulate(told.time, told.size).outputs
    inside = (outputs >= told.low) & (outputs <= told.high)
    assert inside.mean() > 0.95
    assert told.size == pytest.approx(9.0, abs=0.2)
    # A band that says nothing holds everything.
    assert np.max(told.high - told.low) < 0.3 * told.size


def test_the_true_response_to_the_load_lies_in_the_band(found):
    told = found.load
    assert told.size == 5.0
    assert found.shows_load
    # The process in an Euler step of 0.02 s: x' = (1.8 (u + d)(t - 12) - x)/40, u = PI(-x).
    step, gains = 0.02, found.controller.gains
    late = round(LATE / step)
    count = round((told.time[-1] - told.time[0]) / step)
    x, integral, sent, moved = 0.0, 0.0, np.zeros(count + 1), np.zeros(count + 1)
    for k in range(count):
        integral -= gains["Ki"] * x * step
        sent[k] = integral - gains["Kp"] * x + told.size
        arrived = sent[k - late] if k >= late else 0.0
        x += step * (1.8 * arrived - x) / 40.0
        moved[k + 1] = x
    times = told.time[0] + step * np.arange(count + 1)
    outputs = told.outputs[0] + np.interp(told.time, times, moved)
    assert ((outputs >= told.low) & (outputs <= told.high)).mean() > 0.95
    assert told.peak == pytest.approx(np.max(moved), rel=0.1)


def test_a_prediction_takes_any_set_point(found):
    time = np.arange(300.0)
    target = np.where(time < 100.0, 50.0, 52.0)
    outputs, low, high = found.predict(time, target)
    assert outputs[:100] == pytest.approx(50.0)
    assert outputs[-1] == pytest.approx(52.0, abs=0.05)
    assert np.all((low < outputs) & (outputs < high))


def test_gains_change_by_at_most_a_factor_of_two(bump, found):
    slow = dtm.PI(0.1, 0.001)
    step = dtm.tune(found.fit, flown=slow)
    assert step.controller.gains == pytest.approx({"Kp": 0.2, "Ki": 0.002})
    assert "factor of 2" in step.remarks[-1]
    near = {name: 1.2 * gain for name, gain in found.controller.gains.items()}
    assert dtm.tune(found.fit, flown=dtm.PI(**near)).controller.gains == pytest.approx(
        found.controller.gains, rel=1e-3
    )


def test_no_gains_come_of_a_record_that_shows_no_plant():
    time = np.arange(200.0)
    command = np.where(time < 60.0, 40.0, 45.0)
    noise = np.random.default_rng(1).normal(0.0, 1.0, time.size)
    nothing = dtm.tune(dtm.Recording(time, None, noise, command))
    assert nothing.verdict == "none"
    assert nothing.reasons[0] in nothing.summary()
    assert nothing.settings is None
    for ask in (nothing.plot, lambda: nothing.controller, lambda: nothing.report("x.html")):
        with pytest.raises(ValueError, match="no gains"):
            ask()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_integrating_process_has_gains_of_its_sign(sign):
    # A tank: 0.5 exp(-s)/s.
    time = 0.1 * np.arange(500)
    valve = 1.0 * ((time > 5.0) & (time < 12.0)) - 1.0 * ((time > 20.0) & (time < 27.0))
    arrived = np.interp(time - 1.0, time, valve, left=0.0)
    level = sign * 0.05 * np.cumsum(arrived)
    level += np.random.default_rng(1).normal(0.0, 0.01, time.size)
    found = dtm.tune(dtm.Recording(time, None, level, valve))
    assert found.verdict == "reliable"
    assert min(sign * gain for gain in found.controller.gains.values()) > 0.0
    truth = dtm.ControlLoop(dtm.Integrator(0.5 * sign), found.controller, delay=0.95)
    assert truth.is_stable()
    assert truth.margin().max_sensitivity < 1.7
    assert any("direct action" in note for note in found.settings.notes) == (sign < 0.0)


def test_a_closed_loop_is_drawn_under_its_own_set_point():
    truth = dtm.ControlLoop(TRUTH, dtm.PI(1.0, 0.02), delay=LATE, sample_time=1.0)
    time = np.arange(900.0)
    target = np.where(time < 50.0, 55.0, np.where(time < 500.0, 65.0, 58.0))
    run = truth.simulate(time, target - 55.0, reference_time=time)
    noise = np.random.default_rng(2).normal(0.0, 0.1, time.size)
    record = dtm.Recording(time, target, 55.0 + run.outputs + noise, 40.0 + run.inputs)
    found = dtm.tune(record, flown=dtm.PI(1.0, 0.02))
    assert found.shows_set_point
    assert not found.shows_load
    told = found.set_point
    again = dtm.ControlLoop(TRUTH, found.controller, delay=LATE)
    outputs = 55.0 + again.simulate(time, target - 55.0, reference_time=time).outputs
    assert ((outputs >= told.low) & (outputs <= told.high)).mean() > 0.95
    assert math.isclose(told.size, 10.0)


def test_a_proposal_is_plain_values_and_a_page(found, tmp_path):
    pytest.importorskip("matplotlib", reason="matplotlib draws")
    pytest.importorskip("jinja2", reason="jinja2 makes pages")
    plain = found.to_dict()
    assert plain["verdict"] == "reliable"
    assert plain["settings"]["values"]["Ti"] == found.settings.values["Ti"]
    assert len(found.plot()) == 2
    page = found.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert found.settings.lines[0] in page
    assert "<svg" in page
