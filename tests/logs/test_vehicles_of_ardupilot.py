"""Planes, rovers, controllers' own messages and injected signals in DataFlash logs."""

import dataclasses

import deadtime as dtm
import numpy as np
import pytest
from flights import flight_path
from made_logs import DataFlash

DEGREE = np.pi / 180.0
COPTER, PLANE, ROVER = "ArduCopter V4.5.7 (1)", "ArduPlane V4.5.7 (1)", "Rover V4.5.0 (1)"


@dataclasses.dataclass
class Made:
    """A log of messages at 50 Hz, in each of which the second column follows the first."""

    firmware: str = ""
    modes: tuple = ((0, 5),)
    messages: tuple = ()
    parameters: tuple = ()
    rows: int = 300
    events: tuple = ()

    def data(self):
        log = DataFlash()
        log.define("MSG", 1, "QZ", "TimeUS,Message")
        log.define("PARM", 2, "QNf", "TimeUS,Name,Value")
        log.define("MODE", 3, "QMB", "TimeUS,Mode,ModeNum")
        if self.firmware:
            log.add("MSG", 0, self.firmware)
        for name in self.parameters:
            log.add("PARM", 0, name, 1.0)
        number = 10
        for name, columns, _, _ in self.messages:
            form = "Q" + "f" * (columns.count(",") + 1)
            log.define(name, number, form, f"TimeUS,{columns}")
            number += 1
        log.define("SIDS", 9, "QB", "TimeUS,Ax")
        for at, axis in self.events:
            log.add("SIDS", at * 20_000, axis)
        for k in range(self.rows):
            for at, mode in self.modes:
                if at == k:
                    log.add("MODE", 20_000 * k, mode, mode)
            for name, columns, scale, every in self.messages:
                if k % every == 0:
                    pair = [scale * np.sin(0.31 * k), 0.8 * scale * np.sin(0.31 * (k - 2))]
                    log.add(name, 20_000 * k, *(pair * 8)[: columns.count(",") + 1])
        return log.data


@pytest.fixture
def opened(tmp_path):
    def write(*given, **named):
        path = tmp_path / "log.bin"
        path.write_bytes(Made(*given, **named).data())
        return dtm.open_log(path)

    return write


def followed(log):
    return {name: round(loop.followed, 1) for name, loop in log.loops.items() if loop.segments}


PID = "Tar,Act,P,I"


@pytest.mark.parametrize("vibration", [1.0, 100.0])
def test_the_message_of_a_controller_is_taken_where_it_is_logged_faster(opened, vibration):
    # Units are those of the firmware: beside a gyroscope that vibrates any rate is small.
    rate = "RDes,R,ROut"
    gyro = ("IMU", "GyrZ,GyrX", vibration, 1)
    messages = (("RATE", rate, 50.0, 5), ("PIDR", PID, 1.0, 1), gyro)
    loop = opened(COPTER, messages=messages).loops["roll rate"]
    assert loop.setpoint.source == "PIDR.Tar"
    assert loop.response.source == "PIDR.Act"
    assert loop.response.rate == pytest.approx(50.0)
    assert np.abs(loop.setpoint.values).max() == pytest.approx(1.0, abs=0.01)
    assert "behind the filter of the setpoint" in loop.setpoint.conversion
    messages = (("RATE", rate, 50.0, 1), ("PIDR", PID, 1.0, 1), gyro)
    loop = opened(COPTER, messages=messages).loops["roll rate"]
    assert loop.setpoint.source == "RATE.RDes"
    assert np.abs(loop.setpoint.values).max() == pytest.approx(50.0 * DEGREE, abs=0.01)


def test_a_controller_alone_is_a_rate_loop(opened):
    log = opened(COPTER, messages=(("PIDR", PID, 1.0, 1), ("PIDY", PID, 1.0, 1)))
    assert followed(log) == {"roll rate": 6.0, "yaw rate": 6.0}
    # Firmware of 2016 logs no rate in it: half a loop is none.
    assert not opened(COPTER, messages=(("PIDR", "Des,P,I", 1.0, 1),)).loops


def test_an_injected_signal_is_the_setpoint_of_its_axis_alone(opened):
    messages = (("SIDD", "Targ,Gx,F", 10.0, 1), ("ATT", "DesPitch,Pitch", 5.0, 1))
    log = opened(
        COPTER, ((0, 5), (50, 25), (250, 5)), messages, events=((50, 7), (150, 2)), rows=300
    )
    assert followed(log) == {
        "pitch": 6.0,
        "roll rate from the injected signal": 2.0,
        "pitch from the injected signal": 2.0,
    }
    loop = log.loops["roll rate from the injected signal"]
    assert np.array(loop.segments) == pytest.approx(np.array([(1.0, 3.0)]), abs=0.03)
    assert np.abs(loop.setpoint.values).max() == pytest.approx(10.0 * DEGREE, rel=1e-3)
    assert loop.response.source == "SIDD.Gx"


@pytest.mark.parametrize(
    ("axis", "loop"),
    [
        *((axis, name) for first in (1, 4) for axis, name in enumerate(("roll", "pitch"), first)),
        *((axis, f"{name} rate") for axis, name in enumerate(("roll", "pitch", "yaw"), 7)),
    ],
)
def test_an_injected_signal_belongs_to_the_loop_of_its_number(opened, axis, loop):
    # SID_AXIS of ArduPilot: input angles are 1 to 3, recovered angles 4 to 6, rates 7 to 9.
    messages = (
        ("SIDD", "Targ,Gx,Ax,Gy,Ay,Gz", 10.0, 1),
        ("ATT", "DesRoll,Roll,DesPitch,Pitch", 5.0, 1),
    )
    log = opened(COPTER, ((0, 5), (50, 25), (250, 5)), messages, events=((50, axis),), rows=300)
    injected = [name for name in followed(log) if name.endswith("from the injected signal")]
    assert injected == [f"{loop} from the injected signal"]


def test_turn_rate_speed_and_heading_of_a_rover(opened):
    messages = (
        ("STER", "DesTurnRate,TurnRate,SteerOut", 20.0, 1),
        ("THR", "DesSpeed,Speed,ThrOut", 2.0, 1),
        ("NTUN", "DesYaw,Yaw", 30.0, 1),
        ("ATT", "DesYaw,Yaw", 30.0, 1),  # its setpoint is 0 in a rover
    )
    # MANUAL, HOLD, STEERING, AUTO.
    log = opened(ROVER, ((0, 0), (50, 4), (100, 3), (200, 10)), messages)
    assert log.vehicle == "Rover"
    assert followed(log) == {"yaw rate": 4.0, "forward speed": 4.0, "yaw": 2.0}
    assert log.loops["yaw"].setpoint.source == "NTUN.DesYaw"
    assert log.loops["yaw rate"].actuator.source == "STER.SteerOut"
    speed = log.loops["forward speed"]
    assert (speed.kind, speed.response.unit) == ("velocity", "m/s")


def test_attitude_and_rates_of_a_plane_and_of_its_rotors(opened):
    messages = (
        ("ATT", "DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", 20.0, 1),
        ("RATE", "RDes,R,ROut,Spare,YDes,Y", 60.0, 1),
        ("PIDR", PID, 60.0, 1),
        ("PIQP", PID, 1.0, 1),
    )
    # MANUAL, FBWA, QSTABILIZE, QACRO, ACRO: a second each.
    modes = ((0, 0), (50, 5), (100, 17), (150, 23), (200, 4))
    log = opened(PLANE, modes, messages, rows=250)
    assert followed(log) == {
        "roll rate": 2.0,
        "hover roll rate": 2.0,
        "hover pitch rate": 2.0,
        "hover yaw rate": 2.0,
        "roll": 2.0,
        "pitch": 2.0,
        "yaw": 1.0,
    }
    # A plane logs degrees, the controllers of its rotors radians.
    assert np.abs(log.loops["roll rate"].setpoint.values).max() == pytest.approx(1.047, abs=0.01)
    assert np.abs(log.loops["hover pitch rate"].setpoint.values).max() == pytest.approx(1, abs=0.01)


def test_attitude_of_an_old_plane_is_in_its_control_message(opened):
    log = opened(
        PLANE, ((0, 5),), (("CTUN", "NavRoll,Roll", 20.0, 1), ("ATT", "Spare,Roll", 20.0, 1))
    )
    assert log.loops["roll"].setpoint.source == "CTUN.NavRoll"
    assert followed(log) == {"roll": 6.0}


@pytest.mark.parametrize(
    ("named", "vehicle", "mode"),
    [
        ({"firmware": "ArduRover v2.46beta2 (d01fa3bf)"}, "Rover", "HOLD"),
        ({"firmware": "ArduSub V4.1.0 (1)"}, "Sub", "GUIDED"),
        ({"parameters": ("WP_YAW_BEHAVIOR", "LOG_BITMASK")}, "Copter", "GUIDED"),
        ({"parameters": ("KFF_RDDRMIX", "LOG_BITMASK")}, "Plane", "ACRO"),
        ({"parameters": ("CRUISE_SPEED",)}, "Rover", "HOLD"),
        ({"parameters": ("SURFACE_DEPTH",)}, "Sub", "GUIDED"),
        ({"messages": (("CTUN", "NavRoll,Roll", 20.0, 1),)}, "Plane", "ACRO"),
        ({"messages": (("THR", "DesSpeed,Speed", 2.0, 1),)}, "Rover", "HOLD"),
        ({"parameters": ("LOG_BITMASK", "INS_GYRO_FILTER")}, "", "mode 4"),
        ({"parameters": ("CRUISE_SPEED", "KFF_RDDRMIX")}, "", "mode 4"),
    ],
)
def test_a_vehicle_is_told_by_what_only_it_has(opened, named, vehicle, mode):
    # A log without MSG said "mode 6", which closes no loop, where the copter flew RTL.
    still = (("ATT", "DesRoll,Roll", 1.0, 1),)
    log = opened(modes=((0, 4),), **({"messages": still} | named))
    assert (log.vehicle, [name for _, name in log.modes]) == (vehicle, [mode])
    told = [remark for remark in log.remarks if "does not name its vehicle" in remark]
    assert len(told) == (bool(vehicle) and "firmware" not in named)


@pytest.mark.parametrize(
    ("name", "vehicle", "modes"),
    [
        ("rover_2014_61.bin", "Rover", {"MANUAL", "HOLD", "LEARNING"}),
        ("plane_2014_E.bin", "Plane", {"MANUAL", "FBWA", "RTL", "LOITER", "GUIDED"}),
        ("copter_without_msg.bin", "Copter", {"RTL"}),
    ],
)
def test_real_vehicles_are_named(name, vehicle, modes):
    log = dtm.open_log(flight_path(name))
    assert log.vehicle == vehicle
    assert {name for _, name in log.modes} == modes
    if vehicle == "Copter":
        assert log.loops["north position"].followed == pytest.approx(48.4, abs=0.1)
