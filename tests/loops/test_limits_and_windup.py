"""Limits of the command, anti-windup, weights of the reference: every combination with a meaning.

The table of combinations is drawn by lot, a hundred by default and all as a survey; each loop meets
loads, a disturbance of the output and noise, and is compared with another simulator.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime.loops import BackCalculation, ConditionalIntegration, SweepStatus

from tests.support.simulated_loops import Diagram, simulated, transition, zeros_in

TIMES = np.linspace(0.0, 5.0, 51)
FILTER = (15.0, 0.8)
PLANTS = {
    "integrator": dtm.Integrator(1.2),
    "integrator with a lag": dtm.Integrator(0.9, 0.3),
    "lag": dtm.FirstOrder(2.0, 1.0),
    "two lags and a zero": dtm.FactoredPlant([0.8, 0.3], gain=1.5, zero=-0.2),
    "resonance": dtm.FactoredPlant(pole_frequency=3.0, pole_damping=0.3, gain=1.0),
    "lead": dtm.RationalPlant([0.3, 1.0], [0.5, 1.0]),
}
CONTROLLERS = ("P", "PV", "PV ideal", "PD", "PI", "PID")
PATHS = (
    (None, 0.0, False),
    (None, 0.3, False),
    (None, 0.3, True),
    (0.065, 0.0, False),
    (0.065, 0.3, False),
)
LIMITS = (None, 0.5, (-0.2, 0.6))
RATES = (None, 0.9)
GUARDS = (None, 1.5, "stop")
#: Weights b and c, and the gain of the feed-forward.
WEIGHTS = ((1.0, 1.0, 0.0), (0.6, 0.2, 0.3))


def has_a_meaning(case):
    plant, kind, (sample_time, delay, is_measured), limit, rate, guard, weights = case
    is_integral, is_direct = kind in ("PI", "PID"), plant == "lead"
    if guard and not (is_integral and (limit or rate)):
        return False
    if weights != WEIGHTS[0] and kind in ("P", "PV", "PV ideal"):
        return False
    # What passes its command straight on has no ideal derivative, and in continuous time no stopped
    # integral or limited rate; the other simulator has it with a delay alone.
    watched = sample_time is None and (rate or guard == "stop")
    if is_direct and (kind == "PV ideal" or watched or delay == 0.0 or is_measured):
        return False
    # An ideal derivative of a disturbed output is an impulse.
    return not (kind == "PV ideal" and (watched or plant == "two lags and a zero"))


CASES = [
    case
    for case in itertools.product(PLANTS, CONTROLLERS, PATHS, LIMITS, RATES, GUARDS, WEIGHTS)
    if has_a_meaning(case)
]
LOT = np.random.default_rng(5).permutation(len(CASES))[:100]


def both(case):
    """The loop, and the same for the other simulator."""
    plant, kind, (sample_time, delay, is_measured), limit, rate, guard, weights = case
    b, c, feed = weights
    gains = {"P": (0.8, 0.0, 0.0), "PI": (0.8, 0.6, 0.0), "PID": (0.8, 0.6, 0.15)}
    Kp, Ki, Kd = gains.get(kind, (0.8, 0.0, 0.15))
    if kind == "PV ideal":
        Kd = 0.1
    guarded = {None: None, "stop": ConditionalIntegration()}.get(guard) if guard != 1.5 else 1.5
    extra = {} if weights == WEIGHTS[0] else {"weight": b, "feed_forward": feed}
    more = {} if weights == WEIGHTS[0] else {"derivative_weight": c}
    smooth = dtm.DerivativeFilter(*FILTER)
    controller = {
        "P": lambda: dtm.P(Kp),
        "PV": lambda: dtm.PV(Kp, Kd, smooth),
        "PV ideal": lambda: dtm.PV(Kp, Kd),
        "PD": lambda: dtm.PD(Kp, Kd, smooth, **extra, **more),
        "PI": lambda: dtm.PI(Kp, Ki, **extra, anti_windup=guarded),
        "PID": lambda: dtm.PID(Kp, Ki, Kd, smooth, **extra, **more, anti_windup=guarded),
    }[kind]()
    loop = dtm.ControlLoop(
        PLANTS[plant],
        controller,
        delay=delay,
        sample_time=sample_time,
        limit=limit,
        rate_limit=rate,
        delay_path="measurement" if is_measured else "command",
    )
    num, den = PLANTS[plant].polynomials()
    low, high = loop.bounds
    diagram = Diagram(
        tuple(num),
        tuple(den),
        Kp,
        Ki,
        Kd,
        smooth=None if kind == "PV ideal" else FILTER,
        weight=b,
        derivative_weight=0.0 if kind.startswith("PV") else c,
        feed_forward=feed,
        delay=delay,
        is_measured=is_measured,
        sample_time=sample_time,
        low=low,
        high=high,
        rate=rate or np.inf,
        windup=guard,
        reference=((0.0, 1.0), (3.1, 0.4)),
        load=((1.03, 0.4), (2.21, -0.3)),
        output=() if kind == "PV ideal" else ((4.0, 0.2),),
        noise=() if kind == "PV ideal" else ((0.7, 0.02),),
    )
    return loop, diagram


def compare(case):
    loop, diagram = both(case)
    outputs, commands = simulated(diagram, TIMES)
    jumps = {
        name: tuple(np.array(given).T)
        for name, given in (
            ("load", diagram.load),
            ("output_disturbance", diagram.output),
            ("noise", diagram.noise),
        )
        if given
    }
    when, values = np.array(diagram.reference).T
    found = loop.simulate(TIMES, values, reference_time=when, reference_before=0.0, **jumps)
    scale = 1.0 + np.abs(outputs).max()
    np.testing.assert_allclose(found.outputs, outputs, rtol=0, atol=1e-9 * scale)
    # At a jump of its reference a command may be that before or after.
    steady = np.abs(TIMES - 3.1) > 1e-9
    np.testing.assert_allclose(found.inputs[steady], commands[steady], rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("place", LOT)
def test_a_loop_drawn_by_lot_agrees_with_another_simulator(place):
    compare(CASES[place])


@pytest.mark.survey
@pytest.mark.long
@pytest.mark.parametrize("kind", CONTROLLERS)
@pytest.mark.parametrize("plant", PLANTS)
def test_every_combination_agrees_with_another_simulator(plant, kind):
    cases = [case for case in CASES if case[:2] == (plant, kind)]
    for case in cases:
        compare(case)
    assert cases or (kind == "PV ideal" and plant in ("lead", "two lags and a zero"))


LINEAR = [case for case in CASES if case[3:] == (None, None, None, WEIGHTS[0])]


@pytest.mark.parametrize("case", LINEAR, ids=lambda case: f"{case[0]}, {case[1]}, {case[2]}")
def test_poles_where_the_delay_is_a_fifth_longer(case):
    """Against eigenvalues of one sample, or the zeros to the right of two lines."""
    loop, diagram = both(case)
    loop = loop.replace(delay=1.2 * loop.delay)
    diagram = dataclasses.replace(diagram, delay=loop.delay)
    abscissa = loop.spectral_abscissa()
    assert loop.is_stable() == (abscissa < 0.0)
    if loop.sample_time:
        largest = np.abs(np.linalg.eigvals(transition(diagram))).max()
        assert abscissa == pytest.approx(math.log(largest) / loop.sample_time, abs=1e-7)
        return
    close = 1e-6 * (1.0 + abs(abscissa))
    assert zeros_in(diagram, abscissa + close, abscissa + 60.0, 300.0) == 0
    assert zeros_in(diagram, abscissa - close, abscissa + 60.0, 300.0) >= 1


def wound(guard, sample_time=None, limit=(-0.2, 0.2)):
    controller = dtm.PI(1.0, 0.5, anti_windup=guard)
    return dtm.ControlLoop(
        dtm.Integrator(), controller, delay=0.1, sample_time=sample_time, limit=limit
    )


@pytest.mark.parametrize("sample_time", [None, 0.05])
def test_an_integrator_at_its_limit_winds_up_and_does_not_with_a_remedy(sample_time):
    """In simulation, in the metrics of a sweep and in load responses alike."""
    times = np.linspace(0.0, 60.0, 6001)
    found = {}
    for name, guard in (("none", None), ("back", 2.0), ("stop", ConditionalIntegration())):
        loop = wound(guard, sample_time)
        response = loop.simulate(times)
        overshoot = 100.0 * (response.outputs.max() - 1.0)
        swept = dtm.sweep(loop, {"Kp": np.array([1.0, 1.1])})
        assert (swept.status == SweepStatus.OK).all()
        assert swept["overshoot"][0] == pytest.approx(overshoot, abs=1e-2)
        assert response.info()["overshoot"] == pytest.approx(overshoot, abs=1e-2)
        # A load beyond the limit for a while, and then none.
        pulse = loop.simulate(times, 0.0, load=([0.0, 5.0], [-0.5, 0.0])).outputs
        found[name] = overshoot, float(pulse.max())
    assert found["none"][0] > 60.0
    assert found["back"][0] < 14.0
    assert found["stop"][0] < 6.0
    assert max(found["back"][1], found["stop"][1]) < 0.5 * found["none"][1]


def test_back_calculation_is_the_integral_that_its_equation_has():
    """u = Kp e + I with I' = Ki e + (v - u)/Tt, integrated from the signals themselves."""
    loop = wound(2.0)
    times = np.linspace(0.0, 10.0, 20_001)
    response = loop.simulate(times)
    error, v = 1.0 - response.outputs, response.inputs
    integral, step = 0.0, times[1]
    computed = np.empty_like(v)
    for i, e in enumerate(error):
        u = 1.0 * e + integral
        computed[i] = np.clip(u, -0.2, 0.2)
        integral += step * (0.5 * e + (v[i] - u) / 2.0)
    np.testing.assert_allclose(computed, v, atol=1e-3)


@pytest.mark.parametrize("guard", [None, BackCalculation(1.0), ConditionalIntegration()])
def test_a_loop_with_short_samples_is_close_to_a_continuous_one(guard):
    """The rules of sampled and of continuous controllers are one in the limit."""
    times = np.linspace(0.0, 12.0, 121)
    errors = []
    for sample_time in (0.01, 0.005):
        loops = [
            dtm.ControlLoop(
                dtm.Integrator(1.0, 0.2),
                dtm.PI(1.0, 0.5, anti_windup=guard),
                delay=0.1,
                sample_time=sampled,
                limit=(-0.1, 0.3),
                rate_limit=0.4,
            )
            for sampled in (None, sample_time)
        ]
        continuous, sampled = (one.simulate(times).outputs for one in loops)
        errors.append(np.abs(continuous - sampled).max())
    assert errors[0] < 0.01
    assert errors[1] < 0.7 * errors[0]


def test_a_rate_limit_makes_ramps():
    """P control of an integrator at rest: v = R t until it meets Kp (1 - y), y = R (t - T)^2/2."""
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.5, rate_limit=1.0)
    times = np.array([0.25, 0.5, 1.0, 1.25])
    response = loop.simulate(np.array([0.0, *times]))
    np.testing.assert_allclose(response.inputs[1:], times, atol=1e-12)
    truth = 0.5 * np.clip(times - 0.5, 0.0, None) ** 2
    np.testing.assert_allclose(response.outputs[1:], truth, atol=1e-12)


def test_weights_and_feed_forward_change_the_response_to_the_reference_alone():
    plain = dtm.ControlLoop(dtm.FirstOrder(2.0, 1.0), dtm.PI(1.0, 0.8), delay=0.2)
    other = plain.replace(controller=dtm.PI(1.0, 0.8, weight=0.4, feed_forward=0.1))
    assert other.characteristic() == plain.characteristic()
    assert other.load_response().iae == plain.load_response().iae
    # A feed-forward is a weight of the reference for a proportional term.
    same = plain.replace(controller=dtm.PI(1.0, 0.8, weight=0.5))
    np.testing.assert_allclose(
        other.simulate(TIMES).outputs, same.simulate(TIMES).outputs, atol=1e-13
    )
    gain = other.simulate(np.linspace(0.0, 60.0, 11), lambda t: np.sin(0.7 * t)).outputs[-1]
    s = 0.7j
    G, late = 2.0 / (s + 1.0), np.exp(-0.2 * s)
    T = G * late * (0.5 + 0.8 / s) / (1.0 + G * late * (1.0 + 0.8 / s))
    assert gain == pytest.approx((T * np.exp(s * 60.0)).imag, abs=1e-9)
    assert other.parameters["weight"] == 0.4
    assert other.replace(weight=0.2).controller.weight == 0.2


def test_slopes_by_numbers_of_a_guarded_loop_are_those_of_differences():
    loop = wound(2.0).replace(rate_limit=0.8)
    times = np.linspace(0.0, 8.0, 17)
    for name in ("Kp", "delay", "tracking_time", "rate_limit", "limit"):
        value, step = loop.parameters[name], 1e-5
        slopes = loop.simulate(times, sensitivities=(name,)).sensitivities[name]
        ends = [
            loop.replace(**{name: value + way}).simulate(times).outputs for way in (step, -step)
        ]
        np.testing.assert_allclose(slopes, (ends[0] - ends[1]) / (2 * step), atol=2e-4)


def test_computation_time_is_delay():
    late = dtm.ControlLoop(
        dtm.Integrator(), dtm.P(1.0), delay=0.1, sample_time=0.05, computation_time=0.02
    )
    assert late.delay == pytest.approx(0.12)


def test_what_has_no_meaning_is_refused_with_the_reason():
    loop = wound(2.0, limit=(-0.1, 0.3))
    assert loop.bounds == (-0.1, 0.3)
    assert loop.parameters["limit_low"] == -0.1
    assert loop.replace(limit_high=0.4).bounds == (-0.1, 0.4)
    with pytest.raises(ValueError, match="the same limit for positive and negative"):
        _ = -loop.limit
    with pytest.raises(ValueError, match="zero between"):
        loop.replace(limit=(0.1, 0.3))
    with pytest.raises(ValueError, match="rate_limit=-1"):
        loop.replace(rate_limit=-1.0)
    with pytest.raises(TypeError, match="anti_windup='always'"):
        dtm.PI(1.0, 0.5, anti_windup="always")
    with pytest.raises(ValueError, match="anti_windup"):
        dtm.simulate_fixed_step(loop, 1.0, step=0.01)
    with pytest.raises(ValueError, match="conditional integration"):
        wound(ConditionalIntegration()).simulate(TIMES, sensitivities=("Kp",))
    with pytest.raises(ValueError, match="computation_time"):
        dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), computation_time=0.1)


def test_a_sweep_over_guarded_loops_is_that_of_each():
    loop = wound(2.0, sample_time=0.05, limit=(-0.1, 0.3)).replace(rate_limit=0.5)
    values = {"Kp": np.array([0.6, 1.0]), "rate_limit": np.array([0.2, 0.5])}
    outputs = dtm.sweep(loop, values, TIMES, responses=True).outputs
    measured = dtm.sweep(loop, values)
    for i in range(2):
        one = loop.replace(**{name: float(array[i]) for name, array in values.items()})
        np.testing.assert_allclose(outputs[i], one.simulate(TIMES).outputs, atol=1e-13)
        info = one.step_response(np.linspace(0.0, 60.0, 6001)).info()
        assert measured["overshoot"][i] == pytest.approx(info["overshoot"], abs=1e-3)
        assert measured["settling_time"][i] == pytest.approx(info["settling_time"], abs=1e-3)


def test_an_array_of_two_bounds_is_a_limit():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.3, limit=np.array([-1.0, 2.0]))
    assert loop.specification.bounds == (-1.0, 2.0)
    with pytest.raises(ValueError, match="the least and the greatest command"):
        loop.replace(limit=np.array([1.0, 2.0, 3.0]))
