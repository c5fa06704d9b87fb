"""Designs by the responses to a load and a set point, under Ms and other demands."""

import math

import deadtime as dtm
import numpy as np
import pytest
from classical_plants import PLANTS
from scipy.optimize import brentq, minimize_scalar

PROCESS = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.PI(1.0, 0.1), delay=2.0)
VEHICLE = dtm.ControlLoop(
    dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.25, sample_time=0.065, limit=1.0
)
SMOOTH = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))

#: What is left of a demand by the search.
CLOSE = 1e-6


def least_distance(gains):
    """1/Ms on a dense grid of frequencies."""
    plant = 2.0 * np.exp(-2j * OMEGA) / (10j * OMEGA + 1.0)
    feedback = gains["Kp"] + gains.get("Ki", 0.0) / (1j * OMEGA)
    return np.abs(1.0 + plant * feedback).min()


#: Frequencies of the grid.
OMEGA = np.geomspace(0.02, 3.0, 4001)


def test_the_integral_of_the_error_is_best_on_the_boundary_of_ms():
    # Another search: Ki as a function of Kp where the circle of 1/1.6 around -1 is touched.
    best = dtm.design(PROCESS, controller=dtm.PI, objective="load_ie")

    def largest(Kp):
        return brentq(lambda Ki: least_distance({"Kp": Kp, "Ki": Ki}) - 1.0 / 1.6, 1e-4, 1.0)

    found = minimize_scalar(
        lambda Kp: -largest(Kp), bounds=(0.5, 1.4), method="bounded", options={"xatol": 1e-6}
    )
    assert best.gains["Ki"] == pytest.approx(-found.fun, rel=1e-4)
    assert best.value == pytest.approx(1.0 / best.gains["Ki"])
    assert best.margins.max_sensitivity == pytest.approx(1.6, rel=CLOSE)


def test_the_default_is_the_best_load_response():
    best = dtm.design(PROCESS, controller=dtm.PI)
    assert best.objective == "load"
    assert best.value == pytest.approx(best.loop.load_response().iae, rel=1e-5)
    assert best.loop.margin().max_sensitivity == pytest.approx(1.6, rel=CLOSE)
    # No gains along the boundary are better by more than a tenth.
    for Kp in np.linspace(0.6, 1.3, 15):
        Ki = brentq(lambda Ki, Kp=Kp: least_distance({"Kp": Kp, "Ki": Ki}) - 1.0 / 1.6, 1e-4, 1.0)
        other = PROCESS.replace(Kp=Kp, Ki=Ki).load_response().iae
        assert other >= best.value / 1.1 * (1.0 - 1e-4)


@pytest.mark.parametrize("controller", [dtm.P, dtm.PV, SMOOTH])
@pytest.mark.parametrize("loop", [VEHICLE, VEHICLE.continuous()])
def test_without_an_integral_the_deviation_at_rest_is_least(loop, controller):
    if controller is dtm.PV:
        loop = loop.replace(plant=dtm.Integrator(0.85))
    best = dtm.design(loop, controller=controller)
    assert best.value == pytest.approx(1.0 / best.gains["Kp"])
    assert best.loop.margin().max_sensitivity == pytest.approx(1.6, rel=CLOSE)
    if controller is not dtm.P:
        # With other velocity gains less proportional gain is possible.
        for factor in (0.9, 1.1):
            other = best.loop.replace(Kv=factor * best.gains["Kv"])
            assert other.margin().max_sensitivity > 1.6 * (1 - 1e-4)
    plant = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.P(1.0), delay=2.0)
    best = dtm.design(plant, controller=dtm.P)
    assert best.value == pytest.approx(2.0 / (1.0 + 2.0 * best.gains["Kp"]))


def test_the_set_point_has_a_weight_with_which_it_settles_first():
    best = dtm.design(PROCESS, controller=dtm.PI)
    weight = best.loop.controller.weight
    assert 0.0 <= weight < 1.0
    times = [
        best.loop.replace(weight=other).step_response().info()["settling_time"]
        for other in (weight, *np.linspace(0.0, 1.0, 9))
    ]
    assert times[0] <= min(times) * 1.005
    kept = dtm.design(PROCESS, controller=dtm.PI(1.0, 0.1, weight=0.9))
    assert kept.loop.controller.weight == 0.9


def test_a_plant_of_negative_gain_has_the_mirrored_design():
    one = dtm.design(PROCESS, controller=dtm.PI)
    other = dtm.design(PROCESS.replace(gain=-2.0), controller=dtm.PI)
    assert {k: -v for k, v in other.gains.items()} == pytest.approx(one.gains, rel=1e-6)


def test_an_unstable_plant_is_stabilised():
    plant = dtm.RationalPlant([1.0], [1.0, -1.0])
    loop = dtm.ControlLoop(plant, dtm.P(1.0), delay=0.1)
    best = dtm.design(loop, controller=dtm.PI, max_sensitivity=2.0)
    assert best.loop.is_stable()
    assert best.margins.max_sensitivity <= 2.0 * (1 + CLOSE)


def test_ms_holds_over_intervals_and_plants():
    best = dtm.design(PROCESS, controller=dtm.PI, delay=(1.5, 2.5), gain=(1.8, 2.2))
    assert best.margins.max_sensitivity == pytest.approx(1.6, rel=CLOSE)
    for delay in np.linspace(1.5, 2.5, 5):
        for gain in np.linspace(1.8, 2.2, 5):
            found = best.loop.replace(delay=delay, gain=gain).margin()
            assert found.max_sensitivity <= 1.6 * (1 + CLOSE)
    slow = PROCESS.replace(delay=4.0)
    both = dtm.design(PROCESS, controller=dtm.PI, plants=[slow], objective="load_ie")
    alone = dtm.design(slow, controller=dtm.PI, objective="load_ie")
    assert both.gains["Ki"] <= alone.gains["Ki"] * (1 + 1e-6)
    assert slow.replace(**both.gains).margin().max_sensitivity <= 1.6 * (1 + CLOSE)


@pytest.mark.parametrize(
    ("name", "least"), [("gain_margin", 5.0), ("phase_margin", 65.0), ("delay_margin", 6.0)]
)
def test_margins_are_demands(name, least):
    free = dtm.design(PROCESS, controller=dtm.PI, load_slack=0.0)
    assert getattr(free.margins, name) < least
    best = dtm.design(PROCESS, controller=dtm.PI, **{name: least})
    assert getattr(best.margins, name) >= least * (1 - CLOSE)
    assert getattr(best.margins, name) <= least * 1.05
    assert best.value > free.value
    (trade,) = (one for one in best.traded if one.requirement == name)
    assert trade.active
    assert trade.without == pytest.approx(free.value, rel=1e-3)


def test_noise_is_a_demand():
    free = dtm.design(VEHICLE, controller=SMOOTH)
    best = dtm.design(VEHICLE, controller=SMOOTH, noise_gain=0.5 * free.noise_gain)
    assert best.noise_gain <= 0.5 * free.noise_gain * (1 + CLOSE)
    # For white noise the gain of P is known: |Kp S| over all frequencies.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.3)
    best = dtm.design(loop, controller=dtm.P, noise_gain=0.5, bandwidth=200.0)
    omega = np.linspace(1e-3, 200.0, 400001)
    size = np.abs(best.gains["Kp"] / (1.0 + best.loop.frequency_response(omega)))
    white = math.sqrt(np.trapezoid(size**2, omega) / 200.0)
    assert white == pytest.approx(0.5, rel=1e-3)


def test_a_settling_time_is_a_demand():
    best = dtm.design(PROCESS, controller=dtm.PI, settling_time=14.0)
    assert best.loop.step_response().info()["settling_time"] <= 14.0 * (1 + 1e-4)


def test_load_and_set_point_are_weighed():
    load = dtm.design(PROCESS, controller=dtm.PI, load_slack=0.0)
    point = dtm.design(PROCESS, controller=dtm.PI, objective="set_point")
    both = dtm.design(PROCESS, controller=dtm.PI, load_weight=0.5)
    iae = [one.loop.load_response().iae for one in (load, both, point)]
    assert iae[0] <= iae[1] * (1 + 1e-6)
    assert iae[1] <= iae[2] * (1 + 1e-6)
    settled = dtm.design(PROCESS, controller=dtm.PI, objective="set_point_settling")
    times = [
        PROCESS.replace(**one.gains).step_response().info()["settling_time"]
        for one in (settled, point)
    ]
    assert settled.value == pytest.approx(times[0], rel=1e-3)
    assert times[0] <= times[1] * 1.001


def test_pid_control_is_better_than_pi():
    smooth = dtm.PID(1.0, 0.1, 0.1, dtm.DerivativeFilter(5.0))
    best = dtm.design(PROCESS, controller=smooth)
    assert best.value < dtm.design(PROCESS, controller=dtm.PI).value
    assert best.margins.max_sensitivity == pytest.approx(1.6, rel=CLOSE)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"max_sensitivity": 1.0}, "Ms is above 1"),
        ({"load_weight": 2.0}, "between 0 and 1"),
        ({"load_slack": -0.1}, "load_slack"),
        ({"load_slack": 0.1, "load_weight": 0.5}, "load_slack=0.1"),
        (
            {"load_slack": 0.1, "objective": "abscissa"},
            "load_slack cannot be used with objective='abscissa'",
        ),
        ({"load_slack": 0.1, "controller": dtm.P}, "with PI or PID control"),
        (
            {"bandwidth": 3.0, "objective": "abscissa"},
            "bandwidth cannot be used with objective='abscissa'",
        ),
        ({"fixed": {"Ki": 0.1}}, "depends only on Ki, which is fixed"),
        ({"noise_gain": -1.0}, "noise_gain"),
        (
            {"objective": "abscissa", "noise_gain": 1.0},
            "noise_gain cannot be used with objective='abscissa'",
        ),
        ({"objective": "fast"}, "objective='fast'"),
        ({"filter": "auto"}, "filter='auto'"),
        ({"settling_time": 0.1}, "no gains"),
    ],
)
def test_demands_that_have_no_meaning_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        dtm.design(PROCESS, **({"controller": dtm.PI} | change))


@pytest.mark.parametrize("objective", ["load", "abscissa"])
def test_a_hold_far_shorter_than_the_delay_is_refused(objective):
    loop = PROCESS.replace(sample_time=1e-9)
    with pytest.raises(ValueError, match=r"sample_time=1e-09: .* leave sample_time out"):
        dtm.design(loop, controller=dtm.PI, objective=objective)


def test_hundreds_of_samples_in_the_delay_change_little():
    held = dtm.design(PROCESS.replace(sample_time=PROCESS.delay / 300), controller=dtm.PI)
    free = dtm.design(PROCESS, controller=dtm.PI)
    assert held.gains == pytest.approx(free.gains, rel=0.01)
    assert held.damping == pytest.approx(free.damping, rel=0.01)
    assert held.step_info["settling_time"] == pytest.approx(
        free.step_info["settling_time"], rel=0.02
    )


def test_a_loop_that_nothing_limits_is_refused():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.0)
    with pytest.raises(ValueError, match="nothing limits the gains"):
        dtm.design(loop, controller=dtm.P)


def test_the_table_holds_every_rule():
    best = dtm.design(PROCESS, controller=dtm.PI)
    table = best.compared()
    assert table["SIMC"].gains == pytest.approx({"Kp": 1.25, "Ki": 0.125})
    assert table["SIMC"].max_sensitivity == pytest.approx(1.59, abs=5e-3)
    # AMIGO: 0.15/2 + (0.35 - 20/144) 10/4, and Ti = 0.7 + 13 x 2 x 100/(100 + 240 + 28).
    assert table["AMIGO"].gains["Kp"] == pytest.approx(0.6027778, rel=1e-3)
    ti = 0.7 + 2600.0 / 368.0
    assert table["AMIGO"].gains["Ki"] == pytest.approx(0.6027778 / ti, rel=2e-3)
    assert table["design"].load_iae < table["SIMC"].load_iae
    for row in table:
        loop = PROCESS.replace(**row.gains)
        if row.rule == "design":
            loop = best.loop
        assert loop.margin().max_sensitivity == pytest.approx(row.max_sensitivity)
        assert loop.load_response().iae == pytest.approx(row.load_iae, rel=1e-5)
        info = loop.step_response().info()
        assert info["settling_time"] == pytest.approx(row.settling_time, rel=1e-3)
        assert info["overshoot"] == pytest.approx(row.overshoot, abs=0.1)
    assert "SIMC" in repr(table)
    with pytest.raises(KeyError, match="AMIGO"):
        table["Cohen"]


def test_the_half_rule_is_that_of_its_author():
    # Skogestad 2003, example E1: 1/((s + 1)(0.2 s + 1)): tau_1 = 1.1, theta = 0.1.
    plant = dtm.RationalPlant([1.0], np.convolve([1.0, 1.0], [0.2, 1.0]).tolist())
    table = dtm.tuning.rules(dtm.ControlLoop(plant, dtm.PI(1.0, 1.0), delay=0.0))
    assert table.reduced == pytest.approx(
        {"gain": 1.0, "lag": 1.1, "second_lag": 0.0, "dead_time": 0.1}
    )
    # Critical gain and period of e^(-T s)/s: pi/(2 T) and 4 T.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PI(1.0, 0.1), delay=0.36)
    row = dtm.tuning.rules(loop)["Ziegler-Nichols frequency"]
    assert row.gains["Kp"] == pytest.approx(0.45 * math.pi / 0.72, rel=1e-9)
    assert row.gains["Kp"] / row.gains["Ki"] == pytest.approx(4 * 0.36 / 1.2, rel=1e-9)


@pytest.mark.survey
@pytest.mark.long
@pytest.mark.parametrize(("family", "value", "loop"), PLANTS)
def test_designs_of_fifty_plants(family, value, loop):
    table = dtm.tuning.rules(loop)
    best = dtm.design(loop, controller=dtm.PI)
    settled = best.loop.step_response().info()["settling_time"]
    if np.isfinite(table["SIMC"].settling_time):
        assert settled <= table["SIMC"].settling_time * (1 + 1e-3)
    assert best.loop.margin().max_sensitivity <= 1.6 * (1 + CLOSE)
    amigo = table["AMIGO"]
    equal = dtm.design(
        loop, controller=dtm.PI, max_sensitivity=amigo.max_sensitivity, objective="load_ie"
    )
    assert 1.0 / equal.gains["Ki"] <= 1.0 / amigo.gains["Ki"] * (1 + 1e-6)
    same = dtm.design(loop, controller=dtm.PI, max_sensitivity=amigo.max_sensitivity)
    assert same.value <= amigo.load_iae * (1 + 1e-4)


@pytest.mark.survey
def test_gains_from_a_bump_test_are_nearly_the_best():
    # 1.8 e^(-12 s)/(40 s + 1), a row a second, noise 0.15, a bump of 5 after a minute.
    lot = np.random.default_rng(7)
    time_s = np.arange(600.0)
    command = np.where(time_s >= 60.0, 45.0, 40.0)
    since = np.maximum(time_s - 72.0, 0.0)
    output = 55.0 + 9.0 * (1.0 - np.exp(-since / 40.0)) + 0.15 * lot.standard_normal(600)
    record = dtm.Recording(time_s, None, output, command)
    fit = dtm.estimate_delay(record)
    assert fit.verdict == "reliable"
    truth = dtm.ControlLoop(dtm.FirstOrder(1.8, 40.0), dtm.PI(1.0, 0.02), delay=12.0)
    found = dtm.design(fit, controller=dtm.PI)
    own = truth.replace(**found.gains)
    best = dtm.design(truth, controller=dtm.PI, max_sensitivity=own.margin().max_sensitivity)
    assert own.load_response().iae <= 1.15 * best.value
    point = dtm.design(fit, controller=dtm.PI, objective="set_point_settling")
    own = truth.replace(**point.gains)
    best = dtm.design(
        truth,
        controller=dtm.PI,
        objective="set_point_settling",
        max_sensitivity=own.margin().max_sensitivity,
    )
    assert own.step_response().info()["settling_time"] <= 1.15 * best.value


def test_a_settling_time_that_the_weight_brings_costs_nothing():
    loop = dtm.ControlLoop(dtm.Integrator(1.0), dtm.PI(1.0, 0.1), delay=0.5)
    best = dtm.design(loop, controller=dtm.PI)
    settled = best.loop.step_response().info()["settling_time"]
    asked = dtm.design(loop, controller=dtm.PI, settling_time=1.02 * settled)
    assert asked.value <= best.value * (1 + 1e-3)
    assert asked.loop.step_response().info()["settling_time"] <= 1.02 * settled


def test_limits_of_the_command_do_not_move_a_design_by_responses():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.PI(1.0, 0.1), delay=2.0)
    free = dtm.design(loop, controller=dtm.PI)
    for limits in ({"limit": (0.0, 1.0)}, {"limit": (-0.5, 1.0)}, {"rate_limit": 0.1}):
        held = dtm.design(loop.replace(**limits), controller=dtm.PI)
        assert held.gains == free.gains
        assert held.summary()
    assert (
        "s at the limit of 0 to 1"
        in dtm.design(loop.replace(limit=(0.0, 1.0)), controller=dtm.P).summary()
    )


def test_a_plant_with_delays_inside_has_a_design_by_the_integral_alone():
    loop = dtm.ControlLoop(
        dtm.DelaySystem({0.0: -0.1, 0.5: -0.2}, 1.0), dtm.PI(1.0, 0.1), delay=0.3
    )
    with pytest.raises(ValueError, match="use objective='load_ie'"):
        dtm.design(loop, controller=dtm.PI)
    found = dtm.design(loop, controller=dtm.PI, objective="load_ie")
    assert found.loop.margin().max_sensitivity == pytest.approx(1.6, rel=1e-6)
