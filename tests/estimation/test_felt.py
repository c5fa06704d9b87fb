"""What a loop feels of the plant of an estimate: G around crossover, with intervals."""

import math
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation._felt import FELT, limits

TRUTH = dtm.ControlLoop(
    dtm.Integrator(0.9, lag=0.15), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
)
FREE = ("delay", "gain", "lag")


def flight(seed, rows=160, noise=0.006):
    time = np.arange(rows) * 0.065
    rng = np.random.default_rng(seed)
    reference = np.where(time < 1.0, 0.0, np.repeat(rng.choice([0.0, 0.6, 1.2], rows), 30)[:rows])
    return dtm.Experiment(time, reference).run(TRUTH, noise, seed)


@pytest.fixture(scope="module")
def fit():
    return dtm.estimate_delay(flight(1), TRUTH.replace(delay=None, gain=1.0, lag=0.1), free=FREE)


def test_an_integrator_has_its_closed_form():
    """K/s e^(-sT): the largest gain is pi/(2 K T), half of it crosses over at pi/(4 T)."""
    for gain in (0.8, -0.8):
        loop = dtm.ControlLoop(dtm.Integrator(gain), dtm.P(0.1), delay=0.4)
        largest, crossover = limits(loop)
        assert largest == pytest.approx(math.pi / (2.0 * gain * 0.4), rel=1e-9)
        assert crossover == pytest.approx(math.pi / (4.0 * 0.4), rel=1e-9)


@pytest.mark.parametrize(
    "plant",
    [
        dtm.FirstOrder(1.8, 40.0),
        dtm.FactoredPlant([3.0, 1.0], 0.7, zero=-0.5),
        dtm.FactoredPlant(
            [], 0.69, zero=1.3, integrator=True, pole_frequency=1.7, pole_damping=0.9
        ),
    ],
)
def test_the_largest_gain_is_where_the_loop_becomes_unstable(plant):
    loop = dtm.ControlLoop(plant, dtm.P(1e-3), delay=0.5)
    largest, _ = limits(loop)
    assert loop.replace(Kp=0.999 * largest).is_stable()
    assert not loop.replace(Kp=1.001 * largest).is_stable()


def test_gain_and_angle_are_those_of_the_plant(fit):
    """The angle is that of the transfer function but for whole turns, and falls without a jump."""
    omega = np.linspace(0.1, 30.0, 500)
    view = fit.at(omega)
    exact = np.ravel(fit.loop.plant.transfer_function().frequency_response(omega))
    exact = exact * np.exp(-1j * omega * fit.delay)
    assert np.allclose(view.gain * np.exp(1j * view.phase), exact, rtol=1e-9)
    assert np.all(np.diff(view.phase) < 0.0)
    assert np.allclose(view.delay, -(view.phase + 0.5 * np.pi) / omega)
    for value, ends in ((view.gain, view.gain_ci), (view.phase, view.phase_ci)):
        assert np.all((ends[0] < value) & (value < ends[1]))
    assert np.all((view.delay_ci[0] < view.delay) & (view.delay < view.delay_ci[1]))


def test_both_ways_to_estimate_have_the_same_names(fit):
    """One protocol for an estimate with a loop and one without."""
    known = {"plant": "integrator, lag", "controller": TRUTH.controller, "between": "held"}
    found = dtm.estimate_delay(flight(1), **known)
    for one in (fit, found):
        for name in FELT:
            low, high = one.ci(0.9, name)
            assert low < getattr(one, name) < high
        assert one.at(one.crossover).delay[0] == pytest.approx(one.delay_at_crossover)
        assert one.at([1.0, 2.0]).gain_ci.shape == (2, 2)
        assert one.crossover_in_loop > 0.0
    low, high = fit.ci(0.95, "largest_gain")
    assert low < found.largest_gain < high


def test_a_plant_without_a_largest_gain_says_so(fit):
    loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(1.6), delay=0.0, sample_time=0.065)
    slow = replace(fit, loop=loop, free=("gain",), cov=np.array([[1e-6]]))
    assert slow.largest_gain == math.inf
    assert math.isnan(slow.crossover)
    assert "no proportional gain makes the loop unstable. At " in slow.summary()
    with pytest.raises(ValueError, match="no proportional gain makes the loop unstable"):
        slow.ci(0.95, "largest_gain")
    with pytest.raises(ValueError, match=r"omega=-1 rad/s: give frequencies above zero"):
        fit.at(-1.0)


@pytest.mark.survey
@pytest.mark.long
def test_intervals_hold_what_a_loop_feels_as_often_as_they_say():
    """200 flights, each quantity: 95 % with its scatter."""
    largest, crossover = limits(TRUTH)
    held = dict.fromkeys(["largest_gain", "crossover", "gain", "delay"], 0)
    count = 0
    for seed in range(200):
        known = TRUTH.replace(delay=None, gain=1.0, lag=0.1)
        fit = dtm.estimate_delay(flight(seed), known, free=FREE)
        if fit.verdict != "reliable":
            continue
        count += 1
        low, high = fit.ci(0.95, "largest_gain")
        held["largest_gain"] += low <= largest <= high
        low, high = fit.ci(0.95, "crossover")
        held["crossover"] += low <= crossover <= high
        view = fit.at(crossover)
        true = replace(fit, loop=TRUTH).at(crossover)
        for name in ("gain", "delay"):
            low, high = getattr(view, f"{name}_ci")[:, 0]
            held[name] += low <= getattr(true, name)[0] <= high
    assert count >= 170
    for name, number in held.items():
        assert 0.90 * count <= number, (name, number, count)
