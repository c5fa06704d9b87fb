"""Commands with times of their own, and what is unknown of them between rows."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import refit
from flown_plants import Plant
from marks import NIGHTLY
from scipy import stats

#: Of the controller and of rows, s; the plant, whose lag is long against the rows.
PERIOD, ROW, DELAY, LAG, GAIN = 0.0025, 0.08, 0.05, 0.15, 0.9

#: A share of wrong intervals that is no accident.
ALARM = 0.01

#: Commands for each row.
EVERY = round(ROW / PERIOD)


def flown(seed, pace=0.5, seconds=16.0, noise=0.004, every=EVERY, rows=None):
    """Commands that jump at any time, known at some rows, and what comes of all of them."""
    random = np.random.default_rng([seed, 5])
    count = round(seconds / PERIOD)
    changes = np.cumsum(random.exponential(pace, count // 40))
    levels = random.choice([-1.0, 1.0], changes.size + 1) * random.uniform(
        0.3, 1.0, changes.size + 1
    )
    at = PERIOD * np.arange(count)
    sent = levels[np.searchsorted(changes, at, side="right")]
    time = at[::every] if rows is None else rows
    plant = Plant("lag", DELAY, LAG, gain=GAIN)
    output = plant.response(time, PERIOD, sent) + noise * random.standard_normal(time.size)
    known = slice(int(random.integers(every)), None, every)
    told = np.append(at[0], at[known][1:]), sent[known]
    return dtm.Recording(time, None, output, sent=told)


def of(recording, **given):
    return dtm.estimate_delay(recording, integrates=False, largest_delay=0.5, **given)


@pytest.fixture(scope="module")
def sparse():
    return flown(1)


@pytest.fixture(scope="module")
def straight(sparse):
    return of(sparse, between="straight", hold=PERIOD)


@pytest.fixture(scope="module")
def dense():
    """Each command is known, at times that are no rows."""
    return of(flown(2, every=1, rows=np.arange(0.0, 15.9, 0.0533)), between="held")


def test_each_command_holds_from_its_own_time(dense):
    assert dense.verdict == "reliable"
    for name, truth in (("delay", DELAY), ("lag", LAG), ("delay+lag", DELAY + LAG)):
        low, high = dense.ci(0.99, name)
        assert low < truth < high, name
    assert dense.recording.sent.time.size > 10 * len(dense.recording)
    # A quarter of a row: the times of the commands are those of the estimate.
    low, high = dense.ci(0.95, "delay+lag")
    assert high - low < 0.25 * 0.0533


def test_the_sum_of_delay_and_lag_has_an_interval_of_its_own(dense):
    low, high = dense.ci(0.95, "delay+lag")
    assert low < dense.delay_plus_lag < high
    # Errors of both cancel in the sum.
    apart = [np.diff(dense.ci(0.95, name)).item() for name in ("delay", "lag")]
    assert high - low < np.hypot(*apart)
    assert dense.delay_plus_lag == pytest.approx(dense.best.delay + dense.best.lag_sum)
    # It is the equivalent delay as the frequency goes to zero, with its interval.
    value, ends = dense.mean_delay([1e-3], [1.0])
    assert value == pytest.approx(dense.delay_plus_lag, rel=1e-4)
    assert ends == pytest.approx((low, high), abs=0.1 * (high - low))


def test_straight_commands_are_half_of_the_hold_later(sparse, straight):
    late = of(sparse, between="straight", hold=0.04)
    assert straight.delay - late.delay == pytest.approx(0.5 * (0.04 - PERIOD), abs=2e-3)
    # A command that is held for longer leaves less open: its interval is narrower.
    width = [np.diff(one.ci(0.95, "delay+lag")).item() for one in (straight, late)]
    assert width[1] < width[0]
    # Held commands begin at their rows, whatever the hold.
    held = [of(sparse, between="held", **more).delay for more in ({}, {"hold": 0.04})]
    assert held[0] == pytest.approx(held[1], abs=1e-9)


def test_what_is_wrong_about_a_hold_is_said(sparse):
    for hold in (-0.01, np.inf, np.nan):
        with pytest.raises(ValueError, match="give a time above zero"):
            of(sparse, hold=hold)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0))
    with pytest.raises(ValueError, match="hold is only for an estimate without a loop"):
        dtm.estimate_delay(sparse, loop, hold=0.01)


def test_only_plants_that_integrate_or_only_those_that_do_not(sparse, straight):
    assert not any(one.integrates for one in straight.candidates)
    found = dtm.estimate_delay(sparse, integrates=True, between="straight", largest_delay=0.5)
    assert found.candidates
    assert all(one.integrates for one in found.candidates)


def test_plants_that_some_rows_leave_are_fitted_to_many(sparse, straight):
    few = of(sparse.window(0.0, 8.0), between="straight", hold=PERIOD)
    more = refit(few, [sparse])
    assert {one.name for one in more.candidates} <= {one.name for one in few.candidates}
    assert len(more.recording) == len(sparse)
    for name in ("delay+lag", "gain"):
        value, ends = more.value(name), straight.ci(0.95, name)
        assert ends[0] < value < ends[1], name
    own, wide = (np.diff(one.ci(0.95, "delay+lag")).item() for one in (more, few))
    assert own < wide
    # It keeps what it was told of commands between rows.
    assert more.delay == pytest.approx(straight.delay, abs=0.01)


def test_several_recordings_are_fitted_again_together(sparse):
    few = of(sparse.window(0.0, 8.0), between="straight", hold=PERIOD)
    both = refit(few, [sparse, flown(3)])
    assert len(both.runs) == 2
    alone = refit(few, [sparse])
    widths = [np.diff(one.ci(0.95, "delay+lag")).item() for one in (both, alone)]
    # Recordings that differ by chance widen what both determine.
    assert widths[0] < 1.3 * widths[1]


@pytest.mark.parametrize("seeds", [6, pytest.param(200, marks=NIGHTLY)])
def test_what_rows_leave_open_of_a_command_that_jumps_is_in_the_interval(seeds):
    """Of n jumps, each at any time of a row h, the mean is known to h/sqrt(12 n)."""
    held, widths = 0, []
    for seed in range(100, 100 + seeds):
        one = flown(seed, pace=1.0, seconds=12.0)
        low, high = of(one, between="straight", hold=PERIOD, plant="lag").ci(0.95, "delay+lag")
        held += low < DELAY + LAG < high
        # Jumps of another size count less: n is that of as many of one size.
        square = np.diff(one.sent.values) ** 2
        number = np.sum(square) ** 2 / np.sum(square**2)
        widths.append((high - low) / (3.92 * (ROW - PERIOD) / np.sqrt(12.0 * number)))
    # 95 % but for chance. Noise alone would leave a tenth of the width.
    assert stats.binom.cdf(held, seeds, 0.93) > ALARM
    assert 0.8 < np.median(widths) < 1.6


def test_a_command_that_is_smooth_leaves_little_open():
    time = np.arange(0.0, 16.0, ROW)
    random = np.random.default_rng(6)
    fine = np.arange(0.0, 16.0, PERIOD)
    sent = np.sin(1.7 * fine) + 0.7 * np.sin(4.1 * fine + 1.0)
    output = Plant("lag", DELAY, LAG, gain=GAIN).response(time, PERIOD, sent)
    output = output + 0.004 * random.standard_normal(time.size)
    smooth = dtm.Recording(time, None, output, sent=(time, sent[::EVERY]))
    jumping = flown(1)
    widths = [
        np.diff(of(one, between="straight", hold=PERIOD, plant="lag").ci(0.95, "delay+lag")).item()
        for one in (smooth, jumping)
    ]
    assert widths[0] < 0.5 * widths[1]
