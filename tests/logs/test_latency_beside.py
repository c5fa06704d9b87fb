"""A fit beside the plain numbers of the same log: the right one agrees, a wrong one is doubted."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from deadtime.logs import Series
from deadtime.logs._log import LogLoop
from deadtime.logs.latencies._beside import beside_plain_numbers
from deadtime.logs.latencies._commands import Sampling
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.loops import FirstOrder
from flown_plants import Plant
from scipy.ndimage import gaussian_filter1d

#: Period of the controller, s, and the truth.
PERIOD, DELAY, LAG = 0.0025, 0.04, 0.03


def loop_of(every=16, seconds=60.0, noise=0.02, smooth=0.12):
    """Sticks that wander, known at every so-many-th command, and the rate of a vehicle."""
    random = np.random.default_rng(7)
    time = PERIOD * np.arange(round(seconds / PERIOD))
    asked = gaussian_filter1d(random.standard_normal(time.size), smooth / PERIOD)
    asked /= asked.std()
    rows = time[::every]
    came = Plant("lag", DELAY, LAG).response(rows, PERIOD, asked)
    came = came + noise * random.standard_normal(rows.size)
    setpoint, response = (
        Series(rows, values, "rad/s", name)
        for values, name in ((asked[::every], "asked"), (came, "came"))
    )
    return LogLoop(
        "roll rate", "roll", "rate", setpoint, response, None, ((1.0, seconds - 1.0),), ()
    )


def fitted(sampling, late=0.0):
    """A reliable answer whose plant is the truth, but for the delay."""
    time = DELAY + LAG + late
    return LoopLatency(
        "roll rate", "roll", "rate", "setpoint", "reliable", "",
        time=time, interval=(time - 1e-3, time + 1e-3), sampling=sampling,
        estimate=SimpleNamespace(plant=FirstOrder(1.0, LAG), delay=DELAY + late),
    )  # fmt: skip


@pytest.fixture(scope="module")
def loop():
    return loop_of()


SAMPLING = Sampling("straight", PERIOD)


def test_the_right_fit_agrees_to_a_small_share_of_a_row(loop):
    found = beside_plain_numbers(fitted(SAMPLING), loop, SAMPLING)
    assert (found.verdict, found.reason) == ("reliable", "")
    assert {"cross-correlation", "moves"} <= {one.name for one in found.differences}
    assert not any(one.disagrees for one in found.differences)
    # Rows are 40 ms apart. Half of the hold, 1.25 ms, and cubics are in the response of the fit.
    (correlated,) = (one for one in found.differences if one.name == "cross-correlation")
    assert correlated.measured == pytest.approx(correlated.modelled, abs=6e-4)
    assert found.plain.correlation.value == correlated.measured
    assert found.answered.count == found.plain.aligned.count


@pytest.mark.parametrize("late", [-0.015, 0.015])
def test_a_wrong_fit_is_doubted(loop, late):
    found = beside_plain_numbers(fitted(SAMPLING, late), loop, SAMPLING)
    assert found.verdict == "indication"
    assert "by cross-correlation the log gives " in found.reason
    (correlated,) = (one for one in found.differences if one.name == "cross-correlation")
    assert correlated.modelled - correlated.measured == pytest.approx(late, abs=2e-3)


def test_a_response_that_precedes_its_setpoint_has_no_time(loop):
    early = replace(loop.response, time=loop.response.time - 0.2)
    found = beside_plain_numbers(fitted(SAMPLING), replace(loop, response=early), SAMPLING)
    assert found.verdict == "none"
    assert np.isnan(found.time)
    assert found.estimate is None
    assert found.plain.correlation.interval[1] < 0.0
    why = r"by cross-correlation the response comes 1\d\d\.\d+ ms before its setpoint \(95 %: 1"
    assert re.match(why, found.reason)


def test_a_fit_that_is_known_as_badly_is_not(loop):
    wrong = fitted(SAMPLING, 0.015)
    unsure = replace(wrong, interval=(wrong.time - 0.03, wrong.time + 0.03))
    found = beside_plain_numbers(unsure, loop, SAMPLING)
    assert any(one.disagrees for one in found.differences)
    assert found.verdict == "reliable"


def test_without_a_fit_nothing_is_compared(loop):
    none = LoopLatency("roll rate", "roll", "rate", "setpoint", "none", "it does not move")
    assert beside_plain_numbers(none, loop, SAMPLING) is none


def test_commands_that_hold_are_compared_as_such():
    held = Sampling("held")
    loop = loop_of(every=1, seconds=20.0)
    found = beside_plain_numbers(fitted(held), loop, held)
    assert found.verdict == "reliable"
    (correlated,) = (one for one in found.differences if one.name == "cross-correlation")
    assert correlated.measured == pytest.approx(correlated.modelled, abs=1e-3)
    assert np.isfinite(found.plain.correlation.interval).all()
