"""The bound by which made logs are judged, and a short survey of `dtm.latency` with them."""

from dataclasses import replace

import numpy as np
import pytest
from flown_cases import CASES, COPTER, LOUD, QUIET, RATE, Case
from flown_logs import fly
from latency_bound import bound_of, likeliest_time
from latency_survey import CASES_OF_THE_TEST, Answer, answers, broken, table
from marks import NIGHTLY

#: Logs of each case in the short survey, and the probability of a false alarm of one of its limits.
SEEDS, ALARM = (1, 2), 0.01

#: Rows that leave open when the setpoint jumped, and rows of each sample under coloured noise.
SPARSE = Case("DataFlash", RATE, 400.0, 400.0, (25.0, 25.0), 30.0, "jumps", 0.4, 0.0, "lag",
              COPTER, QUIET)  # fmt: skip
DENSE = replace(
    SPARSE, rows=(400.0, 400.0), seconds=6.0, noise=LOUD, colour=0.2, gust=0.1, vibration=0.1
)


@pytest.mark.parametrize("logs", [8, pytest.param(200, marks=NIGHTLY)])
@pytest.mark.parametrize("case", [SPARSE, DENSE], ids=["sparse", "dense"])
def test_the_bound_is_the_spread_of_the_likeliest_time(case, logs):
    off = []
    for seed in range(logs):
        flown = fly(case, seed)
        off.append((likeliest_time(flown, steps=2) - flown.plant.time) / bound_of(flown).error)
    assert abs(np.mean(off)) < 3.0 / np.sqrt(logs)
    # The Gaussian limits of a deviation, and a tenth for what is not Gaussian in jumps.
    chance = 3.0 / np.sqrt(2.0 * logs)
    assert 0.9 * (1.0 - chance) < np.std(off) < 1.1 * (1.0 + chance)


def test_rows_that_leave_jumps_open_cost_what_jumps_at_any_time_cost():
    # One lag, jumps far apart, no noise to speak of: each jump is uniform over a row of h, and the
    # mean of n of them is known to h/sqrt(12 n). Small ones, which noise hides, tell less.
    flown = fly(replace(SPARSE, seconds=120.0, pace=2.0, noise=(1e-3, 1.001e-3)), 3)
    count = np.count_nonzero(np.diff(flown.inputs))
    least = (0.04 - 0.0025) / np.sqrt(12.0 * count)
    assert least < bound_of(flown).error < 1.35 * least


def test_the_bound_falls_with_the_noise_and_with_the_length():
    short = bound_of(fly(DENSE, 1)).error
    assert bound_of(fly(replace(DENSE, noise=(0.3, 0.3001)), 1)).error > short
    assert bound_of(fly(replace(DENSE, seconds=24.0), 1)).error < 0.8 * short


def said(**changes):
    """An answer to a log that tells its time, and holds it."""
    right = {
        "case": 0, "seed": 0, "truth": 0.1, "bound": 0.001, "block": 0.002, "verdict": "reliable",
        "time": 0.1, "low": 0.098, "high": 0.102, "reason": "", "seconds": 1.0,
    }  # fmt: skip
    return Answer(**right | changes)


def test_limits_are_those_of_wrong_wide_and_missing_answers():
    assert broken([said()] * 40) == []
    wrong = said(low=0.101, high=0.105)
    assert "do not hold the truth" in broken([said()] * 37 + [wrong] * 3)[0]
    assert "of case 0 are reliable and wrong" in broken([said()] * 32 + [wrong] * 8)[1]
    others = [said(case=1)] * 100
    assert broken([*others, *[said()] * 33, *[wrong] * 7]) == []
    assert "wider than 2.04 times" in broken([said(low=0.096, high=0.104)] * 3)[0]
    doubted = said(verdict="indication", reason="the windows differ by 3.2 ms")
    assert "only 2 of 4 logs" in broken([said(), said(), doubted, doubted])[0]
    assert broken([said(), said(), doubted, doubted], alarm=0.01) == []
    assert "1 of 2 logs raise an error" in broken([said(), said(verdict="failed")])[0]
    # A log that cannot tell its time need not be reliable.
    assert broken([replace(doubted, bound=0.02)]) == []
    text = table([said(), doubted, replace(doubted, reason="the windows differ by 41 ms")])
    assert "    2    2  indication: the windows differ by #" in text
    assert CASES[0].name in text


@pytest.mark.survey
def test_a_short_survey_keeps_its_limits():
    found = list(answers([(case, seed) for case in CASES_OF_THE_TEST for seed in SEEDS], 1))
    assert not broken(found, ALARM), table(found)
