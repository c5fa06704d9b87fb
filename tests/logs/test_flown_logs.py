"""The made logs are what they say: exact responses, known noise, and files that are read back."""

from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from flown_cases import CASES, DAMPED
from flown_files import SUFFIXES
from flown_logs import fly
from flown_plants import FREE, Noise, drawn_plant, markov
from flown_sticks import STICKS
from scipy import signal

#: One case of each format.
OF_A_FORMAT = {case.writer: case for case in CASES}


def some_plant(kind, seed=3):
    random = np.random.default_rng(seed)
    return drawn_plant(kind, (0.01, 0.03), (0.05, 0.2), DAMPED, random)


@pytest.mark.parametrize("kind", FREE)
def test_responses_are_those_of_the_transfer_function(kind):
    plant = some_plant(kind)
    period, fine = 0.004, 16
    inputs = np.random.default_rng(1).standard_normal(200)
    inputs[0] = 0.0
    num, den = np.trim_zeros([plant.zero, 1.0], "f"), [plant.square, plant.lag, 1.0]
    system = (plant.gain * np.asarray(num), np.trim_zeros(den, "f"))
    steps = period / fine * np.arange(200 * fine)
    _, expected, _ = signal.lsim(system, np.repeat(inputs, fine), steps, interp=False)
    found = plant.response(steps + plant.delay, period, inputs)
    assert found == pytest.approx(expected.ravel(), abs=1e-9)
    # A step that began long ago, and one that has not begun.
    assert plant.step(np.array([0.0, 9.0])) == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize("kind", FREE)
def test_the_truth_is_the_equivalent_delay_at_low_frequency(kind):
    plant, omega = some_plant(kind), 1e-3
    s = 1j * omega
    value = np.exp(-s * plant.delay) * (plant.zero * s + 1.0)
    value /= plant.square * s**2 + plant.lag * s + 1.0
    assert -np.angle(value) / omega == pytest.approx(plant.time, rel=1e-4)


def test_noise_has_the_covariance_that_it_says():
    noise = Noise(
        0.1, colour=0.3, colour_time=0.02, gust=0.5, gust_time=0.2, vibration=0.2, frequency=70.0
    )
    plant, period, count = some_plant("pair and zero"), 0.0025, 500_000
    random = np.random.default_rng(2)
    gusts = markov(count, period, noise.gust, noise.gust_time, random)
    times = period * np.arange(count)
    made = noise.drawn(count, period, random) + plant.response(times, period, gusts)
    rows = np.array([0, 1, 2, 5, 10, 40, 120])
    found = [np.mean(made[: count - row] * made[row:]) for row in rows]
    # A gust that is held for a period is as late as half of it.
    assert found == pytest.approx(noise.covariance(plant)(rows * period), abs=8e-3)


@pytest.mark.parametrize("sticks", STICKS)
def test_sticks_rest_for_their_share_and_have_their_size(sticks):
    time = np.arange(0.0, 600.0, 0.005)
    moved = STICKS[sticks](time, 0.5, 0.5, np.random.default_rng(4))
    at_rest = np.mean(np.abs(moved) < 1e-3)
    assert 0.35 < at_rest < (0.8 if sticks == "doublets" else 0.65)
    assert 0.5 < np.std(moved[np.abs(moved) > 1e-3]) < 1.5


def test_jumps_come_at_any_time_between_rows():
    case = next(each for each in CASES if each.sticks == "jumps" and each.rows[0] == 25.0)
    shares = []
    for seed in range(8):
        flown = fly(case, seed)
        changes = np.flatnonzero(np.diff(flown.inputs)) + 1
        place = np.searchsorted(flown.asked, changes)
        inside = (place > 0) & (place < flown.asked.size)
        before, after = flown.asked[place[inside] - 1], flown.asked[place[inside]]
        shares.append((changes[inside] - before) / (after - before))
    # Uniform: the first and the last of 16 samples alike.
    found = np.concatenate(shares)
    assert np.mean(found) == pytest.approx(0.5 + 0.5 / 16.0, abs=0.04)
    assert np.std(found) == pytest.approx(12.0**-0.5, abs=0.02)


@pytest.mark.parametrize("writer", OF_A_FORMAT)
def test_files_hold_the_rows_of_the_flight(writer, tmp_path):
    if writer != "DataFlash":
        pytest.importorskip("pymavlink", reason="pymavlink and pyulog read these logs")
    flown = fly(replace(OF_A_FORMAT[writer], seconds=6.0), 5)
    path = tmp_path / f"flown{SUFFIXES[writer]}"
    path.write_bytes(flown.data(np.random.default_rng(1)))
    loop = dtm.open_log(path).loop(flown.case.loop)
    stamp, rounding = {"tlog": (1e-3, 1e-6), "Blackbox": (6e-6, 0.51)}.get(writer, (1e-6, 0.01))
    for series, at, values in (
        (loop.setpoint, flown.asked_at, flown.setpoint),
        (loop.response, flown.read_at, flown.response),
    ):
        assert np.ptp(series.time - at) < stamp
        assert np.degrees(series.values) == pytest.approx(values, abs=rounding)
