"""The number of lags is chosen by evidence, and delay and lag together hold whatever it is."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import choose_plant
from vehicles import record_attitude

VEHICLE = {"delay": 0.047, "lags": (0.15, 0.05), "gain": 0.95}
FLAT = dtm.ControlLoop(dtm.FirstOrder(), dtm.P(1.0), sample_time=0.02)
INTEGRATING = FLAT.replace(plant=dtm.Integrator())


@pytest.mark.parametrize("most_lags", [2, pytest.param(3, marks=pytest.mark.survey)])
def test_two_lags_are_found_and_a_third_is_not(most_lags):
    choice = choose_plant(record_attitude(0, **VEHICLE), FLAT, most_lags=most_lags)
    assert choice.chosen == "2 lags"
    assert choice.best.verdict == "reliable"
    assert choice.criteria["1 lag"] > choice.criteria["2 lags"] + 100.0
    assert choice.estimates["1 lag"].verdict != "reliable"
    assert sum(choice.weights.values()) == pytest.approx(1.0)
    assert choice.weights.get("1 lag", 0.0) == 0.0
    low, high = choice.ci()
    assert low < 0.247 < high
    assert high - low < 0.01
    assert choice.ci(0.5)[0] > low
    table = str(choice)
    assert "2 lags *" in table
    assert "Sum of delay and lag, averaged over all plants" in table
    assert choice.to_dict()["chosen"] == "2 lags"


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.survey) for k in (2, 5))])
def test_a_zero_is_found(seed):
    choice = choose_plant(record_attitude(seed, rows=180, **VEHICLE, zero=0.3), FLAT, most_lags=2)
    assert choice.chosen == "2 lags, zero"
    low, high = choice.ci()
    # The output leads a ramp: the zero is longer than delay and lags.
    assert low < -0.053 < high
    assert 0.004 < high - low < 0.01


@pytest.mark.parametrize("louder", [pytest.param(0.0, marks=pytest.mark.survey), 3e-12])
def test_what_cannot_be_told_apart_is_refused_whatever_the_rounding(louder):
    """Columns of rounding let the search go on to a zero beside no lag, which is no plant."""
    time = 0.02 * np.arange(200)
    told = np.where(time < 0.3, 0.0, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))))
    vehicle = dtm.FactoredPlant([0.15, 0.05]).transfer_function() * dtm.delay(0.047)
    output = np.ravel(vehicle.simulate(time, told).outputs)
    output = output + 0.003 * np.random.default_rng(1).standard_normal(200)
    recording = dtm.Recording(time, told, output * (1.0 + louder), command=told)
    choice = choose_plant(recording, FLAT, most_lags=2)
    assert choice.chosen == "2 lags"
    # With rows and commands at the same times, this holds for any output.
    assert "delay and zero cannot be distinguished" in choice.refusals["1 lag, zero"]


def test_a_zero_beside_a_lag_that_comes_out_at_none_is_refused():
    """Rows at any times, and an output without lag: the zero would be a pulse between rows."""
    random = np.random.default_rng(2)
    time = np.sort(random.uniform(0.0, 5.0, 300))
    sent = 0.02 * np.arange(250)
    told = 0.2 * np.sign(np.sin(3.7 * sent)) * (sent > 0.3)
    known = FLAT.replace(plant=dtm.FactoredPlant([0.05], zero=0.01), sample_time=None)
    late = np.searchsorted(sent, time - 0.047, side="right") - 1
    output = np.where(late < 0, 0.0, told[late]) + 0.002 * random.standard_normal(time.size)
    command = told[np.searchsorted(sent, time, side="right") - 1]
    recording = dtm.Recording(time, command, output, sent=(sent, told))
    with pytest.raises(
        dtm.NotIdentifiableError,
        match=r"the lags are estimated as zero|do not determine|cannot be distinguished",
    ):
        dtm.estimate_delay(recording, known, free=("delay", "gain", "lag_1", "zero"))


def test_an_integrator_is_known_from_the_loop():
    recording = record_attitude(2, **VEHICLE, integrator=True)
    choice = choose_plant(recording, INTEGRATING, most_lags=1)
    assert "no lags" in choice.estimates
    assert choice.estimates["no lags"].verdict != "reliable"
    assert choice.best.loop.plant.integrator


@pytest.mark.long
@pytest.mark.survey
@pytest.mark.parametrize(
    ("vehicle", "known"),
    [({}, FLAT), ({"zero": 0.03}, FLAT), ({"integrator": True}, INTEGRATING)],
)
def test_the_interval_of_the_sum_holds_the_truth_whatever_the_split(vehicle, known):
    truth = 0.247 - vehicle.get("zero", 0.0)
    choices = [
        choose_plant(record_attitude(100 + seed, **VEHICLE, **vehicle), known, most_lags=2)
        for seed in range(10)
    ]
    ends = [choice.ci() for choice in choices]
    assert sum(low <= truth <= high for low, high in ends) >= 8


def test_what_cannot_be_chosen_is_refused():
    recording = record_attitude(0, **VEHICLE)
    with pytest.raises(ValueError, match="most_lags=0"):
        choose_plant(recording, FLAT, most_lags=0)
    inside = FLAT.replace(plant=1.0 / (dtm.s + dtm.delay(1.0)), sample_time=None)
    with pytest.raises(ValueError, match="delays inside"):
        choose_plant(recording, inside)
