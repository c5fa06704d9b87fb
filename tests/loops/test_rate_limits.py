"""Plants that limit the rate of their command: what becomes of a command, and what is refused."""

import math
from itertools import pairwise

import deadtime as dtm
import numpy as np
import pytest

STEP = (np.array([-1.0, 0.0, 2.0]), np.array([0.0, 1.0, 1.0]))


def means(exact, time):
    """Means of a function over pieces, by Simpson's rule on 200 parts of each."""
    found = []
    for low, high in pairwise(time):
        points = np.linspace(low, high, 401)
        weights = np.r_[1.0, np.tile([4.0, 2.0], 200)[:-1], 1.0]
        found.append(sum(w * exact(t) for w, t in zip(weights, points, strict=True)) / 1200.0)
    return np.array(found)


def test_with_a_limit_of_the_rate_a_step_becomes_a_ramp():
    time, command = dtm.RateLimited(dtm.Integrator(), rate=2.0).limited(*STEP)
    np.testing.assert_allclose(
        command[:-1], means(lambda t: min(max(2.0 * t, 0.0), 1.0), time), atol=1e-5
    )
    assert command[-1] == 1.0


def test_with_a_limit_of_its_rate_too_a_step_becomes_a_smooth_curve():
    def exact(t):
        if t <= 0.0:
            return 0.0
        if t <= 0.2:  # the rate rises to 1 at 5 a second
            return 2.5 * t**2
        if t <= 0.9:
            return t - 0.1
        return 1.0 - 0.2 * math.exp(-(t - 0.9) / 0.2)

    time, command = dtm.RateLimited(dtm.Integrator(), 1.0, rate_of_rate=5.0).limited(*STEP)
    np.testing.assert_allclose(command[:-1], means(exact, time), atol=1e-7)


def test_neither_rate_exceeds_its_limit():
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.01, 0.2, 300))
    told = rng.normal(size=300)
    time, command = dtm.RateLimited(dtm.Integrator(), 2.5, rate_of_rate=5.0).limited(times, told)
    middles = 0.5 * (time[1:] + time[:-1])
    rates = np.diff(command[:-1]) / np.diff(middles)
    assert np.abs(rates).max() <= 2.5 * (1.0 + 1e-9)
    second = np.diff(rates) / np.diff(0.5 * (middles[1:] + middles[:-1]))
    assert np.abs(second).max() <= 5.0 * 1.6  # pieces of different lengths
    assert np.abs(second[: 8 * 3]).max() > 0.5


def test_small_commands_meet_a_lag():
    plant = dtm.RateLimited(dtm.Integrator(0.9, lag=0.1), rate=1.0, rate_of_rate=5.0)
    np.testing.assert_allclose(
        plant.for_small_commands().polynomials()[1], np.polymul([0.2, 1.0], [0.1, 1.0, 0.0])
    )
    time = np.arange(0.0, 1.0, 0.05)
    command = np.full(time.size, 1e-6)
    command[0] = 0.0
    at, found = plant.limited(time, command)
    since = 0.5 * (at[:-1] + at[1:]) - 0.05
    late = since > 0.0
    np.testing.assert_allclose(
        found[:-1][late], 1e-6 * (1.0 - np.exp(-since[late] / 0.2)), rtol=5e-3
    )


def test_its_numbers_are_those_of_the_loop():
    plant = dtm.RateLimited(dtm.Integrator(0.9), rate=1.0, rate_of_rate=5.0)
    loop = dtm.ControlLoop(plant, dtm.P(1.0), delay=0.3, sample_time=0.065, limit=1.0)
    assert loop.replace(rate=2.0, gain=0.8).plant == dtm.RateLimited(dtm.Integrator(0.8), 2.0, 5.0)
    assert "rate_of_rate" not in dtm.RateLimited(dtm.Integrator(), rate=1.0).parameters


@pytest.mark.parametrize(
    "ask",
    [
        lambda loop: loop.is_stable(),
        lambda loop: loop.poles(re=(-5, 1), im=(0, 50)),
        lambda loop: loop.margin(),
        lambda loop: loop.simulate([0.0, 1.0]),
        lambda loop: loop.step_response(),
        lambda loop: loop.continuous().characteristic(),
        lambda loop: loop.plant.transfer_function(),
        lambda loop: dtm.sweep(loop, {"Kp": (1.0, 2.0, 3)}, [0.0, 1.0]),
        lambda loop: dtm.design(
            loop, controller=dtm.P, ranges={"Kp": (0.1, 3.0)}, objective="abscissa"
        ),
        lambda loop: dtm.simulate_fixed_step(loop, 1.0, step=0.01),
    ],
)
def test_what_is_for_linear_plants_is_refused_by_name(ask):
    plant = dtm.RateLimited(dtm.Integrator(), rate=1.0, rate_of_rate=5.0)
    loop = dtm.ControlLoop(plant, dtm.P(1.0), delay=0.3, sample_time=0.065, limit=1.0)
    with pytest.raises(ValueError, match="for_small_commands"):
        ask(loop)


@pytest.mark.parametrize("limits", [{"rate": 0.0}, {"rate": 1.0, "rate_of_rate": -1.0}])
def test_limits_are_above_zero(limits):
    with pytest.raises(ValueError, match="rate"):
        dtm.RateLimited(dtm.Integrator(), **limits)


def test_a_plant_within_limits_is_rational():
    with pytest.raises(TypeError, match="Integrator"):
        dtm.RateLimited(dtm.RateLimited(dtm.Integrator(), rate=1.0), rate=2.0)
