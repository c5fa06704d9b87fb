"""Verdicts on steps whose commands are at their limits, against long runs of an own simulator.

While its command is at its limit a loop is open, and its integral may have to unwind: the output
may cross its band so slowly that it is inside for many time constants of the loop without limit.
"""

from typing import NamedTuple

import deadtime as dtm
import numpy as np
import pytest
from deadtime.loops import SweepStatus
from scipy.linalg import expm

SAMPLE = 0.05
#: Steps of the own simulator in a sample, and step, s.
FINE = 2
STEP = SAMPLE / FINE
BAND = 0.02


class Draw(NamedTuple):
    """Loops of one kind with numbers, one of each for every set."""

    loop: dtm.ControlLoop
    numbers: dict

    def single(self, i):
        return self.loop.replace(**{name: float(array[i]) for name, array in self.numbers.items()})


def drawn(kind, count, end, seed):
    """Loops whose commands are at their limits for up to `end` seconds; half of them pass then."""
    rng = np.random.default_rng([kind, seed])
    sample_time = SAMPLE if kind < 6 else None
    first_order = kind % 2 == 1
    lag = rng.uniform(0.2, 3.0) if first_order else rng.choice([0.0, 0.1, 0.4])
    plant = dtm.FirstOrder(1.0, lag) if first_order else dtm.Integrator(1.0, lag)
    late = STEP * rng.integers(1, 15)
    ultimate = (lag if first_order else 1.0) / (late + SAMPLE + (0.0 if first_order else lag))
    Kp = ultimate * 10.0 ** rng.uniform(-1.5, 0.1, count)
    # The output of a first-order plant rests at the limit, or moves slowly only near to it.
    limit = (
        1.0 + rng.choice([-0.3, 0.0, 1e-3, 0.1, 1.0], count)
        if first_order
        else np.where(
            rng.random(count) < 0.5,
            10.0 ** rng.uniform(-np.log10(end), 1.0, count),
            (1.0 + rng.uniform(-BAND, BAND, count)) / end,
        )
    )
    Ki = Kp * 10.0 ** rng.uniform(-2.5, -0.3, count)
    controller = dtm.PI(1.0, 1.0) if kind % 3 else dtm.P(1.0)
    loop = dtm.ControlLoop(plant, controller, delay=late, sample_time=sample_time, limit=1.0)
    numbers = {"Kp": Kp, "Ki": Ki, "limit": limit}
    return Draw(loop, {n: v for n, v in numbers.items() if n != "Ki" or kind % 3})


def last_outside(draw, final, end):
    """The last times at which own outputs are outside the bands around `final`, a row a sweep."""
    loop, numbers = draw
    wait = round(loop.delay / STEP)
    every = FINE if loop.is_sampled else 1
    Kp, limit = numbers["Kp"], numbers["limit"]
    Ki = numbers.get("Ki", 0.0 * Kp)
    lag = loop.parameters.get("lag", 0.0)
    # The own simulator holds commands of a continuous loop for a step: it is a little wrong.
    band = BAND if loop.is_sampled else 1.2 * BAND
    # Output, speed, integral of the error; command and reference.
    big = np.zeros((5, 5))
    if isinstance(loop.plant, dtm.FirstOrder):
        big[0, 0], big[0, 3] = [-1.0, 1.0] / np.array(loop.plant.time_constant)
    elif lag:
        big[0, 1], big[1, 1], big[1, 3] = 1.0, -1.0 / lag, 1.0 / lag
    else:
        big[0, 3] = 1.0
    big[2, 0], big[2, 4] = -1.0, 1.0
    step = expm(big * STEP)
    x = np.zeros((5, Kp.size))
    x[4] = 1.0
    commands = np.zeros((wait + 1, Kp.size))
    last = np.zeros(final.shape)
    for k in range(round(end / STEP)):
        if k % every == 0:
            held = np.clip(Kp * (1.0 - x[0]) + Ki * x[2], -limit, limit)
        commands[k % (wait + 1)] = held
        x[3] = commands[(k + 1) % (wait + 1)]
        x = step @ x
        last[np.abs(x[0] - final) > band * np.abs(final)] = (k + 1) * STEP
    return last


def check(kind, count, seed, times, longest):
    """Compare claims with own runs; returns how many sets were called settled, and how many did."""
    draw = drawn(kind, count, times[-1], seed)
    found = [dtm.sweep(draw.loop, draw.numbers, time) for time in times]
    lasts = last_outside(draw, np.array([sweep["steady_state"] for sweep in found]), longest)
    error = STEP if draw.loop.is_sampled else 0.5 + 0.02 * lasts
    claims = settled = 0
    for sweep, last in zip(found, lasts - error, strict=True):
        ok = sweep.status == SweepStatus.OK
        assert np.array_equal(np.isfinite(sweep["settling_time"]), ok)
        late = ok & (last > sweep["settling_time"])
        assert not late.any(), (draw.single(int(np.argmax(late))), sweep.time[-1])
        claims += int(ok.sum())
        settled += int((last < 0.25 * min(sweep.time[-1], longest)).sum())
        for i in range(0, count, max(1, count // 4)):
            step = draw.single(i).step_response(np.arange(0.0, sweep.time[-1], 5.0 * SAMPLE))
            info = step.info()
            if np.isfinite(info["settling_time"]):
                assert last[i] <= info["settling_time"], draw.single(i)
    return claims, settled


@pytest.mark.parametrize("kind", range(12))
def test_no_step_is_called_settled_that_leaves_its_band_later(kind):
    claims, settled = check(kind, 30, 0, (20.0, 200.0), longest=300.0)
    # Half of those that settle in a quarter of the time are known to.
    assert claims >= 0.5 * settled > 0


@pytest.mark.survey
@pytest.mark.parametrize(
    "kind", [0, *(pytest.param(k, marks=pytest.mark.long) for k in range(1, 12))]
)
def test_no_step_of_a_thousand_is_called_settled_that_leaves_its_band_later(kind):
    claims, settled = check(kind, 90, 1, (None, 60.0, 800.0), longest=4000.0)
    assert claims >= 0.5 * settled > 0


@pytest.mark.parametrize("sample_time", [None, SAMPLE])
def test_a_slow_integrator_under_pi_control_is_not_settled_where_it_passes_its_reference(
    sample_time,
):
    # Called settled after 2146 s with no overshoot, where the output went on to 2.
    slow = dtm.ControlLoop(
        dtm.Integrator(), dtm.PI(1.0, 0.2), delay=0.3, limit=0.000456664957792711,
        sample_time=sample_time,
    )  # fmt: skip
    for time in (None, 2190.0):
        found = dtm.sweep(slow, {"Ki": np.array([0.2])}, time)
        assert found.status == SweepStatus.UNSETTLED
        assert np.isnan(found["settling_time"])
    response = slow.step_response(np.linspace(0.0, 2190.0, 2001))
    assert abs(response.outputs[-1] - 1.0) < 0.02
    assert np.isnan(response.info()["settling_time"])
    assert slow.step_response([0.0, 4380.0]).outputs[-1] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("sample_time", [None, SAMPLE])
@pytest.mark.parametrize("controller", [dtm.P(10.0), dtm.PI(2.0, 1.0)])
@pytest.mark.parametrize("limit", [0.5, 1.0])
def test_a_step_that_needs_the_whole_limit_settles_with_its_plant(sample_time, controller, limit):
    loop = dtm.ControlLoop(
        dtm.FirstOrder(1.0, 1.0), controller, delay=0.1, sample_time=sample_time, limit=limit
    )
    found = dtm.sweep(loop, {"Kp": np.array([controller.Kp])}, 60.0)
    assert found.status == SweepStatus.OK
    if limit == 0.5:
        # 1 - exp(-(t - delay)) = 1 - band.
        assert found["settling_time"] == pytest.approx(0.1 + np.log(1.0 / BAND), abs=1e-9)
