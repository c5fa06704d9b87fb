"""Gains that follow the delay in flight: in virtual time, and on the firmware behind a relay."""

import asyncio
import csv
import json
import os
import subprocess
import sys

import deadtime as dtm
import numpy as np
import pytest
from command_line import one_clear_line, run as run_command
from deadtime.estimation import OnlineEstimator
from deadtime.flights import AdaptivePlan, FlightPlan, FlownVehicle, MovingDelay
from deadtime.flights._adaptive import STEP_COLUMNS, AdaptiveStudy
from deadtime.flights._adaptive_control import AdaptiveControl, ChosenSet, ScheduledControl
from deadtime.links import now, run
from deadtime.tuning import SwitchingProof, adaptive_gains

LOOP = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(1.0), sample_time=0.1, limit=1.0)


@pytest.fixture(scope="module")
def schedule():
    return adaptive_gains(LOOP, (0.0, 0.5), sets=3)


def controlled(control, delays, duration=40.0):
    """Fly an integrator with moving delays in virtual time; the outputs."""

    async def fly():
        y, coming, last, held = 0.0, [], 0.0, 0.0
        outputs = []
        for k in range(round(duration / 0.1)):
            await asyncio.sleep(0.1)
            time, until = 0.1 * k, 0.1 * k
            outputs.append(y)
            reference = 0.3 * (k // 40 % 2)
            command = float(np.clip(control.command(reference, y, None), -1.0, 1.0))
            last = max(last, time + delays(time))
            coming.append((last, command))
            while coming and coming[0][0] < time + 0.1:
                arrival, following = coming.pop(0)
                y += 0.9 * held * (arrival - until)
                until, held = arrival, following
            y += 0.9 * held * (time + 0.1 - until)
        return np.array(outputs)

    return run(fly())


def test_control_takes_faster_gains_when_the_delay_is_known_to_be_short(schedule):
    estimator = OnlineEstimator(LOOP, delays=(0.0, 0.6), noise=0.002, level=0.999)
    control = AdaptiveControl(schedule, estimator, 1.0)
    outputs = controlled(control, lambda time: 0.1)
    numbers = [one.number for one in control.choices]
    robust = len(schedule.sets) - 1
    assert len(numbers) == len(outputs)
    assert numbers[0] == robust
    assert not control.choices[0].covered
    assert min(numbers) < robust
    settled = control.choices[-1]
    assert settled.covered
    assert settled.low <= 0.1 <= settled.high <= schedule.sets[settled.number].delays[1]


def test_control_without_following_keeps_the_robust_gains(schedule):
    control = ScheduledControl(schedule)
    Kp = schedule.robust.gains["Kp"]
    assert control.command(1.25, 1.0, None) == pytest.approx(0.25 * Kp)


class Told(OnlineEstimator):
    """An estimator that keeps what it is told."""

    def __init__(self):
        super().__init__(LOOP, delays=(0.0, 0.6), noise=0.002)
        self.commands = []

    def command(self, time, value):
        self.commands.append((time, value))
        super().command(time, value)


def test_the_estimator_is_told_of_commands_as_the_vehicle_follows_them(schedule):
    shaping = dtm.RateLimited(dtm.Integrator(0.9), rate=1.0, rate_of_rate=5.0)
    estimator = Told()
    control = AdaptiveControl(schedule, estimator, 1.0, shaping)
    controlled(control, lambda time: 0.1, duration=12.0)
    times = np.array([one.time for one in control.choices])
    sent = np.array([value for _, value in control._sent])
    expected = np.column_stack(shaping.limited(times, sent))[:-1]
    assert np.array(estimator.commands) == pytest.approx(expected, abs=1e-9)


def test_the_emulator_obeys_a_delay_that_moves():
    """The set point that the drone echoes comes later by what the delay was moved."""
    moving = MovingDelay((0.1, 0.5))

    async def hover(drone):
        for _ in range(15):
            drone.hover()
            await asyncio.sleep(0.1)

    async def fly():
        async with FlownVehicle.emulated(moving=moving).connect() as drone:
            await drone.take_off()
            found = []
            for begin in (1e9, now() - 50.0):  # before the move; at its longest
                moving.start(begin, 100.0)
                await hover(drone)
                sent, seen = now(), None
                while seen is None:
                    drone.command(0.2)
                    await asyncio.sleep(0.005)
                    if (await drone.state()).climb_setpoint:
                        seen = now() - sent
                found.append(seen)
                await hover(drone)
            await drone.land()
            return found

    short, long = run(fly())
    assert long - short == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--moving-delay", "0.1,0.5"], "--virtual-time"),
        (["--moving-delay", "0.5", "--virtual-time"], "two delays"),
        (["--moving-delay", "0.5,0.1", "--virtual-time"], "0.5"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, message, tmp_path):
    assert message in one_clear_line(run_command("fly", "--adapt", "--folder", tmp_path, *options))


def test_the_programme_steps_up_and_down_for_its_duration():
    programme = AdaptivePlan(duration=40.0, hold=8.0).programme(FlightPlan())
    assert programme.references == (1.0, 1.25, 1.0, 1.25, 1.0)
    assert programme.duration == 40.0


def test_each_step_has_a_row_with_the_delay_that_was_known(schedule):
    time = 0.1 * np.arange(400)
    reference = 0.3 * (np.arange(400) // 100 % 2)
    quick, slow = (
        dtm.Recording(time, reference, np.convolve(reference, np.ones(n) / n)[:400])
        for n in (10, 40)
    )
    choices = tuple(
        ChosenSet(7.0 + t, 0.1, 0.2 + 0.01 * t, k // 150, True) for k, t in enumerate(time.tolist())
    )
    study = AdaptiveStudy(schedule, slow, quick, choices)
    rows = study.rows()
    assert [row[0] for row in rows] == ["10", "20", "30"]
    assert [row[5] for row in rows] == ["0.10 to 0.30", "0.10 to 0.40", "0.10 to 0.50"]
    assert [row[6] for row in rows] == [
        f"{schedule.sets[number].delays[1]:.2f}" for number in (0, 1, 2)
    ]
    assert all(len(row) == len(STEP_COLUMNS) for row in rows)
    assert float(rows[0][2]) == pytest.approx(3.8, abs=0.2)
    assert float(rows[0][4]) == pytest.approx(0.9, abs=0.2)


@pytest.mark.survey
def test_the_command_flies_them_in_virtual_time(tmp_path):
    if "DEADTIME_LONG_FLIGHTS" not in os.environ:
        pytest.skip("three minutes: set DEADTIME_LONG_FLIGHTS to fly them")
    done = subprocess.run(
        [sys.executable, "-m", "deadtime", "fly", "--virtual-time", "--adapt", "--json",
         "--moving-delay", "0.1,0.5", "--folder", str(tmp_path)],
        capture_output=True, text=True, timeout=900.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    adaptive = json.loads(done.stdout)["adaptive"]["z"]
    assert adaptive["error_adaptive"] < adaptive["error_robust"]
    assert SwitchingProof.from_json((tmp_path / "proof-z.json").read_text()).verify() >= 0.5
    page = (tmp_path / "report.html").read_text()
    assert "<h2>Gains that follow the delay</h2>" in page
    assert all(f'<th scope="col">{head}</th>' in page for head in STEP_COLUMNS)
    with (tmp_path / "choices-z.csv").open() as file:
        choices = list(csv.DictReader(file))
    assert len({row["set"] for row in choices}) > 1


@pytest.mark.survey
@pytest.mark.flight
@pytest.mark.long
def test_they_fly_on_the_firmware_behind_a_relay_whose_delay_moves(tmp_path):
    pytest.importorskip("pymavlink", reason="pymavlink is the codec")
    from arducopter import told_by

    if "DEADTIME_LONG_FLIGHTS" not in os.environ:
        pytest.skip("eight minutes: set DEADTIME_LONG_FLIGHTS to fly them")
    told = told_by("arducopter_adaptive.py", str(tmp_path), timeout=900.0)
    found = json.loads(told.splitlines()[-1])
    # The limits of the firmware make the estimate an indication: robust gains flew in both, 1.07.
    assert found["error_adaptive"] <= 1.2 * found["error_robust"]
    assert SwitchingProof.from_json((tmp_path / "proof-z.json").read_text()).verify() >= 0.75
