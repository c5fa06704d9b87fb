"""The simulation of linear loops against exact solutions found in other ways."""

from __future__ import annotations

import json
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

PROBLEMS = {
    problem["id"]: problem
    for problem in json.loads(
        (Path(__file__).parents[1] / "reference" / "dde_problems.json").read_text()
    )["problems"]
}

DRONE = dtm.Integrator()

LOOPS = {
    "drone_p_step": dtm.ControlLoop(DRONE, dtm.P(1.31), delay=0.36, delay_path="measurement"),
    "drone_p_sat_zoh": dtm.ControlLoop(
        DRONE, dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0, delay_path="measurement"
    ),
    "drone_pv_neutral": dtm.ControlLoop(
        DRONE, dtm.PV(2.0, 0.3), delay=0.36, delay_path="measurement"
    ),
    "drone_p_sat_continuous": dtm.ControlLoop(
        DRONE, dtm.P(1.31), delay=0.36, limit=1.0, delay_path="measurement"
    ),
    "drone_pv_filter_zoh_sat": dtm.ControlLoop(
        DRONE,
        dtm.PV(2.0, 0.3, dtm.DerivativeFilter(omega=25.0, damping=0.7)),
        delay=0.36,
        sample_time=0.065,
        limit=1.0,
        delay_path="measurement",
    ),
}


@pytest.mark.parametrize("name", LOOPS)
def test_reference_problems(name):
    problem = PROBLEMS[name]
    times = np.array([0.0, *map(float, problem["times"])])
    values = np.array([float(row[0]) for row in problem["values"]])
    reference = float(problem["parameters"]["r"])
    found = LOOPS[name].simulate(times, reference)
    # A hundred-odd elements or samples, each exact to a unit of the last place or so.
    assert np.abs(found.outputs[1:] - values).max() < 1e-14


def test_breaks_are_the_known_ones():
    problem = PROBLEMS["drone_p_step"]
    found = LOOPS["drone_p_step"].simulate([0.0, 3.7])
    known = [float(t) for t in problem["discontinuity_times"]]
    np.testing.assert_allclose(found.breaks, known, rtol=0, atol=1e-14)


def test_switching_time_is_exact():
    problem = PROBLEMS["drone_p_sat_continuous"]
    found = LOOPS["drone_p_sat_continuous"].simulate([0.0, 10.0], 2.0)
    for switch in map(float, problem["switching_times"]):
        # The command leaves its limit one delay before the plant sees it.
        assert np.abs(found.breaks - switch).min() < 1e-14


# Overshoot of a unit step, x = Kp Td: exact for the integrator, and with the command limited.


@pytest.mark.parametrize("x", [1.0, 1.1, 1.25, 1.5, 1.7])
def test_overshoot_beyond_one(x):
    loop = dtm.ControlLoop(DRONE, dtm.P(x / 0.36), delay=0.36)
    # From pi/2 on it is unstable, and has none but against a steady state that is given.
    info = loop.simulate(np.linspace(0.0, 1.5, 151)).info(steady_state=1.0)
    assert info["overshoot"] == pytest.approx(100.0 * (x - 0.5), abs=1e-11)


@pytest.mark.parametrize(
    ("x", "overshoot"),
    [(0.6, 11.648091), (0.7, 20.599407), (0.8, 30.158600), (0.9, 40.018058), (1.0, 50.0)],
)
def test_overshoot_table(x, overshoot):
    loop = dtm.ControlLoop(DRONE, dtm.P(x / 0.36), delay=0.36)
    info = loop.simulate(np.linspace(0.0, 3.0, 301)).info()
    assert info["overshoot"] == pytest.approx(overshoot, abs=6e-7)
    w = 1.0 - np.sqrt(2.0 * x - 1.0)
    exact = 2 * x - x**2 / 2 + (1 - x) * w - w**2 / 2 + w**3 / 6 - 1
    assert info["overshoot"] == pytest.approx(100.0 * exact, abs=1e-11)


@pytest.mark.parametrize(
    ("delay", "overshoot"),
    [
        (0.325, 0.398),
        (0.364, 2.038),
        (0.36816, 2.272),
        (0.368199, 2.275),
        (0.36829, 2.280),
        (0.3705, 2.408),
    ],
)
def test_overshoot_under_a_limit(delay, overshoot):
    """Armah & Yi, Table 2, with a converged solution instead of their fixed steps."""
    loop = dtm.ControlLoop(DRONE, dtm.P(1.31), delay=delay, limit=1.0)
    info = loop.simulate(np.linspace(0.0, 6.0, 121)).info()
    assert info["overshoot"] == pytest.approx(overshoot, abs=6e-4)


# Loops of higher order against the method of steps with one matrix exponential a delay.


def stacked_exponentials(loop, times, delays):
    """All delay intervals side by side: a constant linear system in the time within a delay."""
    model, delay = loop.specification.model, loop.delay
    n = len(model.B)
    outputs = np.zeros(len(times))
    starts = [np.zeros(n)]
    for k in range(delays):
        size = n * (k + 1) + 1
        matrix = np.zeros((size, size))
        command = np.zeros(size)  # w of the first interval is zero
        rows = []
        for j in range(k + 1):
            block = slice(j * n, (j + 1) * n)
            rows.append(command)
            matrix[block] = np.outer(model.B, command)
            matrix[block, block] += model.A
            matrix[block, -1] += model.E
            command = model.L * command
            command[block] += model.K
            command[-1] += model.M
        start = np.concatenate([*starts, [1.0]])
        inside = (times >= k * delay) & (times < (k + 1) * delay)
        for i in np.flatnonzero(inside):
            state = expm(matrix * (times[i] - k * delay)) @ start
            outputs[i] = model.C @ state[-1 - n : -1] + model.D * (rows[-1] @ state)
        starts.append((expm(matrix * delay) @ start)[-1 - n : -1])
    return outputs


HIGHER = {
    "lag": (dtm.Integrator(gain=0.9, lag=0.2), dtm.P(1.3)),
    "lag, filtered derivative": (
        dtm.Integrator(lag=0.2),
        dtm.PV(2.0, 0.3, dtm.DerivativeFilter(38.0)),
    ),
    "neutral": (dtm.Integrator(), dtm.PV(1.5, 0.4)),
    "kit": (dtm.kit_plant(), dtm.P(2.4)),
    "kit, neutral": (dtm.kit_plant(), dtm.PV(2.0, 0.2)),
    "first order, integral": (dtm.FirstOrder(2.0, 0.8), dtm.PI(0.6, 0.5)),
    "oscillator, filtered pid": (
        dtm.RationalPlant([1.0], [1.0, 0.4, 4.0]),
        dtm.PID(0.5, 1.0, 0.3, dtm.DerivativeFilter(20.0, 0.7)),
    ),
    "direct feedthrough": (dtm.RationalPlant([0.3, 1.0], [1.0, 1.0]), dtm.PI(0.5, 0.6)),
    "fourth order": (dtm.RationalPlant([2.0, 1.0, 8.0], [1.0, 5.0, 12.0, 20.0, 8.0]), dtm.P(0.4)),
    "no dynamics": (dtm.RationalPlant([0.5], [1.0]), dtm.P(0.8)),
}


@pytest.mark.parametrize("name", HIGHER)
def test_higher_orders(name):
    plant, controller = HIGHER[name]
    loop = dtm.ControlLoop(plant, controller, delay=0.31)
    times = np.linspace(0.0, 2.41, 50)
    truth = stacked_exponentials(loop, times, 8)
    found = loop.simulate(times)
    # Exponentials of matrices with up to forty rows and norms up to a hundred lose some digits.
    assert np.abs(found.outputs - truth).max() < 2e-12 * max(1.0, np.abs(truth).max())


@pytest.mark.parametrize("limit", [0.4, 0.9, 2.0])
@pytest.mark.parametrize("name", ["lag", "neutral", "kit", "first order, integral"])
def test_limits_of_higher_orders(name, limit):
    """Against an adaptive Runge-Kutta method of steps, which finds the kinks by small steps."""
    plant, controller = HIGHER[name]
    delay = 0.31
    loop = dtm.ControlLoop(plant, controller, delay=delay, limit=limit)
    model = loop.specification.model
    times = np.linspace(0.0, 2.4, 49)
    outputs = np.zeros(len(times))
    state, past = np.zeros(len(model.B)), lambda t: 0.0
    for k in range(8):
        start = k * delay

        def slope(t, x, past=past):
            return model.A @ x + model.B * past(t - delay) + model.E

        solution = solve_ivp(
            slope,
            (start, start + delay),
            state,
            "DOP853",
            rtol=1e-11,
            atol=1e-12,
            dense_output=True,
        )

        def command(t, states=solution.sol, past=past):
            u = model.K @ states(t) + model.L * past(t - delay) + model.M
            return float(np.clip(u, -limit, limit))

        inside = (times >= start) & (times < start + delay)
        for i in np.flatnonzero(inside):
            outputs[i] = model.C @ solution.sol(times[i]) + model.D * past(times[i] - delay)
        state, past = solution.sol(start + delay), command
    found = loop.simulate(times)
    assert np.abs(found.outputs - outputs).max() < 2e-7
    assert np.abs(found.inputs).max() <= limit


def test_a_sampled_loop_by_hand():
    """One sample after the other, with the fraction of the delay inside a sample."""
    kp, gain, delay, sample_time = 1.7, 0.8, 0.23, 0.1
    loop = dtm.ControlLoop(
        dtm.Integrator(gain), dtm.P(kp), delay=delay, sample_time=sample_time, limit=0.9
    )
    samples = np.arange(60) * sample_time
    y, commands = 0.0, []
    outputs = []
    for k in range(60):
        outputs.append(y)
        commands.append(np.clip(kp * (1.0 - y), -0.9, 0.9))
        # 0.23 = 2 samples + 0.03: the older command acts for 0.03 s.
        older = commands[k - 3] if k >= 3 else 0.0
        newer = commands[k - 2] if k >= 2 else 0.0
        y += gain * (0.03 * older + 0.07 * newer)
    found = loop.simulate(samples)
    np.testing.assert_allclose(found.outputs, outputs, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.inputs, commands, rtol=0, atol=1e-14)


def test_a_long_limit_cycle_stays_exact():
    """Far beyond its stability limit the limited loop has a limit cycle with a closed form."""
    loop = dtm.ControlLoop(DRONE, dtm.P(1000.0), delay=0.25, limit=1.0)
    found = loop.simulate(np.linspace(0.0, 200.0, 4001), 0.0, initial_output=0.1)
    tail = found.outputs[found.time > 100.0]
    # Nearly a relay: period 4 Td, amplitude Td, for an infinite gain.
    assert np.abs(tail).max() == pytest.approx(0.25, abs=2e-3)
    rising = found.time[1:][(found.outputs[1:] > 0) & (found.outputs[:-1] <= 0)]
    period = np.diff(rising[rising > 100.0]).mean()
    assert period == pytest.approx(1.0, abs=5e-3)
