"""What a log file holds, in its own names and units, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from deadtime._base.arrays import Array
from deadtime.logs._link import Link


@dataclass(frozen=True, eq=False)
class Topic:
    """One series of messages.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds on the vehicle's clock, as logged: it may repeat or go back.
    columns : mapping of str to ndarray, shape (n,)
        Values by their names in the log; NaN where a message has none.
    units : mapping of str to str
        Units of columns, where the log tells them.
    """

    time: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LogContents:
    """What a reader makes of a log file.

    Attributes
    ----------
    format : str
        For example ``"ULog"``.
    autopilot : str
        ``"PX4"``, ``"ArduPilot"``, ``"Betaflight"``, ``"INAV"``, ``"Crazyflie"``, or empty.
    vehicle, firmware : str
        As the log tells, or empty.
    topics : mapping of str to Topic
        An instance of a topic that has several is named ``"topic[1]"``, the first ``"topic"``.
    parameters : mapping of str to float
        Parameters of the autopilot, and numbers of the header.
    modes : tuple of (float, str)
        Flight modes, each with the time from which it holds, s.
    remarks : tuple of str
        What was damaged or left out, in sentences.
    span : (float, float), optional
        First and last time of the log, s, where its header or its index tells; otherwise those of
        the topics.
    gaps : tuple of (float, float)
        Where the logger lost data: start and stop, s.
    link : Link, optional
        The way of the messages to the ground station that logged them.
    """

    format: str
    autopilot: str
    vehicle: str
    firmware: str
    topics: Mapping[str, Topic]
    parameters: Mapping[str, float] = field(default_factory=dict)
    modes: tuple[tuple[float, str], ...] = ()
    remarks: tuple[str, ...] = ()
    span: tuple[float, float] | None = None
    gaps: tuple[tuple[float, float], ...] = ()
    link: Link | None = None
