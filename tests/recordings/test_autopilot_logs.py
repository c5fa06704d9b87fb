"""Logs of two autopilots: delay and lag of a vehicle's inner loop from its setpoint.

The expected numbers are approximate, from two independent fits. The logs are sampled at 10 Hz, so a
delay is known within about a sample, and its sum with the time constant is known better.

"""

import deadtime as dtm
import numpy as np
import pytest
from flights import flight_path

FREE = ("delay", "gain", "time_constant")

#: An inner loop follows its setpoint with a first-order lag; the outer controller does not matter.
INNER = dtm.ControlLoop(dtm.FirstOrder(1.0, 0.2), dtm.P(1.0), delay=0.0)


def arducopter(demanded, measured):
    mavutil = pytest.importorskip("pymavlink.mavutil", reason="pymavlink reads DataFlash logs")
    path = flight_path("arducopter_2014-10-18_21-19-07.bin")
    log = mavutil.mavlink_connection(str(path))
    rows = []
    while (message := log.recv_match(type=["ATT"])) is not None:
        rows.append((message.TimeMS, getattr(message, demanded), getattr(message, measured)))
    log.close()
    time, wanted, found = np.array(rows, dtype=float).T
    return dtm.Recording(1e-3 * time, wanted, found, wanted, source=path.name)


@pytest.mark.parametrize(
    ("axis", "late", "gain"),
    [pytest.param("Roll", 0.22, 0.65, marks=pytest.mark.survey), ("Pitch", 0.17, 0.79)],
)
def test_the_roll_loop_of_a_copter(axis, late, gain):
    flight = arducopter(f"Des{axis}", axis)
    fit = dtm.estimate_delay(flight, INNER, free=FREE)
    assert fit.delay + fit.loop.parameters["time_constant"] == pytest.approx(late, abs=0.02)
    assert fit.gain == pytest.approx(gain, abs=0.01)
    assert fit.verdict != "reliable"


def test_the_climb_loop_of_a_simulated_copter():
    pyulog = pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    log = pyulog.ULog(str(flight_path("px4_sitl_takeoff.ulg")))
    data = {topic.name: topic.data for topic in log.data_list}
    wanted, found = data["vehicle_local_position_setpoint"], data["vehicle_local_position"]
    start = min(wanted["timestamp"][0], found["timestamp"][0])
    asked, seen = (1e-6 * (topic["timestamp"] - start) for topic in (wanted, found))
    # While the mode is inactive its setpoints are NaN.
    active = np.isfinite(wanted["vz"])
    rows = (seen >= 18.0) & (seen <= 25.8)
    last = np.searchsorted(asked[active], seen[rows], side="right") - 1
    command = wanted["vz"][active][last].astype(float)
    flight = dtm.Recording(seen[rows], command, found["vz"][rows].astype(float), command)
    fit = dtm.estimate_delay(flight, INNER, free=FREE)
    # Delay about 0, lag 0.12 s, gain 0.80; one of the two fits treats the beginning differently.
    assert fit.delay <= 0.02
    assert fit.loop.parameters["time_constant"] == pytest.approx(0.12, abs=0.03)
    assert fit.gain == pytest.approx(0.80, abs=0.06)
    assert fit.ci(0.95, "delay")[0] == 0.0
