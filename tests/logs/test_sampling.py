"""Delay and lag from logs whose rows and clocks are as logs have them."""

import os

import deadtime as dtm
import numpy as np
import pytest
from deadtime.logs.latencies._clocks import growth_of, rate_of_drift
from deadtime.logs.latencies._commands import period_of, sampling_of
from deadtime.logs.latencies._latency import latency_of
from deadtime.logs.latencies._relation import WindowTime
from sampled_loops import LOGGERS, fly, made
from scipy import stats

#: The part of a log that answers already.
PART = {"rate": 0.3, "height": 0.5}

#: Those of two minutes are in the survey alone.
SHORT = [(kind, logger) for kind in ("rate", "height") for logger in LOGGERS[kind][1]]

#: Cases that are refused, or not reliable, in most logs.
DOUBTED = {
    ("rate", "clocks drift by 100 ppm"),
    ("height", "clocks drift by 100 ppm"),
    ("long height", "clocks drift by 100 ppm, scattered stamps"),
}

#: Logs of each case in the survey (`docs/theory/measured-estimates.md` has what came out of more),
#: and the probability of a false alarm at either end.
LOGS, ALARM = int(os.environ.get("DEADTIME_LOGS", "2")), 0.01


def answered(kind, logger, seed, part=1.0):
    """The answer to a log from its actuator, and its truth at the same frequencies, s."""
    flight, log = made(kind, logger, seed, part)
    one = latency_of(log, log.loop(flight.kind.loop), "actuator")
    return one, flight.delay_at(one.frequencies) @ one.weights


def held_in(answers):
    """Whether the intervals of the reliable ones among these answers hold their truth."""
    reliable = [(one, truth) for one, truth in answers if one.verdict == "reliable"]
    return [one.interval[0] <= truth <= one.interval[1] for one, truth in reliable]


def is_as_often_as_said(held):
    """In 93 to 99 % of the intervals, but for chance: the spread between windows is in them."""
    few = stats.binom.cdf(sum(held), len(held), 0.93)
    many = stats.binom.sf(sum(held) - 1, len(held), 0.99)
    return min(few, many) > ALARM


def is_mostly_reliable(answers):
    """Three quarters of them, but for chance."""
    return stats.binom.cdf(len(held_in(answers)), len(answers), 0.75) > ALARM


@pytest.mark.parametrize(("kind", "logger"), SHORT)
def test_a_log_is_answered_rightly_or_doubted(kind, logger):
    one, truth = answered(kind, logger, 500, PART[kind])
    assert one.verdict != "none"
    if one.verdict == "reliable":
        assert abs(one.time - truth) < 4.0 * one.stderr


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


def test_the_period_of_the_controller_says_how_commands_pass_between_rows():
    flight, log = made("rate", "commands: every fifth row", 1007, part=0.2)
    loop = log.loop(flight.kind.loop)
    assert period_of(log, "rate").time == 0.0025
    assert sampling_of(log, "rate", loop.setpoint) == ("held", 0.0, 0.0)
    # Five commands for a row: straight lines, and each holds for a period.
    assert sampling_of(log, "rate", loop.actuator) == ("straight", 0.0025, 0.0)
    # Positions of a PX4 are computed 50 times a second or more: half of the longest hold is taken.
    between, hold, unsure = sampling_of(log, "position", loop.actuator)
    assert (between, hold) == ("straight", 0.5 * loop.actuator.period)
    assert unsure == 0.25 * loop.actuator.period


def test_what_rare_commands_leave_open_makes_intervals_wider():
    each, rare = (
        answered("rate", f"{logger}", 1007, part=0.5)[0]
        for logger in ("every row", "commands: every fifth row")
    )
    width = [one.interval[1] - one.interval[0] for one in (each, rare)]
    assert width[1] > 2.0 * width[0]


def test_clocks_that_drift_apart_are_named_with_their_rate():
    # Over a short log the stamps alone show it.
    one, _ = answered("rate", "clocks drift by 100 ppm", 1001, part=0.4)
    assert one.verdict == "indication"
    assert (
        "the time stamps of vehicle_torque_setpoint.xyz[0] and vehicle_angular_velocity.xyz[0] "
        "drift apart by 100 ppm. If they come from two clocks, the time is wrong by 100 µs for each"
    ) in one.reason


@pytest.mark.survey
def test_a_time_that_grows_with_the_drift_of_clocks_is_named():
    # Over a long log it grows, whatever the stamps look like.
    one, _ = answered("long height", "clocks drift by 100 ppm, scattered stamps", 1000)
    assert one.verdict == "indication"
    assert "the time from command to response grows by " in one.reason


def times(drift, random, number=10):
    """Times of windows whose errors are as they say, under a drift."""
    at = np.linspace(5.0, 115.0, number)
    errors = 2e-3 * random.uniform(0.5, 2.0, number)
    values = 0.4 + drift * at + errors * random.standard_normal(number)
    rows = zip(at.tolist(), values.tolist(), errors.tolist(), strict=True)
    return [WindowTime(middle, value, error, 1.0) for middle, value, error in rows]


@pytest.mark.parametrize("drift", [0.0, 1e-4])
def test_the_time_grows_with_the_drift_of_the_clocks(drift):
    random = np.random.default_rng(2)
    off, wrong = [], 0
    for _ in range(400):
        found = growth_of(times(drift, random), 0.4, 0.0)
        off.append([(found.value - drift) / found.error, found.start / found.start_error])
        wrong += not found.may_be(drift)
    assert np.all(np.abs(np.mean(off, axis=0)) < 4.0 / np.sqrt(len(off)))
    assert np.all(np.std(off, axis=0) < 1.2)
    # A test at 1 %; errors of the best half are taken for their median.
    assert wrong <= stats.binom.isf(ALARM, 400, 0.01)


@pytest.mark.parametrize("gaps", [False, True])
def test_stamps_tell_how_fast_their_clocks_are(gaps):
    random = np.random.default_rng(1)
    sent = np.round(0.0025 * np.arange(4000), 6)
    received = np.round((1.0 + 7e-5) * (0.001 * np.arange(10_000) + 0.0003), 6)
    if gaps:
        sent, received = (one[random.uniform(size=one.size) < 0.7] for one in (sent, received))
    found = rate_of_drift(sent, received)
    assert abs(found.value - 7e-5) < found.most < 1e-6
    # Stamps that scatter tell less, and say so.
    found = rate_of_drift(sent, received + random.uniform(-2e-4, 2e-4, received.size))
    assert abs(found.value - 7e-5) < found.most


def test_stamps_that_are_not_regular_tell_no_rate():
    random = np.random.default_rng(1)
    regular = 0.0025 * np.arange(2000)
    assert rate_of_drift(regular, np.sort(random.uniform(0.0, 5.0, 2000))) is None
    assert rate_of_drift(regular[:40], regular) is None
    # Periods in no ratio of small whole numbers, as of tasks that have nothing to do with another.
    assert rate_of_drift(regular, 0.00207 * np.arange(2000)) is None


def test_a_recording_with_commands_of_another_clock_is_doubted():
    flight, _ = made("long height", "every row", 1000, part=0.2)
    time, sent = flight.time, (flight.time, flight.sent)
    same, other = (
        dtm.latency(dtm.Recording(apart * time, flight.setpoint, flight.read, sent=sent)).loops[0]
        for apart in (1.0, 1.0 + 1e-4)
    )
    assert same.verdict == "reliable"
    assert other.verdict == "indication"
    assert "the commands and the rows" in other.reason
    assert "by 100 ppm" in other.reason
