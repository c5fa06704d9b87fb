"""Checks of a command before it is sent, and the rules that end a flight.

The type of a command is a number in [-1, 1]: nothing else can be sent. A flight ends (hover, then
land) when the vehicle is too far from its reference, tilts too far, has a low battery, loses a
sensor or repeats one reading, when its messages are old or missing, and when it reports an
emergency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Self, SupportsFloat

from deadtime._base.errors import FlightAbortedError
from deadtime._base.validation import finite, positive
from deadtime.links.axes import AXES, Axis, AxisReader
from deadtime.links.vehicle import VehicleState


class UnitCommand(float):
    """A finite number in [-1, 1]: a share of the largest motion of the vehicle.

    Raises
    ------
    ValueError
        If the value is not finite or lies outside; `saturated` clips finite values instead.

    Examples
    --------
    >>> UnitCommand.saturated(1.7)
    UnitCommand(1.0)
    >>> UnitCommand(float("nan"))
    Traceback (most recent call last):
    ValueError: command=nan: give a finite number
    """

    __slots__ = ()

    def __new__(cls, value: SupportsFloat = 0.0) -> Self:  # noqa: D102
        number = finite("command", value)
        if not -1.0 <= number <= 1.0:
            raise ValueError(
                f"command={number} is outside of -1 to 1: give a value within this range, or "
                "use `saturated`"
            )
        return super().__new__(cls, number)

    @classmethod
    def saturated(cls, value: SupportsFloat) -> Self:
        """The command nearest to a finite value."""
        return cls(max(-1.0, min(1.0, finite("command", value))))

    def __repr__(self) -> str:
        return f"UnitCommand({float(self)})"


@dataclass(frozen=True)
class Limits:
    """Limits of a flight. They are checked here; the vehicle does not guarantee them.

    Attributes
    ----------
    max_climb : float
        Largest commanded vertical speed, m/s.
    max_speed : float
        Largest horizontal speed that is commanded, m/s.
    max_yaw_rate : float
        Largest commanded turn, rad/s.
    max_body_rate : float
        Largest commanded rate around an axis of the vehicle, rad/s.
    min_thrust, max_thrust : float
        Least and largest commanded thrust, as shares of all that the motors have. Hovering takes a
        quarter to a half.
    min_height : float
        Height below which a flight is aborted, m.
    max_height : float
        Height above which a flight is aborted, m.

        It is set in the vehicle too, where it has such a setting.
    max_angle : float
        Roll or pitch beyond which a flight is aborted, rad.
    min_battery : float
        Charge below which a flight is aborted, percent.
    max_error : float
        Distance from the reference beyond which a flight is aborted, m.
    max_heading_error : float
        The same of a heading, rad.
    max_distance : float
        Horizontal distance from the take-off beyond which a flight is aborted, m.

        Where the vehicle reports its position.
    max_jump : float
        Largest plausible rate of change of the measured height, m/s.
    max_state_age : float
        Age of the newest message of the vehicle beyond which a flight is aborted, s: the time since
        its arrival, plus its delay relative to the fastest message, by the clock of the vehicle.
    max_still : float
        Longest time for which exactly the same height may be read away from the reference, s.
    max_missing : int
        Successive messages that may be lost before a flight is aborted.
    command_age : float
        Age beyond which a command is replaced by hovering, s.
    landing_after : float
        Time without any new command after which the link lands the vehicle, s.
    """

    max_climb: float = 0.5
    max_speed: float = 0.5
    max_yaw_rate: float = 0.5
    max_body_rate: float = 1.0
    min_thrust: float = 0.15
    max_thrust: float = 0.7
    min_height: float = 0.2
    max_height: float = 3.0
    max_angle: float = math.radians(15.0)
    min_battery: float = 20.0
    max_error: float = 1.0
    max_heading_error: float = 1.0
    max_distance: float = 5.0
    max_jump: float = 5.0
    max_state_age: float = 0.3
    max_still: float = 1.0
    max_missing: int = 20
    command_age: float = 0.25
    landing_after: float = 1.0

    def __post_init__(self) -> None:
        for item in fields(self):
            positive(item.name, getattr(self, item.name))
        if self.min_height >= self.max_height:
            raise ValueError(
                f"min_height={self.min_height} is not below max_height={self.max_height}: "
                "give a smaller min_height"
            )
        if not self.min_thrust < self.max_thrust <= 1.0:
            raise ValueError(
                f"min_thrust={self.min_thrust}, max_thrust={self.max_thrust}: give two shares "
                "from 0 to 1, the smaller one first"
            )
        if self.command_age >= self.landing_after:
            raise ValueError(
                f"command_age={self.command_age} is not below "
                f"landing_after={self.landing_after}, but a vehicle has to hover before it "
                "lands: give a longer landing_after"
            )

    def largest(self, axis: Axis) -> float:
        """Largest commanded rate of an axis."""
        horizontal = {"north": self.max_speed, "east": self.max_speed}
        return {"up": self.max_climb, "turn": self.max_yaw_rate, **horizontal}[axis.command]

    def error_of(self, axis: Axis) -> float:
        """Distance of an axis from its reference beyond which a flight is aborted."""
        return self.max_heading_error if axis.wraps else self.max_error

    def lines(self, axes: tuple[str, ...] = ("z",)) -> list[str]:
        """The limits in words, one for each line, to be shown before a flight on some axes."""
        commanded = [AXES[name] for name in axes]
        moves = {"up": "climbs and sinks", "turn": "turns", "north": "flies", "east": "flies"}
        rates = {
            f"{moves[axis.command]} at no more than {self.largest(axis):g} {axis.rate_unit}": None
            for axis in commanded
        }
        errors = {f"{self.error_of(axis):g} {axis.unit}": None for axis in commanded}
        far = f"{' and '.join(errors)} from the reference"
        if axes != ("z",):
            far += f", and {self.max_distance:g} m from its place of take-off"
        return [
            ", ".join(rates),
            f"stays between {self.min_height:g} and {self.max_height:g} m, and within {far}",
            f"aborts if roll or pitch exceeds {math.degrees(self.max_angle):g} degrees, the "
            f"battery is below {self.min_battery:g} %, or no message arrives for "
            f"{self.max_state_age:g} s",
            f"hovers if no command comes for {self.command_age:g} s, and lands after "
            f"{self.landing_after:g} s without a command",
        ]


def largest_gain(delay: float, gain: float = 1.0) -> float:
    r"""The largest proportional gain of a flight before the delay is known.

    Half of the gain pi / (2 delay gain) at which an integrator with this delay loses stability: a
    gain margin of 2 if the assumed delay is right.

    Parameters
    ----------
    delay : float
        Assumed delay, lags included, s.
    gain : float
        Vertical speed per unit of command.

    Examples
    --------
    >>> round(largest_gain(0.36, 0.885), 3)
    2.465
    """
    return math.pi / (4.0 * positive("delay", delay) * positive("gain", gain))


#: Change of the height that is accepted at any speed, m: noise of the sensor, a bump on the ground.
BUMP = 0.1


def jumps(before: float, height: float, passed: float, max_jump: float) -> bool:
    """Whether a measured height changes faster than a vehicle can; NaN does.

    Parameters
    ----------
    before, height : float
        The last two measured heights, m.
    passed : float
        Time between them, s, not negative.
    max_jump : float
        Fastest change that is accepted, m/s.
    """
    return not abs(height - before) <= max_jump * passed + BUMP


#: Distance from the reference, m or rad, beyond which a constant output is suspicious.
AWAY = 0.05


class Watch:
    """Checks the states of one flight, and raises when a rule is broken.

    Parameters
    ----------
    limits : Limits
    reader : AxisReader, optional
        Reads the axis that follows the reference; without it that is the height.
    origin : VehicleState, optional
        The state from which the horizontal distance counts; without it that is not checked.

    Examples
    --------
    >>> watch = Watch(Limits())
    >>> state = VehicleState(time=0.0, height=1.0, flying=True, landed=False, sequence=1, battery=9)
    >>> watch.check(state, now=0.0)
    Traceback (most recent call last):
    deadtime._base.errors.FlightAbortedError: the battery is at 9 %, below its limit of 20 %
    """

    def __init__(
        self,
        limits: Limits,
        reader: AxisReader | None = None,
        origin: VehicleState | None = None,
    ) -> None:
        self.limits = limits
        self._reader, self._origin = reader, origin
        self._axis = AXES["z"] if reader is None else reader.axis
        self._last: VehicleState | None = None
        self._value = math.nan
        self._moved = -math.inf
        self._least_difference = math.inf

    def check(self, state: VehicleState, now: float, reference: float | None = None) -> None:
        """Check the newest state against the limits.

        Parameters
        ----------
        state : VehicleState
            The newest state; the same one may be given again.
        now : float
            `deadtime.links.now`, s.
        reference : float, optional
            Reference of the axis; without it the error is not checked.

        Raises
        ------
        FlightAbortedError
            If a rule is broken.
        LinkError
            If the vehicle does not report the axis.
        """
        value = state.height if self._reader is None else self._reader.output(state)
        if self._last is None or value != self._value or not self._away(reference):
            self._moved = now
        broken = self._broken(state, value, now, reference)
        self._last, self._value = state, value
        if broken is not None:
            raise FlightAbortedError(broken)

    def _away(self, reference: float | None) -> bool:
        """Whether the output was away from the reference."""
        return reference is not None and abs(self._value - reference) > AWAY

    def _lateness(self, state: VehicleState) -> float:
        """Delay of a message relative to the fastest one, by the clock of the vehicle, s."""
        if state.vehicle_time is None:
            return 0.0
        difference = state.time - state.vehicle_time
        self._least_difference = min(self._least_difference, difference)
        return difference - self._least_difference

    def _broken(
        self, state: VehicleState, value: float, now: float, reference: float | None
    ) -> str | None:
        limits, axis = self.limits, self._axis
        if state.emergency:
            return "the vehicle reports an emergency"
        age = now - state.time + self._lateness(state)
        if not age <= limits.max_state_age:
            return (
                f"the newest message is {age:.2f} s old, but at most {limits.max_state_age:g} s "
                "are allowed"
            )
        if state.missing > limits.max_missing:
            return (
                f"{state.missing} messages in a row were lost, but at most {limits.max_missing} "
                "are allowed"
            )
        for angle in (abs(state.roll), abs(state.pitch)):  # separately: `max` may ignore a NaN
            if not angle <= limits.max_angle:
                return (
                    f"the vehicle is tilted by {math.degrees(angle):.0f} degrees, but at most "
                    f"{math.degrees(limits.max_angle):g} degrees are allowed"
                )
        if state.battery is not None and not state.battery >= limits.min_battery:
            return (
                f"the battery is at {state.battery:g} %, below its limit of "
                f"{limits.min_battery:g} %"
            )
        if state.fault is not None:
            return f"the vehicle reports that {state.fault}"
        if not limits.min_height <= state.height <= limits.max_height:
            return (
                f"the height is {state.height:.2f} m, outside of its limits, "
                f"{limits.min_height:g} to {limits.max_height:g} m"
            )
        most = limits.error_of(axis)
        if reference is not None and not abs(value - reference) <= most:
            return (
                f"the {axis.words} is {value:.2f} {axis.unit} and its reference {reference:.2f} "
                f"{axis.unit}, so they differ by more than {most:g} {axis.unit}"
            )
        if not self._distance(state) <= limits.max_distance:
            return (
                f"the vehicle is {self._distance(state):.2f} m from its place of take-off, but "
                f"at most {limits.max_distance:g} m are allowed"
            )
        if now - self._moved > limits.max_still:
            return (
                f"the {axis.words} has not changed from {value:.3f} {axis.unit} for "
                f"{now - self._moved:.1f} s, although the reference differs"
            )
        return self._broken_since(state)

    def _distance(self, state: VehicleState) -> float:
        """Horizontal distance from the origin, m; 0 where it is not known."""
        origin = self._origin
        if origin is None or origin.north is None or origin.east is None:
            return 0.0
        if state.north is None or state.east is None:
            return math.nan
        return math.hypot(state.north - origin.north, state.east - origin.east)

    def _broken_since(self, state: VehicleState) -> str | None:
        """What is wrong with a state only in the light of the one before."""
        last = self._last
        if last is None or state.sequence == last.sequence:
            return None
        passed = state.time - last.time
        if state.vehicle_time is not None and last.vehicle_time is not None:
            passed = max(passed, state.vehicle_time - last.vehicle_time)
        passed = max(passed, 0.0)  # messages may arrive in one burst
        if jumps(last.height, state.height, passed, self.limits.max_jump):
            return (
                f"the height changes from {last.height:.2f} to {state.height:.2f} m within "
                f"{1e3 * passed:.0f} ms, faster than the limit of {self.limits.max_jump:g} m/s"
            )
        return None
