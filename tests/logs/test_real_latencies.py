"""Times of recorded vehicles, against what is known of them, and against one another."""

from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from deadtime.logs.latencies._latency import latency_of
from flights import flight_path

#: File, loop, and lowest and highest time of independent fits and cross-correlations, ms. Of a few
#: windows there are several; delay and lag together are more than the mean over frequencies.
KNOWN = [
    ("copter_erlebrain_24.bin", "roll rate", 69.0, 94.0),
    ("copter_erlebrain_24.bin", "roll", 29.0, 43.0),
    ("copter_2015_83.bin", "roll", 132.0, 135.0),
    ("copter_2014_37.bin", "roll", 255.0, 255.0),
    ("copter_barker_3.bin", "roll", 194.0, 310.0),
    ("arducopter_2014-10-18_21-19-07.bin", "roll", 220.0, 270.0),
    ("arducopter_2014-10-18_21-19-07.bin", "pitch", 170.0, 210.0),
    ("px4_s250_gyro_only.ulg", "roll rate", 41.0, 47.0),
    ("px4_s250_gyro_only.ulg", "pitch rate", 41.0, 47.0),
    ("px4_sitl_takeoff.ulg", "vertical speed", 100.0, 140.0),
]

#: Farthest an indication may lie from what is known, as a share of it.
NEAR = 0.3

#: Loops whose setpoint moves enough to be known from half of the flight.
HALVED = [
    ("copter_2015_83.bin", "roll"),
    ("copter_2015_83.bin", "pitch"),
    ("copter_barker_3.bin", "roll"),
    ("copter_barker_3.bin", "pitch"),
    ("arducopter_2014-10-18_21-19-07.bin", "roll"),
    ("arducopter_2014-10-18_21-19-07.bin", "pitch"),
    ("copter_att_24hz_sticks_idle_truth_111.5ms.bin", "roll"),
    ("copter_rate_24hz_truth_62.5ms.bin", "roll rate"),
    ("px4_s250_gyro_only.ulg", "roll rate"),
    ("px4_s250_gyro_only.ulg", "pitch rate"),
]


def opened(name):
    if name.endswith(".ulg"):
        pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    return dtm.open_log(flight_path(name))


@pytest.mark.survey
@pytest.mark.parametrize(("name", "loop", "least", "most"), KNOWN)
def test_times_of_recorded_vehicles_are_those_of_independent_fits(name, loop, least, most):
    log = opened(name)
    one = latency_of(log, log.loop(loop), "setpoint")
    low, high = (1e3 * end for end in one.interval)
    print(f"{name} {loop}: {one.headline()}, known {least:g} to {most:g} ms; {one.reason}")
    if one.verdict == "reliable":
        assert low <= most
        assert high >= least
    elif one.verdict == "indication":
        assert (1.0 - NEAR) * least <= 1e3 * one.time <= (1.0 + NEAR) * most


@pytest.mark.parametrize(
    ("name", "time"),
    [
        ("copter_rate_24hz_truth_62.5ms.bin", 0.0625),
        ("copter_att_24hz_sticks_idle_truth_111.5ms.bin", 0.1115),
    ],
)
def test_logs_of_known_truth_are_reliable_and_hold_it(name, time):
    log = dtm.open_log(flight_path(name))
    for loop in ("roll rate", "roll"):
        one = latency_of(log, log.loop(loop), "setpoint")
        assert one.verdict == "reliable", one.reason
        low, high = one.estimate.ci(0.95, "delay+lag")
        assert low < time < high
        # The mean over frequencies is below delay and lag, because lags delay less there.
        plant = one.estimate.best
        w = one.frequencies
        angle = np.angle(plant.plant.transfer_function()(1j * w))
        short = plant.lag_sum + float(angle / w @ one.weights)
        assert one.interval[0] < time - short < one.interval[1]
        assert high - low < 0.04 * time


def halves_of(loop):
    """The loop with the first and with the second half of the time in which it is followed."""
    ends = np.array(loop.segments)
    middle = 0.5 * np.sum(ends[:, 1] - ends[:, 0])
    first, second, so_far = [], [], 0.0
    for low, high in loop.segments:
        cut = min(max(low + middle - so_far, low), high)
        so_far += high - low
        first += [(low, cut)] if cut > low else []
        second += [(cut, high)] if cut < high else []
    return [replace(loop, segments=tuple(some)) for some in (first, second)]


def test_halves_are_of_equal_length_and_in_order():
    loop = opened("copter_2015_83.bin").loop("roll")
    first, second = halves_of(loop)
    assert first.followed == pytest.approx(second.followed)
    assert first.followed + second.followed == pytest.approx(loop.followed)
    assert first.segments[-1][1] == second.segments[0][0] or second.segments[0] in loop.segments


@pytest.mark.survey
def test_halves_of_a_flight_that_are_both_reliable_overlap():
    """A vehicle that changes, or a spread that is not in the interval, would show here."""
    both, apart = 0, []
    for name, loop in HALVED:
        log = opened(name)
        first, second = (latency_of(log, half, "setpoint") for half in halves_of(log.loop(loop)))
        print(f"{name} {loop}: {first.headline()} | {second.headline()}")
        if first.verdict == second.verdict == "reliable":
            both += 1
            low = max(first.interval[0], second.interval[0])
            if low > min(first.interval[1], second.interval[1]):
                apart.append((name, loop, first.shown(), second.shown()))
    # Two intervals of 95 % miss one another far less often than one of twenty times.
    assert both >= 3
    assert not apart
