"""Settling times of designs and sweeps against long runs of an independent simulation."""

import deadtime as dtm
import numpy as np
import pytest
from scipy.linalg import expm

#: Steps of the own simulator in a sample.
FINE = 20


def own_settling(loop, end, band=0.02):
    """Settling time of a step: plant lag, PI or P or PV, hold, limit and delay in short steps."""
    h = loop.sample_time / FINE
    wait = round(loop.delay / h)
    assert abs(wait * h - loop.delay) < 1e-9
    numbers = loop.parameters
    gain, lag = numbers["gain"], numbers["lag"]
    Kp, Ki, Kv = (numbers.get(name, 0.0) for name in ("Kp", "Ki", "Kv"))
    # height, speed, integral of the error; command and reference
    big = np.zeros((5, 5))
    big[0, 1] = 1.0
    big[1, 1], big[1, 3] = -1.0 / lag, gain / lag
    big[2, 0], big[2, 4] = -1.0, 1.0
    step = expm(big * h)
    limit = np.inf if loop.limit is None else loop.limit
    x, held = np.array([0.0, 0.0, 0.0, 0.0, 1.0]), 0.0
    commands = [0.0] * wait
    last = 0.0
    for k in range(int(end / h)):
        if k % FINE == 0:
            held = np.clip(Kp * (1.0 - x[0]) + Ki * x[2] - Kv * x[1], -limit, limit)
        commands.append(held)
        x[3] = commands[k]
        x = step @ x
        if abs(x[0] - 1.0) > band:
            last = (k + 1) * h
    return last


LAGGING = dtm.ControlLoop(
    dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.3, sample_time=0.05, limit=None
)


def test_a_designed_step_settles_when_it_is_said_to_and_after_rounding_its_gains():
    # 2.357 s were claimed where the step took 4.733 s; elsewhere 8.30 s, and 10.94 s with gains
    # rounded to three digits.
    options = {"gain_margin": 2.0, "phase_margin": 45.0, "shape": (41, 41)}
    best = dtm.design(LAGGING, controller=dtm.PI, objective="settling_time", **options)
    # 6.97 s came out where gains with an integral weaker than the first cell of the map settle.
    assert best.value < 2.45
    own = own_settling(best.loop, 80.0)
    assert own == pytest.approx(best.step_info["settling_time"], abs=0.005)
    assert own <= best.value + 0.0025
    rounded = {name: float(f"{gain:.3g}") for name, gain in best.gains.items()}
    assert 0.94 * best.value <= own_settling(best.loop.replace(**rounded), 80.0) <= best.value


@pytest.mark.parametrize("seed", range(4))
def test_a_sweep_calls_nothing_settled_that_leaves_the_band_later(seed):
    rng = np.random.default_rng(seed)
    lag = 10.0 ** rng.uniform(-1.5, 0.3)
    late = float(rng.integers(0, 160) * 0.0025)
    limit = rng.choice([None, 0.5])
    loop = LAGGING.replace(lag=lag, delay=late, limit=limit, controller=dtm.PI(1.0, 0.1))
    Kp = rng.uniform(0.1, 1.2, 12) / (0.85 * (lag + late + 0.025))
    Ki = Kp * 10.0 ** rng.uniform(-3.0, 0.0, 12)
    claims = 0
    for time in (None, 3.0, 12.0):
        found = dtm.sweep(loop, {"Kp": Kp, "Ki": Ki}, time)
        for i in np.flatnonzero(np.isfinite(found["settling_time"]))[:3]:
            one = loop.replace(Kp=float(Kp[i]), Ki=float(Ki[i]))
            longer = max(4.0 * found.time[-1], -12.0 / min(one.spectral_abscissa(), -0.05))
            own = own_settling(one, min(longer, 250.0))
            assert own <= found["settling_time"][i] + 0.0025, (one, time)
            claims += 1
        unsettled = np.isnan(found["settling_time"])
        assert np.array_equal(unsettled, found.status != dtm.loops.SweepStatus.OK)
    assert claims


def test_a_creeping_integral_is_not_settled_before_three_of_its_time_constants():
    # The integrator's own pole was left out of the time: 25 s of creeping were not looked at.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PI(1.0, 0.02), delay=0.3, sample_time=0.05)
    slowest = -1.0 / loop.spectral_abscissa()
    assert slowest > 40.0
    early, late = (dtm.sweep(loop, {"Ki": 0.02}, n * slowest) for n in (0.5, 6.0))
    assert early.status == dtm.loops.SweepStatus.UNSETTLED
    assert np.isnan(early["settling_time"])
    assert late.status == dtm.loops.SweepStatus.OK
    longest = dtm.sweep(loop, {"Ki": 0.02})
    assert longest.time[-1] > 3.0 * slowest
    assert longest["settling_time"] == pytest.approx(late["settling_time"], rel=1e-9)
