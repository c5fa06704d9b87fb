"""Logs whose content is known, because the tests write them."""

import copy
import pickle

import deadtime as dtm
import numpy as np
import pytest
from made_logs import DataFlash, Tlog, ULogFile, as_text, copter

DEGREE = np.pi / 180.0


@pytest.fixture
def opened(tmp_path):
    def write(data, name="log"):
        path = tmp_path / name
        path.write_bytes(getattr(data, "data", data))
        return dtm.open_log(path)

    return write


def test_a_dataflash_log(opened):
    log = opened(copter())
    assert (log.format, log.autopilot, log.vehicle) == ("DataFlash", "ArduPilot", "Copter (QUAD/X)")
    assert log.firmware == "ArduCopter V4.5.7 (01234567)"
    assert log.parameters == {
        "ATC_RAT_RLL_P": pytest.approx(0.135),
        "BATT_CAPACITY": 5000.0,
    }
    assert list(log.key_parameters) == ["ATC_RAT_RLL_P"]
    assert [name for _, name in log.modes] == ["ALT_HOLD"]
    loop = log.loop("roll")
    assert loop.setpoint.values.max() == pytest.approx(10.0 * DEGREE)
    assert loop.setpoint.conversion == "ATT.DesRoll [deg] to rad"
    assert loop.setpoint.rate == pytest.approx(50.0)
    assert np.array_equal(loop.setpoint.values[:-3], loop.response.values[3:])
    assert loop.segments == ((loop.setpoint.time[0], loop.setpoint.time[-1]),)
    with pytest.raises(ValueError, match="Its loops are roll, pitch"):
        log.loop("heave")


@pytest.mark.parametrize("ending", ["flight.bin", "flight.csv", "flight"])
def test_the_format_is_told_by_the_first_bytes(opened, ending):
    assert opened(copter(), ending).format == "DataFlash"


@pytest.mark.parametrize("way", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_logs_can_be_copied_and_stay_read_only(opened, way):
    log = opened(copter())
    other = way(log)
    assert other.loops["roll"] == log.loops["roll"]
    assert not other.loops["roll"].setpoint.values.flags.writeable
    assert other.to_dict() == log.to_dict()
    with pytest.raises(TypeError):
        log.loops["roll"] = None


def test_height_and_climb_in_the_units_of_each_version(opened):
    """The climb is in cm/s without a word in old logs; new ones tell the unit of each column."""

    def log_of(form, values, units):
        log = DataFlash()
        log.define("CTUN", 7, form, "TimeUS,DAlt,Alt,DCRt,CRt")
        if units is not None:
            log.units({"m": "m", "n": "m/s", "s": "s"}, {"0": 1.0, "B": 1e-2, "F": 1e-6}, units)
        for k in range(40):
            log.add("CTUN", 100_000 * k, *values)
        return log

    found = [
        opened(log_of("Qffhh", (2.0, 1.5, 150, 120), None)),
        opened(log_of("Qffhh", (2.0, 1.5, 150, 120), {"CTUN": ("smmnn", "F00BB")})),
        opened(log_of("Qffff", (2.0, 1.5, 1.5, 1.2), {"CTUN": ("smmnn", "F0000")})),
        # A letter with a factor of its own: hundredths in the file, metres in the log.
        opened(log_of("Qeecc", (200, 150, 150, 120), {"CTUN": ("smmnn", "FBBBB")})),
    ]
    for log in found:
        climb, height = log.loops["vertical speed"], log.loops["altitude"]
        assert climb.setpoint.unit == "m/s"
        assert climb.setpoint.values == pytest.approx(1.5)
        assert climb.response.values == pytest.approx(1.2)
        assert height.setpoint.values == pytest.approx(2.0)
        assert height.response.values == pytest.approx(1.5)
    assert found[0].loops["vertical speed"].setpoint.conversion == "CTUN.DCRt [cm/s] to m/s"
    assert found[2].loops["vertical speed"].setpoint.conversion == ""


def test_feet_are_converted(opened):
    log = DataFlash()
    log.define("CTUN", 7, "Qff", "TimeUS,DAlt,Alt")
    log.units({"f": "ft", "s": "s"}, {"0": 1.0, "F": 1e-6}, {"CTUN": ("sff", "F00")})
    for k in range(40):
        log.add("CTUN", 100_000 * k, 10.0 + k % 2, 10.0)
    loop = opened(log).loops["altitude"]
    assert loop.response.values == pytest.approx(3.048)
    assert loop.response.conversion == "CTUN.Alt [ft] to m"


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "deg/s"), (100.0, "cdeg/s")])
def test_rates_of_old_firmware_in_hundredths_of_a_degree(opened, factor, unit):
    log = DataFlash()
    log.define("RATE", 8, "Iff", "TimeMS,RDes,R")
    log.define("IMU", 9, "If", "TimeMS,GyrX")
    for k in range(100):
        rate = np.sin(0.3 * k)
        log.add("RATE", 20 * k, factor * rate / DEGREE, factor * rate / DEGREE + factor)
        log.add("IMU", 20 * k, rate)
    loop = opened(log).loops["roll rate"]
    assert loop.setpoint.values == pytest.approx(np.sin(0.3 * np.arange(100)), abs=1e-5)
    assert f"[{unit}] to rad/s" in loop.setpoint.conversion


def test_several_sensors_are_several_topics(opened):
    log = DataFlash()
    log.define("IMU", 9, "QBf", "TimeUS,I,GyrX")
    log.units({"#": "instance", "E": "rad/s"}, {"0": 1.0}, {"IMU": ("-#E", "---")})
    for k in range(20):
        for number in (0, 1):
            log.add("IMU", 1000 * k, number, 10.0 * number + k)
    topics = opened(log).contents.topics
    assert np.array_equal(topics["IMU"].columns["GyrX"], np.arange(20.0))
    assert np.array_equal(topics["IMU[1]"].columns["GyrX"], 10.0 + np.arange(20.0))


def test_messages_without_a_time_get_that_of_the_next_one(opened):
    # Logs of 2014: MODE has no time.
    log = DataFlash()
    log.define("ATT", 5, "Icc", "TimeMS,DesRoll,Roll")
    log.define("MODE", 3, "MB", "Mode,ThrCrs")
    for k in range(100):
        if k == 50:
            log.add("MODE", 5, 0)
        log.add("ATT", 1000 + 20 * k, 100 * (k % 7), 50)
    log.add("MODE", 6, 0)
    found = opened(log)
    assert found.start == pytest.approx(1.0)
    assert [at for at, _ in found.modes] == pytest.approx([1.0, 1.98])


def test_text_logs_say_the_same_as_binary_ones(opened):
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 5, 19, ATT, Qcccc, TimeUS,DesRoll,Roll,DesPitch,Pitch",
        "FMT, 1, 75, MSG, QZ, TimeUS,Message",
        "FMT, 3, 15, MODE, QMB, TimeUS,Mode,ModeNum",
        "FMT, 2, 31, PARM, QNf, TimeUS,Name,Value",
        "FMT, 4, 12, EV, QB, TimeUS,Id",
        "MSG, 0, ArduCopter V4.5.7 (01234567)",
        "MSG, 0, Frame: QUAD/X",
        "MSG, 0, a text, with commas",
        "PARM, 0, ATC_RAT_RLL_P, 0.135",
        "PARM, 0, BATT_CAPACITY, 5000",
        "MODE, 1000, ALT_HOLD, 2",
        "EV, 1000, 10",
        "EV, 2000, 28",
    ]
    for k in range(200):
        asked, came = 10 * (k % 50 < 25), 10 * ((k - 3) % 50 < 25)
        lines.append(f"ATT, {10_000 + 20_000 * k}, {asked}, {came}, 1.0, 1.00")
    text, binary = opened(as_text(lines)), opened(copter())
    assert text.format == "DataFlash text"
    same = [text.to_dict(), binary.to_dict()]
    for one in same:
        del one["format"], one["parameters"], one["key_parameters"]
    assert same[0] == same[1]
    assert text.parameters == pytest.approx(binary.parameters)
    for name, loop in binary.loops.items():
        assert np.allclose(text.loops[name].setpoint.values, loop.setpoint.values)
        assert np.array_equal(text.loops[name].setpoint.time, loop.setpoint.time)
    # Some tools write no blank after the comma, and a line before the first message.
    tight = [line.replace(", ", ",") for line in lines]
    again = opened(as_text(["ArduCopter", *tight]))
    assert np.array_equal(again.loops["roll"].setpoint.values, text.loops["roll"].setpoint.values)


@pytest.mark.parametrize(
    ("name", "columns", "disarmed"), [("ARM", "ArmState", 0), ("EV", "Id", 11)]
)
def test_a_log_that_was_begun_in_the_air_was_armed_before_it_was_disarmed(
    opened, name, columns, disarmed
):
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 5, 19, ATT, Qcccc, TimeUS,DesRoll,Roll,DesPitch,Pitch",
        "FMT, 1, 75, MSG, QZ, TimeUS,Message",
        f"FMT, 4, 12, {name}, QB, TimeUS,{columns}",
        "MSG, 0, ArduCopter V4.5.7 (01234567)",
    ]
    for k in range(200):
        asked, came = 10 * (k % 50 < 25), 10 * ((k - 3) % 50 < 25)
        lines.append(f"ATT, {10_000 + 20_000 * k}, {asked}, {came}, 1.0, 1.00")
        if k == 149:
            lines.append(f"{name}, {10_000 + 20_000 * k}, {disarmed}")
    loop = opened(as_text(lines)).loops["roll"]
    assert np.array(loop.segments) == pytest.approx(np.array([(0.01, 2.99)]))
    assert loop.why_left_out == ("1 s are left out: the vehicle is disarmed",)


def flying(**further):
    """A ULog of a vehicle in the air, in position control; topics may be added."""
    log = ULogFile()
    log.info("char[3]", "sys_name", b"PX4")
    log.parameter("MC_ROLLRATE_P", 0.15)
    log.topics(
        {
            "vehicle_rates_setpoint": ("roll", "pitch", "yaw"),
            "vehicle_angular_velocity": ("xyz[0]", "xyz[1]", "xyz[2]"),
            "vehicle_local_position": ("z", "vz"),
            "vehicle_local_position_setpoint": ("z", "vz"),
            "vehicle_status": ("arming_state", "nav_state"),
            **further,
        }
    )
    return log


def test_a_copy_of_the_estimate_is_left_out(opened):
    # From 3 to 5 s the setpoint is the estimate of the row before, as of a loop that is open.
    rng = np.random.default_rng(5)
    speed = np.cumsum(rng.normal(size=400)) * 0.05
    log = flying()
    log.add("vehicle_status", 1.0, 2.0, 2.0)
    for k in range(400):
        at = 1.0 + 0.02 * k
        copied = 150 <= k < 250
        log.add("vehicle_local_position", at, 0.0, speed[k])
        log.add("vehicle_local_position_setpoint", at, np.nan, speed[k - 1] if copied else k // 50)
    loop = opened(log).loops["vertical speed"]
    assert np.array(loop.segments) == pytest.approx(np.array([(0.0, 3.0), (5.0, 7.98)]), abs=0.05)
    assert loop.why_left_out == (
        "1.98 s are left out: the setpoint is only a copy of the estimate",
    )


def test_lift_off_and_touch_down_are_left_out(opened):
    # For the autopilot in the air from 2 s, with full thrust from 4 s; it notices the landing
    # at 8 s, as late as 2.5 s after it.
    log = flying(vehicle_land_detected=("landed",), takeoff_status=("takeoff_state",))
    log.add("vehicle_status", 1.0, 2.0, 2.0)
    for at, landed, state in ((1.0, 1, 2), (2.0, 0, 4), (4.0, 0, 5), (8.0, 1, 3)):
        log.add("vehicle_land_detected", at, landed)
        log.add("takeoff_status", at, state)
    for k in range(400):
        at = 1.0 + 0.02 * k
        log.add("vehicle_local_position", at, 0.0, np.sin(0.1 * k))
        log.add("vehicle_local_position_setpoint", at, np.nan, 0.5 * (k // 20 % 2))
    loop = opened(log).loops["vertical speed"]
    assert np.array(loop.segments) == pytest.approx(np.array([(3.0, 4.5)]), abs=0.03)
    ground, thrust = loop.why_left_out
    assert ground.endswith("the vehicle is on the ground or lands")
    assert thrust.endswith("the thrust is rising for the take-off")


def test_a_setpoint_that_rests_on_coarse_values_is_no_copy(opened):
    # 1 cm steps of a height that is held: many rows are equal, and the loop is closed.
    log = flying()
    log.add("vehicle_status", 1.0, 2.0, 2.0)
    for k in range(400):
        at = 1.0 + 0.02 * k
        log.add("vehicle_local_position", at, -round(2.0 + 0.004 * np.sin(k), 2), 0.0)
        log.add("vehicle_local_position_setpoint", at, -2.0, 0.0)
    loop = opened(log).loops["altitude"]
    assert loop.followed == pytest.approx(7.98)
    assert loop.why_left_out == ()


def test_modes_gaps_and_missing_numbers_bound_the_segments(opened):
    log = flying()
    for at, armed, mode in ((1.0, 1.0, 0.0), (2.0, 2.0, 2.0), (7.0, 2.0, 0.0), (8.0, 1.0, 0.0)):
        log.add("vehicle_status", at, armed, mode)
    for k in range(400):
        at = 1.0 + 0.02 * k
        log.add("vehicle_local_position", at, 0.0, np.sin(0.1 * k))
        if not 4.0 < at < 5.0:
            asked = np.nan if 3.0 <= at < 3.5 else 0.5 * (k // 20 % 2)
            log.add("vehicle_local_position_setpoint", at, np.nan, asked)
    log.dropout(600)
    found = opened(log)
    loop = found.loops["vertical speed"]
    expected = np.array([(1.0, 2.0), (2.5, 3.0), (4.0, 6.0)])
    assert np.array(loop.segments) == pytest.approx(expected, abs=0.05)
    for words in (
        "the vehicle is disarmed",
        "in this flight mode the loop is open",
        "not a number",
        "a gap",
    ):
        assert any(words in reason for reason in loop.why_left_out), words
    assert loop.setpoint.gaps == (pytest.approx((3.0, 4.0), abs=0.03),)
    assert found.gaps == (pytest.approx((7.98, 8.58), abs=0.01),)
    assert "altitude" not in found.loops  # its setpoint is NaN throughout


def test_a_loop_without_a_setpoint_is_not_offered(opened):
    log = flying()
    for k in range(50):
        log.add("vehicle_angular_velocity", 1.0 + 0.02 * k, 0.1, 0.2, 0.3)
    found = opened(log)
    assert not found.loops
    assert "no loop" in found.summary()


def test_times_that_repeat_or_go_back_are_left_out(opened):
    log = DataFlash()
    log.define("ATT", 5, "Qcc", "TimeUS,DesRoll,Roll")
    times = [20_000 * k for k in range(100)]
    times[30] = times[29]
    times[50] = times[40]
    times[70] = 10**12  # one row far ahead must not take all that follow with it
    for k, at in enumerate(times):
        log.add("ATT", at, 100 * (k % 5), 50)
    found = opened(log)
    assert len(found.loops["roll"].setpoint) == 97
    assert "ATT: 3 rows are left out because their time repeats or goes back" in found.remarks


def tlog(rows=500, late=0.05, autopilot=3):
    """A tlog of a copter; the ground station is `late` s behind, its clock starts in 2024."""
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    log = Tlog()
    m = log.dialect
    for k in range(rows):
        boot = 10.0 + 0.02 * k
        ground = 1.7e9 + 0.02 * k + late
        if k % 50 == 0:
            log.add(ground, m.MAVLink_heartbeat_message(2, autopilot, 128 | 1, 4, 4, 3))
        if k == 7:
            log.add(ground, m.MAVLink_param_value_message(b"ATC_RAT_RLL_P", 0.135, 9, 1, 0))
            text = m.MAVLink_statustext_message(6, b"ArduCopter V4.5.7 (01234567)")
            log.add(ground, text)
        angle = 0.1 * np.sin(0.1 * k)
        half = 0.5 * angle
        q = [np.cos(half), np.sin(half), 0.0, 0.0]
        stamp = round(1e3 * boot)
        log.add(ground, m.MAVLink_attitude_message(stamp, angle, 0.0, 0.0, 0.0, 0.0, 0.0), k % 2)
        log.add(ground, m.MAVLink_attitude_target_message(stamp, 0, q, 0.1, 0.0, 0.0, 0.5))
        log.add(ground, m.MAVLink_nav_controller_output_message(5.0, 0, 0, 0, 0, 0, 0, 0))
        mask = 0b111 if k < 250 else 0b111000
        wanted = (1.0, 2.0, -3.0, 0.4, 0.5, -0.6)
        log.add(
            ground,
            m.MAVLink_position_target_local_ned_message(stamp, 1, mask, *wanted, 0, 0, 0, 0, 0),
        )
        log.add(ground, m.MAVLink_local_position_ned_message(stamp, 1, 2, -3, 0.4, 0.5, -0.6))
    return log


def test_a_tlog(opened):
    log = opened(tlog())
    assert (log.format, log.autopilot, log.vehicle) == ("tlog", "ArduPilot", "quadrotor")
    assert log.firmware == "ArduCopter V4.5.7 (01234567)"
    assert log.key_parameters == {"ATC_RAT_RLL_P": pytest.approx(0.135)}
    assert [name for _, name in log.modes] == ["GUIDED"]
    assert log.start == pytest.approx(10.0)
    assert log.duration == pytest.approx(9.98)
    roll = log.loops["roll"]
    angle = 0.1 * np.sin(0.1 * np.arange(500))
    assert roll.response.values == pytest.approx(angle, abs=1e-7)
    assert roll.setpoint.values == pytest.approx(angle, abs=1e-6)
    # Fields that the mask ignores are no setpoints.
    climb, height = log.loops["vertical speed"], log.loops["altitude"]
    assert np.isnan(climb.setpoint.values[250:]).all()
    assert climb.setpoint.values[:250] == pytest.approx(0.6)
    assert np.isnan(height.setpoint.values[:250]).all()
    assert height.setpoint.values[250:] == pytest.approx(3.0)
    assert height.segments[0][0] == pytest.approx(5.0, abs=0.03)


def test_both_clocks_of_a_tlog_are_kept(opened):
    topics = opened(tlog(late=0.07)).contents.topics
    attitude = topics["ATTITUDE"]
    delay = attitude.columns["ground_time"] - 1.7e9 + 10.0 - attitude.time
    assert delay == pytest.approx(0.07, abs=1e-3)
    # This message has no time of the vehicle: it is placed beside those that came with it.
    placed = topics["NAV_CONTROLLER_OUTPUT"].time
    assert placed == pytest.approx(attitude.time, abs=1e-3)


def test_other_senders_are_topics_of_their_own(opened):
    log = tlog()
    other = Tlog(system=255, component=190)
    m = other.dialect
    for k in range(20):
        ground = 1.7e9 + 10.0 + 0.05 * k
        other.add(ground, m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        sent = m.MAVLink_set_position_target_local_ned_message(
            123_456, 1, 1, 1, 0, 0, 0, 0, 0, 0, -1.0, 0, 0, 0, 0, 0
        )
        other.add(ground, sent)
    found = opened(log.data + other.data)
    topics = found.contents.topics
    assert topics["HEARTBEAT[255/190]"].columns["type"].tolist() == [6.0] * 20
    assert topics["HEARTBEAT"].columns["type"].tolist() == [2.0] * 10
    # The ground station's own count of milliseconds is not the vehicle's clock.
    assert topics["SET_POSITION_TARGET_LOCAL_NED"].time.max() <= found.start + found.duration


def test_of_a_vehicle_that_restarted_the_longest_part_is_read(opened):
    found = opened(tlog(600).data + tlog(300).data)
    assert found.duration == pytest.approx(11.98)
    assert any("restarts 1 times" in remark for remark in found.remarks)


def test_modes_of_px4_in_a_tlog(opened):
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    log = Tlog()
    m = log.dialect
    # Main modes, then those of "auto" by sub mode.
    modes = [1 << 16, 3 << 16, *(4 << 16 | sub << 24 for sub in (2, 3, 4, 5, 6, 9))]
    for k, mode in enumerate(modes):
        for j in range(10):
            ground = 1.7e9 + k + 0.1 * j
            log.add(ground, m.MAVLink_heartbeat_message(2, 12, 128, mode, 4, 3))
            stamp = round(1e3 * (k + 0.1 * j))
            log.add(ground, m.MAVLink_attitude_message(stamp, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    found = opened(log)
    assert found.autopilot == "PX4"
    assert [name for _, name in found.modes] == [
        "Manual", "Position", "Takeoff", "Hold", "Mission", "Return", "Land", "Precision land",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "mode"),
    [(2, "LOITER"), (1, "FBWA"), (10, "LOITER"), (11, "LOITER"), (12, "mode 5"), (27, "mode 5")],
)
def test_a_mode_has_the_name_of_its_vehicle(opened, kind, mode):
    # A submarine's modes had the names of a rover's.
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    log = Tlog()
    m = log.dialect
    for k in range(20):
        log.add(1.7e9 + k, m.MAVLink_heartbeat_message(kind, 3, 128, 5, 4, 3))
        log.add(1.7e9 + k, m.MAVLink_attitude_message(1000 + 1000 * k, 0, 0, 0, 0, 0, 0))
    assert [name for _, name in opened(log).modes] == [mode]
