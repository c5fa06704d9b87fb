"""Two signals of a flight as a file of each format, in deg or deg/s."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from blackbox_logs import END, SIGNED, TAGGED_3, UNSIGNED, Log
from flown_cases import Case
from made_logs import DataFlash, Tlog, ULogFile
from numpy.typing import NDArray

Array = NDArray[np.float64]
Writer = Callable[[Case, Array, Array, Array, Array, np.random.Generator], bytes]

#: When a log begins on the clock of the vehicle, s, and on that of a ground station.
START, GROUND = 10.0, 1.7e9

#: Shortest and longest way of a message to the ground station, s.
LINK = (0.02, 0.08)


def _microseconds(times: Array) -> list[int]:
    return [int(at) for at in np.round(1e6 * (START + times))]


def data_flash(
    case: Case, asked_at: Array, setpoint: Array, _: Array, response: Array, __: np.random.Generator
) -> bytes:
    """ArduPilot: ATT in centidegrees, RATE in floats."""
    log = DataFlash()
    log.define("MSG", 1, "QZ", "TimeUS,Message")
    log.define("PARM", 2, "QNf", "TimeUS,Name,Value")
    log.define("MODE", 3, "QMB", "TimeUS,Mode,ModeNum")
    log.define("EV", 4, "QB", "TimeUS,Id")
    log.add("MSG", 0, "ArduCopter V4.5.7 (01234567)")
    log.add("MSG", 0, "Frame: QUAD/X")
    log.add("PARM", 0, "SCHED_LOOP_RATE", case.controller)
    log.add("MODE", 1000, 2, 2)
    log.add("EV", 1000, 10)
    log.add("EV", 2000, 28)
    times = _microseconds(asked_at)
    if case.loop == "roll":
        log.define("ATT", 5, "Qcc", "TimeUS,DesRoll,Roll")
        log.add_rows(
            "ATT", times, *(np.rint(100.0 * each).astype(int) for each in (setpoint, response))
        )
    else:
        log.define("RATE", 5, "Qff", "TimeUS,RDes,R")
        log.add_rows("RATE", times, setpoint, response)
    return log.data


def ulog(
    case: Case, asked_at: Array, setpoint: Array, read_at: Array, response: Array,
    _: np.random.Generator,
) -> bytes:  # fmt: skip
    """PX4: a topic for each signal; angles as quaternions."""
    log = ULogFile()
    log.info("char[3]", "sys_name", b"PX4")
    log.parameter("IMU_GYRO_RATEMAX", case.controller)
    asked, found = np.radians(setpoint), np.radians(response)
    if case.loop == "roll":
        names = ("vehicle_attitude_setpoint", "vehicle_attitude")
        columns = [[f"{name}[{k}]" for k in range(4)] for name in ("q_d", "q")]
        asked, found = _quaternions(asked), _quaternions(found)
    else:
        names = ("vehicle_rates_setpoint", "vehicle_angular_velocity")
        columns = [["roll"], ["xyz[0]"]]
        asked, found = asked[:, None], found[:, None]
    log.topics(
        dict(zip(names, columns, strict=True)) | {"vehicle_status": ("arming_state", "nav_state")}
    )
    log.add("vehicle_status", START, 2.0, 2.0)
    log.add_rows(names[0], START + asked_at, asked)
    log.add_rows(names[1], START + read_at, found)
    return log.data


def _quaternions(angles: Array) -> Array:
    """Rolls as quaternions, shape (n, 4)."""
    none = np.zeros(angles.size)
    return np.stack([np.cos(0.5 * angles), np.sin(0.5 * angles), none, none], axis=1)


def blackbox(
    case: Case, asked_at: Array, setpoint: Array, _: Array, response: Array,
    random: np.random.Generator,
) -> bytes:  # fmt: skip
    """Betaflight: whole deg/s; the time of a loop is some microseconds off its plan."""
    fields = [(f"{name}[0]", 1, (0, SIGNED), (1, SIGNED)) for name in ("setpoint", "gyroADC")]
    slow = [
        ("flightModeFlags", 0, (0, UNSIGNED)),
        ("stateFlags", 0, (0, UNSIGNED)),
        *((name, 0, (0, TAGGED_3)) for name in ("failsafePhase", "rxSignalReceived", "valid")),
    ]
    every = round(case.controller / case.rows[0])
    lines = {"looptime": round(1e6 / case.controller), "pid_process_denom": 1}
    log = Log(fields=fields, slow=slow, lines=lines, logged=f"1/{every}", interval=32 * every)
    iterations = every * np.arange(asked_at.size)
    times = np.array(_microseconds(asked_at)) + random.integers(-2, 3, asked_at.size)
    columns = [iterations, times, *(np.rint(each).astype(int) for each in (setpoint, response))]
    first, *rest = map(list, zip(*(each.tolist() for each in columns), strict=True))
    frames = [log.main(first), log.slow_frame([1, 0, 0, 1, 1]), *map(log.main, rest)]
    return log.head() + b"".join(frames) + END


def tlog(
    case: Case, asked_at: Array, setpoint: Array, read_at: Array, response: Array,
    random: np.random.Generator,
) -> bytes:  # fmt: skip
    """ArduPilot over a link: ATTITUDE_TARGET and ATTITUDE, stamped in whole ms."""
    log = Tlog()
    m = log.dialect

    def stamped(at: float) -> int:
        return int(1e3 * (START + at) + 1e-6)

    sent = [(0.0, m.MAVLink_param_value_message(b"SCHED_LOOP_RATE", case.controller, 9, 1, 0))]
    sent += [
        (float(at), m.MAVLink_heartbeat_message(2, 3, 129, 2, 4, 3))
        for at in np.arange(0.0, case.seconds)
    ]
    for at, angles in zip(asked_at.tolist(), _quaternions(np.radians(setpoint)), strict=True):
        message = m.MAVLink_attitude_target_message(stamped(at), 7, angles, 0.0, 0.0, 0.0, 0.5)
        sent.append((at, message))
    for at, angle in zip(read_at.tolist(), np.radians(response).tolist(), strict=True):
        sent.append((at, m.MAVLink_attitude_message(stamped(at), angle, 0.0, 0.0, 0.0, 0.0, 0.0)))
    sent.sort(key=lambda each: each[0])
    received = np.maximum.accumulate([at + random.uniform(*LINK) for at, _ in sent])
    for at, (_, message) in zip(received.tolist(), sent, strict=True):
        log.add(GROUND + at, message)
    return log.data


#: What writes each format.
WRITERS: dict[str, Writer] = {
    "DataFlash": data_flash,
    "ULog": ulog,
    "Blackbox": blackbox,
    "tlog": tlog,
}

#: How the file of each format is called.
SUFFIXES = {"DataFlash": ".bin", "ULog": ".ulg", "Blackbox": ".bbl", "tlog": ".tlog"}
