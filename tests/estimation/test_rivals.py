"""Another plant that is clearly better is named, and no right plant is doubted for one."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import OutputError
from deadtime.estimation.evidence import _rival
from deadtime.estimation.evidence._rival import kind_of
from deadtime.experiments import FlightNoise
from flights import flight_path
from made_processes import bump

#: Noise of the sensor, gusts after Dryden, air that walks, coloured noise; then rounding to 1 cm.
NOISES = (
    0.004,
    FlightNoise(0.004, air=0.1, air_time=0.5),
    FlightNoise(0.004, air_walk=0.02),
    FlightNoise(0.003, sensor=0.006, sensor_time=0.3),
    0.003,
)


def test_a_bump_test_with_an_integrator_is_an_indication():
    """It was reliable with 72 s for 12: the integrator's misfit was booked as air."""
    time, command, output = bump(rows=300)
    recording = dtm.Recording(time, command, output, command)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0))
    alone = dtm.estimate_delay(recording, loop, method=OutputError(rivals=False))
    fit = dtm.estimate_delay(recording, loop)
    assert alone.delay == fit.delay > 20.0
    assert fit.verdict == "indication"
    assert "a process that comes to rest, time constant" in fit.reason
    assert "clearly better" in fit.headline()
    assert fit.advice.endswith("dtm.estimate_delay(recording)")
    right = dtm.ControlLoop(dtm.FirstOrder(1.0, 20.0), dtm.P(1.0))
    fit = dtm.estimate_delay(recording, right, free=("delay", "gain", "time_constant"))
    assert fit.verdict == "reliable"


@pytest.mark.parametrize(
    ("file", "Kp"),
    [("0_5_1_0", 0.5), pytest.param("2_4_0_25", 2.4, marks=pytest.mark.survey)],
)
def test_a_recorded_height_names_the_servo(file, Kp):
    recording = dtm.read_recording(flight_path(f"ardrone2_height_step_{file}.csv"))
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), sample_time=0.065, limit=1.0)
    fit = dtm.estimate_delay(recording, loop, window=(13, 25.5))
    assert fit.verdict == "indication"
    assert "a process that integrates, after a lag of" in fit.reason
    assert ", zero " in fit.reason
    assert fit.advice.endswith(f"window=(13, 25.5), controller=dtm.P(Kp={Kp}), limit=1.0)")


def verdicts(seed):
    """Verdicts on a drawn record, without rivals and with them; the named plant is right."""
    rng = np.random.default_rng(seed)
    rows, gain = int(rng.integers(150, 400)), rng.uniform(0.6, 1.2)
    late, slow = rng.uniform(0.1, 0.45), rng.uniform(0.05, 0.4)
    plants = (
        (dtm.Integrator(gain), ()),
        (dtm.Integrator(gain, lag=slow), ("lag",)),
        (dtm.FirstOrder(gain, 3.0 * slow), ("time_constant",)),
    )
    plant, more = plants[seed % 3]
    controller = dtm.P(0.35 / (gain * (late + slow)))
    truth = dtm.ControlLoop(plant, controller, delay=late, sample_time=0.065)
    reference = np.repeat(rng.choice([0.0, 1.0, 2.0], rows // 30 + 1), 30)[:rows]
    reference[:20] = 0.0
    number = seed % len(NOISES)
    run = dtm.Experiment(0.065 * np.arange(rows), reference).run(truth, NOISES[number], seed)
    output = np.round(run.output, 2) if number == len(NOISES) - 1 else run.output
    run = dtm.Recording(run.time, run.reference, output, run.command)
    return [
        dtm.estimate_delay(
            run,
            truth.replace(delay=None, gain=1.0),
            free=("delay", "gain", *more),
            method=OutputError(rivals=rivals),
        ).verdict
        for rivals in (False, True)
    ]


@pytest.mark.parametrize("seed", [1, 6, 13])
def test_a_right_plant_keeps_its_verdict(seed):
    alone, beside = verdicts(seed)
    assert alone == beside


@pytest.mark.survey
@pytest.mark.long
def test_right_plants_keep_their_verdicts_in_any_noise():
    drawn = [verdicts(seed) for seed in range(60)]
    assert sum(alone == "reliable" for alone, _ in drawn) >= 45
    assert sum(alone != beside for alone, beside in drawn) <= 1


def test_wind_alone_asks_for_no_other_plant(monkeypatch):
    """What air leaves is no response to the command, however smooth it is."""
    asked = []
    monkeypatch.setattr(_rival, "_answer", lambda *given: asked.append(given))
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0)
    time = 0.065 * np.arange(300)
    reference = np.where(((time > 1.04) & (time < 7.0)) | (time > 13.0), 1.0, 0.0)
    flight = dtm.Experiment(time, reference)
    for seed in range(11, 19):
        run = flight.run(loop, FlightNoise(0.004, air_walk=0.02), seed)
        dtm.estimate_delay(run, loop.replace(delay=None), free=("delay", "gain"))
    assert len(asked) <= 2


def test_few_rows_have_no_rivals():
    """The family needs twenty rows that count: fewer were an error of its own."""
    loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(2.0), delay=0.3, sample_time=0.065)
    run = dtm.Experiment.step(1.0, rest=0.2).run(loop, 0.002, 1)
    fit = dtm.estimate_delay(run, loop.replace(delay=None))
    assert fit.verdict in ("reliable", "indication")


@pytest.mark.parametrize(
    ("plant", "free", "kind"),
    [
        (dtm.Integrator(), (), "integrator"),
        (dtm.Integrator(), ("lag",), "integrator, lag"),
        (dtm.FirstOrder(), (), "lag"),
        (dtm.FactoredPlant([0.2, 0.1]), (), "two lags"),
        (dtm.FactoredPlant([0.2], zero=0.1), (), "two lags, zero"),
        (dtm.FactoredPlant([], pole_frequency=2.0, pole_damping=0.5), ("zero",), "two lags, zero"),
        (dtm.FactoredPlant([0.2], integrator=True), ("zero",), "integrator, lag, zero"),
        (dtm.FactoredPlant([0.3, 0.2, 0.1]), (), None),
        (dtm.RateLimited(dtm.Integrator(), 1.0), (), None),
    ],
)
def test_the_kind_of_a_plant_is_the_least_that_has_its_numbers(plant, free, kind):
    assert kind_of(plant, free) == kind
