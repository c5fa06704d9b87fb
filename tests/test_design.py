"""Design: the best gains are better than the map's, and hold over the delay's interval."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime._design import critical_gain

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
SAMPLED = dtm.ControlLoop(
    dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.25, sample_time=0.065, limit=1.0
)


def test_the_most_stable_gains_of_the_papers_loop():
    # On Kp = 2 alone the best Kv is 0.2415 with abscissa -3.684; both gains free do better.
    best = dtm.design(LOOP, ranges={"Kp": (1.0, 4.0), "Kv": (-0.2, 0.9)}, shape=(31, 31))
    assert best.abscissa < -3.684
    assert best.abscissa == pytest.approx(best.loop.spectral_abscissa(), rel=1e-9)
    assert best.loop.parameters["Kp"] == best.gains["Kp"]
    # no neighbour is better: the search has converged
    for dp, dv in [(0.02, 0), (-0.02, 0), (0, 0.01), (0, -0.01)]:
        near = best.loop.replace(Kp=best.gains["Kp"] + dp, Kv=best.gains["Kv"] + dv)
        assert near.spectral_abscissa() > best.abscissa - 1e-3


def test_the_search_improves_on_the_map():
    best = dtm.design(LOOP, shape=(15, 15), ranges={"Kp": (1.0, 4.0), "Kv": (0.0, 0.9)})
    assert best.abscissa <= best.charts[0].best()[1]


def test_gains_for_an_interval_hold_on_all_of_it():
    best = dtm.design(SAMPLED, delay=(0.2, 0.3), shape=(31, 31))
    assert best.delays == (0.2, 0.25, 0.3)
    for delay in np.linspace(0.2, 0.3, 11):
        assert best.loop.replace(delay=delay).is_stable()
    # the worst of the interval cannot be better than the best at one of its delays
    alone = dtm.design(SAMPLED, delay=0.3, shape=(31, 31))
    assert alone.abscissa <= best.abscissa + 1e-6


def test_the_settling_time_is_that_of_the_simulated_loop():
    best = dtm.design(SAMPLED, objective="settling_time", shape=(21, 21))
    settled = best.loop.step_response().info()["settling_time"]
    assert settled == pytest.approx(best.value, abs=0.05)
    calm = dtm.design(SAMPLED, objective="abscissa", shape=(21, 21))
    assert best.value <= calm.loop.step_response().info()["settling_time"] + 0.05


@pytest.mark.parametrize("controller", [dtm.PD, dtm.PI])
def test_other_controllers_with_two_gains(controller):
    filtered = (
        controller(1.0, 0.1, dtm.DerivativeFilter(38.0)) if controller is dtm.PD else controller
    )
    best = dtm.design(SAMPLED, controller=filtered, shape=(21, 21))
    assert best.loop.is_stable()
    assert isinstance(best.loop.controller, controller)


def test_a_filter_of_the_template_is_kept():
    template = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
    best = dtm.design(SAMPLED, controller=template, shape=(15, 15))
    assert best.loop.controller.filter == dtm.DerivativeFilter(38.0)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"controller": dtm.P}, ValueError, "1 gains"),
        ({"controller": dtm.PID}, ValueError, "3 gains"),
        ({"controller": "PV"}, TypeError, "no controller"),
        ({"delay": (0.4, 0.3)}, ValueError, "interval"),
        ({"delay": -0.1}, ValueError, "delay"),
        ({"objective": "beauty"}, ValueError, "beauty"),
        ({"ranges": {"Kp": (0, 1)}}, ValueError, "gains are"),
        ({"ranges": {"Kp": (20, 30), "Kv": (0, 0.5)}}, ValueError, "no gains"),
    ],
)
def test_what_cannot_be_designed_is_refused(change, error, words):
    with pytest.raises(error, match=words):
        dtm.design(LOOP, **({"shape": (5, 5)} | change))


@pytest.mark.parametrize("delay", [1e-5, 0.01, 0.36, 20.0])
def test_the_critical_gain_is_found_over_many_decades(delay):
    # s + Kp e^(-sT) loses stability at Kp T = pi/2
    assert critical_gain(LOOP.replace(delay=delay)) == pytest.approx(np.pi / 2 / delay, rel=1e-9)


def test_an_unknown_delay_is_refused():
    with pytest.raises(ValueError, match="not known"):
        dtm.design(LOOP.replace(delay=None))
