"""The Cramér-Rao bound of a planned experiment in moving air."""

import math
import re
import sys
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from deadtime.experiments import FlightNoise
from loops import TS, held_loop

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))

from reality import bound  # noqa: E402
from reality.conditions import Condition  # noqa: E402

# --- bounds in wind -------------------------------------------------------------------------

#: Noises, and the air of each for a computation that shares no code.
NOISES = {
    "white": (FlightNoise(0.005), None),
    "walk": (FlightNoise(0.005, air_walk=0.02), Condition("walk", air=0.02)),
    "strong walk": (FlightNoise(0.005, air_walk=0.2), Condition("walk", air=0.2)),
    "gusts": (FlightNoise(0.005, air=0.1, air_time=0.3), Condition("gusts", gust=(0.1, 0.3))),
    "trim": (FlightNoise(0.005, trim=-0.02), None),
    "coloured": (FlightNoise(0.002, sensor=0.005, sensor_time=-TS / math.log(0.9)), None),
    "all": (
        FlightNoise(0.002, 0.05, 1.0, trim=0.02, sensor=0.005, sensor_time=0.2),
        Condition("gusts", gust=(0.05, 1.0)),
    ),
}


def covariances(noise, air, lag, time):
    """Of the air through the plant at rest, and of the sensor."""
    size, moved = time.size, np.zeros((time.size, time.size))
    if air is not None:
        moved = bound.air_covariance(air, lag, time)
        if air.gust and lag:
            # There the gusts have moved the vehicle before.
            deviation, T = air.gust
            of_air, velocity = bound.fading(time, lag, T), -lag * np.expm1(-time / lag)
            both = np.outer(of_air, velocity)
            moved -= deviation**2 * T / (T + lag) * (both + both.T + np.outer(velocity, velocity))
    sensor = noise.white**2 * np.eye(size)
    if noise.sensor:
        apart = np.abs(np.subtract.outer(time, time))
        sensor += noise.sensor**2 * np.exp(-apart / noise.sensor_time)
    return moved, sensor


def smallest_errors(columns, V, names):
    cov = np.linalg.inv(columns @ np.linalg.solve(V, columns.T))
    return dict(zip(names, np.sqrt(np.diag(cov)), strict=False))


def derivatives(function, values, step=1e-6):
    return [
        (function(**values | {name: value + step}) - function(**values | {name: value - step}))
        / (2 * step)
        for name, value in values.items()
    ]


@pytest.mark.parametrize("lag", [0.0, 0.2])
@pytest.mark.parametrize("name", NOISES)
def test_the_bound_in_wind_is_that_of_the_dense_matrices(name, lag):
    noise, air = NOISES[name]
    loop = held_loop(1.6, 0.3, lag, 0.85)
    plan = dtm.identifiability(loop, dtm.Experiment.step(7.8, rest=0.65), noise=noise)
    time, command = plan.recording.time, plan.recording.command
    moved, sensor = covariances(noise, air, lag, time)

    def output(delay, gain, lag=0.0):
        lags = (lag,) if lag else ()
        return gain * bound.response(time, time + delay, command, lags)

    columns = derivatives(output, {key: loop.parameters[key] for key in plan.free})
    columns.append(np.ones(time.size))
    if noise.trim or noise.air_walk:
        columns.append(bound.ramp(time, (lag,) if lag else ()))
    expected = smallest_errors(np.array(columns), moved + sensor, plan.free)
    for key in plan.free:
        assert plan.command_logged.stderr[key] == pytest.approx(expected[key], rel=1e-3)
    assert ("trim" in plan.bound.free) == bool(noise.trim or noise.air_walk)


@pytest.mark.parametrize("name", ["walk", "all"])
@pytest.mark.parametrize(
    "plant",
    [dtm.FirstOrder(1.4, 0.7), dtm.RationalPlant([0.3, 2.0], [1.0, 3.0, 0.0])],
)
def test_the_air_goes_through_any_plant(plant, name):
    noise, _ = NOISES[name]
    loop = dtm.ControlLoop(plant, dtm.P(1.2), delay=0.2, sample_time=0.05)
    plan = dtm.identifiability(
        loop, dtm.Experiment.square(6.0, 1.0, 1.1, sample_time=0.05), noise=noise
    )
    time = plan.recording.time
    V = noise.process(plant).covariance(time) + covariances(noise, None, 0.0, time)[1]
    columns = np.array(list(plan.bound.sensitivities.values()))
    assert plan.bound.free == (*plan.free, "initial output", "trim")
    expected = smallest_errors(columns, V, plan.free)
    for key in plan.free:
        assert plan.stderr[key] == pytest.approx(expected[key], rel=1e-3)


@pytest.mark.parametrize(("lag", "limit"), [(0.0, None), (0.2, 1.0)])
@pytest.mark.parametrize("name", NOISES)
def test_the_bound_without_the_command_has_the_air_in_the_loop(name, lag, limit):
    noise, air = NOISES[name]
    loop = held_loop(1.6, 0.3, lag, 0.85, limit=limit)
    experiment = dtm.Experiment.step(4.55, rest=0.65)
    plan = dtm.identifiability(loop, experiment, noise=noise, initial_output=0.0)
    time, reference = plan.recording.time, experiment.reference
    moved, sensor = covariances(noise, air, lag, time)

    def output(shift=0.0, **numbers):
        changed = loop.replace(**numbers)
        return changed.simulate(
            time, reference - shift, reference_time=time, initial_output=0.0
        ).outputs

    # What the simulated loop makes of each sample of the effect of the air.
    step = 1e-6
    loops = (
        np.eye(time.size)
        + np.array(
            [(output(step * one) - output(-step * one)) / (2 * step) for one in np.eye(time.size)]
        ).T
    )
    columns = derivatives(output, {key: loop.parameters[key] for key in plan.free})
    if noise.trim or noise.air_walk:
        columns.append(loops @ bound.ramp(time, (lag,) if lag else ()))
    V = loops @ moved @ loops.T + sensor
    expected = smallest_errors(np.array(columns), V, plan.free)
    for key in plan.free:
        assert plan.reference_only.stderr[key] == pytest.approx(expected[key], rel=0.01)


def test_a_plan_in_wind_does_not_promise_what_a_calm_one_does():
    loop, step = held_loop(1.6, 0.3, gain=0.85), dtm.Experiment.step(7.8)
    calm, windy = (
        dtm.identifiability(loop, step, noise=NOISES[name][0]) for name in ("white", "gusts")
    )
    assert windy.stderr["delay"] > 4 * calm.stderr["delay"]
    assert windy.stderr["gain"] > 30 * calm.stderr["gain"]
    assert "wind (air) of 0.1 with a time constant of 0.3 s" in windy.summary()
    assert windy.bound.noise == windy.noise == NOISES["gusts"][0]
    noisy = dtm.identifiability(loop, step, noise=windy.noise, runs=20)
    # The command that holds the vehicle against the gusts adds a little information.
    assert 0.9 < noisy.stderr["gain"] / windy.stderr["gain"] < 0.995
    assert len(windy.plot()) == 2


def test_the_noise_of_an_estimate_is_that_of_a_run_and_of_a_plan():
    noise = FlightNoise(0.005, air=0.1, air_time=1.0)
    loop, prbs = held_loop(1.6, 0.3, gain=0.85), dtm.Experiment.prbs(20.0, 0.4, 0.4)
    fit = dtm.estimate_delay(
        prbs.run(loop, noise, seed=1), loop.replace(delay=None), method="output_error"
    )
    assert isinstance(fit.noise, FlightNoise)
    assert fit.noise.air == pytest.approx(0.1, rel=0.4)
    assert fit.crb.noise == fit.noise
    assert fit.details["rows_left_out"] == 0
    plan = dtm.identifiability(loop, prbs, noise=fit.noise)
    truth = dtm.identifiability(loop, prbs, noise=noise)
    assert plan.stderr["delay"] == pytest.approx(truth.stderr["delay"], rel=0.3)
    again = prbs.run(fit.loop, fit.noise, seed=2)
    assert again.output.std() == pytest.approx(prbs.run(loop, noise, seed=2).output.std(), rel=0.3)


@pytest.mark.survey
@pytest.mark.parametrize("name", ["white", "walk", "slow gusts", "trim", "coloured"])
def test_estimates_in_wind_scatter_as_the_bound_says(name):
    slow = {"slow gusts": (FlightNoise(0.005, air=0.05, air_time=1.0), None)}
    noise, _ = (NOISES | slow)[name]
    plan = dtm.identifiability(
        held_loop(1.6, 0.3, gain=0.85),
        dtm.Experiment.step(7.8, rest=0.65),
        noise=noise,
        free=("delay", "gain"),
    )
    tried = plan.monte_carlo(60, "output_error", processes=1)
    # The median, because some runs are called indications and have the estimate of least squares;
    # 60 runs determine it to 15 %.
    errors = np.abs(tried.estimates["delay"] - tried.truth["delay"])
    assert 0.65 < np.median(errors) / 0.6745 / plan.stderr["delay"] < 1.5


class Unknown:
    def sample(self, time, seed):
        return np.zeros(time.size)


def test_noise_without_a_covariance_is_refused():
    options = {"loop": held_loop(), "experiment": dtm.Experiment.step()}
    with pytest.raises(TypeError, match="covariance is not known"):
        dtm.identifiability(**options, noise=Unknown())
    with pytest.raises(ValueError, match=r"noise\.white"):
        dtm.identifiability(**options, noise=FlightNoise(air=0.1, air_time=1.0))


@pytest.mark.parametrize(
    ("change", "experiment", "match"),
    [
        ({}, dtm.Experiment.relay(5.0, 0.5), "times at which the relay switches"),
        ({"controller": dtm.PI(1.3, 0.2)}, dtm.Experiment.step(), "integral"),
        ({"controller": dtm.PV(1.3, 0.0)}, dtm.Experiment.step(), "P controller"),
        ({}, dtm.Experiment.step(3001 * TS), "3001 samples.*shorter"),
    ],
)
def test_air_in_a_loop_without_its_command_is_refused_with_the_reason(change, experiment, match):
    loop = held_loop(lag=0.06).replace(**change)
    plan = dtm.identifiability(loop, experiment, noise=NOISES["gusts"][0])
    assert plan.reference_only is None
    assert len(plan.remarks) == 1
    assert re.search(match, plan.remarks[0])


def test_air_in_a_continuous_loop_has_no_bound():
    loop = held_loop(lag=0.06).continuous()
    with pytest.raises(dtm.NotIdentifiableError, match=r"continuous loop.*continuous controller"):
        dtm.identifiability(loop, dtm.Experiment.step(), noise=NOISES["gusts"][0])
