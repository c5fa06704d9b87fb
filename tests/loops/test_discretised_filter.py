"""A derivative filter that runs on samples, for each discretisation rule."""

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import cont2discrete

TS = 0.065
RULES = {"hold": "zoh", "tustin": "bilinear", "backward": "backward_diff"}


def by_recursion(rule, Kp, Kv, omega, damping, delay, limit, samples, on_error=False):
    """The loop sample by sample: the filter as a difference equation, the integrator as sums."""
    num, den, _ = cont2discrete(
        ([omega**2, 0.0], [1.0, 2 * damping * omega, omega**2]), TS, method=RULES[rule]
    )
    num = np.ravel(num)
    heights, commands, seen, slopes = [0.0], [], [], []

    def arriving(t):
        """The integral of the delayed command up to t."""
        total = 0.0
        for k, u in enumerate(commands):
            start = k * TS + delay
            total += u * min(max(t - start, 0.0), TS)
        return total

    for k in range(samples):
        height = arriving(k * TS)
        heights.append(height)
        seen.append(height - 1.0 if on_error else height)
        past = [seen[k - i] if k >= i else 0.0 for i in range(3)]
        late = [slopes[k - i] if k >= i else 0.0 for i in range(1, 3)]
        slope = float(num @ past[: len(num)] - den[1:] @ late)
        slopes.append(slope)
        commands.append(float(np.clip(Kp * (1.0 - height) - Kv * slope, -limit, limit)))
    return np.array(heights[1:])


@settings(max_examples=30)
@given(
    rule=st.sampled_from(sorted(RULES)),
    Kp=st.floats(0.2, 2.5),
    Kv=st.floats(0.0, 0.3),
    omega=st.floats(5.0, 60.0),
    damping=st.floats(0.4, 1.5),
    delay=st.floats(0.0, 0.5),
    limited=st.booleans(),
)
def test_the_loop_is_that_of_the_difference_equation(rule, Kp, Kv, omega, damping, delay, limited):
    limit = 0.8 if limited else 1e6
    loop = dtm.ControlLoop(
        dtm.Integrator(),
        dtm.PV(Kp, Kv, dtm.DerivativeFilter(omega, damping, discretisation=rule)),
        delay=delay,
        sample_time=TS,
        limit=limit,
    )
    samples = 60
    found = loop.simulate(TS * np.arange(samples)).outputs
    truth = by_recursion(rule, Kp, Kv, omega, damping, delay, limit, samples)
    # Sixty samples of rounding; a loop that grows has its rounding grow with it.
    size = max(1.0, np.abs(truth).max())
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize("rule", sorted(RULES))
def test_poles_are_those_of_the_simulated_loop(rule):
    loop = dtm.ControlLoop(
        dtm.Integrator(),
        dtm.PV(1.5, 0.1, dtm.DerivativeFilter(38.0, discretisation=rule)),
        delay=0.36,
        sample_time=TS,
    )
    steps = 240
    outputs = 1.0 - loop.simulate(TS * np.arange(steps)).outputs
    # Late differences obey the recursion of the transition matrix (Cayley and Hamilton).
    polynomial = np.poly(loop.transition_matrix())
    n = len(polynomial) - 1
    rows = np.lib.stride_tricks.sliding_window_view(outputs[10:120], n + 1)[:, ::-1]
    assert np.abs(rows @ polynomial).max() < 1e-12
    assert loop.rightmost().roots[0].real == pytest.approx(loop.spectral_abscissa(), abs=1e-9)


def test_a_derivative_of_the_error_sees_the_reference():
    kick = dtm.ControlLoop(
        dtm.Integrator(),
        dtm.PD(1.0, 0.2, dtm.DerivativeFilter(20.0, discretisation="tustin")),
        delay=0.2,
        sample_time=TS,
    )
    response = kick.simulate(TS * np.arange(200))
    num, _, _ = cont2discrete(([400.0, 0.0], [1.0, 40.0, 400.0]), TS, method="bilinear")
    # The first command: proportional, and the filter's direct path on the step of the error.
    assert response.inputs[0] == pytest.approx(1.0 + 0.2 * np.ravel(num)[0], rel=1e-12)
    assert response.outputs[-1] == pytest.approx(1.0, abs=0.02)
    assert response.steady_state == pytest.approx(1.0, abs=1e-12)


def test_a_loop_at_rest_stays_at_rest():
    for rule in RULES:
        loop = dtm.ControlLoop(
            dtm.Integrator(),
            dtm.PV(1.5, 0.1, dtm.DerivativeFilter(38.0, discretisation=rule)),
            delay=0.36,
            sample_time=TS,
        )
        response = loop.simulate(np.linspace(0.0, 3.0, 50), 2.0, initial_output=2.0)
        assert np.abs(response.outputs - 2.0).max() < 1e-12


def test_fast_sampling_comes_to_the_continuous_filter():
    def settled(rule, sample_time):
        loop = dtm.ControlLoop(
            dtm.Integrator(),
            dtm.PV(2.0, 0.19, dtm.DerivativeFilter(38.0, discretisation=rule)),
            delay=0.36,
            sample_time=sample_time,
        )
        return loop.simulate(np.linspace(0.0, 3.0, 61)).outputs

    for rule, least in (("hold", 1.7), ("tustin", 1.7), ("backward", 1.7)):
        exact = settled(None, 1e-4)
        errors = [np.abs(settled(rule, ts) - exact).max() for ts in (4e-3, 2e-3)]
        # Of first order at least, the hold of the loop itself included.
        assert errors[0] / errors[1] > least, rule
        assert errors[1] < 0.01


def test_the_rule_belongs_to_the_hold():
    smooth = dtm.DerivativeFilter(38.0, discretisation="tustin")
    plain = dtm.DerivativeFilter(38.0)
    sampled = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.19, smooth), delay=0.36)
    assert sampled.continuous().spectral_abscissa() == pytest.approx(
        dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.19, plain), delay=0.36).spectral_abscissa()
    )
    assert sampled.replace(Kv=0.1).controller.filter.discretisation == "tustin"


def test_what_cannot_run_it_says_so():
    smooth = dtm.DerivativeFilter(38.0, discretisation="tustin")
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.19, smooth), delay=0.36, sample_time=TS)
    with pytest.raises(ValueError, match="a sweep cannot"):
        dtm.sweep(loop, {"Kp": (1.0, 2.0, 2)}, [0.0, 1.0])
    with pytest.raises(ValueError, match="sensitivities cannot"):
        loop.simulate([0.0, 1.0], sensitivities=("Kp",))
    with pytest.raises(ValueError, match="a map cannot"):
        dtm.stability_map(loop, {"Kp": (1, 2), "Kv": (0, 1)}, shape=(3, 3))
    with pytest.raises(ValueError, match="fixed steps cannot"):
        dtm.simulate_fixed_step(loop, 1.0, step=0.065)
    with pytest.raises(ValueError, match="discretisation='euler'"):
        dtm.DerivativeFilter(38.0, discretisation="euler")
