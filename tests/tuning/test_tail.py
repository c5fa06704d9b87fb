"""Bounds on a response after the end of its simulation, against longer simulations."""

import deadtime as dtm
import numpy as np
from deadtime.loops._runs import LoopRun
from deadtime.tuning._tail import Fundamental, tail_bound
from hypothesis import assume, example, given, settings, strategies as st
from loops import loops

#: Steps of a simulation in a delay.
FINE = 20

LAGGING = dtm.ControlLoop(dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.3)


@settings(max_examples=25, deadline=None)
@given(loop=loops(st.sampled_from([None, 2.0])), times=st.floats(1.0, 8.0))
def test_the_tail_is_bounded(loop, times):
    try:
        abscissa = loop.spectral_abscissa()
    except ValueError:
        assume(False)
    assume(-50.0 < abscissa < -0.05)
    end = times / -abscissa
    bound = tail_bound(loop, 1.0, end)
    response = loop.step_response(np.linspace(0.0, 6.0 * end + 10.0 / -abscissa, 4001))
    if np.isfinite(bound):
        assert response.steady_state is not None
        after = np.abs(response.outputs - response.steady_state)[response.time >= end].max()
        assert after <= bound * (1.0 + 1e-6) + 1e-11


def test_the_unit_of_the_command_changes_no_bound():
    """States in other units than the transition of a sample: 5.8 times the bound, or none."""
    bounds = []
    for unit in (1.0, 100.0, 1e3, 0.02):
        controller = dtm.PID(0.5 / unit, 0.01 / unit, 0.025 / unit, dtm.DerivativeFilter(80.0))
        plant = dtm.Integrator(unit, 0.05)
        loop = dtm.ControlLoop(plant, controller, delay=0.1, sample_time=0.05, limit=100.0 / unit)
        bounds.append(tail_bound(loop, 1.0, 10.0))
    np.testing.assert_allclose(bounds, bounds[0], rtol=1e-6)
    assert bounds[0] < 1.0


@settings(max_examples=40, deadline=None)
@given(
    loop=loops(),
    state=st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5),
    pulse=st.sampled_from([0.0, 1.0]),
    delays=st.sampled_from([1, 2, 4]),
)
@example(loop=LAGGING, state=[0.0] * 5, pulse=1.0, delays=1)
@example(loop=LAGGING.replace(lag=0.0, Kp=12.0), state=[1.0] * 5, pulse=0.0, delays=2)
@example(
    loop=LAGGING.replace(lag=0.0, controller=dtm.PI(12.0, 0.1)),
    state=[1.0, 0.0, 0.0, 0.0, 0.0],
    pulse=0.0,
    delays=2,
)
def test_a_period_is_bounded_by_what_it_begins_with(loop, state, pulse, delays):
    assume(loop.delay > 0.0)
    model, late = loop.continuous().specification.model, loop.delay
    n = len(model.B)
    Q, outputs, commands = Fundamental(model, late).bounds(delays)
    # Either nothing is under way when the period begins, or a pulse of the reference is.
    h, begin = late / FINE, FINE if pulse else 0
    time = h * np.arange(begin + delays * FINE + 1)
    jumps = h * np.array([0.0, FINE - 4, FINE])
    run = LoopRun(np.array(state[:n]), 0.0, 0.0, np.array([0.0, pulse, 0.0]), jumps)
    rows = [model._replace(C=row, D=0.0) for row in np.eye(n)]
    x = np.array([one.native(late, None, None).outputs(time, run) for one in rows])
    # Commands from one delay before the first time on.
    u = np.concatenate([np.zeros(FINE), model.K @ x])
    u[2 * FINE - 4 : 2 * FINE] += model.M * pulse
    for i in range(2 * FINE, u.size):
        u[i] += model.L * u[i - FINE]
    y = model.C @ x + model.D * u[: x.shape[1]]

    def sizes(i, under_way, least):
        parts = h * least(under_way[1:], under_way[:-1])
        return np.array([*np.abs(x[:, i]), parts.sum(), under_way.max()])

    first = np.abs(u[begin : begin + FINE + 1])
    if not pulse:
        first[-1] = 0.0
    before = sizes(begin, first, np.maximum) * (1.0 + 1e-9) + 1e-12
    after = sizes(-1, np.abs(u[-FINE - 1 :]), np.minimum)
    assert (after <= Q @ before).all()
    assert np.abs(y[begin:]).max() <= outputs @ before
    assert np.abs(u[begin + FINE :]).max() <= commands @ before


def test_the_tail_bound_is_of_use():
    for period in (None, 0.05):
        for controller in (dtm.PI(1.0, 0.2), dtm.PV(1.5, 0.2), dtm.P(1.5)):
            loop = LAGGING.replace(sample_time=period, controller=controller)
            end = 8.0 / -loop.spectral_abscissa()
            time, y = loop.step_response(np.linspace(0.0, 3.0 * end, 4001))
            assert tail_bound(loop, 1.0, end) < 12.0 * np.abs(y - 1.0)[time >= end].max()


def test_a_tail_that_may_meet_the_limit_is_not_proved():
    loop = dtm.ControlLoop(
        dtm.FirstOrder(1.0, 1.0), dtm.PI(1.0, 1.0), delay=0.3, sample_time=0.05, limit=1.0
    )
    # The rest itself is at the limit.
    assert tail_bound(loop, 1.0, 60.0) == np.inf
    assert tail_bound(loop, 0.9, 60.0) < 1e-3
