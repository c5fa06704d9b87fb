"""Responses to an impulse against closed forms, other methods and the step response."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from scipy import signal

TIMES = np.linspace(0.0, 5.0, 101)


def test_of_a_delayed_lag_is_its_exponential():
    found = (2.0 * delay(0.53) / (s + 1.5)).impulse_response(TIMES)
    late = TIMES - 0.53
    truth = np.where(late >= 0.0, 2.0 * np.exp(-1.5 * np.maximum(late, 0.0)), 0.0)
    np.testing.assert_allclose(found.outputs, truth, atol=1e-13)
    assert found.steady_state == 0.0
    assert not found.inputs.any()


def test_of_a_system_without_delay_agrees_with_scipy():
    rng = np.random.default_rng(2)
    A, B, C = rng.normal(size=(4, 4)) - 2.0 * np.eye(4), rng.normal(size=(4, 2)), np.eye(4)[:3]
    for index in (0, 1):
        found = dtm.DelaySystem(A, B, C).impulse_response(TIMES, input=index)
        each = [signal.StateSpace(A, B[:, [index]], row[None], [[0.0]]) for row in C]
        truth = np.stack([signal.impulse(one, T=TIMES)[1] for one in each])
        np.testing.assert_allclose(found.outputs, truth, atol=1e-9)


def test_of_a_system_and_its_transfer_function_agree():
    system = dtm.DelaySystem(
        {0.0: [[0, 1], [-4, -0.4]], 0.5: [[0, 0], [1.5, 0]]},
        {0.2: [[0], [1.0]]},
        {0.0: [[1.0, 0.0]], 0.1: [[0.0, 0.3]]},
        N={0.7: [[0, 0], [0, 0.2]]},
    )
    one, other = system.impulse_response(TIMES), system.transfer_function().impulse_response(TIMES)
    np.testing.assert_allclose(one.outputs, other.outputs, atol=1e-11)


def test_is_the_derivative_of_the_step_response():
    loop = dtm.feedback(2.0 / s * delay(0.36))
    fine = np.linspace(0.0, 5.0, 5001)
    step, impulse = loop.step_response(fine).outputs, loop.impulse_response(fine).outputs
    area = np.concatenate([[0.0], np.cumsum(0.5 * (impulse[1:] + impulse[:-1]) * 1e-3)])
    assert np.abs(area - step).max() < 2e-3


def test_the_default_time_ends_where_it_has_settled():
    found = (1.0 / (s + 1.0)).impulse_response()
    assert 5.0 <= found.time[-1] <= 40.0
    washed_out = (s / (s + 1.0)).step_response()
    assert 5.0 <= washed_out.time[-1] <= 40.0


def test_direct_feedthrough_is_refused():
    with pytest.raises(ValueError, match="contains an impulse"):
        ((s + 2.0) / (s + 1.0)).impulse_response()
    with pytest.raises(ValueError, match="D is not zero"):
        dtm.DelaySystem(-1.0, 1.0, D=1.0).impulse_response()


def test_one_class_of_responses():
    G = 1.0 / (s + 1.0)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.2)
    of_system, of_loop = G.step_response([0.0, 1.0]), loop.step_response([0.0, 1.0])
    assert type(of_system) is type(of_loop) is dtm.systems.Response
    assert repr(of_system) == "<Response: 1 output at 2 times, 0 to 1 s, steady state 1>"
    assert of_system.reference is None
    assert of_loop.states is None
    two = dtm.DelaySystem([[-1, 0], [0, -2]], {0: np.eye(2)}).step_response(TIMES)
    assert two.outputs.shape == (2, 101)
    assert two.info(1)["steady_state"] == 0.0
    np.testing.assert_allclose(two.steady_state, [1.0, 0.0])
    with pytest.raises(IndexError, match="output=2"):
        two.info(2)
