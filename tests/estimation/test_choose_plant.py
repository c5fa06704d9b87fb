"""The number of lags is chosen by evidence, and delay and lag together hold whatever it is."""

import deadtime as dtm
import pytest
from deadtime.estimation import choose_plant
from vehicles import record_attitude

VEHICLE = {"delay": 0.047, "lags": (0.15, 0.05), "gain": 0.95}
FLAT = dtm.ControlLoop(dtm.FirstOrder(), dtm.P(1.0), sample_time=0.02)
INTEGRATING = FLAT.replace(plant=dtm.Integrator())


def test_two_lags_are_found_and_a_third_is_not():
    choice = choose_plant(record_attitude(0, **VEHICLE), FLAT, most_lags=3)
    assert choice.chosen == "2 lags"
    assert choice.best.adequate
    assert choice.criteria["1 lag"] > choice.criteria["2 lags"] + 100.0
    assert not choice.estimates["1 lag"].adequate
    assert sum(choice.weights.values()) == pytest.approx(1.0)
    assert choice.weights.get("1 lag", 0.0) == 0.0
    low, high = choice.ci()
    assert low < 0.247 < high
    assert high - low < 0.01
    assert choice.ci(0.5)[0] > low
    table = str(choice)
    assert "2 lags *" in table
    assert "Delay and lag together, over all plants" in table
    assert choice.to_dict()["chosen"] == "2 lags"


def test_a_zero_is_found():
    choice = choose_plant(record_attitude(2, **VEHICLE, zero=0.3), FLAT, most_lags=2)
    assert choice.chosen == "2 lags, zero"
    low, high = choice.ci()
    # The output leads a ramp: the zero is longer than delay and lags.
    assert low < -0.053 < high


def test_an_integrator_is_known_from_the_loop():
    recording = record_attitude(2, **VEHICLE, integrator=True)
    choice = choose_plant(recording, INTEGRATING, most_lags=1)
    assert "no lags" in choice.estimates
    assert not choice.estimates["no lags"].adequate
    assert choice.best.loop.plant.integrator


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
