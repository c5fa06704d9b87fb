"""Times that are no clock, and states that change twice at one time."""

import deadtime as dtm
import numpy as np
import pytest
from made_logs import DataFlash, Tlog, ULogFile


@pytest.fixture
def opened(tmp_path):
    def write(data):
        path = tmp_path / "log"
        path.write_bytes(getattr(data, "data", data))
        return dtm.open_log(path)

    return write


def rolling_tlog(others, heartbeats=60):
    """A minute of a vehicle that rolls at 10 Hz; `others` adds messages at each row."""
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    log = Tlog()
    m = log.dialect
    for k in range(600):
        ground, boot = 1.7e9 + 0.1 * k, 5.0 + 0.1 * k
        if k % 10 == 0 and k < 10 * heartbeats:
            log.add(ground, m.MAVLink_heartbeat_message(2, 3, 129, 5, 4, 3))
        stamp = round(1e3 * boot)
        for made in others(m, boot):
            log.add(ground, made)
        log.add(ground, m.MAVLink_attitude_message(stamp, np.sin(k), 0, 0, 0, 0, 0))
        log.add(ground, m.MAVLink_nav_controller_output_message(k % 5, 0, 0, 0, 0, 0, 0, 0))
    return log


def gps(m, stamp):
    return m.MAVLink_gps_raw_int_message(round(1e6 * stamp), 1, 0, 0, 0, 0, 0, 0, 0, 0)


def home(m, stamp):
    still = [1.0, 0.0, 0.0, 0.0]
    return m.MAVLink_home_position_message(
        0, 0, 0, 0.0, 0.0, 0.0, still, 0.0, 0.0, 0.0, round(1e6 * stamp)
    )


@pytest.mark.parametrize(
    "others",
    [
        lambda m, boot: [gps(m, 0.0)],
        lambda m, boot: [home(m, 0.0)],
        lambda m, boot: [gps(m, min(boot, 20.0))],
        lambda m, boot: [gps(m, 1.7e9 + boot)],
        lambda m, boot: [m.MAVLink_attitude_target_message(0, 0, [1, 0, 0, 0], 0, 0, 0, 0)],
    ],
    ids=["no fix", "home", "fix lost", "satellites", "target without a time"],
)
def test_a_time_that_is_not_known_starts_no_clock_anew(opened, others):
    # Without a fix GPS_RAW_INT says 0: "the clock starts anew 239 times" of one flight.
    log = opened(rolling_tlog(others))
    assert log.remarks == ()
    assert (log.start, log.duration) == pytest.approx((5.0, 59.9))
    assert log.loops["roll"].followed == pytest.approx(59.9)
    for name, topic in log.contents.topics.items():
        placed = topic.time - topic.columns["ground_time"] + 1.7e9
        assert placed == pytest.approx(5.0, abs=10.0), name


def test_a_part_without_a_heartbeat_is_read(opened):
    # The longest part held no heartbeat: KeyError 'HEARTBEAT'.
    before, after = rolling_tlog(lambda m, boot: []), rolling_tlog(lambda m, boot: [], heartbeats=0)
    short = before.data[: len(before.data) // 2]
    log = opened(short[: short.rfind(b"\x00\x06")] + after.data)
    assert (log.autopilot, log.vehicle, log.modes) == ("ArduPilot", "quadrotor", ())
    assert "roll" in log.loops


def test_of_two_events_at_one_time_the_last_holds(opened):
    # The first was kept: a copter that landed and took off within 1 ms was "on the ground" for
    # the 130 s of the flight that followed.
    log = DataFlash()
    log.define("MSG", 1, "IZ", "TimeMS,Message")
    log.define("EV", 2, "IB", "TimeMS,Id")
    log.define("ATT", 3, "Icc", "TimeMS,DesRoll,Roll")
    log.define("MODE", 4, "IBB", "TimeMS,Mode,ModeNum")
    log.add("MSG", 0, "ArduCopter V3.2.1 (01234567)")
    for event in (10, 28):
        log.add("EV", 0, event)
    for k in range(1400):
        if k == 100:
            log.add("EV", 10_000, 18)
            log.add("EV", 10_000, 28)
            log.add("MODE", 10_000, 0, 0)
            log.add("MODE", 10_000, 2, 2)
        log.add("ATT", 100 * k, 1000 * (k % 20 < 10), 1000 * ((k - 2) % 20 < 10))
    found = opened(log)
    assert found.loops["roll"].followed == pytest.approx(139.9)
    assert found.loops["roll"].why_left_out == ()


def test_of_two_states_of_px4_at_one_time_the_last_holds(opened):
    log = ULogFile()
    log.info("char[3]", "sys_name", b"PX4")
    log.topics(
        {
            "vehicle_rates_setpoint": ("roll",),
            "vehicle_angular_velocity": ("xyz[0]",),
            "vehicle_land_detected": ("landed",),
            "vehicle_status": ("arming_state", "nav_state"),
        }
    )
    log.add("vehicle_status", 1.0, 1.0, 0.0)
    log.add("vehicle_status", 1.0, 2.0, 0.0)
    log.add("vehicle_land_detected", 1.0, 1.0)
    log.add("vehicle_land_detected", 1.0, 0.0)
    for k in range(200):
        log.add("vehicle_rates_setpoint", 1.0 + 0.02 * k, k % 5)
        log.add("vehicle_angular_velocity", 1.0 + 0.02 * k, 0.9 * ((k - 1) % 5))
    assert opened(log).loops["roll rate"].followed == pytest.approx(3.98, abs=0.03)
