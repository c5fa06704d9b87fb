"""Control loops: properties of their responses, their arguments and values."""

from __future__ import annotations

import inspect
import math

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from loops import INTEGRATOR, TIMES, controllers, loops, plants


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
        (lambda: dtm.Integrator(gain=0.0), "gain=0: a plant whose gain is zero"),
        (lambda: dtm.Integrator(lag=-0.1), "lag=-0.1"),
        # It was told that the loop is open without a time constant.
        (lambda: dtm.FirstOrder(1, 0), "time_constant=0: then the plant is only a gain"),
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


def test_a_controller_says_what_it_takes_in_place_of_another_name():
    with pytest.raises(TypeError, match=r"PI has no 'kp': it takes Kp, Ki, weight, "):
        dtm.PI(kp=0.75)
    with pytest.raises(TypeError, match=r"PI has no 'Ti': it takes .*; Ki = Kp/Ti$"):
        dtm.PI(Kp=0.75, Ti=37.5)
    with pytest.raises(TypeError, match=r"PD has no 'Td': .*; Kd = Kp Td$"):
        dtm.PD(Kp=0.75, Td=3.0)
    with pytest.raises(TypeError, match=r"P has no 'Ti': it takes Kp, feed_forward$"):
        dtm.P(Kp=0.75, Ti=37.5)
    assert list(inspect.signature(dtm.PI).parameters)[:2] == ["Kp", "Ki"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda loop: loop.simulate([0.0, 1.0, 1.0]), "increasing"),
        (lambda loop: loop.simulate([]), "empty"),
        (lambda loop: loop.simulate([0.0, math.nan]), "time contains NaN"),
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
        (lambda loop: loop.replace(Kd=1.0), "Kd: this loop has no such parameter"),
        (
            lambda loop: loop.replace(sample_time=0.1, Kp=9.0).stable_range("Kp"),
            "at Kp=9",
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


def test_a_response_does_not_change_with_the_arrays_of_its_call():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36)
    time, reference = np.linspace(0.0, 8.0, 33), np.linspace(1.0, 0.2, 33)
    response = loop.simulate(time, reference)
    other = loop.simulate(time.copy(), reference.copy())
    kept, info = time.copy(), other.info()
    time *= 2.0
    reference[:] = 5.0
    np.testing.assert_array_equal(response.time, kept)
    assert response.info() == pytest.approx(info, rel=0.0, abs=0.0, nan_ok=True)


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
    model = loop.specification.model
    s = 0.7 + 1.9j
    resolvent = np.linalg.inv(s * np.eye(len(model.B)) - model.A)
    from_command = model.K @ resolvent @ model.B + model.L
    from_reference = model.K @ resolvent @ model.E + model.M
    b, a = (np.polyval(p, s) for p in plant.polynomials())
    feedback, h = controller.transfer_function(), loop.characteristic()
    f, g = feedback.num(s), feedback.den(s)
    assert from_command == pytest.approx(-b / a * f / g, rel=1e-10)
    # The reference reaches the command by R = r/g, and the output by b r e^(-s T)/h.
    r = loop.closed_loop()(s) * h(s) / (b * np.exp(-0.1 * s))
    assert from_reference + s * model.impulse == pytest.approx(r / g, rel=1e-10)
