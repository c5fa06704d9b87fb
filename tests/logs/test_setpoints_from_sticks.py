"""Rate loops of Blackbox logs that hold the sticks and no setpoint, and of PX4 logs with gyros."""

import deadtime as dtm
import numpy as np
import pytest
from blackbox_logs import END, SIGNED, UNSIGNED, Log
from flights import flight_path
from made_logs import ULogFile

DEGREE = np.pi / 180.0
STATES = [
    ("flightModeFlags", 0, (0, UNSIGNED)),
    *((name, 0, (0, UNSIGNED)) for name in ("stateFlags", "failsafePhase")),
]
RATES = {"rc_rates": "100,230,120", "rc_expo": "0,30,0", "rates": "70,0,70"}


def opened(tmp_path, data):
    path = tmp_path / "log"
    path.write_bytes(data)
    return dtm.open_log(path)


def stick_log(revision, lines, setpoint, flags=1, rows=400, limit=10_000):
    """Sticks in steps, the rate a first-order lag behind what `setpoint` makes of them, and P."""
    names = [f"{name}[{k}]" for name in ("axisP", "rcCommand", "gyroADC") for k in range(3)]
    log = Log([(name, 1, (0, SIGNED), (1, SIGNED)) for name in names], revision, slow=STATES)
    log.lines = lines
    draw = np.random.default_rng(3)
    sticks = np.repeat(draw.integers(-500, 501, (rows // 20, 3)), 20, axis=0)
    asked = np.stack([setpoint(k, sticks[:, k].astype(float)) for k in range(3)], axis=1)
    rate = np.zeros((rows, 3))
    for k in range(1, rows):
        rate[k] = np.round(rate[k - 1] + 0.1 * (asked[k - 1] - rate[k - 1]))
    term = np.clip(np.round(1.3 * (asked - rate)), -limit, limit)
    table = np.hstack([term, sticks, rate]).astype(int)
    frames = [[k, 1_000_000 + 2000 * k, *map(int, row)] for k, row in enumerate(table)]
    data = [log.main(frames[0]), log.slow_frame([flags, 0, 0]), *map(log.main, frames[1:])]
    return log.head() + b"".join(data) + END, asked


def betaflight(axis, sticks):
    # Worked out by hand for RATES: a rate of 2.3 counts 2.3 + 14.54 * 0.3.
    u = sticks / 500.0
    if axis == 1:
        curved = 200.0 * 6.662 * (0.3 * u * np.abs(u) ** 3 + 0.7 * u)
        return np.clip(curved, -1998, 1998)
    return np.clip((200.0, 0, 240.0)[axis] * u / np.maximum(1 - 0.7 * np.abs(u), 0.01), -1998, 1998)


@pytest.mark.parametrize("revision", ["Betaflight 3.4.0 (a5b) X", "Cleanflight 2.1.0 (a5b) X"])
def test_the_head_of_betaflight_3_makes_rates_of_sticks(tmp_path, revision):
    data, asked = stick_log(revision, RATES, betaflight)
    log = opened(tmp_path, data)
    for k, loop in enumerate(log.loops.values()):
        np.testing.assert_allclose(loop.setpoint.values, DEGREE * asked[:, k], rtol=1e-12)
        assert "computed from the rates in the header" in loop.setpoint.conversion
        assert loop.followed > 0.7


@pytest.mark.parametrize("limit", [10_000, 300])
@pytest.mark.parametrize("revision", ["0aac025", "Betaflight 2.7.1 (a5b) X", "Cleanflight 1.14.2"])
def test_before_that_the_rates_follow_from_the_controller(tmp_path, revision, limit):
    flags = 1 if revision.startswith("Beta") else 0
    linear = lambda axis, sticks: (0.41, 0.46, 0.59)[axis] * sticks  # noqa: E731
    data, asked = stick_log(revision, {}, linear, flags, limit=limit)
    for k, loop in enumerate(opened(tmp_path, data).loops.values()):
        np.testing.assert_allclose(loop.setpoint.values, DEGREE * asked[:, k], rtol=2e-3)


@pytest.mark.parametrize(
    ("revision", "lines", "setpoint"),
    [
        ("0aac025", {}, betaflight),
        ("Betaflight 4.3.0 (a5b) X", RATES | {"rates_type": 3}, betaflight),
        ("0aac025", {}, lambda axis, sticks: 90.0 * np.sin(np.arange(sticks.size))),
    ],
    ids=["a curve", "rates of another type", "not the sticks"],
)
def test_a_rate_that_sticks_do_not_explain_is_no_loop(tmp_path, revision, lines, setpoint):
    data, _ = stick_log(revision, lines, setpoint, flags=0)
    assert not opened(tmp_path, data).loops


@pytest.mark.parametrize(
    ("revision", "flags"),
    [("Betaflight 3.4.0 (a) X", 0b11), ("Betaflight 3.4.0 (a) X", 0b101), ("Cleanflight 1.9", 1)],
)
def test_where_sticks_set_angles_no_rate_is_followed(tmp_path, revision, flags):
    linear = lambda axis, sticks: sticks if "Clean" in revision else betaflight(axis, sticks)  # noqa: E731
    data, _ = stick_log(revision, RATES, linear, flags)
    loops = opened(tmp_path, data).loops
    assert len(loops) == 3
    for loop in loops.values():
        assert not loop.segments
        assert "the sticks set angles" in loop.why_left_out[-1]


@pytest.mark.parametrize(
    ("name", "autopilot", "followed"),
    [
        ("betaflight_3.4_no_setpoint.bfl", "Betaflight", 17.2),
        ("cleanflight_2016.txt", "Cleanflight", 5.5),
    ],
)
def test_real_logs_without_a_setpoint(name, autopilot, followed):
    log = dtm.open_log(flight_path(name))
    assert log.autopilot == autopilot
    assert list(log.loops) == ["roll rate", "pitch rate", "yaw rate"]
    main = log.contents.topics["main"].columns
    for k, loop in enumerate(log.loops.values()):
        assert loop.followed == pytest.approx(followed, abs=0.1)
        # The controller's own P is a gain times what is left: a third, independent number.
        left = (loop.setpoint.values - loop.response.values) / DEGREE
        term = main[f"axisP[{k}]"]
        free = np.abs(term) < 0.9 * np.abs(term).max()
        assert np.corrcoef(left[free], term[free])[0, 1] > 0.995


def gyros(topics, rotated=None):
    log = ULogFile()
    log.info("char[3]", "sys_name", b"PX4")
    if rotated is not None:
        log.parameter("SENS_BOARD_ROT", rotated)
    log.topics({"vehicle_rates_setpoint": ("roll", "pitch", "yaw"), **topics})
    for k in range(200):
        log.add("vehicle_rates_setpoint", 1.0 + 0.01 * k, *(k % 5 + j for j in range(3)))
        for number, name in enumerate(topics):
            log.add(name, 1.0 + 0.01 * k, *(0.9 * ((k - 1) % 5) + j + number for j in range(3)))
    return log.data


COMBINED = {"sensor_combined": ("gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]")}
SINGLE = {"sensor_gyro": ("x", "y", "z")}


@pytest.mark.parametrize(
    ("topics", "rotated", "source"),
    [
        (COMBINED | SINGLE, None, "sensor_combined.gyro_rad[1]"),
        (SINGLE, None, "sensor_gyro.y"),
        (SINGLE, 0.0, "sensor_gyro.y"),
        (COMBINED | SINGLE, 6.0, "sensor_combined.gyro_rad[1]"),
        (SINGLE, 6.0, None),
    ],
)
def test_a_gyroscope_is_the_response_of_an_old_px4_log(tmp_path, topics, rotated, source):
    # The best excited log of all held sensor_gyro alone, and "no loop".
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    loops = opened(tmp_path, gyros(topics, rotated)).loops
    if source is None:  # a board that is turned in the vehicle measures other axes
        assert not loops
        return
    assert loops["pitch rate"].response.source == source
    assert loops["pitch rate"].followed > 1.9


def test_quaternions_that_are_not_set_are_no_level_attitude(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    log = ULogFile()
    log.info("char[3]", "sys_name", b"PX4")
    q = tuple(f"q[{k}]" for k in range(4))
    asked = (*(f"q_d[{k}]" for k in range(4)), "roll_body", "pitch_body", "yaw_body")
    log.topics({"vehicle_attitude": (*q, "roll"), "vehicle_attitude_setpoint": asked})
    for k in range(200):
        angle = 0.1 * (k % 20 < 10)
        log.add("vehicle_attitude_setpoint", 1.0 + 0.01 * k, 0, 0, 0, 0, angle, 0, 0)
        log.add("vehicle_attitude", 1.0 + 0.01 * k, 0, 0, 0, 0, 0.9 * angle)
    loops = opened(tmp_path, log.data).loops
    assert list(loops) == ["roll"]
    assert loops["roll"].setpoint.values.max() == pytest.approx(0.1)
    assert loops["roll"].response.values.max() == pytest.approx(0.09)


def test_the_best_excited_real_log_has_rate_loops():
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    loops = dtm.open_log(flight_path("px4_s250_gyro_only.ulg")).loops
    assert list(loops) == ["roll rate", "pitch rate", "yaw rate"]
    assert loops["roll rate"].response.source == "sensor_gyro.x"
    for name in ("roll rate", "pitch rate"):
        loop = loops[name]
        assert loop.followed > 45.0
        # Cross-correlation of setpoint and response is largest at 41 to 47 ms.
        time = np.arange(1.0, 45.0, 0.001)
        asked = np.interp(time, loop.setpoint.time, loop.setpoint.values)
        lags = np.arange(0.0, 0.1, 0.001)
        alike = [
            np.corrcoef(asked, np.interp(time + lag, loop.response.time, loop.response.values))[
                0, 1
            ]
            for lag in lags
        ]
        assert max(alike) > 0.9
        assert 0.040 <= lags[int(np.argmax(alike))] <= 0.048
