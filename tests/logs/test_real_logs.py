"""Logs of real and simulated vehicles: what they hold, against the libraries of their formats."""

import deadtime as dtm
import numpy as np
import pytest
from flights import flight_path

RATES = {"roll rate", "pitch rate", "yaw rate"}
ANGLES = {"roll", "pitch", "yaw"}
HORIZONTAL = {f"{axis} {kind}" for axis in ("north", "east") for kind in ("velocity", "position")}
VERTICAL = {"vertical speed", "altitude"}

#: File: autopilot, vehicle, part of the firmware, duration, loops, and those never followed.
LOGS = {
    "arducopter_2014-10-18_21-19-07.bin": (
        "ArduPilot", "Copter", "V3.1.3", 73.4, ANGLES | HORIZONTAL | VERTICAL, set(),
    ),
    "ardupilot_sitl_guided_heights.bin": (
        "ArduPilot", "Copter (QUAD/PLUS)", "V4.6.0-dev", 38.4,
        RATES | ANGLES | HORIZONTAL | VERTICAL, set(),
    ),
    "px4_sitl_takeoff.ulg": (
        "PX4", "quadrotor (PX4_SITL)", "v1.15.0", 31.1,
        RATES | ANGLES | HORIZONTAL | VERTICAL, set(),
    ),
    # These two lay on a bench, disarmed.
    "px4_sample.ulg": (
        "PX4", "quadrotor (AUAV_X21)", "fd483321", 69.0, RATES | ANGLES, RATES | ANGLES,
    ),
    "px4_tagged_params.ulg": (
        "PX4", "quadrotor (PX4_SITL)", "v1.13.0", 10.8, RATES | ANGLES, RATES | ANGLES,
    ),
}  # fmt: skip


def opened(name):
    if name.endswith(".ulg"):
        pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    return dtm.open_log(flight_path(name))


@pytest.mark.parametrize("name", LOGS)
def test_vehicle_and_loops_are_listed(name):
    autopilot, vehicle, firmware, duration, loops, unused = LOGS[name]
    log = opened(name)
    assert (log.autopilot, log.vehicle) == (autopilot, vehicle)
    assert firmware in log.firmware
    assert log.duration == pytest.approx(duration, abs=0.1)
    assert set(log.loops) == loops
    assert {loop.name for loop in log.loops.values() if not loop.segments} == unused
    for loop in log.loops.values():
        assert loop.segments or "disarmed" in " ".join(loop.why_left_out)
        for series in loop.signals.values():
            assert np.all(np.diff(series.time) > 0.0)
            assert series.time[0] >= -1.0
            assert series.time[-1] <= log.duration + 0.1
        for start, stop in loop.segments:
            inside = (loop.setpoint.time >= start) & (loop.setpoint.time <= stop)
            assert np.isfinite(loop.setpoint.values[inside]).all()
    assert log.key_parameters
    assert log.key_parameters.items() <= log.parameters.items()
    assert log.source in log.summary()


def test_the_climb_of_a_simulated_copter_is_followed_while_it_flies():
    # Its speed is zero until 18.9 s, and it is back at the height of the start at 25.8 s.
    log = opened("px4_sitl_takeoff.ulg")
    ((start, stop),) = log.loops["vertical speed"].segments
    assert 18.9 < start < 19.0
    assert 25.5 < stop < 25.8
    assert [name for _, name in log.modes] == ["Hold", "Takeoff", "Hold", "Return", "Hold"]
    assert log.key_parameters["IMU_GYRO_CUTOFF"] == 40.0


@pytest.mark.survey
def test_an_estimate_from_the_loop_of_a_log():
    # Delay near 0, lag 0.12 s, gain 0.80: from two independent fits of this log.
    loop = opened("px4_sitl_takeoff.ulg").loops["vertical speed"]
    rows = (loop.response.time >= 18.0) & (loop.response.time <= 25.8)
    time = loop.response.time[rows]
    last = np.searchsorted(loop.setpoint.time, time, side="right") - 1
    asked = loop.setpoint.values[last]
    inner = dtm.ControlLoop(dtm.FirstOrder(1.0, 0.2), dtm.P(1.0), delay=0.0)
    flight = dtm.Recording(time, asked, loop.response.values[rows], asked)
    fit = dtm.estimate_delay(flight, inner, free=("delay", "gain", "time_constant"))
    assert fit.delay <= 0.02
    assert fit.loop.parameters["time_constant"] == pytest.approx(0.12, abs=0.03)


def test_heights_that_old_firmware_does_not_hold_are_left_out():
    # In the descent of RTL the log says DAlt = 0 and DCRt = 0; the copter sank at 1.7 m/s.
    log = opened("arducopter_2014-10-18_21-19-07.bin")
    assert [name for _, name in log.modes] == ["STABILIZE", "LOITER", "RTL"]
    for name in VERTICAL:
        ((start, stop),) = log.loops[name].segments
        assert start == pytest.approx(9.2, abs=0.2)
        assert stop == pytest.approx(50.5, abs=0.2)
    altitude = log.loops["altitude"]
    rows = (altitude.setpoint.time > 10.0) & (altitude.setpoint.time < 50.0)
    assert altitude.setpoint.values[rows].min() > 5.0
    assert log.loops["roll"].followed > 70.0


def test_setpoints_on_the_ground_are_left_out():
    # GUIDED before the take-off: targets of position and velocity are copies of the estimate.
    log = opened("ardupilot_sitl_guided_heights.bin")
    for name in HORIZONTAL | VERTICAL:
        ((start, _),) = log.loops[name].segments
        assert start == pytest.approx(5.2, abs=0.1)


@pytest.mark.parametrize("name", [name for name in LOGS if name.endswith(".bin")])
def test_every_number_of_a_dataflash_log_is_that_of_pymavlink(name):
    reader = pytest.importorskip("pymavlink.DFReader", reason="pymavlink reads DataFlash logs")
    topics = opened(name).contents.topics
    log = reader.DFReader_binary(str(flight_path(name)))
    rows = {}
    while (message := log.recv_msg()) is not None:
        instance = message.fmt.instance_field
        number = 0 if instance is None else getattr(message, instance)
        rows.setdefault((message.get_type(), number), []).append(message)
    log.filehandle.close()
    log.data_map.close()
    compared = 0
    for (kind, number), messages in rows.items():
        shown = kind if f"{kind}[{number}]" not in topics else f"{kind}[{number}]"
        topic = topics[shown]
        for column, values in topic.columns.items():
            if kind == "MODE" and column == "Mode":
                continue  # pymavlink gives its own number
            expected = [float(getattr(message, column)) for message in messages]
            assert np.array_equal(values, expected, equal_nan=True), f"{shown}.{column}"
            compared += values.size
    assert compared > 70_000


def test_units_of_a_new_log_are_its_own():
    topics = opened("ardupilot_sitl_guided_heights.bin").contents.topics
    assert topics["CTUN"].units["DCRt"] == "cm/s"
    assert topics["RATE"].units["RDes"] == "deg/s"
    assert topics["ATT"].units["Yaw"] == "deg"
    assert topics["PSCD"].units["TPD"] == "m"


def test_every_number_of_a_ulog_is_that_of_pyulog():
    pyulog = pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    name = "px4_sitl_takeoff.ulg"
    log, known = opened(name), pyulog.ULog(str(flight_path(name)))
    rates = known.get_dataset("vehicle_rates_setpoint").data
    loop = log.loops["roll rate"]
    assert np.array_equal(loop.setpoint.values, rates["roll"].astype(float))
    assert np.allclose(loop.setpoint.time + log.start, 1e-6 * rates["timestamp"], atol=1e-6)
    down = known.get_dataset("vehicle_local_position").data
    assert np.array_equal(log.loops["altitude"].response.values, -down["z"].astype(float))
    tilted = known.get_dataset("vehicle_attitude_setpoint").data
    asked = log.loops["roll"].setpoint.values
    assert np.allclose(asked, tilted["roll_body"], atol=1e-5)
