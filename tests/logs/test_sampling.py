"""Delay and lag from logs whose rows and clocks are as logs have them."""

import os
from dataclasses import replace
from types import SimpleNamespace

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation.likelihood._missing import with_lost
from deadtime.estimation.likelihood._rows import on_same_step, rounding_of
from deadtime.logs.latencies._clocks import growth_of, rates_apart
from deadtime.logs.latencies._controller import between_rows, period_of, smeared
from deadtime.logs.latencies._latency import _told
from deadtime.logs.latencies._windows import seen_windows
from marks import NIGHTLY
from sampled_loops import LOGGERS, fly, made
from scipy import stats

#: Those of two minutes are in the survey alone.
SHORT = [(kind, logger) for kind in ("rate", "height") for logger in LOGGERS[kind][1]]

#: Rows at any times: their likelihood has no steps that repeat, and takes ten times as long.
ANY_TIMES = {"uneven rows", "scattered stamps", "clocks drift by 100 ppm"}

#: Cases that are refused, or not reliable, in most logs.
DOUBTED = {
    ("height", "commands: every second row"),
    ("height", "commands: every fifth row"),
    ("rate", "commands: every fifth row"),
    ("rate", "scattered stamps"),
    ("rate", "steps of 1 deg/s, little noise"),
    ("height", "steps of 0.1 hPa"),
    ("rate", "clocks drift by 100 ppm"),
    ("height", "clocks drift by 100 ppm"),
    ("long height", "clocks drift by 100 ppm, scattered stamps"),
}

#: Logs of each case in the survey (`docs/theory/measured-estimates.md` has what came out of more),
#: and the probability of a false alarm at either end.
LOGS, ALARM = int(os.environ.get("DEADTIME_LOGS", "2")), 0.01


def answered(kind, logger, seed, part=1.0):
    """The truth of a log and its reliable answer: value, error and interval; None without one."""
    flight, log = made(kind, logger, seed, part)
    one = _told(log, log.loop(flight.kind.loop), "actuator")
    is_reliable = one.estimate is not None and one.estimate.verdict == "reliable"
    return flight.delay_plus_lag, one.sum_of() if is_reliable else None


def held_in(answers):
    """Whether the intervals of the reliable ones among these answers hold their truth."""
    return [told[2][0] <= truth <= told[2][1] for truth, told in answers if told is not None]


def is_as_often_as_said(held):
    """In 93 to 97.5 % of the intervals, but for chance."""
    few = stats.binom.cdf(sum(held), len(held), 0.93)
    many = stats.binom.sf(sum(held) - 1, len(held), 0.975)
    return min(few, many) > ALARM


def is_mostly_reliable(answers):
    """Three quarters of them, but for chance."""
    return stats.binom.cdf(len(held_in(answers)), len(answers), 0.75) > ALARM


@pytest.mark.parametrize(("kind", "logger"), SHORT)
def test_a_log_is_answered_rightly_or_doubted(kind, logger):
    truth, told = answered(kind, logger, 500, part=0.2 if logger in ANY_TIMES else 0.5)
    if told is not None:
        value, error, _ = told
        assert abs(value - truth) < 4.0 * error


@pytest.mark.long
@pytest.mark.survey
@pytest.mark.parametrize("kind", LOGGERS)
def test_reliable_intervals_hold_the_truth_as_often_as_they_say(kind):
    seeds = range(1000, 1000 + LOGS)
    found = {
        logger: [answered(kind, logger, seed) for seed in seeds] for logger in LOGGERS[kind][1]
    }
    # A case alone and all of them together, which tells more.
    wrong = [logger for logger, one in found.items() if not is_as_often_as_said(held_in(one))]
    assert not wrong
    assert is_as_often_as_said([each for one in found.values() for each in held_in(one)])
    meant = {logger: one for logger, one in found.items() if (kind, logger) not in DOUBTED}
    assert not [logger for logger, one in meant.items() if not is_mostly_reliable(one)]
    assert is_mostly_reliable([each for one in meant.values() for each in one])


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


def test_clocks_that_drift_apart_are_named_with_their_rate():
    # Over a short log the stamps alone tell.
    flight, log = made("rate", "clocks drift by 100 ppm", 1001, part=0.4)
    message = _told(log, log.loop(flight.kind.loop), "actuator").estimate.message
    assert (
        "the stamps of vehicle_torque_setpoint.xyz[0] and vehicle_angular_velocity.xyz[0] drift "
        "apart by 100 ppm: if they are those of two clocks, the time is wrong by 100 µs for each"
    ) in message


@pytest.mark.long
@pytest.mark.survey
def test_a_time_that_grows_with_the_drift_of_clocks_is_named():
    # Over a long log it tells, whatever the stamps look like.
    flight, log = made("long height", "clocks drift by 100 ppm, scattered stamps", 1000)
    one = _told(log, log.loop(flight.kind.loop), "actuator")
    assert "the time from command to response grows by " in one.estimate.message


def growths(logger, seeds):
    """Growths of the time, less its true value, in their errors; and of the first time."""
    for seed in seeds:
        flight, log = made("long height", logger, seed)
        loop = log.loop(flight.kind.loop)
        between = between_rows(log, "position", loop.actuator)
        seen = seen_windows(loop, "actuator", between=between)
        vehicle = dtm.FactoredPlant([flight.lag], gain=flight.gain, integrator=True)
        truth = SimpleNamespace(
            delay=flight.delay,
            delay_plus_lag=flight.delay_plus_lag,
            loop=dtm.ControlLoop(vehicle, dtm.P(1.0), delay=flight.delay),
        )
        found = growth_of(truth, [one for one in seen if one.tells], 0.0)
        true = 1e-4 * ("drift" in logger)
        assert found.may_be(true)
        yield (found.value - true) / found.error, found.start / found.start_error
        assert found.may_be(0.0) != ("drift" in logger)


@pytest.mark.parametrize(
    "logger", ["an oscillator of its own", "clocks drift by 100 ppm, scattered stamps"]
)
def test_the_time_grows_with_the_drift_of_the_clocks(logger):
    off = np.array(list(growths(logger, range(2000, 2012))))
    assert np.all(np.abs(np.mean(off, axis=0)) < 3.0 / np.sqrt(len(off)))
    assert np.all(np.std(off, axis=0) < 2.0)


@pytest.mark.parametrize("gaps", [False, True])
def test_stamps_tell_how_fast_their_clocks_are(gaps):
    random = np.random.default_rng(1)
    sent = np.round(0.0025 * np.arange(4000), 6)
    received = np.round((1.0 + 7e-5) * (0.001 * np.arange(10_000) + 0.0003), 6)
    if gaps:
        sent, received = (one[random.uniform(size=one.size) < 0.7] for one in (sent, received))
    found = rates_apart(sent, received)
    assert abs(found.value - 7e-5) < found.most < 1e-6
    # Stamps that scatter tell less, and say so.
    found = rates_apart(sent, received + random.uniform(-2e-4, 2e-4, received.size))
    assert abs(found.value - 7e-5) < found.most


def test_stamps_that_are_not_regular_tell_no_rate():
    random = np.random.default_rng(1)
    regular = 0.0025 * np.arange(2000)
    assert rates_apart(regular, np.sort(random.uniform(0.0, 5.0, 2000))) is None
    assert rates_apart(regular[:40], regular) is None
    # Periods in no ratio of small whole numbers, as of tasks that have nothing to do with another.
    assert rates_apart(regular, 0.00207 * np.arange(2000)) is None


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        # A short one has no parts; its stamps tell.
        (400, "the stamps of the commands and the rows drift apart by 100 ppm"),
        pytest.param(
            3000, "the commands and the rows are stamped by clocks that drift", marks=NIGHTLY
        ),
    ],
)
def test_a_recording_with_commands_of_another_clock_is_doubted(rows, words):
    flight, _ = made("long height", "every row", 1000, part=0.5)
    time, setpoint, read, sent = (
        one[:rows] for one in (flight.time, flight.setpoint, flight.read, flight.sent)
    )
    same, other = (
        dtm.latency(dtm.Recording(time * (1.0 + apart), setpoint, read, sent=(time, sent))).loops[0]
        for apart in (0.0, 1e-4)
    )
    assert same.estimate.verdict == "reliable"
    assert words in other.estimate.message
