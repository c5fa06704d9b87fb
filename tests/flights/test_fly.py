"""The flight experiment in virtual time: steps, rules that end a flight, and what is estimated."""

import math
import os
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import deadtime as dtm
import numpy as np
import pytest
from deadtime import FlightAbortedError, NotIdentifiableError
from deadtime._base.digits import between, stated
from deadtime._cli.fly import _print_study
from deadtime.flights import FlightPlan, FlownSteps, _learn as learn_module, fly_experiment
from deadtime.flights._axis_control import AxisControl, Velocity
from deadtime.flights._fly import PlannedFlight, fly_all
from deadtime.flights._learn import learn
from deadtime.flights._runs import telemetry_of
from deadtime.flights._split import split_delay
from deadtime.flights._step_test import HEIGHT, StepProgramme, check_gain, row_columns
from deadtime.links import Limits, journal as journal_module, run
from deadtime.links.journal import _Writer
from deadtime.loops._derivative_filter import PAPER_FILTER
from emulated import connecting
from simulated_vehicle import KIT, SimulatedVehicle

TS = 0.065


def columns_of(path):
    """The numbers of a recording, by the column names in its first line."""
    return np.genfromtxt(path, delimiter=",", names=True)


# Commands


def test_the_command_with_filtered_speed_is_that_of_the_exact_loop():
    # The simulated `ControlLoop` with the same rule gives the same command at each sample.
    smooth = dtm.DerivativeFilter(38.0, discretisation="tustin")
    loop = dtm.ControlLoop(
        dtm.Integrator(0.9, 0.1), dtm.PV(2.0, 0.4, smooth), delay=0.3, sample_time=TS
    )
    time = np.arange(80) * TS
    flown = loop.simulate(time, np.where(time < 0.5, 0.0, 1.0), reference_time=time)
    control = AxisControl(dtm.PV(2.0, 0.4), TS)
    made = [
        control.command(reference, height, None)
        for reference, height in zip(flown.reference, flown.outputs, strict=True)
    ]
    np.testing.assert_allclose(made, flown.inputs, atol=1e-9)


def test_a_reported_speed_replaces_the_filtered_one():
    control = AxisControl(dtm.PV(2.0, 0.5), TS)
    control.command(1.0, 0.5, None)
    assert control.command(1.0, 0.9, 0.2) == pytest.approx(2.0 * 0.1 - 0.5 * 0.2)
    with pytest.raises(TypeError, match="P or PV"):
        AxisControl(dtm.PI(1.0, 0.1), TS)


def test_the_speed_filter_starts_at_rest():
    speed = Velocity(PAPER_FILTER, TS)
    assert [speed.next(1.3) for _ in range(5)] == pytest.approx([0.0] * 5, abs=1e-9)


def test_a_programme_gives_the_reference_at_each_sample():
    programme = StepProgramme((1.0, 1.25, 1.0), (0.5, 0.2, 0.2), 0.1)
    references = [programme.reference(k * 0.1) for k in range(programme.samples)]
    assert references == [1.0] * 5 + [1.25] * 2 + [1.0] * 2
    with pytest.raises(ValueError, match=r"may come to 1\.5 m, outside"):
        programme.check(Limits(max_height=1.4))
    with pytest.raises(ValueError, match="shorter sample time"):
        StepProgramme((1.0, 1.2), (3.0, 3.0), 0.25).check(Limits())
    with pytest.raises(ValueError, match="one hold for each"):
        StepProgramme((1.0, 1.2), (3.0,))


@pytest.mark.parametrize(
    ("Kp", "allowed"), [(2.4, True), (2.5, False), (0.0, False), (math.nan, False)]
)
def test_gains_are_bounded_before_the_delay_is_known(Kp, allowed):
    if allowed:
        check_gain(Kp, 0.36, 0.885)
    else:
        with pytest.raises(ValueError, match="Kp"):
            check_gain(Kp, 0.36, 0.885)


# Rules that end a flight


def vehicle_with(change, after=3.0):
    """A vehicle whose reported states are changed from some time after take-off."""

    def change_state(state, since):
        return state if since < after else change(state)

    return SimulatedVehicle(change_state=change_state)


ABORTS = {
    "tilted": lambda state: replace(state, roll=math.radians(16.0)),
    "pitch is no number": lambda state: replace(state, pitch=math.nan),
    "battery is at 19 %": lambda state: replace(state, battery=19.0),
    "reports that its ultrasound receives no echo": lambda state: replace(
        state, fault="its ultrasound receives no echo"
    ),
    "s old, but at most 0.3 s": lambda state: None,
    "messages in a row were lost": lambda state: replace(state, missing=21),
    "reports an emergency": lambda state: replace(state, emergency=True),
    "not flying any more": lambda state: replace(state, flying=False),
    "the height changes": lambda state: replace(state, height=state.height + 0.45),
    "differ by more than 0.475 m": lambda state: replace(state, height=state.height + 0.6),
    "outside of its limits, 0.2 to 3 m": lambda state: replace(state, height=0.1),
}


@pytest.mark.parametrize("reason", ABORTS)
def test_a_broken_rule_ends_the_flight_and_keeps_its_rows(reason, tmp_path):
    vehicle = vehicle_with(ABORTS[reason])
    message = "tilted" if reason == "pitch is no number" else reason
    if (
        reason == "differ by more than 0.475 m"
    ):  # The height drifts there, so that it does not jump.
        began = []

        def drift(state, since):
            if since < 3.0:
                return state
            began.append(since)
            return replace(state, height=state.height + 0.5 * (since - began[0]))

        vehicle = SimulatedVehicle(change_state=drift)
    if reason == "outside of its limits, 0.2 to 3 m":
        began = []

        def sink(state, since):
            return state if since < 3.0 else replace(state, height=1.0 - 0.9 * (since - 3.0))

        vehicle = SimulatedVehicle(change_state=sink)
        message = "differ by more|outside of"
    with pytest.raises(FlightAbortedError, match=message):
        fly_experiment(lambda: vehicle, FlightPlan(), tmp_path, run=run)
    assert vehicle.log == ["connected", "took off", "hovers", "landed", "closed"]
    rows = columns_of(tmp_path / "flight-1-z-P.csv")
    assert 2.8 < rows["time_s"][-1] < 4.5
    assert rows.dtype.names == row_columns(HEIGHT)


def test_a_constant_height_does_not_make_the_vehicle_climb_for_long(tmp_path):
    # The vehicle is at the base; the first step is at 5 s and would be held until 11.5 s.
    vehicle = vehicle_with(lambda state: replace(state, height=1.0))
    with pytest.raises(FlightAbortedError, match=r"has not changed from 1\.000 m"):
        fly_experiment(lambda: vehicle, FlightPlan(), tmp_path, run=run)
    assert columns_of(tmp_path / "flight-1-z-P.csv")["time_s"][-1] < 6.1
    assert vehicle.log[-2:] == ["landed", "closed"]


def test_a_growing_error_ends_the_flight(tmp_path):
    # The delay is larger than assumed, and the prior does not show it: the loop is unstable.
    vehicle = SimulatedVehicle(delay=0.75)
    with pytest.raises(FlightAbortedError, match=r"differ by more than 0\.475 m"):
        fly_experiment(lambda: vehicle, FlightPlan(gains=(2.4,)), tmp_path, run=run)
    assert vehicle.log[-2:] == ["landed", "closed"]


def test_a_base_far_from_the_hover_height_is_reported_before_it_is_commanded(tmp_path):
    vehicle = SimulatedVehicle()
    plan = FlightPlan(base=2.0)
    with pytest.raises(FlightAbortedError, match=r"hovers at 0\.75 m\. .* 2 m, .* Begin closer"):
        fly_experiment(lambda: vehicle, plan, tmp_path, run=run)
    assert vehicle.log == ["connected", "took off", "landed", "closed"]


def test_a_gain_beyond_the_bound_is_refused_before_connecting(tmp_path):
    vehicle = SimulatedVehicle()
    with pytest.raises(ValueError, match=r"Kp = 2\.6 is above 2\.47"):
        fly_experiment(lambda: vehicle, FlightPlan(gains=(1.2, 2.6)), tmp_path, run=run)
    assert vehicle.log == []


def test_a_folder_that_cannot_be_written_is_refused_before_connecting(tmp_path):
    taken = tmp_path / "taken"
    taken.touch()
    for folder in (taken, taken / "below"):
        vehicle = SimulatedVehicle()
        with pytest.raises(OSError, match=str(folder)):
            fly_experiment(lambda vehicle=vehicle: vehicle, FlightPlan(), folder, run=run)
        assert vehicle.log == []


def test_a_disk_that_fills_up_in_flight_lands_the_vehicle(tmp_path, monkeypatch):
    write, synced = _Writer._write, []

    def full(self, waiting):
        if "messages" not in self._path and self._file.tell() > 2000:
            synced.append(self)
            raise OSError(28, "No space left on device")
        time.sleep(0.001)  # Virtual time is faster than the disk.
        return write(self, waiting)

    monkeypatch.setattr(_Writer, "_write", full)
    vehicle = SimulatedVehicle()
    with pytest.raises(OSError, match="No space left") as ended:
        fly_experiment(lambda: vehicle, FlightPlan(), tmp_path, run=run)
    assert synced
    assert ended.value.filename.endswith("flight-1-z-P.csv")
    assert vehicle.log[-2:] == ["landed", "closed"]
    assert columns_of(tmp_path / "flight-1-z-P.csv").size > 5


@pytest.mark.parametrize("fails", [False, True])
def test_a_slow_disk_delays_neither_commands_nor_the_landing(fails, tmp_path, monkeypatch):
    # A journal that takes 3 s to be written must not leave the landing to the drone's watchdog.
    ashore, waited = threading.Event(), []

    def slow(call):
        def waits(*given):
            waited.append(ashore.wait(20.0))
            return call(*given)

        return waits

    monkeypatch.setattr(_Writer, "_write", slow(_Writer._write))
    monkeypatch.setattr(journal_module.os, "fsync", slow(os.fsync))

    def change_state(state, since):
        return replace(state, roll=1.0) if fails and since > 3.0 else state

    class Closing(SimulatedVehicle):
        async def close(self):
            await super().close()
            ashore.set()

    vehicle = Closing(change_state=change_state)
    flight = fly_all(lambda: vehicle, [PlannedFlight(FlightPlan(), dtm.P(1.2), 6.5)], tmp_path)
    if fails:
        with pytest.raises(FlightAbortedError, match="tilted"):
            run(flight)
    else:
        run(flight)
    assert waited
    assert all(waited)  # Nothing is written before the vehicle has landed and its link is closed.
    assert vehicle.log[-2:] == ["landed", "closed"]
    rows = columns_of(tmp_path / "flight-1-z-P.csv")
    assert np.diff(rows["time_s"]) == pytest.approx(TS, abs=1e-6)
    assert rows["time_s"][-1] > (2.8 if fails else 17.8)


# Estimates


@pytest.mark.survey
def test_the_paper_s_experiment_is_reproduced(tmp_path):
    stages = []
    plan = FlightPlan()
    found = fly_experiment(connecting(seed=2), plan, tmp_path, stages.append, run)
    assert len(stages) == plan.flights + 2
    learned = found.learned
    slow, fast = learned.flights
    assert 30.0 < fast.overshoot < 37.0
    assert 0.33 < learned.overshoot[1].delay < 0.38
    # Link and navdata: 0.26 s and up to 5 ms; the lag 0.172 s, the lead of the plant's zero 0.030.
    fit = learned.fit
    assert fit.free == ("delay", "gain", "lag")
    assert fit.delay == pytest.approx(0.233, abs=0.02)
    assert fit.lag == pytest.approx(0.172, abs=0.02)
    assert fit.gain == pytest.approx(0.885, abs=0.005)
    assert fit.delay_plus_lag == pytest.approx(0.405, abs=0.006)
    low, high = fit.ci(0.95)
    assert 0.0 < high - low < 0.03
    assert learned.split.transport.delay == pytest.approx(0.26, abs=0.006)
    assert learned.split.vehicle_delay == pytest.approx(0.142, abs=0.015)
    # Link and vehicle take what the loop does, and one number alone is called the delay.
    assert learned.adds_up
    assert sum("delay" in words for words, *_ in found.parts()) == 1
    transport = learned.split.transport
    longer = replace(transport, loop=transport.loop.replace(delay=0.30))
    odd = replace(learned, split=replace(learned.split, transport=longer))
    assert (learned.verdict, odd.verdict) == ("reliable", "indication")
    assert "larger than their intervals allow" in odd.warnings()[0]
    ends = between(*fit.ci(0.95, "delay+lag"), fit.stderr["delay+lag"], "s")
    assert (
        f"{stated(fit.delay_plus_lag, fit.stderr['delay+lag'], 's')}, {ends} with"
        in found.headline()
    )
    best, after = found.checked
    assert isinstance(after.controller, dtm.PV)
    assert after.overshoot < 5.0
    for before in (slow, fast, best):
        assert after.settling_time < before.settling_time
    # Everything was saved and can be read as any recording.
    again = dtm.read_recording(
        fast.path, time="time_s", reference="reference_m", output="height_m", command="command_m_s"
    )
    np.testing.assert_array_equal(again.output, fast.recording.output)
    assert fast.timing.missed == 0
    assert fast.timing.jitter < 1e-9


@pytest.mark.long
@pytest.mark.survey
def test_a_vehicle_that_reports_no_climb_is_controlled_with_the_filter(tmp_path):
    vehicle = SimulatedVehicle(noise=0.002, random=np.random.default_rng(1), reports_climb=False)
    found = fly_experiment(lambda: vehicle, FlightPlan(), tmp_path, run=run)
    assert found.learned.split is None
    assert "does not report" in found.learned.unsplit
    assert found.learned.designed.loop.controller.filter == PAPER_FILTER
    assert found.after.overshoot < 5.0
    assert found.after.settling_time < found.before.settling_time
    assert found.learned.fit.delay_plus_lag == pytest.approx(0.40, abs=0.01)


def test_an_indication_is_reported_before_its_gains_are_used_in_flight(
    tmp_path, capsys, monkeypatch
):
    # Intervals of an unreliable fit do not assure a margin.
    def undesigned(fit, *, controller, **how):  # The designed gains do not matter here.
        return SimpleNamespace(loop=fit.loop.replace(controller=controller))

    monkeypatch.setattr(learn_module, "design", undesigned)

    def gusts(state, since):
        return replace(state, height=state.height + 0.02 * math.sin(9.0 * max(since, 0.0)))

    def warn(doubt):
        warnings.append(doubt)
        flights.append(len(list(tmp_path.glob("flight-?-z-*P.csv"))))

    warnings, flights = [], []
    random = np.random.default_rng(2)
    vehicle = SimulatedVehicle(noise=0.001, random=random, change_state=gusts)
    plan = FlightPlan(gains=(2.4,), settle=2.5, hold=3.5, checked_hold=2.0)
    found = fly_experiment(lambda: vehicle, plan, tmp_path, run=run, warn=warn)
    assert found.learned.fit.verdict == "indication"
    assert flights == [1]
    assert "margins are not certain" in warnings[0]
    _print_study(found)
    assert "The estimate is only an indication" in " ".join(capsys.readouterr().out.split())
    fine = replace(found.learned, fit=replace(found.learned.fit, verdict="reliable"))
    assert "indication" not in replace(found, learned=fine).headline()


def test_recordings_in_which_the_vehicle_does_not_move_are_refused(tmp_path):
    time = np.arange(200) * TS
    reference = np.where(time < 5.0, 1.0, 1.25)
    noise = np.random.default_rng(0).normal(0.0, 0.002, time.size)
    asleep = dtm.Recording(time, reference, 1.0 + noise, np.clip(reference - 1.0, -1, 1))
    flight = FlownSteps(dtm.P(2.0), asleep, tmp_path / "none.csv", None, TS, 5.0)
    with pytest.raises(NotIdentifiableError):
        learn([flight], FlightPlan())


def test_link_delay_and_vehicle_lag_are_estimated_from_reported_setpoint_and_climb():
    # The command changes in steps; the setpoint follows it 0.1234 s later, and the climb follows
    # the setpoint with a lag of 0.15 s.
    random = np.random.default_rng(3)
    command_time = np.arange(50) * TS
    command = np.repeat(random.uniform(-0.5, 0.5, 10), 5)
    time = np.arange(0.0, command_time[-1] - 0.01, 0.01)
    time += random.uniform(0.0, 0.002, time.size)
    rows = np.searchsorted(command_time, time - 0.1234, side="right") - 1
    setpoint = np.where(rows >= 0, command[np.maximum(rows, 0)], 0.0)
    fine = np.arange(0.0, command_time[-1], 5e-4)
    at = np.searchsorted(command_time, fine - 0.1234, side="right") - 1
    driven = np.where(at >= 0, command[np.maximum(at, 0)], 0.0)
    speed, speeds = 0.0, np.empty(fine.size)
    for k, value in enumerate(driven):
        speeds[k] = speed
        speed += 5e-4 * (0.8 * value - speed) / 0.15
    climb = np.interp(time, fine, speeds) + random.normal(0.0, 0.01, time.size)
    split = split_delay([telemetry_of((time, setpoint, climb, climb), command_time, command)])
    # The setpoint is seen in the first message after its change, by up to 12 ms later.
    assert 0.1234 <= split.transport.delay <= 0.1354
    assert split.transport.gain == pytest.approx(1.0, abs=0.01)
    assert split.vehicle_delay == pytest.approx(0.15, abs=0.01)
    assert split.vehicle.gain == pytest.approx(0.8, abs=0.02)


def test_the_simulated_vehicle_is_the_kit_plant():
    plant = dtm.kit_plant()
    assert (*plant.num, plant.den[1]) == KIT


def test_metrics_are_those_of_the_recorded_steps(tmp_path):
    time = np.arange(300) * 0.1
    reference = np.where(time < 10.0, 1.0, np.where(time < 20.0, 1.5, 1.0))
    height = np.where(time < 10.0, 1.0, np.where(time < 20.0, 1.5, 1.0))
    height[100:103] = (1.2, 1.6, 1.55)  # 20 % overshoot, within 5 % from the fourth sample on.
    height[200:205] = (1.3, 1.1, 0.95, 0.97, 1.03)
    recording = dtm.Recording(time, reference, height)
    flight = FlownSteps(dtm.P(1.0), recording, tmp_path / "none.csv", None, 0.1, 10.0)
    up, down = flight.steps
    assert (up.overshoot, down.overshoot) == pytest.approx((20.0, 10.0))
    assert (up.settling_time, down.settling_time) == pytest.approx((0.3, 0.5))
    assert flight.first_step() == pytest.approx((5.0, 19.9))
    late = dtm.Recording(np.delete(time, 50), np.delete(reference, 50), np.delete(height, 50))
    assert FlownSteps(dtm.P(1.0), late, tmp_path, None, 0.1, 10.0).timing.missed == 1
