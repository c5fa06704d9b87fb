"""How commands pass between the rows of a log, by how often an autopilot computes them."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from deadtime.logs._log import Log
from deadtime.logs._names import Kind
from deadtime.logs._series import Series

#: What is followed: the setpoint of the loop, or what its controller commands.
Command: TypeAlias = Literal["setpoint", "actuator"]

#: Whether commands hold between the rows of a log, or are straight.
Between: TypeAlias = Literal["held", "straight"]

#: Rows further apart than this many periods do not hold each command.
EACH = 1.5

#: Rates of a Crazyflie's loops by their kind, Hz, which its firmware fixes.
CRAZYFLIE = {"rate": 500.0, "attitude": 500.0, "velocity": 100.0, "position": 100.0}

#: Least rate of PX4's loops of velocity and position, that of its estimates, and least rate of the
#: loops of any autopilot, Hz.
PX4_OUTER, LEAST = 50.0, 50.0


class Period(NamedTuple):
    """The time between commands, s, what tells it, and whether it may be shorter."""

    time: float
    source: str
    at_most: bool = False


class Sampling(NamedTuple):
    """How commands pass between the rows of a log.

    Attributes
    ----------
    between : {"held", "straight"}
        Held where each command is logged; straight where the log holds some of them.
    hold : float
        For how long the controller holds each command, s; 0 where each is logged.
    unsure : float
        By how much the time from command to response may be wrong where that is not known, s.
    """

    between: Between
    hold: float = 0.0
    unsure: float = 0.0


def period_of(log: Log, kind: Kind) -> Period | None:
    """The period of the controller of a loop, if it is known."""
    parameters = log.parameters
    if log.autopilot == "PX4" and kind in ("velocity", "position"):
        return Period(1.0 / PX4_OUTER, f"at least {PX4_OUTER:g} Hz", True)
    if log.autopilot == "Crazyflie":
        return Period(1.0 / CRAZYFLIE[kind], f"{CRAZYFLIE[kind]:g} Hz, the rate of the firmware")
    for name in ("SCHED_LOOP_RATE", "IMU_GYRO_RATEMAX"):
        if parameters.get(name, 0.0) > 0.0:
            return Period(1.0 / parameters[name], f"{name} {parameters[name]:g}")
    steps = max(parameters.get("pid_process_denom", 1.0), 1.0)
    if log.autopilot in ("Betaflight", "INAV") and parameters.get("looptime", 0.0) > 0.0:
        time = parameters["looptime"] * steps
        return Period(1e-6 * time, f"looptime of {parameters['looptime']:g} µs, times {steps:g}")
    return None


def sampling_of(log: Log, kind: Kind, command: Series) -> Sampling:
    """How the commands of a loop pass between its rows.

    A setpoint that a ground station sends is logged each time. Where the period of the controller
    is known only to be less than a bound, half of that is taken.
    """
    if command.source.startswith("SET_"):
        return Sampling("held")
    period = period_of(log, kind)
    if period is None or period.at_most:
        most = min(command.period, 1.0 / LEAST if period is None else period.time)
        return Sampling("straight", 0.5 * most, 0.25 * most)
    if command.period < EACH * period.time:
        return Sampling("held")
    return Sampling("straight", period.time)


def averaged(sampling: Sampling, together: int) -> Sampling:
    """How commands pass between rows where so many of them are averaged."""
    if together == 1 or sampling.between == "straight":
        return sampling
    return Sampling("straight", 0.0, sampling.unsure)
