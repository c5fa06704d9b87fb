"""The filter of the derivative: noise and loss, against closed forms and simulation."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime.tuning._filter_choice import noise_gain

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
SAMPLED = LOOP.replace(sample_time=0.065)


@pytest.fixture(scope="module")
def choice():
    return dtm.design_filter(LOOP, fixed={"Kp": 2.0})


def test_the_slowest_filter_that_loses_no_more(choice):
    assert choice.ideal.gains["Kv"] == pytest.approx(0.2415, abs=5e-4)
    assert choice.value <= 0.9 * choice.ideal.value
    assert choice.design.loop.parameters["omega"] == choice.omega
    # A slower one loses more, and the paper's 38 rad/s much more.
    slower = dtm.design(
        LOOP,
        fixed={"Kp": 2.0},
        filter=dtm.DerivativeFilter(0.97 * choice.omega),
        objective="abscissa",
    )
    assert slower.value > 0.9 * choice.ideal.value
    paper = np.interp(math.log(38.0), np.log(choice.omegas), choice.values)
    assert paper == pytest.approx(-2.645, abs=0.03)
    assert (np.diff(choice.values) < 0.0).all()
    assert (np.diff(choice.noise_gains) > 0.0).all()
    assert choice.noise_gain < 0.01 * choice.ideal_noise_gain
    assert not choice.values.flags.writeable


def test_the_fastest_filter_that_is_quiet_enough():
    found = dtm.design_filter(
        SAMPLED, fixed={"Kp": 2.0}, noise=0.01, command_noise=0.03, omegas=[10, 30, 90, 270]
    )
    assert 0.029 < found.noise * found.noise_gain <= 0.03
    assert "0.03" in found.rule
    assert found.value > found.ideal.value


def test_noise_without_a_bound_of_the_command_is_only_reported():
    plain, noisy = (
        dtm.design_filter(LOOP, fixed={"Kp": 2.0}, loss=0.2, noise=noise, omegas=[40.0, 160.0])
        for noise in (None, 0.01)
    )
    assert noisy.rule == plain.rule == "the slowest filter that loses at most 20 %"
    assert (noisy.omega, noisy.noise) == (plain.omega, 0.01)


def test_design_chooses_a_filter_itself(choice):
    best = dtm.design(LOOP, fixed={"Kp": 2.0}, filter="auto", objective="abscissa")
    assert best.filter_choice.omega == choice.omega
    assert best.gains == choice.design.gains
    assert best.traded[-1].requirement == "filter"
    assert "filter at" in best.summary()


def test_the_noise_gain_of_a_weak_ideal_derivative():
    # Where the loop gain is small, F = Kp + Kv s: Kp^2 + Kv^2 B^2/3
    loop = dtm.ControlLoop(dtm.Integrator(1e-6), dtm.PV(2.0, 0.3), delay=0.1)
    assert noise_gain(loop, 50.0) == pytest.approx(math.sqrt(4.0 + 0.09 * 2500.0 / 3.0), rel=1e-3)


def test_the_noise_gain_is_what_a_simulated_loop_shows():
    # White noise at the samples of a P loop: the reference of a regulator at rest.
    loop = SAMPLED.replace(controller=dtm.P(2.0))
    time = np.arange(40_000) * 0.065
    noise = np.random.default_rng(3).normal(size=time.size)
    commands = loop.simulate(time, -noise, reference_time=time).inputs
    assert np.std(commands[200:]) == pytest.approx(noise_gain(loop, np.pi / 0.065), rel=0.02)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"objective": "overshoot"}, "every filter"),
        ({"controller": dtm.PI}, "no derivative"),
        ({"command_noise": 0.1}, "both"),
        ({"omegas": [3.0, 2.0]}, "omegas"),
        ({"omegas": [0.0, 2.0]}, "two or more corner frequencies"),
        ({"omegas": [1.0, 2.0], "loss": 0.01}, "loses as little as 1 %"),
        ({"noise": 1.0, "command_noise": 0.1, "omegas": [10.0, 20.0]}, "noise gain"),
        ({"loss": -1.0}, "loss"),
    ],
)
def test_what_cannot_be_chosen_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        dtm.design_filter(LOOP, **({"fixed": {"Kp": 2.0}} | change))


def test_noise_beyond_half_the_sampling_rate_is_refused():
    with pytest.raises(ValueError, match="appears at lower frequencies"):
        dtm.design_filter(SAMPLED, fixed={"Kp": 2.0}, bandwidth=100.0)


def test_the_choice_is_drawn(choice):
    pytest.importorskip("matplotlib")
    figure = choice.plot()
    assert len(figure.axes) == 6
    assert any("rad/s" in ax.get_title() for ax in figure.axes)
