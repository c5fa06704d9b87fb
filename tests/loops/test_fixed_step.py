"""Loops in fixed steps: the results of block diagrams, and their errors."""

import deadtime as dtm
import numpy as np
import pytest

# Armah and Yi, Table 2: overshoot in percent at delays of so many samples of 0.065 s.
SAMPLES = [4.0, 5.0, 5.6, 5.664, 5.6646, 5.666, 5.7]
PRINTED = [0.0, 0.419, 2.067, 2.298, 2.300, 2.305, 2.429]
CONVERGED = [0.0, 0.3977, 2.0381, 2.2722, 2.2745, 2.2797, 2.4079]


def drone(delay, controller=None, **more):
    return dtm.ControlLoop(
        dtm.Integrator(),
        dtm.P(Kp=1.31) if controller is None else controller,
        delay=delay,
        delay_path=more.pop("delay_path", "measurement"),
        **more,
    )


def overshoot(response):
    return 100.0 * max(0.0, response.outputs.max() - 1.0)


def test_coarse_steps_give_the_printed_table():
    # Three stages a step of one sample, the reference stepping off the grid of steps.
    found = [
        overshoot(
            dtm.simulate_fixed_step(
                drone(0.065 * n, limit=1.0),
                10.0,
                [1.0],
                reference_time=[0.5],
                reference_before=0.0,
                step=0.065,
                solver="ode3",
            )
        )
        for n in SAMPLES
    ]
    # Printed with three decimals.
    np.testing.assert_allclose(found, PRINTED, rtol=0, atol=5.1e-4)


def test_the_solver_the_paper_names_gives_other_digits():
    found = [
        overshoot(
            dtm.simulate_fixed_step(drone(0.065 * n, limit=1.0), 10.0, step=0.065, solver="ode8")
        )
        for n in SAMPLES
    ]
    known = [0.0, 0.420, 2.067, 2.298, 2.300, 2.306, 2.438]
    np.testing.assert_allclose(found, known, rtol=0, atol=5.1e-4)


def test_fine_steps_give_the_converged_table():
    found = [
        overshoot(
            dtm.simulate_fixed_step(drone(0.065 * n, limit=1.0), 6.0, step=2e-4, solver="ode4")
        )
        for n in SAMPLES
    ]
    # Errors of second order: 1e-5 at a step of a hundredth, so below 1e-8 of the step here; the
    # switch of the limit and the peak between steps are of the same size.
    np.testing.assert_allclose(found, CONVERGED, rtol=0, atol=1e-4)


@pytest.mark.parametrize("solver", ["ode1", "ode2", "ode3", "ode4", "ode5", "ode8"])
def test_the_buffer_limits_the_order(solver):
    loop = drone(0.36)
    exact = loop.simulate([0.0, 3.7]).outputs[-1]

    def error(step):
        found = dtm.simulate_fixed_step(loop, 3.7, step=step, solver=solver)
        assert found.time[-1] == pytest.approx(3.7, abs=1e-12)
        return abs(found.outputs[-1] - exact)

    # Delay, end and step fit together, so only formula and buffer err. Halving the step divides
    # the error by 2 (Euler) or by 4 (every other), within what the next term adds.
    ratio = error(0.02) / error(0.01)
    expected = 2.0 if solver == "ode1" else 4.0
    assert ratio == pytest.approx(expected, rel=0.1)


def test_without_a_delay_formulas_have_their_full_order():
    loop = drone(0.0, dtm.PV(Kp=2.0, Kv=0.3, filter=dtm.DerivativeFilter(omega=38.0)))

    def error(solver, step):
        found = dtm.simulate_fixed_step(loop, 1.0, step=step, solver=solver)
        return np.abs(found.outputs - loop.simulate(found.time).outputs).max()

    for solver, order, step in [("ode3", 3, 0.005), ("ode5", 5, 0.01), ("ode8", 8, 0.05)]:
        seen = np.log2(error(solver, step) / error(solver, step / 2))
        # Where the step is long against the filter, more is gained than in the limit.
        assert seen > order - 0.5, solver


def test_the_filtered_loop_converges_to_the_exact_one_from_both_paths():
    controller = dtm.PV(Kp=2.0, Kv=0.19, filter=dtm.DerivativeFilter(omega=38.0))
    for path in ("command", "measurement"):
        loop = drone(0.36, controller, limit=1.0, delay_path=path)
        found = dtm.simulate_fixed_step(loop, 5.0, step=1e-3, solver="ode4")
        exact = loop.simulate(found.time)
        # The last stage before the jump of the command arrives reads what comes after it: a sixth
        # of a step of 1e-3 s at 1 m/s. The rest is of second order.
        assert np.abs(found.outputs - exact.outputs).max() < 1.8e-4
        assert np.abs(found.inputs[1:] - exact.inputs[1:]).max() < 5e-3


def test_an_ideal_derivative_is_a_difference_quotient():
    loop = drone(0.36, dtm.PV(Kp=2.0, Kv=0.3))
    errors = []
    for step in (0.01, 0.005):
        found = dtm.simulate_fixed_step(loop, 5.0, step=step, solver="ode4")
        errors.append(np.abs(found.outputs - loop.simulate(found.time).outputs).max())
    # Of first order: the quotient lags by half a step.
    assert errors[0] < 0.01
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)


def test_a_sampled_loop_on_its_own_grid():
    loop = drone(0.26, limit=1.0, sample_time=0.065, delay_path="measurement")
    found = dtm.simulate_fixed_step(loop, 5.2, step=0.0065, solver="ode4")
    exact = loop.simulate(found.time)
    # The measurement of a held command is made of straight lines with corners at whole samples,
    # and the delay is a whole number of samples: nothing is left to err but rounding.
    assert np.abs(found.outputs - exact.outputs).max() < 1e-12


def test_delays_shorter_than_a_step_prolong_the_last_line():
    found = dtm.simulate_fixed_step(drone(0.004), 5.0, step=0.01, solver="ode4")
    exact = drone(0.004).simulate(found.time)
    assert np.abs(found.outputs - exact.outputs).max() < 2e-4


def test_times_and_history():
    loop = drone(0.36)
    found = dtm.simulate_fixed_step(
        loop, 1.0, [1.0, 2.0], reference_time=[0.2, 0.6], initial_output=1.0, step=0.3
    )
    np.testing.assert_allclose(found.time, [0.0, 0.3, 0.6, 0.9, 1.2])
    np.testing.assert_array_equal(found.reference, [1.0, 1.0, 2.0, 2.0, 2.0])
    assert found.outputs[:3].tolist() == [1.0, 1.0, 1.0]
    assert found.breaks.tolist() == [0.6]


@pytest.mark.parametrize(
    ("loop", "arguments", "match"),
    [
        (drone(None), {"end": 1.0, "step": 0.1}, "delay"),
        (drone(0.3), {"end": 1.0, "step": 0.0}, "step=0.0"),
        (drone(0.3), {"end": 1.0, "step": np.nan}, "step=nan"),
        (drone(0.3), {"end": -1.0, "step": 0.1}, "end=-1.0"),
        (drone(0.3), {"end": 1.0, "step": 0.1, "solver": "ode45"}, "ode1, ode2"),
        (drone(0.3), {"end": 1e9, "step": 0.1}, "50000000 steps"),
        (drone(0.3), {"end": 1e300, "step": 1e-3}, "longer"),
        (drone(0.3), {"end": 1.0, "step": 0.1, "reference": [1.0, 2.0]}, "reference_time"),
        (drone(0.3, sample_time=0.065), {"end": 1.0, "step": 0.02}, "3.25 steps"),
        (drone(3.0, dtm.P(Kp=9.0)), {"end": 5000.0, "step": 0.1}, "1e150"),
    ],
)
def test_refusals_say_what_to_do(loop, arguments, match):
    with pytest.raises((ValueError, dtm.DeadtimeError), match=match):
        dtm.simulate_fixed_step(loop, **arguments)


def test_an_algebraic_loop_is_refused():
    loop = dtm.ControlLoop(dtm.RationalPlant([1.0, 1.0], [1.0, 2.0]), dtm.P(Kp=0.5), delay=0.0)
    with pytest.raises(ValueError, match="algebraic loop"):
        dtm.simulate_fixed_step(loop, 1.0, step=0.1)


@pytest.mark.parametrize("path", ["command", "measurement"])
def test_loads_disturbances_and_noise_converge_to_the_exact_response(path):
    loop = dtm.ControlLoop(
        dtm.FirstOrder(2.0, 1.0), dtm.PI(0.8, 0.5), delay=0.25, limit=(-0.4, 0.9), delay_path=path
    )
    given = {
        "load": ([0.5, 2.0], [0.4, -0.2]),
        "output_disturbance": ([1.0], [0.3]),
        "noise": ([3.0], [0.05]),
    }
    coarse = dtm.simulate_fixed_step(loop, 6.0, step=1 / 512, solver="ode4", **given)
    exact = loop.simulate(coarse.time, 1.0, **given)
    # Jumps between whole steps cost one order.
    np.testing.assert_allclose(coarse.outputs[:-1], exact.outputs[:-1], atol=4e-3)
    with pytest.raises(ValueError, match="load is a function"):
        dtm.simulate_fixed_step(loop, 1.0, step=0.1, load=np.sin)
