"""Small logs of autopilots, of at most 4 kB each: a corpus to damage."""

import numpy as np
from blackbox_logs import END, rate_log, rate_rows
from crazyflie_logs import definitions, record, sealed
from made_logs import DataFlash, Tlog, ULogFile, as_text, copter


def small_ulog():
    log = ULogFile()
    log.info("char[3]", "sys_name", b"PX4")
    log.info("char[4]", "ver_hw", b"TEST")
    log.parameter("MC_ROLLRATE_P", 0.15)
    log.topics(
        {
            "vehicle_rates_setpoint": ("roll", "pitch"),
            "vehicle_angular_velocity": ("xyz[0]", "xyz[1]"),
            "vehicle_status": ("arming_state", "nav_state"),
        }
    )
    log.add("vehicle_status", 1.0, 2.0, 2.0)
    for k in range(50):
        log.add("vehicle_rates_setpoint", 1.0 + 0.02 * k, k % 5, 0.0)
        log.add("vehicle_angular_velocity", 1.0 + 0.02 * k, (k - 1) % 5, 0.1)
    log.dropout(30)
    return log.data


def small_text():
    lines = [
        "FMT, 5, 19, ATT, Qcccc, TimeUS,DesRoll,Roll,DesPitch,Pitch",
        "FMT, 3, 15, MODE, QMB, TimeUS,Mode,ModeNum",
        "FMT, 2, 31, PARM, QNf, TimeUS,Name,Value",
        "PARM, 0, ATC_RAT_RLL_P, 0.135",
        "MODE, 1000, ALT_HOLD, 2",
    ]
    lines += [f"ATT, {20_000 * k}, {k % 5}, {(k - 1) % 5}, 1.0, 1.00" for k in range(80)]
    return as_text(lines)


def small_tlog():
    log = Tlog()
    m = log.dialect
    for k in range(30):
        ground, stamp = 1.7e9 + 0.02 * k, 1000 + 20 * k
        if k % 10 == 0:
            log.add(ground, m.MAVLink_heartbeat_message(2, 3, 129, 4, 4, 3))
        log.add(ground, m.MAVLink_attitude_message(stamp, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0), k % 2)
        log.add(ground, m.MAVLink_nav_controller_output_message(k % 5, 0, 0, 0, 0, 0, 0, 0))
    return log.data


def small_blackbox():
    log = rate_log()
    armed, *rest = rate_rows(40, np.random.default_rng(0))
    frames = [log.main(armed), log.slow_frame([1, 0, 0, 1, 1]), *map(log.main, rest)]
    return log.head() + b"".join(frames) + END


def small_crazyflie():
    names = ("controller.rollRate", "gyro.x", "controller.cmd_roll", "stabilizer.thrust")
    events = {1: ("fixedFrequency", list(zip(names, "ffhf", strict=True))), 2: ("mark", [])}
    rows = [(k % 5, (k - 1) % 5, 100 * (k % 7), 4e4) for k in range(120)]
    frames = [record(events, 1, 1_000_000 + 2000 * k, row) for k, row in enumerate(rows)]
    frames.insert(60, record(events, 2, 1_119_000, ()))
    return sealed(definitions(events) + b"".join(frames))


def sdlog2(rows=200, armed=lambda k: 2, landed=lambda k: 0):
    """A log of PX4 before ULog: a message TIME before all that are logged together."""
    log = DataFlash()
    log.define("TIME", 0x81, "Q", "StartTime")
    log.define("VER", 0x82, "NZ", "Arch,FwGit")
    log.define("PARM", 0x83, "Nf", "Name,Value")
    log.define("ATT", 2, "ffffff", "Roll,Pitch,Yaw,RollRate,PitchRate,YawRate")
    log.define("ATSP", 3, "ffff", "RollSP,PitchSP,YawSP,ThrustSP")
    log.define("ARSP", 4, "fff", "RollRateSP,PitchRateSP,YawRateSP")
    log.define("LPOS", 5, "ff", "Z,VZ")
    log.define("GVSP", 6, "fff", "VX,VY,VZ")
    log.define("STAT", 7, "BBB", "MainState,ArmState,Landed")
    log.add("VER", "PX4FMU_V2", "0123456789abcdef")
    log.add("PARM", "MC_ROLLRATE_P", 0.15)
    for k in range(rows):
        log.add("TIME", 20_000_000 + 20_000 * k)
        if k % 10 == 0:
            log.add("STAT", 0 if k < 50 else 2 if k < 150 else 4, armed(k), landed(k))
        asked, came = float(k % 50 >= 10), 0.9 * (k % 50 >= 13)
        log.add("ATT", came, came, came, came, came, came)
        log.add("ATSP", asked, asked, asked, 0.5)
        log.add("ARSP", asked, asked, asked)
        log.add("LPOS", came, came)
        log.add("GVSP", 0.0, 0.0, asked)
    return log


SMALL = {
    "ULog": ("pyulog", small_ulog),
    "DataFlash": ("numpy", lambda: copter(60).data),
    "DataFlash text": ("numpy", small_text),
    "sdlog2": ("numpy", lambda: sdlog2(22).data),
    "tlog": ("pymavlink", small_tlog),
    "Blackbox": ("numpy", small_blackbox),
    "Crazyflie uSD": ("numpy", small_crazyflie),
}
