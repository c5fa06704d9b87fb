"""Responses of control loops: their metrics, and reference solutions for hard ones."""

from __future__ import annotations

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime.loops._open_run import open_response
from deadtime.loops._plants import realise, rest
from loops import INTEGRATOR, TIMES
from scipy.integrate import solve_ivp

# Figures of a response


def test_info_of_a_first_order_loop():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.0)
    info = loop.simulate(np.linspace(0.0, 10.0, 101)).info()
    assert info["rise_time"] == pytest.approx(math.log(9.0), rel=1e-9)
    assert info["settling_time"] == pytest.approx(math.log(50.0), rel=1e-9)
    assert info["overshoot"] == 0.0
    assert info["undershoot"] == 0.0
    assert info["steady_state"] == pytest.approx(1.0, abs=1e-15)
    assert info["peak"] == pytest.approx(1.0 - math.exp(-10.0), rel=1e-12)
    assert info["settling_min"] == pytest.approx(0.9, abs=0.01)
    assert set(info) == {
        "rise_time",
        "settling_time",
        "settling_min",
        "settling_max",
        "overshoot",
        "undershoot",
        "peak",
        "peak_time",
        "steady_state",
    }


GROWING = dtm.ControlLoop(dtm.FirstOrder(1.8, 40.0), dtm.PI(7.5, 0.2), delay=12.0)


@pytest.mark.parametrize(
    "system",
    [
        GROWING,
        GROWING.replace(sample_time=1.0),
        dtm.feedback(GROWING.open_loop()),
        dtm.DelaySystem({0.0: [[-1.0]]}, N={0.5: [[1.1]]}, B=[[1.0]], C=[[1.0]]),
    ],
    ids=["loop", "sampled", "transfer function", "neutral"],
)
def test_an_unstable_system_has_a_peak_alone(system):
    response = system.step_response()
    info = response.info()
    assert {name for name, value in info.items() if not np.isnan(value)} == {"peak", "peak_time"}
    # Against a steady state that is given, they are those of the output.
    largest = np.max(response.outputs)
    assert response.info(steady_state=1.0)["overshoot"] >= 100.0 * (largest - 1.0)


def test_what_a_limit_bounds_keeps_its_figures():
    bounded = GROWING.replace(limit=3.0).step_response(np.linspace(0.0, 2000.0, 4001)).info()
    assert np.isnan(bounded["settling_time"])
    assert 100.0 < bounded["overshoot"] < 200.0


def test_a_stable_loop_that_has_not_settled_keeps_its_figures():
    info = GROWING.replace(Kp=1.0, Ki=0.02).step_response(np.linspace(0.0, 15.0, 31)).info()
    assert np.isnan(info["settling_time"])
    assert info["steady_state"] == 1.0
    assert info["overshoot"] == 0.0


def test_info_of_a_step_down_is_that_of_a_step_up():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.4), delay=0.36)
    up = loop.simulate(np.linspace(0.0, 8.0, 161)).info()
    down = loop.simulate(np.linspace(0.0, 8.0, 161), 0.0, initial_output=1.0).info()
    for name in ("rise_time", "settling_time", "overshoot", "undershoot"):
        assert down[name] == pytest.approx(up[name], rel=1e-8)


def test_info_does_not_depend_on_the_output_grid():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.36, sample_time=0.065, limit=1.0)
    coarse = loop.simulate(np.linspace(0.0, 10.0, 101)).info()
    fine = loop.simulate(np.linspace(0.0, 10.0, 3001)).info()
    for name in ("rise_time", "settling_time", "overshoot", "peak_time"):
        assert coarse[name] == pytest.approx(fine[name], rel=1e-6, abs=1e-9)


FEEDTHROUGH = [
    ([0.5, 3.0], [1.0, 1.5]),
    ([0.3, 1.2, 3.0], [1.0, 0.8, 2.0]),
    ([-0.4, 1.0, 2.0, 1.5], [2.0, 3.0, 4.0, 1.0]),
]


@pytest.mark.parametrize(("num", "den"), FEEDTHROUGH)
def test_a_plant_with_direct_feedthrough_rests_at_an_output_that_is_not_zero(num, den):
    # x' = A x + B u = 0 and y = C x + D u; the sign of D u failed no test.
    state, command = rest(num, den, 0.8)
    plant = realise(num, den)
    assert command == pytest.approx(0.8 * den[-1] / num[-1], rel=1e-15)
    np.testing.assert_allclose(plant.A @ state + plant.B * command, 0.0, atol=1e-14)
    assert plant.C @ state + plant.D * command == pytest.approx(0.8, rel=1e-14)
    for sample_time in (None, 0.05):
        loop = dtm.ControlLoop(
            dtm.RationalPlant(num, den), dtm.PI(0.1, 0.2), delay=0.3, sample_time=sample_time
        )
        stays = loop.simulate(np.linspace(0.0, 3.0, 31), 0.8, initial_output=0.8)
        np.testing.assert_allclose(stays.outputs, 0.8, rtol=1e-12)
        np.testing.assert_allclose(stays.inputs, command, rtol=1e-12)


def test_a_step_response_finds_its_own_time():
    response = dtm.ControlLoop(INTEGRATOR, dtm.P(1.31), delay=0.36, limit=0.1).step_response()
    # Ten seconds at the limit before it settles.
    assert 10.0 < response.time[-1] < 60.0
    assert response.outputs[-1] == pytest.approx(1.0, abs=0.01)
    unstable = dtm.ControlLoop(INTEGRATOR, dtm.P(6.0), delay=0.36).step_response(amplitude=2.0)
    assert np.abs(unstable.outputs).max() > 2.0
    time, outputs = dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.1).step_response([0.0, 0.3])
    assert time.tolist() == [0.0, 0.3]
    assert outputs[1] == pytest.approx(0.195, abs=1e-15)


def test_plot_draws_output_reference_and_command():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    response = dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.1).simulate(TIMES)
    axes = response.plot(inputs=True)
    assert len(axes.lines) == 3
    matplotlib.pyplot.close(axes.figure)


def test_many_jumps_are_the_sum_of_their_steps():
    """Breaking points that are ignored after their decay have no effect on the response."""
    rng = np.random.default_rng(1)
    loop = dtm.ControlLoop(dtm.Integrator(lag=0.05), dtm.P(1.5), delay=0.36)
    jumps = np.sort(rng.uniform(0.0, 40.0, 150))
    levels = rng.choice([-1.0, 0.0, 1.0], 150)
    times = np.linspace(0.0, 40.0, 201)
    found = loop.simulate(times, levels, reference_time=jumps, reference_before=0.0)
    total = np.zeros(len(times))
    for jump, height in zip(jumps, np.diff(levels, prepend=0.0), strict=True):
        if height != 0.0:
            later = times[times > jump] - jump
            one = loop.simulate(np.concatenate([[0.0], later]), height)
            total[times > jump] += one.outputs[1:]
    assert np.abs(found.outputs - total).max() < 1e-12


# The ideal derivative of the error: an impulse where the reference jumps


@pytest.mark.parametrize("delay", [0.0, 0.36])
@pytest.mark.parametrize("plant", [INTEGRATOR, dtm.Integrator(lag=0.1)])
def test_an_ideal_derivative_of_a_step_is_an_impulse(plant, delay):
    """R(s) = Kp + Kd s: the response is that of PV and Kd/Kp times its derivative."""
    kp, kd = 1.6, 0.2
    times = np.concatenate([[0.0], np.linspace(0.007, 4.007, 81)])
    width = 1e-5
    pv = dtm.ControlLoop(plant, dtm.PV(kp, kd), delay=delay)
    around = times[1:, None] + width * np.array([-2, -1, 1, 2])
    near = pv.simulate(np.concatenate([[0.0], around.ravel()])).outputs[1:].reshape(-1, 4).T
    slope = (8 * (near[2] - near[1]) - (near[3] - near[0])) / (12 * width)
    found = pv.replace(controller=dtm.PD(kp, kd)).simulate(times).outputs[1:]
    # Differences of step 1e-5 round to 1e-10.
    assert found == pytest.approx(pv.simulate(times).outputs[1:] + kd / kp * slope, abs=1e-9)


def test_a_fast_filter_tends_to_the_impulse():
    ideal = dtm.ControlLoop(dtm.Integrator(lag=0.1), dtm.PID(1.2, 0.3, 0.1), delay=0.3)
    filtered = ideal.replace(controller=dtm.PID(1.2, 0.3, 0.1, dtm.DerivativeFilter(2000.0)))
    levels, jumps = [1.0, -0.5], [0.2, 1.7]
    sharp = ideal.simulate(TIMES, levels, reference_time=jumps).outputs
    smooth = filtered.simulate(TIMES, levels, reference_time=jumps).outputs
    assert np.abs(sharp - smooth).max() < 5e-3


def test_a_jump_before_the_start_is_no_impulse():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.PD(1.6, 0.2), delay=0.36)
    found = loop.simulate(TIMES, [1.0], reference_time=[-1.0])
    pv = loop.replace(controller=dtm.PV(1.6, 0.2)).simulate(TIMES)
    np.testing.assert_array_equal(found.outputs, pv.outputs)


def test_limit_and_hold_suppress_the_impulse():
    pd = dtm.ControlLoop(INTEGRATOR, dtm.PD(1.6, 0.2), delay=0.36)
    pv = pd.replace(controller=dtm.PV(1.6, 0.2))
    for fields in ({"limit": 1.0}, {"sample_time": 0.065}):
        np.testing.assert_array_equal(
            pd.replace(**fields).simulate(TIMES).outputs,
            pv.replace(**fields).simulate(TIMES).outputs,
        )
    assert np.abs(pd.simulate(TIMES).outputs - pv.simulate(TIMES).outputs).max() > 0.1


def test_a_slow_crossing_of_the_limit_is_simulated():
    # The integral takes the command through its limit again and again, rounding made each of
    # these crossings look like many, in steps too short to change the state.
    plant, limit = dtm.RationalPlant([1.0], [1.0, 0.4, 4.0]), 1.0
    loop = dtm.ControlLoop(plant, dtm.PI(1.0, 0.3), delay=0.0, limit=limit)
    time = np.linspace(0.0, 40.0, 401)

    def slope(_, x):
        y, v, integral = x
        w = np.clip(1.0 - y + 0.3 * integral, -limit, limit)
        return [v, w - 0.4 * v - 4.0 * y, 1.0 - y]

    truth = solve_ivp(
        slope, (0.0, 40.0), [0.0, 0.0, 0.0], t_eval=time, rtol=1e-11, atol=1e-12, max_step=0.1
    )
    # The error that solve_ivp was asked for, over 400 steps.
    np.testing.assert_allclose(loop.simulate(time, 1.0).outputs, truth.y[0], atol=1e-9)


@pytest.mark.parametrize("fast", [30.0, 1000.0])
def test_fast_poles_cost_what_their_rate_costs(fast):
    # In observable canonical form the entries grow like fast², which the length of an element
    # must not depend on: 20 million of them would not reach the end.
    poles = np.array([-1.0, -fast, -1.3 * fast])
    gain = -np.prod(poles)
    loop = dtm.ControlLoop(dtm.RationalPlant([gain], np.poly(poles)), dtm.P(1.0), delay=2.0)
    time = np.linspace(0.0, 4.0, 41)
    residues = [gain / (p * np.prod(p - poles[poles != p])) for p in poles]
    since = np.maximum(time - 2.0, 0.0)
    truth = (time > 2.0) * (1.0 + np.exp(np.outer(since, poles)) @ residues)
    # 1e-12: the cancellation of states of size fast² in the canonical form.
    np.testing.assert_allclose(loop.simulate(time, 1.0).outputs, truth, atol=1e-12)


def test_an_ideal_derivative_over_a_short_lag_without_a_delay():
    # Closing the loop makes entries of 3e7 of a plant whose fastest rate is 1.3e4.
    plant, controller = dtm.Integrator(1.0, 1e-4), dtm.PV(2.0, 0.3)
    loop = dtm.ControlLoop(plant, controller, delay=0.0)
    time = np.linspace(0.0, 5.0, 51)
    poles = np.roots([1e-4, 1.3, 2.0])
    residues = [2e4 / (p * (p - q)) for p, q in (poles, poles[::-1])]
    truth = 1.0 + np.exp(np.outer(time, poles)) @ residues
    np.testing.assert_allclose(loop.simulate(time, 1.0).outputs, truth, atol=1e-12)


def test_a_delay_of_almost_nothing_is_refused_at_once():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=1e-9)
    with pytest.raises(ValueError, match="to exactly zero"):
        loop.simulate([0.0, 1.0])


# Impulses


@pytest.mark.parametrize("delay_path", ["command", "measurement"])
@pytest.mark.parametrize(
    "loop",
    [
        dtm.ControlLoop(dtm.Integrator(0.9, 0.1), dtm.PI(1.2, 0.4), delay=0.3),
        dtm.ControlLoop(1.0 / (dtm.s + 0.5 * dtm.delay(1.0)), dtm.P(0.7), delay=0.2),
    ],
    ids=["rational", "delays inside"],
)
def test_an_impulse_response_is_the_slope_of_the_step_response(loop, delay_path):
    loop = loop.replace(delay_path=delay_path)
    time = np.array([0.05, 0.41, 1.3, 2.77, 5.0])
    step = 1e-4
    slope = (loop.simulate(np.append(0, time + step)).outputs
             - loop.simulate(np.append(0, time - step)).outputs)[1:] / (2 * step)  # fmt: skip
    found = loop.impulse_response(np.append(0, time))
    np.testing.assert_allclose(found.outputs[1:], slope, atol=1e-6)
    assert np.isnan(found.inputs).all()
    assert loop.impulse_response().time[-1] > 5.0


def test_loops_without_an_impulse_response_say_so():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.25)
    with pytest.raises(ValueError, match="does not see an impulse"):
        loop.replace(sample_time=0.1).impulse_response()
    with pytest.raises(ValueError, match=r"limit=1\.0"):
        loop.replace(limit=1.0).impulse_response()
    with pytest.raises(ValueError, match="delay of this loop is None"):
        dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0)).impulse_response()


@pytest.mark.parametrize(
    ("plant", "steady"),
    [(dtm.FirstOrder(2.0, 0.3), 2.0), (dtm.RationalPlant([3.0, 1.0], [1.0, 0.4, 4.0]), 0.25)],
)
def test_a_plant_without_a_controller_rests_under_its_first_command(plant, steady):
    when, command = np.array([0.0, 0.5, 1.0]), np.array([2.0, 2.0, 0.0])
    times = np.array([-3.0, 0.0, 0.4, 1.0])
    found = open_response(plant, plant.parameters, times, when, command)
    np.testing.assert_allclose(found, 2.0 * steady, rtol=1e-12)
