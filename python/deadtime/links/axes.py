"""The axes of a vehicle: what is commanded on each, and what is read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from deadtime._base.errors import LinkError
from deadtime.links.vehicle import Motion, VehicleState

AxisName: TypeAlias = Literal["z", "x", "y", "yaw"]


@dataclass(frozen=True)
class Axis:
    """One axis of a vehicle: a commanded rate, and the output that is its integral.

    Attributes
    ----------
    name : str
        ``z``, ``x``, ``y`` or ``yaw``.
    output, rate, setpoint : str
        Names in `VehicleState` of the output, of its rate, and of the rate that the vehicle
        follows; the last is empty where no vehicle reports it.
    command : str
        Name in `Motion` of the commanded rate.
    words : str
        The output in words.
    unit : str
        Of the output, ``m`` or ``rad``.
    absolute : bool
        Whether references are values of the output; otherwise they are from where the vehicle is at
        the beginning.
    wraps : bool
        Whether the output is an angle, which jumps by a turn.

    Examples
    --------
    >>> AXES["z"].columns
    ('height_m', 'climb_m_s', 'climb_setpoint_m_s')
    >>> AXES["x"].motion(0.3)
    Motion(north=0.3, east=0.0, up=0.0, turn=0.0)
    """

    name: AxisName
    output: str
    rate: str
    setpoint: str
    command: str
    words: str
    unit: str = "m"
    absolute: bool = False
    wraps: bool = False

    @property
    def columns(self) -> tuple[str, str, str]:
        """Names of the columns of output, rate and followed rate."""
        unit = self.unit
        setpoint = self.setpoint or f"{self.rate}_setpoint"
        return f"{self.output}_{unit}", f"{self.rate}_{unit}_s", f"{setpoint}_{unit}_s"

    @property
    def rate_unit(self) -> str:
        """Unit of a command."""
        return f"{self.unit}/s"

    @property
    def thousandth(self) -> str:
        """A thousandth of the unit of the output."""
        return f"m{self.unit}"

    def motion(self, rate: float) -> Motion:
        """The motion with this rate, and rest on the other axes.

        Beside a horizontal speed no turn is commanded, explicitly: a vehicle may otherwise turn
        into the direction of its flight.
        """
        rest = {"turn": 0.0} if self.command in ("north", "east") else {}
        return Motion(**{**rest, self.command: rate})


class AxisReader:
    """Reads one axis from the states of one flight.

    Parameters
    ----------
    axis : Axis
    origin : VehicleState
        The state at the beginning: references of an axis that is not absolute are from there.

    Examples
    --------
    >>> def turned(yaw):
    ...     return VehicleState(0.0, 1.0, True, False, 1, yaw=yaw)
    >>> reader = AxisReader(AXES["yaw"], turned(3.0))
    >>> round(reader.output(turned(-3.0)), 3)
    0.283
    """

    def __init__(self, axis: Axis, origin: VehicleState) -> None:
        self.axis = axis
        self._zero = 0.0 if axis.absolute else self._reported(origin)
        self._last = self._zero

    def output(self, state: VehicleState) -> float:
        """The output, from the origin; an angle without its jumps.

        Raises
        ------
        LinkError
            If the vehicle does not report it.
        """
        value = self._reported(state)
        if self.axis.wraps:
            self._last += math.remainder(value - self._last, 2.0 * math.pi)
            value = self._last
        return value - self._zero

    def rate(self, state: VehicleState) -> float | None:
        """The rate of the output, where the vehicle reports it."""
        return getattr(state, self.axis.rate)  # type: ignore[no-any-return]

    def setpoint(self, state: VehicleState) -> float | None:
        """The rate that the vehicle follows, where it reports it."""
        return getattr(state, self.axis.setpoint) if self.axis.setpoint else None

    def _reported(self, state: VehicleState) -> float:
        value = getattr(state, self.axis.output)
        if value is None:
            raise LinkError(f"the vehicle does not report its {self.axis.words}")
        return float(value)


#: The axes by name: the height, to the north, to the east, and the heading.
AXES: Mapping[str, Axis] = {
    axis.name: axis
    for axis in (
        Axis("z", "height", "climb", "climb_setpoint", "up", "height", absolute=True),
        Axis("x", "north", "north_speed", "north_setpoint", "north", "position to the north"),
        Axis("y", "east", "east_speed", "east_setpoint", "east", "position to the east"),
        Axis("yaw", "yaw", "yaw_rate", "", "turn", "heading", unit="rad", wraps=True),
    )
}
