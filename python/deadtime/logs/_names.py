"""Where an autopilot logs the signals of its loops: the types of the tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._contents import LogContents

Kind = Literal["rate", "attitude", "velocity", "position"]

#: Start and stop of each window, s, on the clock of the log; an end may be infinite.
Windows = list[tuple[float, float]]

#: What finds such windows in a log; None where the log does not tell.
FindWindows = Callable[[LogContents], Windows | None]

#: Units of logs: the unit here, and the factor to it.
UNITS: dict[str, tuple[str, float]] = {
    "rad": ("rad", 1.0),
    "deg": ("rad", np.pi / 180.0),
    "cdeg": ("rad", np.pi / 18000.0),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", np.pi / 180.0),
    "cdeg/s": ("rad/s", np.pi / 18000.0),
    "mrad/s": ("rad/s", 1e-3),
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "ft": ("m", 0.3048),
    "m/s": ("m/s", 1.0),
    "cm/s": ("m/s", 1e-2),
    "mm/s": ("m/s", 1e-3),
    "ft/s": ("m/s", 0.3048),
    "m/s/s": ("m/s²", 1.0),
    "cm/s/s": ("m/s²", 1e-2),
}


@dataclass(frozen=True)
class Signal:
    """One signal of a loop: a column of a topic, or several that are computed into one.

    Attributes
    ----------
    topic : str
        Name of the topic.
    columns : tuple of str
        Its column, or the columns that `derive` takes.
    unit : str
        Unit of the log, or of what `derive` returns: a key of `UNITS`. Any other, such as
        ``"us"`` or none, is kept.
    sign : float
        -1 where the log counts the other way, as down for an altitude.
    derive : callable, optional
        Takes the columns, returns the signal.
    rule : str
        What `derive` does, or what `sign` changes, for people: ``"roll of the quaternion"``.
    """

    topic: str
    columns: tuple[str, ...]
    unit: str = ""
    sign: float = 1.0
    derive: Callable[..., Array] | None = None
    rule: str = ""


@dataclass(frozen=True)
class Condition:
    """When a loop is closed.

    Attributes
    ----------
    windows : callable
        Takes the contents of the log, returns the windows in which the condition holds, or None
        if the log does not tell.
    otherwise : str
        The state where it does not hold, as ``"the vehicle is disarmed"``.
    """

    windows: FindWindows
    otherwise: str


@dataclass(frozen=True)
class LoopNames:
    """One loop of an autopilot: where its signals are.

    Of each signal the alternatives are tried in their order: the first whose topic has all the
    columns, and a finite value in them, is taken. A loop without setpoint or response is not
    offered.

    Attributes
    ----------
    name : str
        ``"roll rate"``, ``"pitch"``, ``"vertical speed"``, ``"altitude"``, ``"north position"``.
    axis : str
        ``"roll"``, ``"pitch"``, ``"yaw"``, ``"north"``, ``"east"``, ``"vertical"``, ``"forward"``.
    kind : str
        ``"rate"``, ``"attitude"``, ``"velocity"`` or ``"position"``.
    setpoint, response, actuator : sequence of Signal
        Alternatives. A vertical loop counts upwards.
    conditions : sequence of Condition
        All must hold where the setpoint is followed.
    """

    name: str
    axis: str
    kind: Kind
    setpoint: Sequence[Signal]
    response: Sequence[Signal]
    actuator: Sequence[Signal] = ()
    conditions: Sequence[Condition] = ()


@dataclass(frozen=True)
class AutopilotNames:
    """What is known of an autopilot's logs.

    Attributes
    ----------
    loops : sequence of LoopNames
        In the order in which they are shown.
    key_parameters : sequence of str
        Patterns of `fnmatch` for the parameters that matter to a delay.
    """

    loops: Sequence[LoopNames]
    key_parameters: Sequence[str] = ()
