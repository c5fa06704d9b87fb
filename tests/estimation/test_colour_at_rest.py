"""Residuals with a colour that is there while the vehicle rests, too, say nothing of the plant."""

import pickle

import deadtime as dtm
import numpy as np
import pytest
from marks import NIGHTLY
from scipy import signal

SAMPLE, DELAY, GAIN = 0.065, 0.3, 0.9
TIME = SAMPLE * np.arange(560)
STEPS = np.where(TIME < 4.0, 0.0, (TIME - 4.0) // 8.0 % 2 == 0).astype(float)
LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=SAMPLE, limit=1.0)
FREE = ("delay", "gain")

#: A position that is corrected five times a second, by a resonance, and what is white, m.
RESONANCE = np.poly(0.98 * np.exp(2j * np.pi * 5.0 * SAMPLE * np.array([1.0, -1.0]))).real
SIZE, WHITE = 0.0006, 0.0002

#: The plant between command and speed: none, a lag, or one that overshoots.
STIFF = dtm.FactoredPlant(integrator=True)
LAGGED = dtm.FactoredPlant([0.15], integrator=True)
OVERSHOOTING = dtm.FactoredPlant([0.15, 0.15], zero=0.27, integrator=True)
FINE = 13


def flown(seed, plant=STIFF, moving_only=False):
    """Four steps, by the states of the plant over a thirteenth of a sample each."""
    random = np.random.default_rng(seed)
    told = signal.lfilter([1.0], RESONANCE, random.standard_normal(2000))[-TIME.size :]
    noise = SIZE * told / told.std() + WHITE * random.standard_normal(TIME.size)
    num, den = plant.polynomials()
    system = signal.tf2ss(GAIN * num, den)
    a, b, c, *_ = signal.cont2discrete(system, SAMPLE / FINE)
    # The delay is 4.6 samples, which is 60 of these steps.
    waits = np.zeros(round(DELAY / (SAMPLE / FINE)))
    state = np.zeros((a.shape[0], 1))
    command, output = np.zeros(TIME.size), np.zeros(TIME.size)
    before = 0.0
    for row in range(TIME.size):
        position = (c @ state).item()
        moves = abs(position - before) > 0.1 * SAMPLE
        output[row] = position + (noise[row] if moves or not moving_only else 0.3 * WHITE)
        before = position
        command[row] = np.clip(STEPS[row] - output[row], -1.0, 1.0)
        for _ in range(FINE):
            state = a @ state + b * waits[0]
            waits = np.append(waits[1:], command[row])
    return dtm.Recording(TIME, STEPS, output, command)


@pytest.mark.parametrize("flights", [7, pytest.param(20, marks=NIGHTLY)])
def test_an_estimate_under_such_noise_is_reliable_and_its_intervals_hold_the_truth(flights):
    fits = [dtm.estimate_delay(flown(seed), LOOP, free=FREE) for seed in range(flights)]
    assert not any(fit.whiteness.white for fit in fits)
    reliable = [fit for fit in fits if fit.verdict == "reliable"]
    assert len(reliable) >= 0.85 * flights
    held = [
        [low <= truth <= high for fit in reliable for low, high in [fit.ci(0.95, name)]]
        for name, truth in (("delay", DELAY), ("gain", GAIN))
    ]
    assert all(np.mean(one) >= 0.85 for one in held)
    assert "coloured also at rest" in reliable[0].message


@pytest.mark.parametrize("plant", [LAGGED, OVERSHOOTING])
@pytest.mark.parametrize("flights", [1, pytest.param(3, marks=NIGHTLY)])
def test_a_plant_that_lacks_something_is_refused_under_such_noise(plant, flights):
    fits = [dtm.estimate_delay(flown(seed, plant), LOOP, free=FREE) for seed in range(flights)]
    assert not any(fit.verdict == "reliable" for fit in fits)


@pytest.mark.survey
def test_a_plant_that_overshoots_is_told_from_one_that_lags():
    loop = LOOP.replace(plant=dtm.Integrator(1.0, lag=0.1))
    fit = dtm.estimate_delay(flown(1, OVERSHOOTING), loop, free=(*FREE, "lag"))
    assert fit.verdict != "reliable"
    richer = LOOP.replace(plant=dtm.FactoredPlant([0.2, 0.1], zero=0.2, integrator=True))
    free = (*FREE, "lag_1", "lag_2", "zero")
    fit = dtm.estimate_delay(flown(1, OVERSHOOTING), richer, free=free)
    assert fit.verdict == "reliable"
    low, high = fit.ci(0.95, "delay+lag")
    assert low < DELAY + 0.03 < high


@pytest.mark.parametrize("flights", [2, pytest.param(4, marks=NIGHTLY)])
def test_a_colour_that_is_not_there_at_rest_is_a_reason(flights):
    fits = [
        dtm.estimate_delay(flown(seed, moving_only=True), LOOP, free=FREE)
        for seed in range(flights)
    ]
    assert not any(fit.verdict == "reliable" for fit in fits)


def test_the_colour_makes_no_interval_shorter():
    fit = dtm.estimate_delay(flown(3), LOOP, free=FREE)
    plain = dict(fit._profile.fit.profile().stderr)
    assert all(1.0 <= (fit.stderr[name] / plain[name]) ** 2 < 3.0 for name in FREE)


def test_the_estimate_survives_a_copy():
    fit = dtm.estimate_delay(flown(4), LOOP, free=FREE)
    again = pickle.loads(pickle.dumps(fit))
    assert again.ci(0.9) == fit.ci(0.9)
