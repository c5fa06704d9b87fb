"""The choice among proved gains during a run, and flights with it."""

import math
import os
import sys
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from deadtime.tuning import Choice, GainFollower, adaptive_gains

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

DELAYS = ((0.0, 0.2), (0.0, 0.3), (0.0, 0.6))
FAST, MIDDLE, ROBUST = 0, 1, 2


def follower(dwell=2.0, hysteresis=0.02, rate=0.0):
    return GainFollower(DELAYS, 0.1, dwell=dwell, hysteresis=hysteresis, rate=rate)


def fed(chooser, times, high, low=0.05, informed=True):
    return [chooser.update(float(time), low, high, informed).number for time in times]


def test_a_faster_set_is_taken_after_the_dwell_time_and_a_slower_one_at_once():
    chooser = follower()
    assert chooser.choice == Choice(ROBUST, False)
    assert fed(chooser, (0.0, 1.0, 1.9), 0.15) == [ROBUST] * 3
    assert fed(chooser, (2.0, 2.1), 0.15) == [FAST] * 2
    assert fed(chooser, [2.2], 0.25) == [MIDDLE]
    assert fed(chooser, [2.3], 0.45) == [ROBUST]
    # The time inside counts anew.
    assert fed(chooser, (2.4, 4.3), 0.15) == [ROBUST] * 2
    assert fed(chooser, [4.4], 0.15) == [FAST]


def test_an_end_between_the_thresholds_changes_nothing():
    chooser = follower()
    # Not far enough inside to begin, far enough to stay.
    assert set(fed(chooser, np.arange(0.0, 10.0, 0.1), 0.19)) == {ROBUST, MIDDLE}
    assert chooser.choice.number == MIDDLE
    fed(chooser, np.arange(10.0, 13.0, 0.1), 0.17)
    assert chooser.choice.number == FAST
    assert set(fed(chooser, np.arange(13.0, 20.0, 0.1), 0.19)) == {FAST}


def test_noise_across_a_threshold_changes_sets_no_faster_than_the_dwell_time():
    chooser, random = follower(), np.random.default_rng(3)
    numbers = [
        chooser.update(0.1 * k, 0.05, 0.2 + 0.02 * random.standard_normal()).number
        for k in range(3000)
    ]
    taken = 0.1 * np.flatnonzero(np.diff(numbers) < 0)
    assert (np.diff(taken) >= 2.0 - 1e-9).all()


@pytest.mark.parametrize(
    ("low", "high", "informed"),
    [(0.05, math.nan, True), (math.nan, 0.1, True), (0.05, 0.1, False), (0.05, math.inf, True),
     (0.2, 0.1, True), (0.05, 0.7, True)],
)  # fmt: skip
def test_without_an_interval_in_the_range_the_robust_gains_are_used(low, high, informed):
    chooser = follower()
    assert fed(chooser, (0.0, 3.0), 0.1)[-1] == FAST
    assert chooser.update(3.1, low, high, informed) == Choice(ROBUST, False)
    assert fed(chooser, [5.0], 0.1) == [ROBUST]


def test_the_interval_is_widened_by_what_the_delay_may_move():
    chooser = follower(dwell=0.0, rate=0.1)
    assert fed(chooser, (0.0, 0.1), 0.15) == [FAST, FAST]
    # 0.17 + 0.1 (0.17 + 0.1) = 0.197 is inside, 0.18 + 0.028 is not.
    assert fed(chooser, (0.2, 0.3), 0.17) == [FAST, FAST]
    assert fed(chooser, [0.4], 0.18) == [MIDDLE]


def test_time_does_not_run_back():
    chooser = follower()
    chooser.update(1.0, 0.1, 0.15)
    with pytest.raises(ValueError, match="do not decrease"):
        chooser.update(0.9, 0.1, 0.15)


def test_schedule_says_what_it_holds():
    loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(1.0), sample_time=0.1, limit=1.0)
    stages = []
    schedule = adaptive_gains(
        loop, (0.02, 0.47), gain=(0.8, 1.0), decay=0.2, progress=stages.append
    )
    assert schedule.delays == (0.0, 0.5)
    factors = [one.factor for one in schedule.sets]
    ends = [one.delays[1] for one in schedule.sets]
    assert factors == sorted(factors, reverse=True)
    assert factors[-1] == 1.0
    assert ends == sorted(ends)
    assert schedule.robust.gains["Kp"] == pytest.approx(schedule.proof.Kp)
    assert schedule.proof.gain == (0.8, 1.0)
    assert schedule.proof.decay == 0.2
    for words in ("0 to 0.5 s", "gain of the plant is 0.8 to 1", "e^(-0.2 t)", "limit of 1"):
        assert words in schedule.summary()
    assert stages[0] == "designing the robust gains"
    # Each set has at the longest delay of its own the margin of the robust one.
    for one in schedule.sets:
        margins = [
            loop.replace(delay=delay, gain=1.0, **one.gains).margin().gain_margin
            for delay in np.linspace(*one.delays, 7)
        ]
        assert min(margins) >= 2.49


@pytest.mark.survey
def test_flights_are_better_than_with_the_robust_gains(monkeypatch):
    import adaptation

    # Without a lag there are fewer cases to search a form for.
    monkeypatch.setattr(adaptation, "LAG", 0.0)
    schedule = adaptation.made_schedule(dtm.P(1.0))
    draws = adaptation.drawn(30, parts=(20.0, 25.0, 15.0, 25.0, 15.0))
    fixed = adaptation.flown(draws, schedule, None)
    adaptive = adaptation.flown(draws, schedule, adaptation.oracle(draws, late=1.5))
    assert not fixed.outside.any()
    assert not adaptive.outside.any()
    ratio = adaptive.error / fixed.error
    assert np.median(ratio) < 0.95
    assert ratio.max() <= 1.1
    assert adaptive.covered.mean() > 0.99
    assert (fixed.sets == len(schedule.sets) - 1).all()


@pytest.mark.long
@pytest.mark.survey
def test_flights_with_the_delay_estimated_online():
    import adaptation

    schedule = adaptation.made_schedule()
    draws = adaptation.drawn(int(os.environ.get("DEADTIME_FLIGHTS", "12")))  # 200 in the bench
    fixed = adaptation.flown(draws, schedule, None)
    adaptive = adaptation.flown(draws, schedule, adaptation.online(draws))
    assert not fixed.outside.any()
    assert not adaptive.outside.any()
    ratio = adaptive.error / fixed.error
    assert np.median(ratio) < 1.0
    assert ratio.max() <= 1.1
    assert adaptive.covered.mean() > 0.99
