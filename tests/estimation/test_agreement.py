"""Recordings that are fitted jointly and contradict one another."""

import warnings

import deadtime as dtm
import pytest
from marks import NIGHTLY

SAMPLE, RUNS = 0.065, 40


def flight(delay, gain, seed):
    loop = dtm.ControlLoop(dtm.Integrator(gain), dtm.P(1.6), delay=delay, sample_time=SAMPLE)
    return dtm.Experiment.step(8.0).run(loop, noise=0.005, seed=seed)


def fitted(*flights):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), sample_time=SAMPLE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return dtm.estimate_delay(
            flights, loop, method=dtm.estimation.OutputError(), free=("delay", "gain")
        )


@pytest.mark.parametrize("pairs", [10, pytest.param(40, marks=NIGHTLY)])
def test_flights_of_one_vehicle_agree(pairs):
    # The test is at the 1 % level, twice: more than 4 of 40 have a probability below 1e-3.
    apart = 0
    for seed in range(pairs):
        found = fitted(flight(0.3, 0.85, 2 * seed), flight(0.3, 0.85, 2 * seed + 1))
        apart += "contradict" in found.message
    assert apart <= 0.1 * pairs


@pytest.mark.parametrize(
    ("other", "name"), [((0.36, 0.85), "delay"), ((0.3, 1.1), "gain")], ids=["delay", "gain"]
)
def test_flights_of_two_vehicles_do_not(other, name):
    found = fitted(flight(0.3, 0.85, 1), flight(*other, 2), flight(0.3, 0.85, 3))
    assert found.verdict != "reliable"
    assert "the recordings contradict one another in " in found.message
    assert f"{name}" in found.message.partition("contradict one another in ")[2]
