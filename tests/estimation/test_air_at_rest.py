"""Air that is there only while the vehicle moves stands for what the plant lacks."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation._native import FlightFit, FlightRows
from deadtime.experiments import FlightNoise
from marks import NIGHTLY

KNOWN = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.065, limit=1.0)
TIME = 0.065 * np.arange(560)
STEPS = np.where(TIME < 2.0, 0.0, (TIME - 2.0) // 8.0 % 2 == 0).astype(float)
AIR = FlightNoise(white=0.001, air=0.04, air_time=0.4)


def flown(seed, moved=None):
    """Four steps in air, of which only a part may be there while the vehicle rests."""
    random = np.random.default_rng(seed)
    kept = np.exp(-0.065 / AIR.air_time)
    command, output = np.zeros(TIME.size), np.zeros(TIME.size)
    position = air = speed = 0.0
    for row in range(TIME.size):
        output[row] = position + AIR.white * random.standard_normal()
        command[row] = np.clip(STEPS[row] - output[row], -1.0, 1.0)
        # The delay is 4.6 samples: a part of two commands acts until the next.
        told = [command[row - late] if row >= late else 0.0 for late in (4, 5)]
        speed = 0.85 * (0.385 * told[0] + 0.615 * told[1])
        air = kept * air + AIR.air * np.sqrt(1.0 - kept**2) * random.standard_normal()
        share = 1.0 if moved is None or abs(speed) > 0.03 else moved
        position += 0.065 * (speed + share * air)
    return dtm.Recording(TIME, STEPS, output, command)


def fitted(seed, moved=None):
    return dtm.estimate_delay(flown(seed, moved), KNOWN, free=("delay", "gain"))


@pytest.mark.parametrize("flights", [10, pytest.param(30, marks=NIGHTLY)])
def test_air_that_is_always_there_is_not_taken_for_more(flights):
    found = sum("than at rest" in fitted(seed).message for seed in range(flights))
    assert found <= flights / 15


@pytest.mark.parametrize("flights", [2, pytest.param(10, marks=NIGHTLY)])
def test_air_that_is_there_while_the_vehicle_moves_is_found(flights):
    found = sum("than at rest" in fitted(seed, 0.1).message for seed in range(flights))
    assert found >= 0.7 * flights


def probability(fit):
    """Of air as much larger while the vehicle moves."""
    found = fit.profile().judge().findings
    return next(one.p_value for one in found if one.cause == "moving air")


def test_a_recording_without_rest_is_not_judged():
    fit = fitted(0)._profile.fit
    time, output, _, *rest = fit.runs[0].__getnewargs__()
    short = FlightRows(time, output, TIME < 5.0, *rest)
    assert 0.01 < probability(fit) < 1.0
    assert probability(FlightFit(fit.plant, [short], fit.trim, fit.numbers)) == 1.0
