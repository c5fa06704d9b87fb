"""The bank of filters against dense covariance matrices, and the batch likelihood."""

from __future__ import annotations

import math

import numpy as np
import pytest
from deadtime._deadtime import (
    FlightFit,
    FlightPlant,
    FlightRows,
    OnlineBank,
    PlantNumbers,
    RowNoise,
)
from deadtime.estimation._plant import Disturbance
from deadtime.estimation.running._bank import BankSettings

WHITE, AIR, AIR_TIME, SENSOR, SENSOR_TIME = 0.006, 0.08, 0.9, 0.004, 0.2
DELAYS = [0.27, 0.285, 0.3, 0.312, 0.33]
ROW = 0.065


def settings(**changed):
    """A bank without walk, jumps and an unknown scale."""
    count = len(changed.get("delays", DELAYS))
    given = {
        "plant": FlightPlant([1.0], [1.0, 0.0], [], [], [], air_behind_lags=True),
        "delays": DELAYS,
        "follow": False,
        "layers": [([0.15], 0.0, [0.0] * count)],
        "disturbances": [
            Disturbance(True, AIR_TIME, AIR / WHITE),
            Disturbance(False, SENSOR_TIME, SENSOR / WHITE),
        ],
        "gain": (0.7, 0.4),
        "trim": 0.05,
        "white": WHITE,
        "freedom": math.inf,
        "memory": 60.0,
        "drift": 0.0,
        "gain_walk": 0.0,
        "width": 0.05,
        "alarm": math.inf,
        "every": 1,
        "at_rest": True,
        "level": 0.95,
    }
    return BankSettings(**{**given, **changed})


def response(times, command_times, commands, delay, lag):
    """Response of 1/(s (lag s + 1)) to held commands, in closed form."""
    age = np.maximum(np.subtract.outer(times, command_times + delay), 0.0)
    ramp = age + (lag * np.expm1(-age / lag) if lag else 0.0)
    return ramp @ np.diff(commands, prepend=0.0)


def integrated(times, deviation, time_constant):
    """Covariance of an integrator behind stationary first-order air, zero at the first time."""
    s = times - times[0]
    low, high = np.minimum.outer(s, s), np.maximum.outer(s, s)
    fall = -np.expm1(-np.array([low, high, high - low]) / time_constant)
    return (
        deviation**2 * time_constant * (2.0 * low - time_constant * (fall[0] + fall[1] - fall[2]))
    )


def flight(rows=160, seed=3, jitter=0.004, sent_later=0.0):
    """Rows at uneven times, some of them lost, with commands of a few rows' duration."""
    random = np.random.default_rng(seed)
    times = ROW * np.arange(rows) + jitter * random.uniform(-1.0, 1.0, rows)
    commands = np.repeat(random.normal(0.0, 0.6, -(-rows // 6)), 6)[:rows]
    commands[:8] = 0.0
    covariance = WHITE**2 * np.eye(rows) + integrated(times, AIR, AIR_TIME)
    covariance += SENSOR**2 * np.exp(-abs(np.subtract.outer(times, times)) / SENSOR_TIME)
    output = 0.2 + 0.85 * response(times, times, commands, 0.3, 0.15)
    output += np.linalg.cholesky(covariance) @ random.normal(size=rows)
    used = random.random(rows) > 0.1
    used[0] = True
    return times, output, commands, used, covariance


def density(times, output, commands, used, covariance, delay, lag=0.15):
    """ln of the joint Gaussian density of the rows that are used, but for the bank's constant."""
    shape = response(times, times, commands, delay, lag)
    mean = output[0] + 0.7 * (shape - shape[0])
    one, slope = np.ones(times.size), response(times, times[:1], np.ones(1), 0.0, lag)
    full = covariance + (1e3 * WHITE) ** 2 * np.outer(one, one)
    full = full + 0.4**2 * np.outer(shape, shape) + 0.05**2 * np.outer(slope, slope)
    full, away = full[np.ix_(used, used)] / WHITE**2, (output - mean)[used] / WHITE
    _, log_det = np.linalg.slogdet(full)
    return -0.5 * (log_det + away @ np.linalg.solve(full, away))


def run(bank, times, output, commands, used):
    """The answers of a bank."""
    found = []
    for time, value, command, seen in zip(times, output, commands, used, strict=True):
        found.append(bank.row(time, value if seen else None))
        bank.command(time, command)
    return found


def alone(index, delays=DELAYS):
    """Prior weights of one delay."""
    return [0.0 if i == index else -math.inf for i in range(len(delays))]


@pytest.mark.parametrize("index", range(len(DELAYS)))
def test_each_filter_has_the_density_of_dense_matrices(index):
    given = flight()
    bank = OnlineBank(settings(layers=[([0.15], 0.0, alone(index))]))
    found = run(bank, *given[:4])[-1].evidence
    expected = density(*given, DELAYS[index])
    assert abs(found - expected) < 1e-9 * abs(expected)


def test_weights_are_the_posterior_over_delays_and_lags():
    given = flight()
    lags = (0.1, 0.15, 0.25)
    layers = [([lag], 0.0, [0.0] * len(DELAYS)) for lag in lags]
    found = run(OnlineBank(settings(layers=layers)), *given[:4])[-1]
    logs = np.array([[density(*given, delay, lag) for delay in DELAYS] for lag in lags])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    # The sum of hundreds of terms, of which the dense covariance gives some ten digits.
    assert found.evidence == pytest.approx(
        np.log(np.mean(np.exp(logs - logs.max()))) + logs.max(), abs=1e-7
    )
    assert found.lag == pytest.approx(float(weights.sum(axis=1) @ lags), abs=1e-9)
    assert found.lowest == pytest.approx(float(weights[:, 0].sum()), abs=1e-9)
    assert found.highest == pytest.approx(float(weights[:, -1].sum()), abs=1e-9)


def test_the_posterior_over_a_range_is_that_of_the_batch_likelihood():
    # With a gain and level of any size the bank eliminates what the batch likelihood eliminates.
    times, output, commands, used, _ = flight()
    delays = np.linspace(0.1, 0.5, 41)
    gaussian = settings(
        delays=delays.tolist(), layers=[([0.15], 0.0, [0.0] * 41)], gain=(0.0, 300.0), trim=30.0
    )
    last = run(OnlineBank(gaussian), times, output, commands, used)[-1]
    rows = FlightRows(times, output, used, times, commands, [], True)
    plant = FlightPlant([1.0], [1.0, 0.0], ["lag"], [0.15], ["gain"], air_behind_lags=True)
    noise = RowNoise(AIR_TIME, AIR / WHITE, SENSOR_TIME, SENSOR / WHITE)
    logs = []
    fine = np.linspace(0.2, 0.4, 401)
    for delay in fine:
        numbers = PlantNumbers(float(delay), [0.15], [noise])
        part = FlightFit(plant, [rows], True, numbers).parts[0]
        _, log_det = np.linalg.slogdet(part.inverse.reshape(3, 3))
        squares = part.variance * part.freedom / WHITE**2
        logs.append(-0.5 * (squares + part.log_det - log_det))
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    mean = float(weights @ fine)
    deviation = math.sqrt(float(weights @ (fine - mean) ** 2))
    assert last.delay == pytest.approx(mean, abs=0.02 * deviation)
    assert last.delay_deviation == pytest.approx(deviation, rel=0.02)
    assert last.low < 0.3 < last.high


def test_a_row_without_an_output_and_a_shift_of_time_change_nothing():
    times, output, commands, used, _ = flight(jitter=0.0)
    whole = run(OnlineBank(settings()), times, output, commands, used)[-1]
    bank = OnlineBank(settings())
    for time, value, command, seen in zip(times, output, commands, used, strict=True):
        if time > 0.0:
            bank.row(time - 0.4 * ROW)
        split = bank.row(time, value if seen else None)
        bank.command(time, command)
    assert split.delay == pytest.approx(whole.delay, abs=1e-9)

    later = run(OnlineBank(settings()), times + 1000.0, output, commands, used)[-1]
    assert later.delay == pytest.approx(whole.delay, abs=1e-9)
    assert later.gain == pytest.approx(whole.gain, abs=1e-9)


def test_what_is_wrong_is_said_with_its_value():
    bank = OnlineBank(settings())
    bank.row(1.0, 0.0)
    bank.command(1.0, 0.0)
    with pytest.raises(ValueError, match="the time 1 s follows 1 s"):
        bank.row(1.0, 0.0)
    with pytest.raises(ValueError, match=r"the command at 0\.5 s follows one at 1 s"):
        bank.command(0.5, 0.0)
    with pytest.raises(ValueError, match="the output at 2 s is inf"):
        bank.row(2.0, math.inf)
    for changed, words in (
        ({"delays": [0.1, 0.2]}, "2 delays"),
        ({"delays": [0.3, 0.2, 0.1]}, "follows 0.3"),
        ({"white": 0.0}, "white noise of 0"),
        ({"level": 1.0}, "the level is 1"),
        ({"layers": [([-0.1], 0.0, [0.0] * 5)]}, "a lag is -0.1 s"),
        ({"layers": [([0.1], 0.0, [-math.inf] * 5)]}, "all prior weights are zero"),
        (
            {"plant": FlightPlant([1.0], [1.0, *[0.0] * 7], [], [], [])},
            "the filters can use at most 9",
        ),
    ):
        with pytest.raises(ValueError, match=words):
            OnlineBank(settings(**changed))
