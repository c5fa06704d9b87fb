"""What a linear plant lacks is found by name and size, and bad readings are left out."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any

import deadtime as dtm
import numpy as np
import pytest

ROW, PARTS, ROWS = 0.065, 5, 460

#: Gain, lag and delay of the vehicle; the delay is a whole number of parts of a row.
GAIN, LAG, DELAY = 0.9, 0.35, 0.26


def actuator(cause: str, size: float, command: float, last: float) -> float:
    """What an actuator makes of a command."""
    if cause == "play":
        return min(max(last, command - 0.5 * size), command + 0.5 * size)
    if cause == "stiction":
        return command if abs(command - last) > size else last
    if cause == "dead zone":
        return math.copysign(max(abs(command) - size, 0.0), command)
    if cause == "unequal limits":
        return max(command, -size)
    return command


def flown(cause: str = "", size: float = 0.0, seed: int = 1) -> dtm.Recording:
    """Heights under P control of a vehicle with a cause, exact between the parts of a row."""
    rng = np.random.default_rng(seed)
    step = ROW / PARTS
    decay = math.exp(-step / LAG)
    queue = deque([0.0] * (round(DELAY / step) + 1), maxlen=round(DELAY / step) + 1)
    reference = np.zeros(ROWS)
    for row in range(20, ROWS, 70):
        reference[row:] = rng.choice([0.0, 0.8, 1.5, -0.7])
    height = speed = moved = 0.0
    output, command = np.zeros(ROWS), np.zeros(ROWS)
    for row in range(ROWS):
        output[row] = height + 0.003 * rng.standard_normal()
        command[row] = min(max(1.3 * (reference[row] - output[row]), -1.0), 1.0)
        moved = actuator(cause, size, command[row], moved)
        for _ in range(PARTS):
            queue.append(moved + (size if cause == "load" and row > 230 else 0.0))
            gain = GAIN * (1.0 + (size * (row / ROWS - 0.5) if cause == "gain ramp" else 0.0))
            goal = gain * queue[0]
            height += goal * step + (speed - goal) * LAG * (1.0 - decay)
            speed = goal + (speed - goal) * decay
    return dtm.Recording(np.arange(ROWS) * ROW, reference, output, command)


def equivalent_delay(omega: float) -> float:
    return DELAY + math.atan(omega * LAG) / omega


def check_the_linear_part(fit: dtm.PlantEstimate, off: float = 0.0) -> None:
    """Reliable, and right but for an error that is a share of each number."""
    assert fit.verdict == "reliable", fit.reason
    seen = fit.at([1.0, 2.0])
    for place, omega in enumerate((1.0, 2.0)):
        gain = GAIN / omega / math.hypot(1.0, omega * LAG)
        # Errors of one record in twenty exceed their 95 % interval: half as much again is allowed.
        for value, (low, high) in (
            (gain, seen.gain_ci[:, place]),
            (equivalent_delay(omega), seen.delay_ci[:, place]),
        ):
            reach = 0.75 * (high - low)
            assert abs(value - 0.5 * (low + high)) < reach + off * value
            assert reach < 0.15 * value


@pytest.mark.parametrize(
    ("cause", "size"),
    [
        ("play", 0.05),
        ("dead zone", 0.03),
        ("stiction", 0.1),
        ("unequal limits", 0.6),
        ("gain ramp", 0.1),
        ("load", 0.05),
    ],
)
def test_a_cause_is_named_with_its_size(cause: str, size: float) -> None:
    fit = dtm.estimate_delay(flown(cause, size))
    first = fit.causes[0]
    assert first.name == cause
    assert first.size == pytest.approx(size, rel=0.1)
    assert first.lead > 30.0
    assert first.ci[0] <= first.size <= first.ci[1]
    assert f"found: {first.in_words()}" in fit.summary()
    assert fit.to_dict()["causes"][0]["name"] == cause
    # When an actuator that sticks moves is not known to a row.
    check_the_linear_part(fit, 0.05 if cause == "stiction" else 0.0)


def bumped(cause: str, size: float, lags: tuple[float, ...], seed: int = 1) -> dtm.Recording:
    """Steps of the command around 40, of a process that rests at 60, with a dead time of 10 s."""
    rng = np.random.default_rng(seed)
    rows, parts, late = 500, 10, 10
    command = np.zeros(rows)
    for row in range(30, rows, 80):
        command[row:] = rng.choice([-6.0, -3.0, 4.0, 8.0])
    states, output = [0.0] * len(lags), np.zeros(rows)
    for row in range(rows):
        output[row] = states[-1] + 0.1 * rng.standard_normal()
        sent = command[max(row - late, 0)]
        for _ in range(parts):
            gain = 1.8
            if cause == "gain ramp":
                gain *= 1.0 + size * (row / rows - 0.5)
            if cause == "gain by level":
                gain *= 1.0 + size * states[-1] / 20.0
            goal = gain * sent
            for place, lag in enumerate(lags):
                goal += (states[place] - goal) * math.exp(-1.0 / parts / lag)
                states[place] = goal
    return dtm.Recording(np.arange(rows) * 1.0, None, output + 60.0, command + 40.0)


@pytest.mark.parametrize("cause", ["gain ramp", "gain by level"])
@pytest.mark.parametrize("lags", [(40.0, 12.0), (30.0, 20.0, 12.0)])
def test_a_gain_that_changes_around_an_operating_point_is_named(cause, lags) -> None:
    """Also of three lags, of which the family has two."""
    fit = dtm.estimate_delay(bumped(cause, 0.25, lags))
    first = fit.causes[0]
    assert (fit.verdict, first.name) == ("reliable", cause)
    if cause == "gain ramp":
        assert first.size == pytest.approx(0.25, rel=0.15)
    # The response at 0.02 rad/s of changes of the command around 40.
    omega = 0.02
    gain = 1.8 / math.prod(math.hypot(1.0, omega * lag) for lag in lags)
    delay = 10.0 + sum(math.atan(omega * lag) for lag in lags) / omega
    seen = fit.at([omega])
    assert seen.delay_ci[0, 0] - 0.5 < delay < seen.delay_ci[1, 0] + 0.5
    assert 0.9 * seen.gain_ci[0, 0] < gain < 1.1 * seen.gain_ci[1, 0]


def test_causes_that_the_recording_does_not_distinguish_are_named_together() -> None:
    cause = replace(dtm.estimate_delay(flown("play", 0.05)).causes[0], others=("drag",))
    assert cause.in_words().startswith("play or drag, which the recording does not distinguish; ")


def limited(slope: float, dead_zone: float = 0.0, seed: int = 1) -> dtm.Recording:
    """The vehicle of `flown`, whose acceleration is at most GAIN times `slope`."""
    rng = np.random.default_rng(seed)
    parts = 40
    step = ROW / parts
    share = 1.0 - math.exp(-step / LAG)
    queue = deque([0.0] * (round(DELAY / step) + 1), maxlen=round(DELAY / step) + 1)
    reference = np.zeros(ROWS)
    for row in range(20, ROWS, 70):
        reference[row:] = rng.choice([0.0, 0.8, 1.5, -0.7])
    height = speed = 0.0
    output, command = np.zeros(ROWS), np.zeros(ROWS)
    for row in range(ROWS):
        output[row] = height + 0.003 * rng.standard_normal()
        command[row] = min(max(1.3 * (reference[row] - output[row]), -1.0), 1.0)
        for _ in range(parts):
            queue.append(actuator("dead zone", dead_zone, command[row], 0.0))
            change = min(max((queue[0] - speed) * share, -slope * step), slope * step)
            height += GAIN * (speed + 0.5 * change) * step
            speed += change
    return dtm.Recording(np.arange(ROWS) * ROW, reference, output, command)


def test_a_limit_of_the_slope_is_named_and_a_dead_zone_before_it() -> None:
    known = {"controller": dtm.P(1.3), "limit": 1.0, "between": "held"}
    fit = dtm.estimate_delay(limited(0.9), **known)
    assert [cause.name for cause in fit.causes] == ["slope limit"]
    assert fit.causes[0].size == pytest.approx(0.9, rel=0.03)
    check_the_linear_part(fit)
    both = dtm.estimate_delay(limited(0.9, 0.08), **known)
    assert {cause.name: round(cause.size, 2) for cause in both.causes} == {
        "slope limit": pytest.approx(0.9, abs=0.04),
        "dead zone": pytest.approx(0.08, abs=0.015),
    }
    check_the_linear_part(both)


def test_a_load_is_found_when_it_begins() -> None:
    (cause, *_) = dtm.estimate_delay(flown("load", -0.06)).causes
    assert cause.time == pytest.approx(231 * ROW, abs=ROW)
    assert cause.size == pytest.approx(-0.06, rel=0.05)


def test_a_linear_plant_has_no_cause() -> None:
    for seed in range(1, 5):
        fit = dtm.estimate_delay(flown(seed=seed))
        assert fit.causes == ()
        assert fit.sensor_faults == ()
        check_the_linear_part(fit)


def test_without_causes_none_is_looked_for() -> None:
    fit = dtm.estimate_delay(flown("play", 0.05), causes=False)
    assert fit.causes == ()


def spoilt(**rows: Any) -> dtm.Recording:
    """The flight of a linear vehicle whose sensor fails afterwards."""
    clean = flown()
    output = clean.output.copy()
    for first, last in rows.get("frozen", ()):
        output[first:last] = output[first]
    for first, last in rows.get("glitch", ()):
        output[first:last] += 0.6
    for row in rows.get("repeated", ()):
        output[row] = output[row - 1]
    return dtm.Recording(clean.time, clean.reference, output, clean.command)


@pytest.mark.parametrize(
    ("name", "rows", "left_out"),
    [
        ("frozen", [(150, 190)], 39),
        ("glitch", [(60, 63), (140, 141), (300, 304)], 8),
        ("repeated", range(3, 460, 4), 115),
        ("repeated", (100, 240, 310), 3),
    ],
)
def test_what_a_sensor_did_not_read_is_left_out(name: str, rows: Any, left_out: int) -> None:
    fit = dtm.estimate_delay(spoilt(**{name: rows}))
    (fault,) = (one for one in fit.sensor_faults if one.name == name)
    # Few of them end in a step that may be one of a coarse sensor.
    assert 0.95 * left_out <= fault.rows <= left_out
    assert f"left out: {fault.in_words()}" in fit.summary()
    check_the_linear_part(fit)


def test_equal_readings_of_a_fine_sensor_are_rounded_ones() -> None:
    clean = flown()
    output = np.round(spoilt(repeated=(100, 240, 310)).output / 1e-4) * 1e-4
    fit = dtm.estimate_delay(dtm.Recording(clean.time, clean.reference, output, clean.command))
    assert fit.sensor_faults == ()


@pytest.mark.parametrize("rows", [3, 5, 9])
def test_the_length_of_a_moving_mean_is_named(rows: int) -> None:
    clean = flown()
    padded = np.pad(clean.output, rows // 2, "edge")
    smooth = np.convolve(padded, np.full(rows, 1.0 / rows), "valid")
    fit = dtm.estimate_delay(dtm.Recording(clean.time, clean.reference, smooth, clean.command))
    (fault,) = fit.sensor_faults
    assert fault.name == "smoothed"
    assert fault.size == pytest.approx(rows, abs=0.02)
    assert f"found: {fault.in_words()}" in fit.summary()
    assert fit.causes == ()
    # As well known as if nothing were smoothed.
    check_the_linear_part(fit)


def test_a_filter_is_no_moving_mean() -> None:
    clean = flown()
    smooth = clean.output.copy()
    for row in range(1, ROWS):
        smooth[row] = smooth[row - 1] + 0.4 * (clean.output[row] - smooth[row - 1])
    fit = dtm.estimate_delay(dtm.Recording(clean.time, clean.reference, smooth, clean.command))
    assert fit.sensor_faults == ()


def stepped(jitter: float, seed: int = 3) -> dtm.Recording:
    """A process with a time constant of 8 s whose commands arrive late by a normal number of s."""
    rng = np.random.default_rng(seed)
    time = np.arange(700.0)
    command = np.zeros(time.size)
    output = np.zeros(time.size)
    level = 0.0
    for row in range(30, time.size, 25):
        step = rng.choice([-3.0, 3.0]) if level == 0.0 else -level
        level += step
        command[row:] += step
        begun = row + 4.3 + jitter * rng.standard_normal()
        output += 1.5 * step * -np.expm1(-np.maximum(time - begun, 0.0) / 8.0)
    output += 0.02 * rng.standard_normal(time.size)
    return dtm.Recording(time, None, output, command)


def test_jitter_of_the_commands_is_named() -> None:
    fit = dtm.estimate_delay(stepped(0.3), between="held")
    (cause,) = fit.causes
    assert cause.name == "jitter"
    assert cause.size == pytest.approx(0.3, rel=0.35)
    assert dtm.estimate_delay(stepped(0.0), between="held").causes == ()


def test_flights_that_differ_widen_the_interval_of_the_vehicle() -> None:
    def flights(*gains: float) -> list[dtm.Recording]:
        return [
            dtm.Recording(one.time, one.reference, one.output, one.command / gain)
            for gain, one in zip(gains, (flown(seed=1), flown(seed=2)), strict=True)
        ]

    known = {"controller": [dtm.P(1.3)] * 2, "limit": 1.0, "causes": False}
    alike = dtm.estimate_delay(flights(1.0, 1.0), **known)
    differ = dtm.estimate_delay(flights(1.03, 0.97), **known)
    gain = GAIN / 2.0 / math.hypot(1.0, 2.0 * LAG)
    low, high = alike.at(2.0).gain_ci[:, 0]
    assert low < gain < high
    assert high - low < 0.08 * gain
    low, high = differ.at(2.0).gain_ci[:, 0]
    assert low < 0.97 * gain
    assert high > 1.03 * gain


def test_equal_readings_of_a_coarse_sensor_are_readings() -> None:
    clean = flown()
    for step in (0.001, 0.01):
        rounded = np.round(clean.output / step) * step
        fit = dtm.estimate_delay(dtm.Recording(clean.time, clean.reference, rounded, clean.command))
        assert fit.sensor_faults == ()


def test_outliers_beside_one_another_are_left_out_and_pulses_are_not():
    random = np.random.default_rng(5)
    time = np.arange(600.0)
    command = np.where(time < 60, 40.0, np.where(time < 300, 45.0, 42.0))
    level = np.zeros(600)
    for at in range(13, 600):
        level[at] = level[at - 1] + (1.8 * (command[at - 13] - 40.0) - level[at - 1]) / 40.0
    level += random.normal(0.0, 0.05, 600)
    level[[0, 100, 106, 111, 350, 599]] += 8.0
    fit = dtm.estimate_delay(dtm.Recording(time, None, level, command))
    assert fit.verdict == "reliable"
    assert [(one.name, one.rows) for one in fit.sensor_faults] == [("glitch", 6)]
    low, high = fit.ci()
    assert low < 12.0 < high
    # A lag of two rows answers pulses of three.
    pulses = np.zeros(600)
    for start in range(40, 560, 60):
        pulses[start : start + 3] = random.uniform(0.7, 1.3)
    answer = np.zeros(600)
    for at in range(5, 600):
        answer[at] = answer[at - 1] + (1.0 - np.exp(-0.5)) * (pulses[at - 5] - answer[at - 1])
    answer += random.normal(0.0, 0.01, 600)
    fit = dtm.estimate_delay(dtm.Recording(time, None, answer, pulses))
    assert fit.sensor_faults == ()
    assert fit.verdict == "reliable"
    assert fit.delay == pytest.approx(4.0, abs=0.05)


@pytest.mark.parametrize("step", [0.7, 1.3])
def test_the_rounding_of_a_coarse_sensor_is_named(step: float) -> None:
    time = np.arange(900.0)
    command = np.select([time < 100, time < 400, time < 650], [50.0, 55.0, 48.0], 52.0)
    level = np.zeros(900)
    for at in range(13, 900):
        level[at] = level[at - 1] + (1.5 * (command[at - 13] - 50.0) - level[at - 1]) / 40.0
    fit = dtm.estimate_delay(dtm.Recording(time, None, step * np.round(level / step), command))
    assert fit.verdict != "reliable"
    assert f"in steps of {step:g}" in fit.reason
    assert "finer" in fit.advice().words
