"""Steps that are proved to stay in their bands, against longer simulations."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.tuning._native import proved_step
from hypothesis import assume, given, settings, strategies as st
from loops import loops

LAGGING = dtm.ControlLoop(dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.3)


def proved(loop, amplitude=1.0):
    return proved_step(loop.specification.kernel, amplitude)


@settings(max_examples=40, deadline=None)
@given(loop=loops(st.sampled_from([None, 2.0])))
def test_a_proved_step_stays_in_its_band(loop):
    step = proved(loop)
    assume(step is not None)
    settled, overshoot = step
    end = max(settled, 10.0 / -loop.spectral_abscissa())
    time = np.unique([0.0, *np.linspace(settled, 6.0 * end, 4001)])
    response = loop.step_response(time)
    rest = response.steady_state
    after = response.outputs[time >= settled * (1.0 + 1e-9)]
    assert np.abs(after - rest).max() <= 0.02 * abs(rest) * (1.0 + 1e-6)
    assert (after.max() - rest) / abs(rest) <= 0.01 * overshoot + 5e-4 or rest < 0.0


def test_the_unit_of_the_command_changes_no_proof():
    """States in other units than the transition of a sample: 5.8 times the bound, or none."""
    found = []
    for unit in (1.0, 100.0, 1e3, 0.02):
        controller = dtm.PID(0.5 / unit, 0.01 / unit, 0.025 / unit, dtm.DerivativeFilter(80.0))
        plant = dtm.Integrator(unit, 0.05)
        loop = dtm.ControlLoop(plant, controller, delay=0.1, sample_time=0.05, limit=100.0 / unit)
        found.append(proved(loop))
    np.testing.assert_allclose(found, [found[0]] * 4, rtol=1e-6)


@pytest.mark.parametrize("period", [None, 0.05])
@pytest.mark.parametrize("controller", [dtm.PI(1.0, 0.2), dtm.PV(1.5, 0.2), dtm.P(1.5)])
def test_the_proof_is_of_use(period, controller):
    assert proved(LAGGING.replace(sample_time=period, controller=controller)) is not None


def test_a_step_that_may_meet_the_limit_is_not_proved():
    loop = dtm.ControlLoop(
        dtm.FirstOrder(1.0, 1.0), dtm.PI(1.0, 1.0), delay=0.3, sample_time=0.05, limit=1.0
    )
    # The rest itself is at the limit.
    assert proved(loop, 1.0) is None
    assert proved(loop, 0.9) is not None
