"""What to log and to fly: the exact settings of each autopilot."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from deadtime.logs import Series, advice, open_log
from made_logs import flown_copter


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "flight.bin"
    path.write_bytes(flown_copter(seconds=20.0).data)
    return open_log(path)


def slow(loop, every=40):
    """The loop with one of so many rows, and a response of much noise."""
    parts = {}
    for name in ("setpoint", "response"):
        series = getattr(loop, name)
        parts[name] = replace(series, time=series.time[::every], values=series.values[::every])
    return replace(loop, **parts)


def as_log(flown, autopilot, firmware, loop=None, columns=(), **parameters):
    loops = {} if loop is None else {loop.name: loop}
    topics = {"main": SimpleNamespace(columns=dict.fromkeys(columns))}
    return replace(
        flown, autopilot=autopilot, firmware=firmware, parameters=parameters, loops=loops,
        contents=SimpleNamespace(topics=topics), vehicle="",
    )  # fmt: skip


def lines(log, *names):
    return [one.line() for one in advice(log, names or None)]


def test_ardupilot_names_the_bits_that_are_missing(flown):
    loop = slow(flown.loops["roll rate"])
    log = as_log(flown, "ArduPilot", "ArduCopter V4.5.7", loop,
                 LOG_BITMASK=176126.0, LOG_FILE_RATEMAX=10.0, SCHED_LOOP_RATE=400.0)  # fmt: skip
    found = lines(log)
    assert found[0].startswith("LOG_BITMASK = 176127 (now 176126)")
    assert found[1].startswith("LOG_FILE_RATEMAX = 0 (now 10 Hz)")
    assert any(line.startswith("SID_AXIS = 7 (roll rate), SID_MAGNITUDE = 15") for line in found)
    assert any(f"LOG_BITMASK = {176126 | 1 | 1 << 19}" in line for line in found)
    assert len(found) <= 5
    assert all("(ArduPilot: " in line for line in found[:3])


def test_an_old_firmware_has_no_system_identification(flown):
    loop = slow(flown.loops["roll rate"])
    log = as_log(flown, "ArduPilot", "APM:Copter V3.4-rc2", loop, LOG_BITMASK=32767.0)
    found = lines(log)
    assert not any("SID_AXIS" in line for line in found)
    assert "fly" in found[-1]
    assert "hold each for" in found[-1]


def test_a_plane_logs_attitude_in_each_loop_by_another_bit(flown):
    loop = slow(flown.loops["roll rate"])
    log = as_log(flown, "ArduPilot", "ArduPlane V4.5.7", loop, LOG_BITMASK=65535.0)
    assert lines(log)[0].startswith(f"LOG_BITMASK = {65535 | 1 << 20} ")


def test_px4_names_profile_and_mode(flown):
    loop = slow(flown.loops["roll rate"])
    log = as_log(flown, "PX4", "v1.15.0", loop, SDLOG_PROFILE=131.0, SDLOG_MODE=1.0)
    found = lines(log)
    assert found[0].startswith("SDLOG_PROFILE = 147 (now 131)")
    assert any(line.startswith("SDLOG_MODE = 0 (now 1)") for line in found)
    high = as_log(flown, "PX4", "v1.15.0", loop, SDLOG_PROFILE=17.0, SDLOG_MODE=0.0)
    assert not any("SDLOG" in line for line in lines(high))


def test_betaflight_names_fields_rate_and_chirp(flown):
    loop = slow(flown.loops["roll rate"])
    columns = ["gyroADC[0]", "axisP[0]"]
    log = as_log(flown, "Betaflight", "Betaflight 2025.12.1 (a) STM32", loop, columns,
                 looptime=125.0, pid_process_denom=2.0)  # fmt: skip
    found = lines(log)
    assert found[0].startswith("set blackbox_disable_setpoint = OFF")
    assert found[1].startswith("set blackbox_sample_rate = 1/4, to log 1000 rows per second")
    assert found[2].startswith("set debug_mode = CHIRP, chirp_amplitude_roll = 230")
    old = as_log(flown, "Betaflight", "Betaflight 3.4.0 (a)", None, columns)
    assert lines(old) == [
        "this firmware does not log setpoint: update to version 4.3 or later "
        "(Betaflight: CLI commands, blackbox_disable_*)"
    ]


def test_a_crazyflie_without_setpoints_is_told_which_to_log(flown):
    found = lines(as_log(flown, "Crazyflie", "", None))
    assert "controller.rollRate and gyro.x" in found[0]
    assert "on:fixedFrequency, 500, 1" in found[1]


def test_a_log_that_tells_its_loop_needs_nothing(flown):
    log = as_log(flown, "PX4", "v1.15.0", flown.loops["roll rate"], SDLOG_PROFILE=17.0)
    fast = replace(flown.loops["roll rate"])
    assert fast.setpoint.rate < 250.0  # 200 rows a second: nearly enough
    assert lines(log) == []


def test_a_setpoint_at_rest_is_to_be_moved(flown):
    loop = flown.loops["roll rate"]
    rest = Series(loop.setpoint.time, np.zeros(len(loop.setpoint)), "rad/s", "RATE.RDes")
    log = as_log(flown, "PX4", "", replace(loop, setpoint=rest), SDLOG_PROFILE=17.0)
    assert lines(log) == [
        "roll rate: move the setpoint, because in this log the response follows almost no part "
        "of it"
    ]


def test_loops_are_asked_for_by_name(flown):
    with pytest.raises(ValueError, match="has no loop 'yaw'"):
        advice(flown, ["yaw"])
    assert advice(flown, ["roll rate"]) == advice(flown)
