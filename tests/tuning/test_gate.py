"""The gate: what passes, and the reason for each refusal."""

import dataclasses
import re

import deadtime as dtm
import numpy as np
import pytest

LOOP = dtm.ControlLoop(
    dtm.Integrator(0.85, 0.1), dtm.P(1.2), delay=0.25, sample_time=0.065, limit=1.0
)


def estimate(noise=0.003, length=8.0, free=("delay", "gain")):
    truth = LOOP.replace(Kp=1.6)
    known = truth.replace(plant=dtm.Integrator(lag=0.1), delay=None)
    flight = dtm.Experiment.step(length, rest=1.04).run(truth, noise=noise, seed=2)
    return dtm.estimate_delay(flight, known, free=free)


def test_moderate_gains_of_a_known_loop_pass():
    found = dtm.check_gains(LOOP, {"Kp": 1.5}, noise=0.003)
    assert found.passed
    assert found
    assert found.reasons == ()
    assert found.max_sensitivity == LOOP.replace(Kp=1.5).margin().max_sensitivity
    assert {"stability", "Ms", "limit", "noise", "change"} <= set(found.checked)
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.passed = False


@pytest.mark.parametrize(
    ("gains", "options", "reason"),
    [
        ({"Kp": 9.0}, {"flown": dtm.P(8.0)}, "not stable|Ms is"),
        ({"Kp": 3.0}, {"flown": dtm.P(2.9)}, "Ms is .* at most 2"),
        ({"Kp": 1.5}, {"flown": {"Kp": 0.5}}, "Kp changes from 0.5 to 1.5, which is more than"),
        ({"Kp": 1.5}, {"flown": {"Kp": -1.5}}, "changes its sign"),
        ({"Kp": 1.5}, {"noise": 0.2}, "noise on the command"),
        ({"Kp": 2.2}, {"loops": [LOOP.replace(delay=0.9)]}, "not stable if .*delay = 0.9"),
    ],
)
def test_each_refusal_has_its_reason(gains, options, reason):
    found = dtm.check_gains(LOOP, gains, **options)
    assert not found.passed
    assert any(re.search(reason, text) for text in found.reasons), found.reasons


def test_a_limit_on_one_side_passes_in_the_direction_that_it_leaves():
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.PI(1.0, 0.1), delay=2.0, limit=(0.0, 1.0))
    found = dtm.check_gains(loop, {"Kp": 1.1})
    assert found.passed
    assert "limit" in found.checked
    assert dtm.check_gains(loop.replace(limit=(-1.0, 0.0)), {"Kp": 1.1}).passed
    # Half of the range counts for the noise.
    loud = dtm.check_gains(loop, {"Kp": 1.1}, noise=0.1)
    assert re.search(r"noise on the command .* of the limit", loud.reasons[0])


@pytest.mark.parametrize(
    ("gains", "options", "reason"),
    [
        ({"Kp": 1.1, "delay": 0.01}, {}, "delay=0.01 is not a gain of this controller"),
        (
            {"Kp": 1.1},
            {"flown": {"kp": 0.1}},
            "flown contains 'kp', which is not a gain: give gains from Kp, Ki",
        ),
        ({"Kp": 1.1}, {"noise": float("nan")}, "noise=nan"),
        ({"Kp": 1.1}, {"noise": 0.1, "bandwidth": -3.0}, "bandwidth=-3"),
        ({"Kp": 1.1}, {"noise_share": -1.0}, "noise_share=-1"),
    ],
)
def test_what_cannot_be_checked_is_no_gate(gains, options, reason):
    with pytest.raises(ValueError, match=reason):
        dtm.check_gains(LOOP, gains, **options)


def test_a_derivative_has_two_names_and_what_is_left_out_has_changed():
    smooth = dtm.DerivativeFilter(60.0)
    loop = LOOP.replace(controller=dtm.PV(1.5, 0.1, smooth))
    found = dtm.check_gains(loop, {"Kp": 1.5}, flown=dtm.PD(1.5, 0.02, smooth))
    assert any("Kd changes from 0.02 to 0.1" in reason for reason in found.reasons)
    found = dtm.check_gains(LOOP, {"Kp": 1.5}, flown=dtm.PD(1.5, 0.02, smooth))
    assert any("Kd changes from 0.02 to 0" in reason for reason in found.reasons)


def test_hidden_modes_are_refused():
    # (s - 0.1)/((s - 0.1)(s + 1)): the loop does not show the pole at 0.1.
    plant = dtm.RationalPlant([1.0, -0.1], np.convolve([1.0, -0.1], [1.0, 1.0]).tolist())
    found = dtm.check_gains(dtm.ControlLoop(plant, dtm.PI(1.0, 0.5), delay=0.1), {"Kp": 1.0})
    assert not found.passed
    # A slow pole that the zero of PI control cancels recovers slowly from loads.
    slow = dtm.ControlLoop(dtm.FirstOrder(1.0, 100.0), dtm.PI(20.0, 0.2), delay=1.0)
    found = dtm.check_gains(slow, {"Kp": 20.0})
    assert any("cancels the slow pole" in reason for reason in found.reasons)
    assert dtm.check_gains(slow, {"Kp": 20.0, "Ki": 0.35}).passed


def test_a_step_that_the_limit_never_lets_rest_is_refused():
    plant = dtm.RationalPlant([1.0], [1.0, -0.5])
    loop = dtm.ControlLoop(plant, dtm.P(2.0), delay=0.1, limit=1.0)
    assert dtm.check_gains(loop, {"Kp": 1.6}, amplitude=0.1).passed
    found = dtm.check_gains(loop, {"Kp": 1.6}, amplitude=5.0)
    assert any("does not come to rest within the limit" in reason for reason in found.reasons)


def test_an_estimate_must_be_reliable_or_set_aside():
    fit = estimate()
    assert fit.verdict == "reliable"
    assert dtm.check_gains(fit, {"Kp": 1.4}).passed
    unsure = fit.doubted("made up")
    found = dtm.check_gains(unsure, {"Kp": 1.4})
    assert not found.passed
    assert "is not reliable" in found.reasons[0]
    found = dtm.check_gains(unsure, {"Kp": 1.4}, override=True)
    assert found.passed
    assert "made up" in found.overridden[0]
    assert "set aside" in found.summary()


def test_a_design_has_its_gate():
    best = dtm.design(LOOP, controller=dtm.P, delay=(0.2, 0.3))
    assert best.gate().passed
    assert not best.gate(flown={"Kp": 0.1}).passed
    fit = estimate()
    best = dtm.design(fit, controller=dtm.P)
    assert best.gate(flown=dtm.P(1.6)).passed
    with pytest.raises(TypeError, match="give a DelayEstimate, a PlantEstimate"):
        dtm.check_gains(3.0, {"Kp": 1.0})
