"""The noise of a flight: its covariance, its draws, and its effect in the loop."""

import math
import sys
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from deadtime.experiments import FlightNoise
from deadtime.loops._open_run import open_response

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))

from reality import bound  # noqa: E402
from reality.conditions import Condition  # noqa: E402

TS = 0.065
TIME = TS * np.arange(60)
GUSTS = FlightNoise(white=0.005, air=0.1, air_time=0.3)


def held_loop(controller=None, plant=None, **fields):
    fields = {"delay": 0.3, "sample_time": TS, "limit": 1.0} | fields
    return dtm.ControlLoop(plant or dtm.Integrator(0.85), controller or dtm.P(1.6), **fields)


# --- covariance and draws --------------------------------------------------------------------


@pytest.mark.parametrize("lag", [0.0, 0.2])
@pytest.mark.parametrize(
    ("noise", "condition"),
    [
        (FlightNoise(air_walk=0.05), Condition("walk", air=0.05)),
        (GUSTS, Condition("gusts", gust=(0.1, 0.3))),
        (FlightNoise(air=0.1, air_time=4.0), Condition("slow gusts", gust=(0.1, 4.0))),
    ],
)
def test_the_air_has_the_covariance_of_itos_isometry(noise, condition, lag):
    times = TIME[::3]
    expected = bound.air_covariance(condition, lag, times)
    if condition.gust and lag:
        # There the gusts have moved the vehicle before; here it is at rest at the first sample.
        deviation, T = condition.gust
        air, velocity = bound.fading(times, lag, T), -lag * np.expm1(-times / lag)
        share = T / (T + lag)
        expected -= deviation**2 * share * (np.outer(air, velocity) + np.outer(velocity, air))
        expected -= deviation**2 * share * np.outer(velocity, velocity)
    found = noise.process(dtm.Integrator(0.85, lag)).covariance(times)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.max(expected))


def test_a_lag_much_shorter_than_a_sample_changes_little():
    without, short = (GUSTS.process(dtm.Integrator(1.0, lag)).covariance(TIME) for lag in (0, 1e-6))
    np.testing.assert_allclose(short, without, rtol=1e-3, atol=1e-9)


class Impulse:
    """Random numbers that are all zero but one, to see what each of them does."""

    def __init__(self, place):
        self.place = place

    def standard_normal(self, size):
        found = (np.arange(size) == self.place).astype(float)
        self.place -= size
        return found


@pytest.mark.parametrize(
    ("noise", "mean"),
    [
        (GUSTS, 0.0),
        (FlightNoise(air_walk=0.05, trim=-0.02), -0.02),
        (FlightNoise(air=0.05, air_time=2.0, air_walk=0.1, trim=0.1), 0.1),
    ],
)
@pytest.mark.parametrize("plant", [dtm.Integrator(1.0, 0.2), dtm.FirstOrder(1.0, 0.7)])
def test_draws_have_the_covariance_and_the_mean_of_the_process(noise, mean, plant):
    times = np.cumsum([0.0, 0.05, 0.2, 0.065, 0.065, 0.5])
    process = noise.process(plant)
    count = process.mean.size * times.size
    none = process.drawn(times, Impulse(count))
    effects = np.array([process.drawn(times, Impulse(i)) - none for i in range(count)])
    covariance = process.covariance(times)
    np.testing.assert_allclose(effects.T @ effects, covariance, atol=1e-10 * np.max(covariance))
    constant = plant.transfer_function().step_response(times).outputs
    np.testing.assert_allclose(none, mean * constant, atol=1e-13)


def test_coloured_noise_of_the_sensor_is_autoregressive():
    noise = FlightNoise(white=0.002, sensor=0.005, sensor_time=-TS / math.log(0.9))
    drawn = np.array([noise.sample(TIME[:8], seed) for seed in range(2000)])
    rows = np.arange(8)
    expected = 0.005**2 * 0.9 ** abs(rows[:, None] - rows) + 0.002**2 * np.eye(8)
    # An element is known to sqrt(2 / 2000) = 0.032.
    np.testing.assert_allclose(np.cov(drawn.T), expected, atol=0.13 * expected[0, 0])
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=5e-4)


def test_the_parts_are_independent_and_the_same_for_the_same_seed():
    both = FlightNoise(white=0.01, air=0.1, air_time=1.0, sensor=0.01, sensor_time=1.0)
    plant = dtm.Integrator()
    for one in (7, np.random.SeedSequence(7, spawn_key=(2,))):
        np.testing.assert_array_equal(both.sample(TIME, one), both.sample(TIME, one))
        moved = both.disturbance(TIME, one, plant)
        np.testing.assert_array_equal(moved, both.disturbance(TIME, one, plant))
    alone = FlightNoise(sensor=0.1, sensor_time=1.0)
    sensor = np.array([alone.sample(TIME[:2], seed)[1] for seed in range(1000)])
    air = np.array([both.disturbance(TIME[:2], seed, plant)[1] for seed in range(1000)])
    assert abs(np.corrcoef(sensor, air)[0, 1]) < 0.13
    white = dtm.Experiment.step().run(held_loop(), noise=FlightNoise(0.01), seed=3)
    plain = dtm.Experiment.step().run(held_loop(), noise=0.01, seed=3)
    np.testing.assert_array_equal(white.output, plain.output)


def test_trim_is_a_constant_input_of_a_plant_at_rest():
    moved = FlightNoise(trim=-0.02).disturbance(TIME, 1, dtm.Integrator(3.0))
    np.testing.assert_allclose(moved, -0.02 * TIME, atol=1e-15)


# --- in the loop -------------------------------------------------------------------------------


@pytest.mark.parametrize("in_loop", [True, False])
@pytest.mark.parametrize("plant", [dtm.Integrator(0.85, 0.2), dtm.FirstOrder(2.0, 0.7)])
def test_the_plant_answers_to_command_and_air_and_the_controller_to_the_output(plant, in_loop):
    noise = FlightNoise(0.005, air=0.2, air_time=0.5, trim=0.1, sensor=0.01, sensor_time=0.3)
    loop = held_loop(plant=plant)
    run = dtm.Experiment.square(8.0, 0.4, 2.0).run(loop, noise, seed=5, noise_in_loop=in_loop)
    sensor = noise.sample(run.time, 5)
    moved = noise.disturbance(run.time, 5, plant)
    arrivals, commands = np.r_[-1.0, run.time + 0.3], np.r_[0.0, run.command]
    answer = open_response(plant, plant.parameters, run.time, arrivals, commands)
    np.testing.assert_allclose(run.output, answer + moved + sensor, atol=1e-12)
    read = run.output if in_loop else run.output - sensor
    np.testing.assert_allclose(
        run.command, np.clip(1.6 * (run.reference - read), -1.0, 1.0), atol=1e-12
    )
    assert np.abs(run.command).max() == 1.0


def test_a_loop_holds_the_vehicle_against_trim():
    rest = dtm.Experiment(TIME, np.zeros(60))
    run = rest.run(held_loop(limit=None, delay=0.1), FlightNoise(trim=0.1))
    # The gain times the command is minus the trim.
    assert run.command[-1] == pytest.approx(-0.1 / 0.85, rel=0.01)
    assert run.output[-1] == pytest.approx(0.1 / 0.85 / 1.6, rel=0.01)


class Bump:
    """Models of one's own: the sensor alone, and one that also moves the plant."""

    def sample(self, time, seed):
        return np.full(time.size, 0.01)


class MovingBump(Bump):
    def disturbance(self, time, seed, plant):
        return 0.1 * plant.parameters["gain"] * time


def test_own_models_are_taken():
    rest = dtm.Experiment(TIME, np.zeros(60))
    still = rest.run(held_loop(delay=10.0), Bump())
    np.testing.assert_array_equal(still.output, 0.01)
    # The first command arrives after the end.
    moving = rest.run(held_loop(delay=10.0), MovingBump())
    np.testing.assert_allclose(moving.output, 0.01 + 0.085 * TIME, atol=1e-15)
    np.testing.assert_allclose(moving.command, -1.6 * moving.output, atol=1e-13)


# --- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("loop", "match"),
    [
        (held_loop(sample_time=None), "continuous controller.*sample_time"),
        (held_loop(dtm.PI(1.0, 0.2)), "integral.*without Ki"),
        (held_loop(dtm.PV(1.0, 0.1, dtm.DerivativeFilter(20.0))), "filter.*discretisation"),
        (held_loop(dtm.PD(1.0, 0.1)), "ideal derivative of noise does not exist"),
        (
            held_loop(dtm.P(30.0), dtm.RationalPlant([1.0], [1.0, -20.0]), delay=0.0),
            "unstable and grows by",
        ),
    ],
)
def test_air_that_cannot_be_computed_is_refused(loop, match):
    with pytest.raises(ValueError, match=match):
        dtm.Experiment.step().run(loop, GUSTS)
    if loop.controller.gains.keys() != {"Kp", "Kd"}:
        dtm.Experiment.step().run(loop, FlightNoise(0.005))


@pytest.mark.parametrize(
    ("numbers", "match"),
    [
        ({"white": -0.1}, "white"),
        ({"air": 0.1}, "air_time=inf.*air_walk"),
        ({"air": 0.1, "air_time": 0.0}, "air_time"),
        ({"sensor": 0.1}, "sensor_time.*white"),
        ({"sensor": 0.1, "sensor_time": math.inf}, "sensor_time"),
        ({"trim": math.nan}, "trim"),
        ({"air_walk": math.inf}, "air_walk"),
    ],
)
def test_invalid_numbers_are_refused(numbers, match):
    with pytest.raises(ValueError, match=match):
        FlightNoise(**numbers)
