"""Control loops: construction, properties of their responses, poles and stable ranges."""

from __future__ import annotations

import math

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import lambertw

INTEGRATOR = dtm.Integrator()

plants = st.one_of(
    st.builds(dtm.Integrator, gain=st.floats(0.3, 2.0), lag=st.sampled_from([0.0, 0.1, 0.35])),
    st.builds(dtm.FirstOrder, gain=st.floats(0.3, 2.0), time_constant=st.floats(0.2, 2.0)),
    st.just(dtm.kit_plant()),
)
controllers = st.one_of(
    st.builds(dtm.P, Kp=st.floats(0.2, 2.5)),
    st.builds(
        dtm.PV,
        Kp=st.floats(0.2, 2.5),
        Kv=st.floats(-0.2, 0.4),
        filter=st.sampled_from([None, dtm.DerivativeFilter(20.0, 0.7)]),
    ),
    st.builds(dtm.PI, Kp=st.floats(0.2, 1.5), Ki=st.floats(0.1, 0.6)),
    st.builds(
        dtm.PID,
        Kp=st.floats(0.2, 1.5),
        Ki=st.floats(0.1, 0.6),
        Kd=st.floats(0.0, 0.2),
        filter=st.just(dtm.DerivativeFilter(15.0)),
    ),
)
sample_times = st.sampled_from([None, 0.05, 0.065, 0.2])


NO_LIMIT = st.none()


@st.composite
def loops(draw, limits=NO_LIMIT):
    return dtm.ControlLoop(
        draw(plants),
        draw(controllers),
        delay=draw(st.sampled_from([0.0, 0.065, 0.1, 0.2731, 0.5])),
        sample_time=draw(sample_times),
        limit=draw(limits),
    )


TIMES = np.linspace(0.0, 4.0, 41)


@given(loops(), st.lists(st.floats(-2, 2), min_size=3, max_size=3))
@settings(deadline=None, max_examples=60)
def test_responses_add_up(loop, levels):
    jumps = np.array([0.0, 0.7, 1.9])
    whole = loop.simulate(TIMES, np.cumsum(levels), reference_time=jumps)
    parts = np.zeros(len(TIMES))
    for level, jump in zip(levels, jumps, strict=True):
        one = loop.simulate(TIMES, [0.0, level], reference_time=[-1.0, jump])
        parts += one.outputs
    scale = 1.0 + np.abs(parts).max()
    assert np.abs(whole.outputs - parts).max() < 1e-12 * scale


@given(loops(st.floats(0.3, 3.0)), st.floats(0.1, 10.0))
@settings(deadline=None, max_examples=60)
def test_responses_scale_with_step_and_limit(loop, factor):
    once = loop.simulate(TIMES)
    scaled = loop.replace(limit=factor * loop.limit).simulate(TIMES, factor)
    scale = 1.0 + np.abs(once.outputs).max()
    assert np.abs(scaled.outputs - factor * once.outputs).max() < 1e-11 * factor * scale


@given(loops(st.one_of(st.none(), st.floats(0.3, 3.0))), st.sampled_from([-3.0, 0.5, 1000.0]))
@settings(deadline=None, max_examples=60)
def test_the_clock_may_start_anywhere(loop, start):
    once = loop.simulate(TIMES, [1.0, 0.2], reference_time=[0.0, 1.0])
    later = loop.simulate(TIMES + start, [1.0, 0.2], reference_time=[start, start + 1.0])
    scale = 1.0 + np.abs(once.outputs).max()
    # The clock itself is rounded: 1e-13 s at 1000 s.
    assert np.abs(later.outputs - once.outputs).max() < 1e-11 * scale
    np.testing.assert_allclose(later.time - start, once.time, atol=1e-12)


@given(loops(st.one_of(st.none(), st.floats(0.3, 3.0))))
@settings(deadline=None, max_examples=60)
def test_a_delay_in_the_measurement_is_the_same_function_earlier(loop):
    late = loop.simulate(np.concatenate([[0.0], TIMES + loop.delay + 1e-9]))
    early = loop.replace(delay_path="measurement").simulate(np.concatenate([[0.0], TIMES + 1e-9]))
    scale = 1.0 + np.abs(late.outputs).max()
    assert np.abs(early.outputs[1:] - late.outputs[1:]).max() < 1e-12 * scale


@given(loops(st.one_of(st.none(), st.floats(0.3, 3.0))), st.floats(-2.0, 2.0))
@settings(deadline=None, max_examples=40)
def test_a_loop_at_rest_stays_there(loop, level):
    level = level if isinstance(loop.plant, dtm.Integrator | dtm.RationalPlant) else 0.0
    found = loop.simulate(TIMES, level, initial_output=level)
    np.testing.assert_allclose(found.outputs, level, rtol=0, atol=1e-13)


@given(
    st.floats(0.3, 3.0),
    st.sampled_from([0.0, 0.1, 0.15, 0.36, 1.0]),
    st.integers(1, 30),
    st.sampled_from([0.0, 0.25, 0.7]),
)
@settings(deadline=None, max_examples=60)
def test_a_sampled_run_can_be_taken_up_again(kp, delay, samples, part):
    """From output and commands at any moment of a run, the rest of the run follows."""
    sample_time = 0.1
    loop = dtm.ControlLoop(
        dtm.Integrator(0.9), dtm.P(kp), delay=delay, sample_time=sample_time, limit=0.8
    )
    moment = (samples + part) * sample_time
    rest = moment + np.linspace(0.0, 2.0, 41)
    whole = loop.simulate(np.concatenate([[0.0], rest]))
    issued = loop.simulate(np.arange(samples + 1) * sample_time).inputs
    again = loop.simulate(
        rest,
        1.0,
        reference_before=1.0,
        initial_output=whole.outputs[1],
        command_history=issued if part else issued[:-1],
        sample_phase=(1.0 - part) * sample_time if part else 0.0,
    )
    np.testing.assert_allclose(again.outputs, whole.outputs[1:], rtol=0, atol=1e-12)
    inner = np.abs((rest - moment) % sample_time - (1 - part) * sample_time) > 1e-9
    np.testing.assert_allclose(again.inputs[inner], whole.inputs[1:][inner], rtol=0, atol=1e-12)


def test_fast_sampling_tends_to_continuous_time():
    loop = dtm.ControlLoop(dtm.kit_plant(), dtm.P(1.5), delay=0.26, limit=1.0)
    smooth = loop.simulate(TIMES).outputs
    errors = [
        np.abs(loop.replace(sample_time=ts).simulate(TIMES).outputs - smooth).max()
        for ts in (4e-3, 2e-3, 1e-3)
    ]
    assert errors[2] < 2e-3
    # First order: the hold is a delay of half a sample.
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.1)


def test_a_reference_between_samples_waits_for_the_next_one():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.0, sample_time=0.1)
    times = np.linspace(0.0, 0.4, 9)
    found = loop.simulate(times, [1.0], reference_time=[0.13])
    assert found.outputs[:5].tolist() == [0.0] * 5
    assert found.inputs[4] == 1.0
    assert found.outputs[5] == pytest.approx(0.05, abs=1e-15)
    np.testing.assert_array_equal(found.reference, (times >= 0.13) * 1.0)


def test_reference_on_the_output_grid():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(1.3), delay=0.3)
    levels = np.where(TIMES < 1.0, 1.0, 0.5)
    on_grid = loop.simulate(TIMES, levels)
    jumps = loop.simulate(TIMES, [1.0, 0.5], reference_time=[0.0, 1.0])
    np.testing.assert_allclose(on_grid.outputs, jumps.outputs, rtol=0, atol=1e-15)


def test_first_order_plant_starts_at_rest_under_its_command():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.PI(0.3, 0.4), delay=0.2)
    found = loop.simulate(TIMES, 3.0, initial_output=3.0)
    # The integral takes over without a bump, so nothing moves.
    np.testing.assert_allclose(found.outputs, 3.0, atol=1e-14)
    np.testing.assert_allclose(found.inputs, 1.5, atol=1e-14)


# Poles and stability


@pytest.mark.parametrize(("kp", "delay"), [(1.31, 0.36), (2.4, 0.36), (5.0, 0.36), (2.4, 0.2)])
def test_responses_decay_with_the_rightmost_pole(kp, delay):
    """Continuous: s = W(-Kp Td)/Td."""
    pole = lambertw(-kp * delay) / delay
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(kp), delay=delay)
    assert decay(loop, 0.05) == pytest.approx(pole.real, abs=2e-5)


@pytest.mark.parametrize(
    "loop",
    [
        dtm.ControlLoop(INTEGRATOR, dtm.P(2.4), delay=0.36, sample_time=0.065),
        dtm.ControlLoop(dtm.kit_plant(), dtm.P(1.5), delay=0.26, sample_time=0.065),
        dtm.ControlLoop(
            INTEGRATOR,
            dtm.PV(3.2, 0.3, dtm.DerivativeFilter(38.0)),
            delay=0.36,
            sample_time=0.065,
        ),
        dtm.ControlLoop(dtm.FirstOrder(1.0, 0.5), dtm.PI(1.0, 3.0), delay=0.3, sample_time=0.1),
    ],
    ids=["p", "kit", "filtered pv", "pi"],
)
def test_sampled_responses_decay_with_the_abscissa(loop):
    assert decay(loop, loop.sample_time) == pytest.approx(loop.spectral_abscissa(), abs=2e-5)


def decay(loop, step):
    """Real part of the dominant pair from three-term recurrences late in a step response."""
    times = step * np.arange(int(8.0 / step))
    y = loop.simulate(times).outputs
    error = (y - 1.0)[len(y) * 5 // 8 :]
    recurrence = np.column_stack([error[1:-1], error[:-2]])
    _, product = np.linalg.lstsq(
        recurrence / np.abs(error[2:, None]).max(), error[2:] / np.abs(error[2:]).max()
    )[0]
    return math.log(-product) / (2.0 * step)


def test_transition_matrix_steps_the_loop():
    loop = dtm.ControlLoop(dtm.kit_plant(), dtm.PV(1.2, 0.1), delay=0.16, sample_time=0.065)
    matrix = loop.transition_matrix()
    assert matrix.shape == (5, 5)
    deviation = np.zeros(5)
    # At rest the second state of the observable form balances the first.
    deviation[:2] = [1.0, 5.820]
    found = loop.simulate(0.065 * np.arange(30), 0.0, initial_output=1.0)
    for k in range(30):
        assert found.outputs[k] == pytest.approx(deviation[0], abs=1e-13)
        deviation = matrix @ deviation


@pytest.mark.parametrize(
    ("delay", "sampled"), [(0.36, 4.024), (0.10, 12.46)], ids=["long delay", "short delay"]
)
def test_the_hold_costs_stability(delay, sampled):
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(0.5), delay=delay, sample_time=0.065)
    low, high = loop.stable_range("Kp")
    assert low == pytest.approx(0.0, abs=1e-12)
    assert high == pytest.approx(sampled, abs=5e-3 if delay == 0.1 else 5e-4)
    assert loop.replace(Kp=high * (1 - 1e-9)).is_stable()
    assert not loop.replace(Kp=high * (1 + 1e-9)).is_stable()


def test_range_of_the_delay_of_a_sampled_loop():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.36, sample_time=0.065)
    low, high = loop.stable_range("delay")
    assert low == 0.0
    assert loop.replace(delay=high - 1e-9).is_stable()
    assert not loop.replace(delay=high + 1e-9).is_stable()
    # A weak loop around a lag stands any delay.
    weak = dtm.ControlLoop(dtm.FirstOrder(1.0, 1.0), dtm.P(0.5), delay=0.1, sample_time=0.1)
    assert weak.stable_range("delay") == (0.0, math.inf)


def test_range_of_the_sample_time():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.0, sample_time=0.1)
    # 1 - Kp Ts > -1.
    low, high = loop.stable_range("sample_time")
    assert low == 0.0
    assert high == pytest.approx(1.0, rel=1e-12)
    late = loop.replace(delay=0.36)
    low, high = late.stable_range("sample_time")
    assert low == 0.0
    # z^2 - (1 - 2 (Ts - Td)) z + 2 Td = 0 meets z = -1 there.
    assert high == pytest.approx(1.72, rel=1e-12)


def test_sampled_poles_carry_their_rounding_error():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.1, sample_time=0.1)
    found = loop.rightmost(2)
    # z^2 - z + 0.2 = 0.
    z = np.roots([1.0, -1.0, 0.2])
    truth = np.sort(np.log(z) / 0.1)[::-1]
    assert (np.abs(np.asarray(found) - truth) <= found.radii).all()
    assert found.radii.max() < 1e-11
    assert found.resolved.all()
    pair = loop.replace(Kp=5.0).rightmost()
    assert len(pair) == pair.counted == 2
    assert pair[0] == pair[1].conjugate()
    assert pair[0].imag > 0.0


# Arguments


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"delay": -0.1}, r"delay=-0\.1 is negative"),
        ({"delay": math.nan}, "delay=nan"),
        ({"delay": math.inf}, "delay=inf"),
        ({"sample_time": 0.0}, r"sample_time=0\.0"),
        ({"sample_time": -1.0}, r"sample_time=-1\.0"),
        ({"limit": 0.0}, r"limit=0\.0"),
        ({"limit": -2.0}, r"limit=-2\.0"),
        ({"delay_path": "both"}, "delay_path='both'"),
    ],
)
def test_bad_numbers_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), **arguments)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: dtm.Integrator(gain=0.0), "gain=0"),
        (lambda: dtm.Integrator(lag=-0.1), "lag=-0.1"),
        (lambda: dtm.FirstOrder(time_constant=0.0), "time_constant=0"),
        (lambda: dtm.P(0.0), "Kp=0"),
        (lambda: dtm.PID(0.0, 0.0, 0.0), "Kp=0, Ki=0, Kd=0"),
        (lambda: dtm.P(math.inf), "Kp=inf"),
        (lambda: dtm.DerivativeFilter(0.0), "omega=0"),
        (lambda: dtm.RationalPlant([1.0, 0.0], [1.0]), "cannot differentiate"),
        (lambda: dtm.RationalPlant([0.0], [1.0]), "other than zero"),
        (
            lambda: dtm.ControlLoop(dtm.RationalPlant([1.0, 1.0], [1.0, 2.0]), dtm.PV(1.0, 0.1)),
            "no ideal derivative",
        ),
    ],
)
def test_bad_parts_are_named(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_wrong_types_are_refused():
    with pytest.raises(TypeError, match="plant="):
        dtm.ControlLoop(dtm.P(1.0), dtm.P(1.0))
    with pytest.raises(TypeError, match="controller="):
        dtm.ControlLoop(INTEGRATOR, INTEGRATOR)
    with pytest.raises(TypeError, match="filter="):
        dtm.PV(1.0, 0.1, filter=38.0)
    with pytest.raises(TypeError, match="Kp="):
        dtm.P("much")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda loop: loop.simulate([0.0, 1.0, 1.0]), "increasing"),
        (lambda loop: loop.simulate([]), "empty"),
        (lambda loop: loop.simulate([0.0, math.nan]), "time holds nan"),
        (lambda loop: loop.simulate([[0.0]]), "one-dimensional"),
        (lambda loop: loop.simulate([0.0], [1.0, 2.0]), "one value for"),
        (lambda loop: loop.simulate([0.0], 1.0, reference_time=[0.0]), "reference_time"),
        (lambda loop: loop.simulate([0.0], math.nan), "reference"),
        (lambda loop: loop.simulate([0.0], initial_output=math.inf), "initial_output=inf"),
        (lambda loop: loop.simulate([0.0], command_history=[1.0]), "sampled loops"),
        (lambda loop: loop.transition_matrix(), "characteristic"),
        (lambda loop: loop.replace(delay=None).simulate([0.0]), "delay of this loop is None"),
        (lambda loop: loop.replace(sample_time=0.1).characteristic(), "transition_matrix"),
        (lambda loop: loop.replace(delay=None).characteristic(), "delay of this loop is None"),
        (lambda loop: loop.stable_range("limit"), "'limit' is not"),
        (lambda loop: loop.rightmost(0), "n=0"),
        (lambda loop: loop.replace(Kd=1.0), "Kd: no such number"),
        (
            lambda loop: loop.replace(sample_time=0.1, Kp=9.0).stable_range("Kp"),
            "not stable at Kp=9",
        ),
        (lambda loop: loop.replace(Kp=50.0).simulate([0.0, 1e4]), "exceeds 1e150"),
        (
            lambda loop: loop.replace(sample_time=0.1).simulate([0.0], sample_phase=0.1),
            r"sample_phase=0\.1",
        ),
    ],
)
def test_bad_calls_say_what_to_do(call, message):
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.36)
    with pytest.raises(ValueError, match=message):
        call(loop)


def test_loops_are_values():
    loop = dtm.ControlLoop(INTEGRATOR, dtm.PV(2.0, 0.3, dtm.DerivativeFilter(38.0)))
    changed = loop.replace(delay=0.36, gain=0.9, omega=25.0, Kv=0.1, sample_time=0.065)
    assert loop.delay is None
    assert changed == dtm.ControlLoop(
        dtm.Integrator(0.9),
        dtm.PV(2.0, 0.1, dtm.DerivativeFilter(25.0)),
        delay=0.36,
        sample_time=0.065,
    )
    assert changed.parameters == {
        "gain": 0.9,
        "lag": 0.0,
        "Kp": 2.0,
        "Kv": 0.1,
        "omega": 25.0,
        "damping": 1.0,
        "delay": 0.36,
        "sample_time": 0.065,
    }
    assert changed.is_sampled
    assert not changed.continuous().is_sampled
    assert hash(changed) != hash(loop)
    with pytest.raises(AttributeError):
        loop.delay = 1.0
    with pytest.raises(ValueError, match="read-only"):
        changed.simulate([0.0, 1.0]).outputs[0] = 1.0


def test_the_kit_plant():
    num, den = dtm.kit_plant().polynomials()
    np.testing.assert_array_equal(num, [0.15265, 5.1529])
    np.testing.assert_array_equal(den, [1.0, 5.820, 0.0])
    plant = dtm.kit_plant().state_space()
    s = 0.3 + 2.0j
    value = plant.C @ np.linalg.solve(s * np.eye(2) - plant.A, plant.B)
    assert value == pytest.approx(np.polyval(num, s) / np.polyval(den, s), rel=1e-14)


@given(plants, controllers)
@settings(deadline=None, max_examples=60)
def test_equations_are_the_polynomials(plant, controller):
    """Loop gain and reference gain at a point of the plane, by both forms."""
    loop = dtm.ControlLoop(plant, controller, delay=0.1)
    model = loop._model
    s = 0.7 + 1.9j
    resolvent = np.linalg.inv(s * np.eye(len(model.B)) - model.A)
    from_command = model.K @ resolvent @ model.B + model.L
    from_reference = model.K @ resolvent @ model.E + model.M
    b, a = (np.polyval(p, s) for p in plant.polynomials())
    f, g = (np.polyval(p, s) for p in controller._feedback(controller.parameters))
    r, _ = (np.polyval(p, s) for p in controller._reference(controller.parameters))
    assert from_command == pytest.approx(-b / a * f / g, rel=1e-10)
    assert from_reference + s * model.impulse == pytest.approx(r / g, rel=1e-10)


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
    axes = response.plot(command=True)
    assert len(axes.lines) == 3
    matplotlib.pyplot.close(axes.figure)


# Continuous loops through their characteristic function


def test_characteristic_functions():
    s, delay = dtm.s, dtm.delay
    loop = dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.36)
    assert loop.characteristic() == s + 2.0 * delay(0.36)
    neutral = loop.replace(controller=dtm.PV(2.0, 0.3))
    assert neutral.characteristic() == s + (2.0 + 0.3 * s) * delay(0.36)
    lagged = dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.PI(1.0, 0.5), delay=0.1)
    assert lagged.characteristic() == 0.2 * s**3 + s**2 + (0.9 * s + 0.45) * delay(0.1)


@given(plants, controllers, st.sampled_from([0.1, 0.36]))
@settings(deadline=None, max_examples=30)
def test_characteristic_function_is_the_determinant(plant, controller, delay):
    """Up to the factor that the plant's and the controller's denominators leave."""
    loop = dtm.ControlLoop(plant, controller, delay=delay)
    model, h = loop._model, loop.characteristic()

    def determinant(s):
        n = len(model.B)
        matrix = np.zeros((n + 1, n + 1), dtype=complex)
        matrix[:n, :n] = s * np.eye(n) - model.A
        matrix[:n, n] = -model.B
        matrix[n, :n] = -model.K * np.exp(-s * delay)
        matrix[n, n] = 1.0 - model.L * np.exp(-s * delay)
        return np.linalg.det(matrix)

    points = [0.7 + 1.9j, -0.4 + 3.0j, 2.0 - 1.0j]
    ratios = [h(s) / determinant(s) for s in points]
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("loop", "name", "high"),
    [
        (dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.36), "Kp", math.pi / 0.72),
        (dtm.ControlLoop(INTEGRATOR, dtm.P(1.0), delay=0.10), "Kp", math.pi / 0.20),
        (dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.1), "delay", math.pi / 4.0),
        (dtm.ControlLoop(INTEGRATOR, dtm.P(2.0), delay=0.1), "gain", math.pi / 0.4),
    ],
)
def test_ranges_of_continuous_loops(loop, name, high):
    found = loop.stable_range(name)
    assert found[0] == 0.0
    assert found[1] == pytest.approx(high, rel=1e-12)


@pytest.mark.parametrize(
    ("derivative_filter", "high"), [(None, 0.9685), (dtm.DerivativeFilter(38.0), 0.890)]
)
def test_velocity_gain_of_the_paper(derivative_filter, high):
    """Armah & Yi: the largest Kv at Kp = 2, and what their filter costs."""
    loop = dtm.ControlLoop(INTEGRATOR, dtm.PV(2.0, 0.3, derivative_filter), delay=0.36)
    assert loop.stable_range("Kv")[1] == pytest.approx(high, abs=5e-4)
    abscissa = {None: -3.3168, dtm.DerivativeFilter(38.0): -2.197}[derivative_filter]
    assert loop.spectral_abscissa() == pytest.approx(abscissa, abs=5e-4)


def test_a_neutral_loop_needs_strong_stability():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 1.05), delay=0.36)
    assert not loop.is_stable()
    assert loop.replace(Kv=0.5).is_stable()


def test_stability_of_loops_without_a_delay():
    loop = dtm.ControlLoop(dtm.Integrator(1.0, 0.5), dtm.PI(1.0, 0.5), delay=0.0)
    # 0.5 s^3 + s^2 + s + Ki is stable for Ki < 2.
    assert loop.is_stable()
    assert loop.stable_range("Ki")[1] == pytest.approx(2.0, rel=1e-12)


@given(st.floats(0.5, 3.5), st.sampled_from([None, 0.1]))
@settings(deadline=None, max_examples=20)
def test_fast_sampling_has_the_poles_of_continuous_time(kp, lag):
    loop = dtm.ControlLoop(dtm.Integrator(lag=lag or 0.0), dtm.P(kp), delay=0.2)
    sampled = loop.replace(sample_time=1e-3).spectral_abscissa()
    # The hold is half a sample of delay, but for terms of Ts^2 |s|^3 / 12 about; next to a double
    # root (Kp 0.2 = 1/e) the poles move by the root of that.
    held = loop.replace(delay=0.2005).spectral_abscissa()
    assert sampled == pytest.approx(held, abs=0.02)


@given(plants, controllers)
@settings(deadline=None, max_examples=30)
def test_numbers_may_be_symbols(plant, controller):
    """Constant quasi-polynomials stand in for symbols: algebra is all they have."""
    loop = dtm.ControlLoop(plant, controller, delay=0.3)
    symbols = {
        name: value if name == "delay" else dtm.QuasiPolynomial([[value]], [0.0])
        for name, value in loop.parameters.items()
    }
    h, symbolic = loop.characteristic(), loop._characteristic(symbols)
    points = np.array([0.7 + 1.9j, -0.4 + 3.0j, 2.0 - 1.0j])
    np.testing.assert_allclose(symbolic(points), h(points), rtol=1e-12)


@pytest.mark.parametrize(
    ("plant", "controller"),
    [
        (dtm.Integrator(), dtm.PV(1.0, 0.2)),
        (dtm.Integrator(lag=0.1), dtm.PV(1.0, 0.2, dtm.DerivativeFilter(20.0))),
        (dtm.kit_plant(), dtm.PID(1.0, 0.2, 0.1, dtm.DerivativeFilter(20.0))),
        (dtm.RationalPlant([0.2, 1.0], [1.0, 1.0]), dtm.PI(0.5, 0.5)),
    ],
)
def test_grids_of_sampled_loops_are_their_single_loops(plant, controller):
    from deadtime._loop_stability import sampled_grid

    rng = np.random.default_rng(7)
    cells = 40
    loop = dtm.ControlLoop(plant, controller, delay=0.3, sample_time=0.065)
    values = {name: value * rng.uniform(0.3, 2.5, cells) for name, value in loop.parameters.items()}
    if "omega" in values:
        values["omega"] = rng.choice([15.0, 30.0], cells)
    values["damping"] = 1.0
    seen = []
    abscissa, unstable, status = sampled_grid(plant, controller, values, progress=seen.append)
    for i in range(cells):
        numbers = {n: np.atleast_1d(v)[i % np.size(v)] for n, v in values.items()}
        single = loop.replace(**{n: v for n, v in numbers.items() if n in loop.parameters})
        # Gains enter in another order here than there: a last place or two of the matrix.
        assert abscissa[i] == pytest.approx(single.spectral_abscissa(), rel=1e-9, abs=1e-9)
        assert unstable[i] == (np.abs(np.linalg.eigvals(single.transition_matrix())) > 1).sum()
        assert status[i] == 0
    shared = sampled_grid(plant, controller, values, threads=1)
    np.testing.assert_array_equal(shared[0], abscissa)


def test_many_jumps_are_the_sum_of_their_steps():
    """Breaks that have faded are forgotten, without a trace in the response."""
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


def test_limit_and_hold_do_not_see_the_impulse():
    pd = dtm.ControlLoop(INTEGRATOR, dtm.PD(1.6, 0.2), delay=0.36)
    pv = pd.replace(controller=dtm.PV(1.6, 0.2))
    for fields in ({"limit": 1.0}, {"sample_time": 0.065}):
        np.testing.assert_array_equal(
            pd.replace(**fields).simulate(TIMES).outputs,
            pv.replace(**fields).simulate(TIMES).outputs,
        )
    assert np.abs(pd.simulate(TIMES).outputs - pv.simulate(TIMES).outputs).max() > 0.1


def test_a_slow_crossing_of_the_limit_is_passed():
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
    with pytest.raises(ValueError, match="set to zero"):
        loop.simulate([0.0, 1.0])
