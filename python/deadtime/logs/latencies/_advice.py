"""What to log and to fly to know more: a table for each autopilot, with its exact settings.

Each rule says when it applies, what to set, and which page of the autopilot's documentation names
the setting. Bits and defaults are those of the pages of 2025 and 2026.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple, TypeAlias

from deadtime._base.digits import shown
from deadtime.logs._log import Log, LogLoop
from deadtime.logs.latencies._advice_facts import WANTED, Facts, share_of
from deadtime.logs.latencies._promise import promises_of

#: Moves that are asked for at least and at most, and how long each is held, in times of the loop.
FEWEST, MOST, HELD = 12, 60, 4.0

#: Most lines.
LINES = 5

#: Rate of a Blackbox log that tells a rate loop well, Hz: more fills flash and leaves gaps.
BLACKBOX = 1000.0

#: Bits of ArduPilot's LOG_BITMASK: attitude and rates in each loop of a Copter, and at 25 Hz in a
#: Plane; raw IMU; attitude in each loop of a Plane.
FAST, RAW_IMU, FULL_RATE = 1 << 0, 1 << 19, 1 << 20

#: Bits of PX4's SDLOG_PROFILE: the default set, system identification, high rate.
DEFAULT_SET, IDENTIFICATION, HIGH_RATE = 1 << 0, 1 << 3, 1 << 4

#: The first firmware of ArduPilot with system identification, and of Betaflight with settings for
#: each field and with a chirp.
SYSTEM_ID, FIELDS, CHIRP = (4, 0), (4, 3), (2025, 12)

#: Axes of ArduPilot's system identification by loop: added to the angle or to the rate asked for.
SID_AXES = {
    "roll": 1, "pitch": 2, "yaw": 3, "roll rate": 7, "pitch rate": 8, "yaw rate": 9,
}  # fmt: skip


#: What to set or to fly, and the page that names it.
Said: TypeAlias = Iterator[tuple[str, str]]


class Advice(NamedTuple):
    """One thing to set or to fly, and the page that names it."""

    text: str
    page: str

    def line(self) -> str:
        """Both in one line."""
        return f"{self.text} ({self.page})" if self.page else self.text


def advice(log: Log, loops: Iterable[str] | None = None) -> tuple[Advice, ...]:
    r"""What to log and to fly to know the times of a vehicle better.

    Parameters
    ----------
    log : Log
        A log of it.
    loops : iterable of str, optional
        The loops that matter, by their names; by default all.

    Returns
    -------
    tuple of Advice
        At most five, the most useful first; none where the log tells all loops well.

    Raises
    ------
    ValueError
        When the log has no loop of such a name.

    Examples
    --------
    >>> import deadtime as dtm, pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "flight.log"
    >>> lines = ["FMT, 1, 23, ATT, Qcc, TimeUS,DesRoll,Roll"]
    >>> lines += [f"ATT, {k * 100000}, {k % 20 // 10}, {(k - 1) % 20 // 10}" for k in range(80)]
    >>> _ = file.write_text("\n".join(lines))
    >>> log = dtm.open_log(file)
    >>> [suggestion.text.partition(":")[0] for suggestion in dtm.logs.advice(log)]
    ['roll']
    """
    chosen = list(log.loops.values()) if loops is None else [log.loop(name) for name in loops]
    facts = Facts(log, chosen, promises_of(log))
    rules = RULES.get(log.autopilot)
    found = [Advice(*entry) for entry in rules(facts)] if rules else []
    if (loop := facts.worst()) is not None:
        found.append(Advice(_flown(loop, facts), ""))
    return tuple(found[:LINES])


def _with(name: str, bit: int, facts: Facts) -> str:
    """The parameter with that bit."""
    now = int(facts.settings.get(name, 0.0))
    return f"{name} = {now | bit} (now {now})"


def _flown(loop: LogLoop, facts: Facts) -> str:
    """How to fly the loop that is known worst."""
    promise = facts.promises[loop.name]
    if not math.isfinite(promise.stderr):
        return (
            f"{loop.name}: move the setpoint, because in this log the response follows "
            "almost no part of it"
        )
    more = max(promise.changes, 1.0) * (share_of(promise) / WANTED) ** 2
    count = int(min(max(math.ceil(more), FEWEST), MOST))
    held = shown(HELD * promise.time, promise.time, "s")
    return (
        f"{loop.name}: fly {count} quick changes of the setpoint with different sizes, and hold "
        f"each for {held} or longer. This log gives {promise.short()}"
    )


def _sid(facts: Facts) -> str:
    """The chirp of ArduPilot for the loop that is known worst."""
    loop = facts.worst(*SID_AXES)
    name = "roll rate" if loop is None else loop.name
    return (
        f"SID_AXIS = {SID_AXES[name]} ({name}), SID_MAGNITUDE = 15, SID_F_START_HZ = 0.5, "
        "SID_F_STOP_HZ = 10, SID_T_REC = 70, then fly mode System ID (25)"
    )


def _missing(facts: Facts) -> list[str]:
    """Fields that a Blackbox log lacks, by the names of their settings."""
    main = facts.log.contents.topics.get("main")
    columns = "" if main is None else " ".join(main.columns)
    fields = {"setpoint": "setpoint[", "gyro": "gyroADC[", "pids": "axisP["}
    return [name for name, column in fields.items() if column not in columns]


def _sampled(facts: Facts) -> str:
    """The sample rate of Blackbox that gives about a thousand rows a second."""
    steps = max(facts.settings.get("pid_process_denom", 1.0), 1.0)
    period = 1e-6 * facts.settings.get("looptime", 125.0) * steps
    share = 2 ** max(0, min(4, math.floor(math.log2(max(1.0 / (period * BLACKBOX), 1.0)))))
    return (
        f"set blackbox_sample_rate = 1/{share}, to log {1.0 / (period * share):.0f} rows per second"
    )


def _ardupilot(facts: Facts) -> Said:
    if facts.is_slow and facts.plane and facts.lacks("LOG_BITMASK", FULL_RATE):
        words = (
            f"{_with('LOG_BITMASK', FULL_RATE, facts)}, to log the attitude in each cycle of the "
            "loop"
        )
        yield words, "ArduPilot: Parameters, LOG_BITMASK"
    elif facts.is_slow and not facts.plane and facts.lacks("LOG_BITMASK", FAST):
        words = (
            f"{_with('LOG_BITMASK', FAST, facts)}, to log ATT and RATE in each cycle of the loop"
        )
        yield words, "ArduPilot: Parameters, LOG_BITMASK"
    most = facts.settings.get("LOG_FILE_RATEMAX", 0.0)
    if facts.is_slow and most > 0.0:
        words = f"LOG_FILE_RATEMAX = 0 (now {most:g} Hz): every row"
        yield words, "ArduPilot: Parameters, LOG_FILE_RATEMAX"
    if facts.worst(*SID_AXES) is not None and facts.version >= SYSTEM_ID and not facts.plane:
        yield _sid(facts), "ArduPilot: System ID Mode Operation"
    if facts.lacks("LOG_BITMASK", RAW_IMU) and any(loop.kind == "rate" for loop in facts.loops):
        words = (
            f"{_with('LOG_BITMASK', FAST | RAW_IMU, facts)}, to log also the raw IMU that the "
            "filters read"
        )
        yield words, "ArduPilot: Measuring Vibration with IMU Batch Sampler"


def _px4(facts: Facts) -> Said:
    if not facts.is_slow:
        return
    if facts.lacks("SDLOG_PROFILE", HIGH_RATE):
        yield (
            f"{_with('SDLOG_PROFILE', DEFAULT_SET | HIGH_RATE, facts)}, to log rates, attitude "
            "and actuators whenever they are computed",
            "PX4: Logging, SDLOG_PROFILE",
        )
    if facts.lacks("SDLOG_PROFILE", IDENTIFICATION | HIGH_RATE):
        yield (
            "if the card is too slow for this, "
            f"{_with('SDLOG_PROFILE', DEFAULT_SET | IDENTIFICATION, facts)}, to log only "
            "actuators and IMU",
            "PX4: Logging, SDLOG_PROFILE",
        )
    mode = facts.settings.get("SDLOG_MODE", 0.0)
    if mode not in (0.0, 3.0):
        yield (
            f"SDLOG_MODE = 0 (now {mode:g}): from arming to disarming, which leaves room for more "
            "rows",
            "PX4: Logging, SDLOG_MODE",
        )


def _betaflight(facts: Facts) -> Said:
    if missing := _missing(facts):
        words = ", ".join(f"set blackbox_disable_{name} = OFF" for name in missing)
        if facts.version < FIELDS:
            words = (
                f"this firmware does not log {', '.join(missing)}: update to version 4.3 or later"
            )
        yield words, "Betaflight: CLI commands, blackbox_disable_*"
    if _is_rare(facts):
        yield _sampled(facts), "Betaflight: CLI commands, blackbox_sample_rate"
    if facts.version >= CHIRP:
        yield (
            "set debug_mode = CHIRP, chirp_amplitude_roll = 230, chirp_amplitude_pitch = 230, "
            "chirp_amplitude_yaw = 180, chirp_time_seconds = 20, and fly with CHIRP on a switch",
            "Betaflight: 2025.12 Release Notes, Chirp",
        )


def _inav(facts: Facts) -> Said:
    if _is_rare(facts):
        words = (
            "set blackbox_rate_num = 1 and blackbox_rate_denom = 1, to log each cycle of the loop"
        )
        yield words, "INAV: Blackbox"


def _is_rare(facts: Facts) -> bool:
    """Whether Blackbox leaves out most rows of a loop."""
    return any(loop.setpoint.rate < 0.4 * BLACKBOX for loop in facts.loops)


def _crazyflie(facts: Facts) -> Said:
    page = "Bitcraze: Micro SD card deck"
    if not facts.log.loops:
        yield (
            "log each setpoint with its response: controller.rollRate and gyro.x, "
            "controller.roll and stateEstimate.roll, ctrltarget.z and stateEstimate.z",
            page,
        )
    if facts.is_slow or not facts.log.loops:
        words = (
            "on:fixedFrequency, 500, 1 in config.txt, to log at 500 Hz, the rate of the stabilizer"
        )
        yield words, page


RULES: Mapping[str, Callable[[Facts], Said]] = {
    "ArduPilot": _ardupilot,
    "PX4": _px4,
    "Betaflight": _betaflight,
    "INAV": _inav,
    "Crazyflie": _crazyflie,
}
