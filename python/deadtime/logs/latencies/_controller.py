"""How often an autopilot computes its commands, by the parameters of a log."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from deadtime.logs._log import Log, LogLoop
from deadtime.logs._names import Kind
from deadtime.logs._recording import moves
from deadtime.logs._series import Series
from deadtime.logs._windows import outside, shared

#: What is followed: the setpoint of the loop, or what its controller commands.
Command: TypeAlias = Literal["setpoint", "actuator"]

#: Whether commands hold from row to row of a log, or move in straight lines.
Between: TypeAlias = Literal["held", "lines"]

#: Rows further apart than this many periods do not hold each command.
EACH = 1.5

#: Longest part of a recording of each kind of loop, s, and the share of it in which a response
#: settles after commands that are unknown.
LENGTHS, SETTLES = {"rate": 4.0, "attitude": 8.0, "velocity": 12.0, "position": 20.0}, 0.05

#: Rates of a Crazyflie's loops by their kind, Hz, which its firmware fixes.
CRAZYFLIE = {"rate": 500.0, "attitude": 500.0, "velocity": 100.0, "position": 100.0}

#: Least rate of PX4's loops of velocity and position, Hz: that of its estimates.
PX4_OUTER = 50.0


class Period(NamedTuple):
    """The time between commands, s, what tells it, and whether it may be shorter."""

    time: float
    source: str
    at_most: bool = False


def period_of(log: Log, kind: Kind) -> Period | None:
    """The period of the controller of a loop, if it is known."""
    told = log.parameters
    if log.autopilot == "PX4" and kind in ("velocity", "position"):
        return Period(1.0 / PX4_OUTER, f"at least {PX4_OUTER:g} Hz", True)
    if log.autopilot == "Crazyflie":
        return Period(1.0 / CRAZYFLIE[kind], f"{CRAZYFLIE[kind]:g} Hz of the firmware")
    for name in ("SCHED_LOOP_RATE", "IMU_GYRO_RATEMAX"):
        if told.get(name, 0.0) > 0.0:
            return Period(1.0 / told[name], f"{name} {told[name]:g}")
    steps = max(told.get("pid_process_denom", 1.0), 1.0)
    if log.autopilot in ("Betaflight", "INAV") and told.get("looptime", 0.0) > 0.0:
        time = told["looptime"] * steps
        return Period(1e-6 * time, f"looptime {told['looptime']:g} µs, times {steps:g}")
    return None


def hold_of(log: Log, kind: Kind) -> tuple[float, float]:
    """Half the time for which a command holds, and by how much that may be wrong, s."""
    period = period_of(log, kind)
    if period is None:
        return 0.0, 0.0
    half = 0.5 * period.time
    return (0.5 * half, 0.5 * half) if period.at_most else (half, 0.0)


def known_commands(log: Log, loop: LogLoop, command: Command, between: Between | None) -> LogLoop:
    """The loop with commands at the times from which they act, where it answers to known ones.

    A command that is computed more often than it is logged holds for a period of the controller,
    and lines between its rows are half of that early. After a pause in its rows, the response
    still answers to commands that are not in the log.
    """
    told = loop.signals[command]
    if between == "lines":
        told = replace(told, time=told.time + hold_of(log, loop.kind)[0])
    settles = SETTLES * LENGTHS[loop.kind]
    pauses = [(low, high + settles) for low, high in sorted([*told.gaps, *log.gaps])]
    kept = tuple(shared(list(loop.segments), outside(pauses)))
    if command == "setpoint":
        return replace(loop, segments=kept, setpoint=told)
    return replace(loop, segments=kept, actuator=told)


#: Share of the variance of a command, off the line between its neighbours, from which it is rough;
#: rows below which a rough one tells no time; fewest rows for that.
ROUGH, ROWS, FEWEST = 0.05, 2.0, 8


def between_rows(log: Log, kind: Kind, told: Series) -> Between | None:
    """Whether commands hold between the rows of a log; None where that is not known."""
    if not moves(told):
        return "held"
    period = period_of(log, kind)
    if period is None:
        return None
    return "held" if told.period < EACH * period.time else "lines"


def hidden_between_rows(told: Series, between: Between | None, start: float, stop: float) -> float:
    """A time that rows of a command are too far apart to tell, s; zero where they tell all.

    A command that moves between the rows of a log is taken for straight lines. Where a row is often
    far from the line between its neighbours, lines are not what the vehicle was told.
    """
    rows = (told.time >= start) & (told.time <= stop) & np.isfinite(told.values)
    values = told.values[rows]
    if between == "held" or values.size < FEWEST:
        return 0.0
    time = told.time[rows]
    trend = np.polynomial.Polynomial.fit(time, values, 1)(time)
    off = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    rough = float(np.mean(off**2)) > ROUGH * float(np.mean((values - trend) ** 2))
    return ROWS * told.period if rough else 0.0


def smeared(log: Log, kind: Kind, told: Series, start: float, stop: float) -> float:
    """How far lines between rows may move commands in time, s, by one standard deviation.

    A change of the command comes at any time between two rows, but for the period of the controller
    before the later one. Of n changes of like size the mean is known to that time over sqrt(12 n).
    """
    period = period_of(log, kind)
    rows = (told.time >= start) & (told.time <= stop) & np.isfinite(told.values)
    squares = np.diff(told.values[rows]) ** 2
    if period is None or not np.any(squares):
        return 0.0
    count = float(np.sum(squares) ** 2 / np.sum(squares**2))
    return max(0.0, told.period - period.time) / math.sqrt(12.0 * count)
