"""Filters that logs name, and the sum of their delays on the gyro path."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from deadtime.logs import filter_lines, filters_of
from scipy import signal


def told(autopilot, **parameters):
    return SimpleNamespace(autopilot=autopilot, parameters=parameters)


def group_delay(num, den):
    omega = np.array([1e-3, 2e-3])
    _, response = signal.freqs(num, den, omega)
    return -np.diff(np.unwrap(np.angle(response)))[0] / 1e-3


def notch_delay(centre, quality):
    w = 2.0 * np.pi * centre
    return group_delay([1.0, 0.0, w**2], [1.0, w / quality, w**2])


def test_ardupilot():
    log = told(
        "ArduPilot", INS_GYRO_FILTER=20.0, INS_HNTCH_ENABLE=1.0, INS_HNTCH_FREQ=80.0,
        INS_HNTCH_BW=40.0, INS_HNTCH_HMNCS=3.0, ATC_RAT_RLL_FLTT=20.0, ATC_RAT_RLL_FLTD=10.0,
        ATC_RAT_RLL_FLTE=0.0,
    )  # fmt: skip
    found = {one.name: one for one in filters_of(log)}
    assert set(found) == {
        "gyro low-pass", "harmonic notch", "harmonic notch, harmonic 2",
        "low-pass of the roll target", "low-pass of the roll derivative",
    }  # fmt: skip
    first, second = notch_delay(80.0, 2.0), notch_delay(160.0, 2.0)
    assert found["harmonic notch"].delay == pytest.approx(first, rel=1e-4)
    assert found["harmonic notch, harmonic 2"].delay == pytest.approx(second, rel=1e-4)
    gyro = group_delay(*signal.butter(2, 2.0 * np.pi * 20.0, analog=True))
    lines = filter_lines(log)
    total = 1e3 * (gyro + first + second)
    assert lines[-1] == f"gyro path together: {total:.4g} ms (3 filters)"
    assert lines[0] == "gyro low-pass: 11.25 ms (INS_GYRO_FILTER 20)"
    assert any(line.endswith("on D alone") for line in lines)


def test_px4():
    log = told("PX4", IMU_GYRO_CUTOFF=40.0, IMU_DGYRO_CUTOFF=30.0, IMU_GYRO_NF0_FRQ=0.0)
    lines = filter_lines(log)
    assert len(lines) == 3
    assert lines[-1] == "gyro path together: 5.627 ms (1 filter)"


@pytest.mark.parametrize(("newer", "poles"), [(False, math.sqrt(2.0)), (True, 1.0)])
def test_the_derivative_of_px4_has_one_pole_where_there_are_two_notches(newer, poles):
    notch = {"IMU_GYRO_NF0_FRQ" if newer else "IMU_GYRO_NF_FREQ": 80.0}
    width = {"IMU_GYRO_NF0_BW" if newer else "IMU_GYRO_NF_BW": 20.0}
    found = {
        one.name: one.delay
        for one in filters_of(told("PX4", IMU_DGYRO_CUTOFF=30.0, **notch, **width))
    }
    assert found["low-pass of the derivative"] == pytest.approx(poles / (60.0 * math.pi))
    assert found["notch 1" if newer else "notch"] == pytest.approx(20.0 / (2 * math.pi * 80.0**2))


BETAFLIGHT = {
    "gyro_lowpass_hz": 100.0, "gyro_lowpass_type": 0.0, "gyro_lowpass2_hz": 300.0,
    "gyro_lowpass2_type": 0.0, "dterm_lowpass_hz": 100.0, "dterm_filter_type": 0.0,
    "dterm_notch_hz": 260.0, "dterm_notch_cutoff": 160.0,
}  # fmt: skip


@pytest.mark.parametrize("autopilot", ["Betaflight", "INAV"])
def test_betaflight_and_its_relatives(autopilot):
    found = {one.name: one for one in filters_of(told(autopilot, **BETAFLIGHT))}
    assert found["gyro low-pass"].delay == pytest.approx(1.0 / (200.0 * np.pi))
    quality = 260.0 * 160.0 / (260.0**2 - 160.0**2)
    expected = notch_delay(260.0, quality)
    assert found["notch of the derivative"].delay == pytest.approx(expected, rel=1e-4)
    assert found["notch of the derivative"].path == "D"
    assert "together: 2.122 ms (2 filters)" in filter_lines(told(autopilot, **BETAFLIGHT))[-1]


@pytest.mark.parametrize("names", [
    ("rpm_filter_harmonics", "rpm_filter_q", "rpm_filter_min_hz"),
    ("gyro_rpm_notch_harmonics", "gyro_rpm_notch_q", "gyro_rpm_notch_min"),
])  # fmt: skip
def test_notches_on_the_motors_delay_at_most_what_they_do_at_the_lowest(names):
    settings = dict(zip(names, (3.0, 500.0, 100.0), strict=True))
    log = told("Betaflight", **BETAFLIGHT, **settings, dshot_bidir=1.0)
    (rpm,) = [one for one in filters_of(log) if "rpm" in one.name]
    expected = 4.0 * sum(notch_delay(k * 100.0, 5.0) for k in (1, 2, 3))
    assert rpm.delay == pytest.approx(expected, rel=1e-4)
    assert "together: at most" in filter_lines(log)[-1]
    # Without telemetry of the motors the firmware has no such filter.
    assert len(filters_of(told("Betaflight", **BETAFLIGHT, **settings, dshot_bidir=0.0))) == 4


def test_a_log_without_settings_has_no_line():
    assert filter_lines(told("ArduPilot")) == []
    assert filter_lines(told("Crazyflie", INS_GYRO_FILTER=20.0)) == []
