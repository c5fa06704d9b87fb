"""Vehicles that limit acceleration and jerk of what they are told, from a generator of its own."""

import math

import deadtime as dtm
import numpy as np
import pytest
from marks import NIGHTLY

SAMPLE, PARTS = 0.065, 65
TRUTH = {"delay": 0.2, "gain": 0.9, "lag": 0.1, "rate": 1.0, "rate_of_rate": 5.0}


def recorded(seed, rows=300, noise=0.005):
    """A P loop around such a vehicle, in short steps by the trapezoidal rule."""
    delay, gain, lag, rate, jerk = TRUTH.values()
    rng, h = np.random.default_rng(seed), SAMPLE / PARTS
    late, kept = round(delay / h), math.exp(-h / lag)
    told = [0.0] * (rows * PARTS + late)
    v = a = w = y = 0.0
    found = []
    for row in range(rows):
        reference = float(row * SAMPLE > 2.0 and int(row * SAMPLE / 6.0) % 2 == 0)
        measured = y + noise * rng.standard_normal()
        command = min(max(1.0 * (reference - measured), -1.0), 1.0)
        found.append((row * SAMPLE, reference, measured, command))
        for part in range(row * PARTS, (row + 1) * PARTS):
            told[part + late] = command
            wanted = min(max((told[part] - v - 0.5 * h * a) * jerk / rate, -rate), rate)
            before = v, a, w
            a += min(max(wanted - a, -jerk * h), jerk * h)
            v += 0.5 * h * (a + before[1])
            middle = 0.5 * (v + before[0])
            w = middle + (w - middle) * kept
            y += gain * 0.5 * h * (w + before[2])
    return dtm.Recording(*np.array(found).T)


def loop_with(plant):
    return dtm.ControlLoop(plant, dtm.P(1.0), sample_time=SAMPLE, limit=1.0)


LINEAR = dtm.Integrator(1.0, lag=0.05)
LIMITED = dtm.RateLimited(LINEAR, TRUTH["rate"], TRUTH["rate_of_rate"])


def holds(fit, name, level=0.99):
    low, high = fit.ci(level, name)
    return low <= sum(TRUTH[part] for part in name.split("+")) <= high


def test_with_the_limits_the_numbers_are_within_their_intervals():
    fit = dtm.estimate_delay(recorded(2), loop_with(LIMITED), free=("delay", "gain", "lag"))
    assert fit.verdict == "reliable", fit.message
    assert fit.stderr["delay+lag"] < 0.002
    for name in fit.stderr:
        assert holds(fit, name), name


@pytest.mark.parametrize("flights", [1, pytest.param(3, marks=NIGHTLY)])
def test_without_the_limits_no_estimate_is_reliable(flights):
    for seed in range(flights):
        fit = dtm.estimate_delay(recorded(seed), loop_with(LINEAR), free=("delay", "gain", "lag"))
        assert fit.verdict != "reliable"
        assert not holds(fit, "delay+lag")


def test_a_limit_can_be_free():
    loop = loop_with(dtm.RateLimited(LINEAR, 0.7, TRUTH["rate_of_rate"]))
    fit = dtm.estimate_delay(recorded(2), loop, free=("delay", "gain", "lag", "rate"))
    assert fit.verdict == "reliable", fit.message
    assert fit.free == ("delay", "gain", "lag", "rate")
    assert fit.cov.shape == (4, 4)
    assert fit.loop.plant.rate == pytest.approx(TRUTH["rate"], rel=0.05)
    for name in fit.stderr:
        assert holds(fit, name), name
    _, t = fit.profile("rate", [0.9 * fit.loop.plant.rate, fit.loop.plant.rate])
    assert t[0] > 2.0
    assert t[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.survey
def test_intervals_cover():
    held = []
    for seed in range(200, 240):
        fit = dtm.estimate_delay(recorded(seed), loop_with(LIMITED), free=("delay", "gain", "lag"))
        held.append([holds(fit, name, 0.95) for name in fit.stderr])
    assert np.mean(held, axis=0).min() >= 0.82  # 33 of 40: one in 300 by chance


FREQUENCIES = np.array([1.0, 2.0, 3.0])


def behind_limits(seed):
    """Is a fit of no named plant reliable, and are gain and phase within their intervals?"""
    flight = recorded(seed).behind_limits(TRUTH["rate"], TRUTH["rate_of_rate"])
    fit = dtm.estimate_delay(flight)
    w = FREQUENCIES
    gain = TRUTH["gain"] / (w * np.hypot(1.0, TRUTH["lag"] * w))
    phase = -0.5 * np.pi - np.arctan(TRUTH["lag"] * w) - TRUTH["delay"] * w
    view = fit.at(w)
    found = [
        (ends[0] <= value) & (value <= ends[1])
        for ends, value in ((view.gain_ci, gain), (view.phase_ci, phase))
    ]
    return fit.verdict == "reliable", np.concatenate(found)


@pytest.mark.parametrize(
    "flights",
    [
        2,
        pytest.param(10, marks=pytest.mark.survey),
        pytest.param(40, marks=[pytest.mark.survey, pytest.mark.long]),
    ],
)
def test_behind_given_limits_no_plant_has_to_be_named(flights):
    found = [behind_limits(seed) for seed in range(300, 300 + flights)]
    reliable = [one for one, _ in found]
    held = np.mean([inside for _, inside in found], axis=0)
    print(f"reliable {sum(reliable)} of {flights}, held {held}")
    assert np.mean(reliable) >= 0.9
    assert held.min() >= 0.82 or flights < 40  # 33 of 40: one in 300 by chance
    assert held.mean() >= 0.75


@pytest.mark.parametrize("method", ["waveform", "gcc", "frequency", "overshoot"])
def test_other_methods_refuse_such_a_plant(method):
    with pytest.raises(ValueError, match="limits the rate of its command"):
        dtm.estimate_delay(recorded(0), loop_with(LIMITED), method=method)


def test_missing_rows_are_refused():
    whole = recorded(0)
    kept = np.r_[0:100, 104:300]
    holed = dtm.Recording(
        *(a[kept] for a in (whole.time, whole.reference, whole.output, whole.command))
    )
    with pytest.raises(dtm.NotIdentifiableError, match="missing rows"):
        dtm.estimate_delay(holed, loop_with(LIMITED))


def test_a_late_row_is_not_a_missing_one():
    exact = recorded(2)
    time = exact.time.copy()
    time[175] += 0.8 * SAMPLE  # at rest
    late = dtm.Recording(time, exact.reference, exact.output, exact.command)
    found, plain = (
        dtm.estimate_delay(one, loop_with(LIMITED), free=("delay", "gain", "lag"))
        for one in (late, exact)
    )
    assert found.delay_plus_lag == pytest.approx(plain.delay_plus_lag, abs=0.003)
