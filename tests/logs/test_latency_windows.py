"""The windows of a loop, and how its commands pass between rows."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import deadtime as dtm
import numpy as np
import pytest
from deadtime.logs.latencies._between import is_smooth, moving_mean, refined
from deadtime.logs.latencies._commands import Sampling
from deadtime.logs.latencies._relation import LoopLatency, _no_answer, relation_of
from deadtime.logs.latencies._table import cells_of
from deadtime.logs.latencies._windows import (
    MOST,
    Window,
    best_of,
    movement_of,
    parts_of,
    prepared,
    that_follow,
    whole_of,
)
from hypothesis import given, strategies as st

# --- between rows -----------------------------------------------------------------------------


def test_a_sine_is_smooth_and_a_random_telegraph_is_not():
    rows = np.arange(200.0)
    assert is_smooth(np.sin(0.4 * rows))
    jumps = np.random.default_rng(1).choice([-1.0, 1.0], 200)
    assert not is_smooth(np.repeat(jumps, 5)[:200])
    assert not is_smooth(np.sin(0.4 * rows[:11]))


@pytest.mark.parametrize("uneven", [0.0, 0.2])
def test_a_smooth_command_is_the_cubic_through_its_rows(uneven):
    random = np.random.default_rng(2)
    time = 0.1 * (np.arange(120.0) + uneven * random.uniform(-1.0, 1.0, 120))
    fine, values = refined(time, np.sin(5.0 * time))
    inside = (fine > time[3]) & (fine < time[-4])
    off = np.max(np.abs(values - np.sin(5.0 * fine))[inside])
    line = np.max(np.abs(np.interp(fine, time, np.sin(5.0 * time)) - np.sin(5.0 * fine))[inside])
    # Errors of lines and cubics: h² y''/8 and 3 h⁴ y''''/128 for the interpolation by neighbours.
    assert line == pytest.approx((0.1 * 5.0) ** 2 / 8.0, rel=0.6)
    assert off < 0.1 * line
    # A jump stays as it is.
    step = np.where(time < 6.0, 0.0, 1.0)
    assert refined(time, step)[1] is step


def mean_of(time, values, between, low, high):
    """The mean of a command over an interval, from many points."""
    at = np.linspace(low, high, 20_001)
    at = 0.5 * (at[1:] + at[:-1])
    if between == "straight":
        return np.mean(np.interp(at, time, values))
    rows = np.searchsorted(time, at + 1e-12, side="right") - 1
    return np.mean(values[np.maximum(rows, 0)])


@given(st.integers(0, 2**32 - 1), st.sampled_from(["held", "straight"]))
def test_the_mean_of_a_command_is_that_of_its_area(seed, between):
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.01, 0.2, 12))
    values = random.standard_normal(12)
    width = float(random.uniform(0.02, 0.3))
    at, means = moving_mean(time, values, between, width)
    assert at[0] == time[0]
    assert at[-1] == time[-1]
    assert np.max(np.diff(at)) <= width
    for place in random.integers(0, at.size, 3):
        ends = at[place] - 0.5 * width, at[place] + 0.5 * width
        wanted = mean_of(time, values, between, *ends)
        assert means[place] == pytest.approx(wanted, abs=2e-3)


def test_the_mean_of_a_ramp_is_the_ramp():
    time = np.linspace(0.0, 2.0, 21)
    at, means = moving_mean(time, 3.0 * time, "straight", 0.15)
    inside = (at > 0.1) & (at < 1.9)
    np.testing.assert_allclose(means[inside], 3.0 * at[inside], atol=1e-12)
    # Held from row to row it is half a row later.
    at, means = moving_mean(time, 3.0 * time, "held", 0.2)
    inside = (at > 0.1) & (at < 1.9)
    rows = np.isclose(at % 0.1, 0.0, atol=1e-9) | np.isclose(at % 0.1, 0.1, atol=1e-9)
    np.testing.assert_allclose(means[inside & rows], 3.0 * (at[inside & rows] - 0.05), atol=1e-9)


@pytest.mark.parametrize("between", ["held", "straight"])
def test_means_of_rows_have_the_time_of_the_rows(between):
    """Filters commute: a plant answers to the mean of a command with the mean of its response."""
    random = np.random.default_rng(3)
    fine = np.arange(0.0, 8.0, 5e-4)
    sent = np.arange(0.0, 8.0, 0.004)
    told = np.cumsum(random.standard_normal(sent.size)) * 0.05
    told = told if between == "straight" else np.repeat(told[::50], 50)[: told.size]
    at = np.interp(fine, sent, told) if between == "straight" else np.repeat(told, 8)
    late = 100
    # Rows in the middle between changes, so that their mean is that of the time around them.
    output = np.concatenate([np.full(late, at[0]), at[:-late]])[2::4]
    output = output + 1e-3 * random.standard_normal(output.size)
    row = dtm.Recording(fine[2::4], np.zeros(output.size), output, sent=(sent, told))
    few = prepared(row, "rate", Sampling(between), 8)
    assert len(few) == len(row) // 8
    assert few.sample_time == pytest.approx(8.0 * row.sample_time)
    fit = dtm.estimate_delay(few, between="straight", plant="delay", largest_delay=0.2)
    low, high = fit.ci()
    assert low < 0.05 < high
    assert high - low < 0.1 * few.sample_time


# --- which windows ----------------------------------------------------------------------------


def recording(rows=40, start=0.0):
    time = start + 0.02 * np.arange(rows)
    command = np.sin(7.0 * time)
    return dtm.Recording(time, command, command, command)


def windows(number, **changes):
    found = []
    for place in range(number):
        start = 0.8 * place
        own = recording(start=start)
        found.append(Window(start, start + 0.78, own, 1.0, 0, 0.9, 0.1))
    return [one._replace(**{name: values[k] for name, values in changes.items()})
            for k, one in enumerate(found)]  # fmt: skip


def test_windows_that_do_not_follow_as_the_others_are_left_out():
    # The third moves the most and answers nothing, the fifth answers much too late.
    some = windows(
        6,
        movement=[1.0, 1.0, 9.0, 1.0, 1.0, 1.0],
        follows=[0.9, 0.8, 0.2, 0.9, 0.9, 0.7],
        late=[0.1, 0.12, 0.1, 0.09, 0.5, 0.08],
    )
    assert that_follow(some) == [some[0], some[1], some[3], some[5]]
    # Two rows more or less are no reason, however short the time.
    some = windows(5, late=[0.0, 0.02, 0.04, 0.0, 0.02])
    assert that_follow(some) == some
    # Of three nobody knows which is right; windows at rest do not count.
    assert len(that_follow(windows(3, follows=[0.9, 0.1, 0.9]))) == 3
    some = windows(5, follows=[0.9, 0.1, 0.9, 0.1, 0.1], movement=[1.0, 1.0, 1.0, 0.0, 0.0])
    assert that_follow(some) == some


def test_those_that_move_the_most_are_fitted_first():
    some = windows(5, movement=[0.0, 0.01, 1.0, 0.8, 0.02])
    assert best_of(some) == [(some[2].start, some[3].stop)]
    assert whole_of(some) == [(some[2].start, some[3].stop)]
    # A window at rest between two ends a run, and not the whole.
    some = windows(5, movement=[1.0, 0.0, 1.0, 0.0, 0.5])
    assert best_of(some) == [(some[k].start, some[k].stop) for k in (0, 2)]
    assert whole_of(some) == [(some[0].start, some[4].stop)]
    # Segments are apart from another.
    some = windows(4, segment=[0, 0, 1, 1])
    assert whole_of(some) == [(some[0].start, some[1].stop), (some[2].start, some[3].stop)]
    assert best_of(windows(2, movement=[0.0, 0.0])) == []


def test_no_more_rows_than_are_quick_are_fitted_first():
    some = [one._replace(recording=recording(500)) for one in windows(6)]
    rows = [500 * round((stop - start) / 0.8 + 0.5) for start, stop in best_of(some)]
    assert sum(rows) <= MOST
    # One that is longer than that is better than none.
    some = [one._replace(recording=recording(MOST + 1)) for one in windows(2)]
    assert len(best_of(some)) == 1


# --- the mean over frequencies, and windows that differ -----------------------------------------

#: The lag of the vehicle, and the time between rows, s.
LAG, STEP = 0.08, 0.02


def flown(delays, seconds=6.0, noise=0.003):
    """Parts of a flight, each with a delay of its own: the whole, and its windows."""
    random = np.random.default_rng(4)
    rows, found = round(seconds / STEP), []
    for place, delay in enumerate(delays):
        time = STEP * np.arange(rows)
        told = 0.2 * np.sign(np.sin(3.7 * time + 0.3 * place))
        vehicle = dtm.FactoredPlant([LAG]).transfer_function() * dtm.delay(delay)
        angle = np.ravel(vehicle.simulate(time, told).outputs)
        angle = angle + noise * random.standard_normal(rows)
        start = place * (seconds + 2.0)
        found.append(dtm.Recording(start + time, told, angle, told))
    return found


def answer_of(parts, sampling=None):
    """The time of parts that are windows, and whole segments, of their own."""
    some = [parts_of(one) for one in parts]
    own = [
        Window(one.time[0], one.time[-1], one, movement_of(one), place)
        for place, (one, _) in enumerate(some)
    ]

    def part(start, stop):
        one = next(one for one in own if one.start <= start and stop <= one.stop)
        return one.recording.window(start, stop)

    nothing = LoopLatency("roll", "roll", "attitude", "setpoint", "none", "", sampling=sampling)
    return relation_of(nothing, own, part)


@pytest.fixture(scope="module")
def alike():
    return answer_of(flown([0.03] * 4))


def test_the_time_is_the_mean_over_the_frequencies_at_which_the_response_moves(alike):
    omega = alike.frequencies
    assert np.all(np.diff(omega) > 0.0)
    assert alike.weights.sum() == pytest.approx(1.0)
    true = (0.03 + np.arctan(LAG * omega) / omega) @ alike.weights
    low, high = alike.interval
    assert low < true < high
    # A square wave through one lag moves by 1/(1 + (n w lag)²) of each odd harmonic alike.
    odd = 3.7 * np.arange(1, 30, 2)
    power = 1.0 / (1.0 + (LAG * odd) ** 2)
    wanted = (0.03 + np.arctan(LAG * odd) / odd) @ power / power.sum()
    assert true == pytest.approx(wanted, rel=0.05)
    # It is below delay and lag, which only slow moves take.
    assert high < 0.03 + LAG


def test_windows_that_differ_by_more_than_their_errors_make_the_interval_wider(alike):
    apart = answer_of(flown([0.03, 0.03, 0.05, 0.05]))
    assert alike.spread.count == apart.spread.count == 4
    assert alike.spread.p_value > 0.01 > apart.spread.p_value
    first, second, third, _ = (one.time for one in apart.times)
    assert second == pytest.approx(first, abs=2e-3)
    assert third == pytest.approx(first + 0.02, abs=2e-3)
    low, high = apart.interval
    assert high - low > 5.0 * (alike.interval[1] - alike.interval[0])
    # The mean over windows, and each of them within the spread.
    assert apart.time == pytest.approx(np.mean([one.time for one in apart.times]), abs=1e-3)
    assert low < min(one.time for one in apart.times)
    assert high > max(one.time for one in apart.times)


def test_windows_that_hardly_move_say_nothing_about_the_spread():
    parts = flown([0.03] * 4)
    faint = [replace(one, output=0.02 * one.output, command=0.02 * one.command)
             for one in flown([0.08])]  # fmt: skip
    faint = [replace(one, time=one.time + 50.0, sent=None) for one in faint]
    found = answer_of(parts + faint)
    assert [one.at < 40.0 for one in found.times] == [True] * 4


def test_few_windows_are_an_indication(alike):
    assert alike.verdict == "reliable"
    few = answer_of(flown([0.03], seconds=1.6))
    assert few.verdict == "indication"
    assert (
        few.reason == "a time needs 4 windows that determine the time alone, but there are only 1"
    )


def test_a_plant_that_is_not_determined_has_a_time_where_windows_show_it(alike):
    fit = alike.estimate
    unknown = SimpleNamespace(
        best=fit.best,
        recording=fit.recording,
        verdict="none",
        reason="the command changes too little",
    )
    found = replace(alike, estimate=unknown)
    assert _no_answer(found) == ""
    assert _no_answer(replace(found, times=found.times[:3])) == unknown.reason
    assert _no_answer(replace(alike, times=alike.times[:3])) == ""


def test_an_interval_from_zero_is_shown_as_a_bound(alike):
    one = replace(alike, time=0.033, interval=(0.0, 0.0902))
    assert one.shown() == "below 90 ms (95 %)"
    assert cells_of(one)[2:5] == ("below 90 ms", "0 to 90 ms", "reliable")
    assert one.doubted("it may be").shown() == "about 33.0 ms"
    assert "below" not in alike.shown()


def test_a_response_against_its_command_is_no_answer():
    parts = [replace(one, output=-one.output) for one in flown([0.03] * 2)]
    found = answer_of(parts)
    assert found.verdict == "none"
    assert found.reason.startswith("the response moves in the opposite direction")
    assert found.estimate is None


def test_what_a_log_leaves_unknown_is_in_the_interval(alike):
    unsure = answer_of(flown([0.03] * 4), Sampling("held", 0.0, 0.02))
    for one, other, way in zip(alike.interval, unsure.interval, (-1.0, 1.0), strict=True):
        assert other == pytest.approx(one + way * 0.02, abs=1e-5)


def test_parts_of_a_recording_have_the_commands_before_them():
    (one,) = flown([0.03], seconds=12.0)
    whole, parts = parts_of(one)
    assert [part.start for part in parts[1:]] == [part.stop for part in parts[:-1]]
    for before, part in pairwise(parts):
        assert part.recording.sent.time[0] == whole.sent.time[0]
        assert part.recording.time[0] >= before.recording.time[-1]
