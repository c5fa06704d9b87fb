"""Thirty cases of logs whose truth is known: what flew, how it was asked, and what was logged."""

from __future__ import annotations

from dataclasses import dataclass

Ends = tuple[float, float]

#: Delay and lag of each kind of vehicle, s: a rate loop of a racer, rate and attitude of copters,
#: and attitude of a large or slow one.
RACER = ((0.002, 0.008), (0.005, 0.020))
COPTER = ((0.005, 0.025), (0.015, 0.060))
ANGLE = ((0.015, 0.060), (0.060, 0.250))
LARGE = ((0.030, 0.120), (0.150, 0.500))

#: Names of loops.
ROLL, RATE = "roll", "roll rate"

#: Deviation of noise as a share of the size of the setpoint: of a good sensor, and of a poor one.
QUIET, LOUD = (0.005, 0.03), (0.03, 0.15)

#: Damping of pairs of poles: well damped, and ringing.
DAMPED, RINGING = (0.7, 0.95), (0.45, 0.55)


@dataclass(frozen=True)
class Case:
    """Ranges from which the logs of one case are drawn.

    Attributes
    ----------
    writer : str
        ``"DataFlash"``, ``"ULog"``, ``"Blackbox"`` or ``"tlog"``.
    loop : str
        ``"roll rate"``, in deg/s, or ``"roll"``, in deg.
    controller, sensor : float
        Hz at which setpoints are computed, and at which the sensor is read.
    rows : (float, float)
        Hz at which setpoint and response are logged; both in one message where its format has it.
    seconds : float
        Length of the log.
    sticks : str
        Key of `flown_sticks.STICKS`.
    pace, rest : float
        Mean time between changes, s, and share of the time at rest.
    plant : str
        Key of `flown_plants.FREE`.
    vehicle : pair of pairs
        Ranges of delay and lag, s.
    noise : (float, float)
        Range of the white deviation, as a share of the size of the setpoint.
    colour, gust, vibration : float
        Largest deviation of these, as a share of the same.
    lost : float
        Share of the rows that are lost: half of it one by one, half in pauses.
    damping : (float, float)
        Range of the damping of a pair of poles.
    size : float
        Deviation of the setpoint in a burst, deg or deg/s.
    """

    writer: str
    loop: str
    controller: float
    sensor: float
    rows: Ends
    seconds: float
    sticks: str
    pace: float
    rest: float
    plant: str
    vehicle: tuple[Ends, Ends]
    noise: Ends
    colour: float = 0.0
    gust: float = 0.0
    vibration: float = 0.0
    lost: float = 0.0
    damping: Ends = DAMPED
    size: float = 10.0

    @property
    def name(self) -> str:
        """What it is, for people: format, loop, rows of setpoint and response in Hz, sticks."""
        asked, read = (f"{each:g}" for each in self.rows)
        rows = asked if self.together else f"{asked}/{read}"
        return f"{self.writer} {self.loop} {rows} {self.sticks}"

    @property
    def together(self) -> bool:
        """Whether both signals are in one message."""
        return self.writer in ("DataFlash", "Blackbox")


#: Deviation of setpoints: deg of an attitude, deg/s of a rate, and that of a racer.
SIZES, RACING = {ROLL: 10.0, RATE: 60.0}, 200.0

#: Rate of the estimate of attitude in PX4, Hz, and least rate at which its sensor is read.
ESTIMATES, SENSOR = 250.0, 400.0


def _flash(loop: str, rows: float, *others, **more) -> Case:
    """ArduPilot at 400 Hz: both signals in one message."""
    return Case(
        "DataFlash", loop, 400.0, 400.0, (rows, rows), *others, size=SIZES[loop], **more
    )  # fmt: skip


def _ulog(loop: str, controller: float, rows: Ends, *others, **more) -> Case:
    """PX4: each signal in a topic of its own."""
    sensor = ESTIMATES if loop == ROLL else max(controller, SENSOR)
    return Case("ULog", loop, controller, sensor, rows, *others, size=SIZES[loop], **more)


def _box(controller: float, rows: float, *others, **more) -> Case:
    """Betaflight: both signals in one frame, in whole deg/s."""
    return Case(
        "Blackbox", RATE, controller, controller, (rows, rows), *others, size=RACING, **more
    )  # fmt: skip


def _tlog(controller: float, rows: Ends, *others, **more) -> Case:
    """Messages of a link, stamped in ms."""
    return Case("tlog", ROLL, controller, controller, rows, *others, size=SIZES[ROLL], **more)


# fmt: off
CASES: tuple[Case, ...] = (
    # loop, rows Hz, seconds, sticks, pace, rest, plant, vehicle, noise
    _flash(ROLL, 10, 120, "smooth", 1.5, 0.3, "pair", ANGLE, QUIET, gust=0.1),
    _flash(ROLL, 10, 120, "jumps", 2.0, 0.0, "lags", LARGE, QUIET),
    _flash(ROLL, 24, 120, "smooth", 1.0, 0.7, "pair", ANGLE, QUIET, gust=0.2),
    _flash(ROLL, 25, 90, "jumps", 1.0, 0.3, "pair", ANGLE, QUIET, gust=0.1),
    _flash(ROLL, 50, 60, "doublets", 0.8, 0.5, "lag", ANGLE, LOUD, colour=0.1),
    _flash(ROLL, 100, 60, "smooth", 1.0, 0.2, "lags", ANGLE, QUIET, gust=0.4),
    _flash(ROLL, 400, 40, "jumps", 0.8, 0.3, "pair", ANGLE, QUIET, gust=0.2),
    _flash(RATE, 10, 120, "smooth", 0.8, 0.3, "lag", COPTER, LOUD),
    _flash(RATE, 24, 120, "smooth", 0.5, 0.6, "pair", COPTER, LOUD, gust=0.1),
    _flash(RATE, 25, 90, "jumps", 0.5, 0.2, "lag", COPTER, QUIET, lost=0.05),
    _flash(RATE, 50, 90, "chirp", 0.3, 0.1, "pair", COPTER, LOUD, damping=RINGING),
    _flash(RATE, 100, 60, "doublets", 0.3, 0.5, "pair and zero", COPTER, QUIET, gust=0.2),
    _flash(RATE, 400, 60, "chirp", 0.2, 0.1, "pair", COPTER, LOUD, colour=0.1, gust=0.1),
    _flash(RATE, 400, 40, "smooth", 0.4, 0.4, "lags", COPTER, LOUD, vibration=0.2),
    # loop, controller Hz, rows Hz (setpoint, response), seconds, …
    _ulog(ROLL, 250, (5, 20), 120, "smooth", 1.5, 0.2, "pair", LARGE, QUIET, gust=0.1),
    _ulog(ROLL, 250, (20, 20), 120, "jumps", 1.2, 0.4, "lags", ANGLE, QUIET, lost=0.03),
    _ulog(ROLL, 250, (50, 100), 60, "smooth", 0.8, 0.3, "pair and zero", ANGLE, QUIET, gust=0.2),
    _ulog(ROLL, 250, (250, 250), 40, "doublets", 0.8, 0.5, "pair", ANGLE, QUIET, gust=0.3),
    _ulog(RATE, 400, (20, 50), 90, "smooth", 0.5, 0.3, "lag", COPTER, LOUD, gust=0.1),
    _ulog(RATE, 800, (50, 50), 60, "jumps", 0.4, 0.3, "lags", COPTER, LOUD, colour=0.1),
    _ulog(RATE, 1000, (100, 200), 60, "smooth", 0.4, 0.7, "pair", COPTER, LOUD, gust=0.2),
    _ulog(RATE, 1000, (1000, 1000), 30, "jumps", 0.4, 0.3, "pair", COPTER, LOUD, colour=0.2),
    # controller Hz, rows Hz, seconds, …
    _box(1000, 250, 60, "smooth", 0.4, 0.3, "lag", RACER, QUIET, gust=0.1),
    _box(2000, 500, 40, "jumps", 0.3, 0.3, "pair", RACER, QUIET, gust=0.1, vibration=0.05),
    _box(8000, 1000, 30, "smooth", 0.3, 0.2, "lags", RACER, QUIET, gust=0.1, colour=0.03),
    _box(2000, 2000, 30, "doublets", 0.2, 0.5, "pair", RACER, QUIET, gust=0.2, damping=RINGING),
    # controller Hz, rows Hz (setpoint, response), seconds, …
    _tlog(400, (4, 4), 120, "smooth", 2.0, 0.1, "lag", LARGE, QUIET, gust=0.05),
    _tlog(400, (4, 10), 120, "jumps", 2.0, 0.2, "pair", LARGE, QUIET, gust=0.1, lost=0.05),
    _tlog(400, (10, 10), 120, "smooth", 1.2, 0.3, "pair", ANGLE, QUIET, gust=0.1),
    _tlog(250, (20, 20), 90, "jumps", 1.0, 0.3, "lags", ANGLE, QUIET, lost=0.05),
)
# fmt: on
