"""The delay is constant over the window, or the estimate says that it is not."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from unittest import mock

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import OutputError
from deadtime.estimation.methods import _flight_conclusion
from marks import NIGHTLY

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

from reality import detection, table
from reality.conditions import CONDITIONS, SAMPLE, Condition
from reality.generator import record

#: What the tests of the kernel say, before they are remembered.
_adequacy_of = _flight_conclusion.adequacy_of

NAMED = {condition.name: condition for condition in CONDITIONS}


def change_of(condition: Condition, number: int) -> tuple[float, float] | None:
    """Probability and size that the test gave last in the estimate of such a recording."""
    judged = []

    def remembered(profile):
        judged.append(profile.judge())
        return _adequacy_of(profile)

    run = record(condition, number)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(run.vehicle.Kp), sample_time=SAMPLE, limit=1.0)
    recording = table.recording_of(condition, run)
    alone = OutputError(rivals=False)  # which would be judged too
    with mock.patch.object(_flight_conclusion, "adequacy_of", remembered):
        dtm.estimate_delay(recording, loop, method=alone, free=("delay", "gain"))
    found = [one for last in judged[-1:] for one in last.findings if one.cause == "change"]
    return (found[0].p_value, found[0].sizes[0]) if found else None


def p_values(condition: Condition, runs: int) -> np.ndarray:
    """Of the test in such recordings."""
    found = [change_of(condition, number) for number in range(runs)]
    return np.array([one[0] for one in found if one is not None])


@pytest.mark.parametrize("name", ["white", "air 0.02"])
@pytest.mark.parametrize(("runs", "most"), [(20, 5), pytest.param(60, 12, marks=NIGHTLY)])
def test_a_constant_delay_is_called_changing_as_rarely_as_the_level_says(name, runs, most):
    found = p_values(NAMED[name], runs)
    assert found.size > 0.9 * runs
    # Of values that are spread evenly, more are below 0.1 once in 100.
    assert np.sum(found < 0.1) <= most
    assert np.sum(found < 0.01) <= most // 4


@pytest.mark.parametrize(
    ("flights", "reliable", "least"), [(4, 1, 2), pytest.param(16, 3, 9, marks=NIGHTLY)]
)
def test_a_delay_that_grows_by_half_of_itself_is_found(flights, reliable, least):
    condition = replace(NAMED["delay ramps 100 ms"], delay_ramp=0.2, white=0.002)
    fits = []
    for number in range(flights):
        run = record(condition, number)
        loop = table.given_loop(condition, run, condition.free)
        fits.append(
            dtm.estimate_delay(table.recording_of(condition, run), loop, free=condition.free)
        )
    assert sum(fit.verdict == "reliable" for fit in fits) <= reliable
    named = [
        "the delay is not constant over the window: its standard deviation is" in fit.message
        for fit in fits
    ]
    assert sum(named) >= least


@pytest.mark.survey
def test_a_delay_that_wanders_is_found_beside_air_that_could_stand_for_it():
    # Of 40 recordings 29 are expected, and of a test that finds one in two 26 or more in 4 %.
    found = p_values(NAMED["delay wanders 30 ms"], 40)
    assert np.sum(found < 0.01) >= 26


@pytest.mark.parametrize("flights", [5, pytest.param(12, marks=NIGHTLY)])
def test_the_spread_of_a_delay_that_wanders_is_about_that_of_its_commands(flights):
    condition = replace(NAMED["delay wanders 30 ms"], delay_wander=0.06, white=0.001)
    ratios = []
    for number in range(flights):
        run = record(condition, number)
        change = change_of(condition, number)
        weights = np.diff(run.command, prepend=run.command[0]) ** 2
        delays = run.arrivals - run.times
        mean = np.average(delays, weights=weights)
        true = np.sqrt(np.average((delays - mean) ** 2, weights=weights))
        assert change is not None
        p_value, spread = change
        assert p_value < 0.01
        ratios.append(spread / true)
    assert 0.7 < np.median(ratios) < 1.2


def test_the_best_test_finds_nothing_where_there_is_no_fault():
    # Its power is then the share of good recordings that it calls faulty.
    ramp = replace(NAMED["delay ramps 100 ms"], delay_ramp=1e-9)
    assert detection.power(ramp, 2) == pytest.approx(detection.LEVEL, abs=0.001)
    wander = replace(NAMED["delay wanders 30 ms"], delay_wander=1e-6)
    assert detection.power(wander, 4) == pytest.approx(detection.LEVEL, abs=0.04)
    lost = replace(NAMED["commands lost 5 %"], commands_lost=1e-9)
    assert detection.power(lost, 2) == pytest.approx(detection.LEVEL, abs=0.05)


def test_the_best_test_finds_more_of_what_is_larger():
    powers = [
        detection.power(replace(NAMED["delay ramps 100 ms"], delay_ramp=size), 4)
        for size in (0.02, 0.05, 0.1)
    ]
    assert powers == sorted(powers)
    assert powers[-1] > 0.6
