"""Delay and lag from logs whose rows and clocks are as logs have them."""

import os
from dataclasses import replace

import numpy as np
import pytest
from deadtime.estimation.likelihood._missing import with_lost
from deadtime.estimation.likelihood._rows import on_same_step, rounding_of
from deadtime.reports.latencies._controller import period_of, smeared
from deadtime.reports.latencies._latency import _told
from sampled_loops import LOGGERS, fly, made
from scipy import stats

CASES = [(kind, logger) for kind, (_, loggers) in LOGGERS.items() for logger in loggers]

#: Cases that are refused, or not adequate, in most logs.
DOUBTED = {
    ("height", "commands: every second row"),
    ("height", "commands: every fifth row"),
    ("rate", "commands: every fifth row"),
    ("rate", "scattered stamps"),
    ("rate", "steps of 1 deg/s, little noise"),
    ("height", "steps of 0.1 hPa"),
}

#: Logs of the survey (`benches/README.md` has what came out of more), and the probability of a
#: false alarm at either end.
LOGS, ALARM = int(os.environ.get("DEADTIME_LOGS", "5")), 0.01


def answered(kind, logger, seed):
    """The truth of a log and its adequate answer: value, error and interval; None without one."""
    flight, log = made(kind, logger, seed)
    one = _told(log, log.loop(flight.kind.loop), "actuator")
    is_adequate = one.estimate is not None and one.estimate.adequate
    return flight.delay_plus_lag, one.sum_of() if is_adequate else None


@pytest.mark.parametrize(("kind", "logger"), CASES)
def test_a_log_is_answered_rightly_or_doubted(kind, logger):
    truth, told = answered(kind, logger, 500)
    if told is not None:
        value, error, _ = told
        assert abs(value - truth) < 4.0 * error


@pytest.mark.survey
@pytest.mark.parametrize(("kind", "logger"), CASES)
def test_adequate_intervals_hold_the_truth_as_often_as_they_say(kind, logger):
    found = [answered(kind, logger, seed) for seed in range(1000, 1000 + LOGS)]
    held = [told[2][0] <= truth <= told[2][1] for truth, told in found if told is not None]
    # 93 to 97.5 % within the binomial error.
    assert stats.binom.cdf(sum(held), len(held), 0.93) > ALARM
    assert stats.binom.sf(sum(held) - 1, len(held), 0.975) > ALARM
    if (kind, logger) not in DOUBTED:
        assert len(held) >= 0.6 * LOGS


@pytest.mark.parametrize("kind", LOGGERS)
def test_flights_are_exact(kind):
    # What the controller read is the closed form at its samples, with the noise.
    flight = fly(LOGGERS[kind][0], np.random.default_rng(3))
    noise = flight.read - flight.response(flight.time)
    assert np.std(noise) == pytest.approx(flight.kind.noise, rel=0.1)
    # The closed form obeys lag y'' + y' = gain u(t - delay) between arrivals, without air.
    step = 1e-4
    at = flight.time[400] + flight.delay + 0.4 * flight.kind.period + step * np.arange(-1, 2)
    before, now, after = flight.response(at) - np.interp(at, flight.time, flight.moved)
    slope, bend = (after - before) / (2.0 * step), (after - 2.0 * now + before) / step**2
    told = flight.gain * flight.sent[400]
    assert flight.lag * bend + slope == pytest.approx(told, abs=1e-4 * abs(told) + 1e-4)


def test_lost_commands_are_the_mean_of_those_around_or_unknown():
    time = np.delete(0.1 * np.arange(100.0), [20, *range(40, 45)])
    command = np.sin(3.0 * time)
    found = with_lost(time, command, np.linspace(0.0, 9.9, 200))
    place = int(np.searchsorted(found.time, 2.0 - 1e-9))
    assert found.time[place] == pytest.approx(2.0)
    assert found.command[place] == pytest.approx(0.5 * (np.sin(5.7) + np.sin(6.3)))
    assert found.unknown == ((pytest.approx(4.0), pytest.approx(4.5)),)
    # Commands that are logged when they change are not lost in between.
    for odd in (np.sort(np.random.default_rng(1).uniform(0.0, 10.0, 100)), time[:10]):
        assert with_lost(odd, np.sin(odd), odd).time is odd
    still = np.where(time < 3.0, 0.0, 1.0)
    assert with_lost(time, still, time).command is still


def test_the_middle_of_a_step_is_neither_early_nor_late():
    # A ramp that stays on each step for two rows.
    output = np.repeat(np.arange(100.0), 2)
    rows = np.flatnonzero(~on_same_step(output))
    assert np.mean(rows - 2.0 * output[rows]) == pytest.approx(0.5)


def test_noise_of_half_a_step_makes_all_rows_tell():
    ramp = np.linspace(0.0, 20.0, 400)
    noise = np.random.default_rng(2).standard_normal(400)
    assert rounding_of(np.round(ramp + 0.1 * noise)) == 1.0
    assert rounding_of(np.round(ramp + 0.5 * noise)) == 0.0


def test_lines_between_rare_rows_of_a_command_are_known_to_what_their_changes_tell():
    flight, log = made("rate", "commands: every fifth row", 1007)
    told = log.loop(flight.kind.loop).actuator
    # Sixteen equal steps, each at any time between its rows.
    values = np.repeat(np.arange(17.0), 2)
    steps = replace(told, time=0.05 * np.arange(34.0), values=values)
    period = period_of(log, "rate")
    expected = (0.05 - period.time) / np.sqrt(12.0 * 16.0)
    assert smeared(log, "rate", steps, 0.0, 2.0) == pytest.approx(expected)
    # Intervals of 2 ms did not know of it: of 28 such answers 18 held the truth.
    assert answered("rate", "commands: every fifth row", 1007)[1] is None
