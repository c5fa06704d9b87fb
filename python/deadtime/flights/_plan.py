"""The plan of an experiment on one axis, and the defaults of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from deadtime._base.validation import positive
from deadtime.flights._step_test import StepProgramme, check_gain
from deadtime.links.axes import AXES, Axis, AxisName
from deadtime.links.safety import Limits

#: Smallest step, m or rad: several times the noise of what is measured.
LEAST_STEP = 0.02

#: What differs from the defaults of `FlightPlan` on the height of ArduPilot and PX4, and on their
#: heading.
AUTOPILOT: Mapping[str, Any] = {"gains": (0.8, 1.4), "prior_delay": 0.5, "prior_gain": 1.0}

#: What differs on the axes that are not absolute. Gains and the assumed delay leave room for a
#: vehicle that leans before it accelerates.
USUAL: Mapping[str, Mapping[str, Any]] = {
    "z": {},
    **{
        name: {"gains": (0.5, 0.8), "step": 0.5, "base": 0.0, "prior_delay": 0.9, "prior_gain": 1.0}
        for name in ("x", "y")
    },
    "yaw": {**AUTOPILOT, "step": 0.4, "base": 0.0},
}


@dataclass(frozen=True)
class FlightPlan:
    """The plan of a flight experiment on one axis.

    Attributes
    ----------
    gains : tuple of float
        Proportional gains of the first flights, 1/s, one flight each.
    step : float
        Size of the steps, m or rad.
    base : float
        Height from which the steps go up, m.

        On another axis than z: from where the vehicle took off, m or rad.
    settle : float
        Time at the base before the first step, s.
    hold : float
        Duration of each step in the flights for the estimate, s.
    checked_hold : float
        Time on each step of the flights with designed gains, s.
    sample_time : float
        Time between two commands, s.
    limits : Limits
        Limits of every flight.
    prior_delay, prior_gain : float
        Assumed delay (s, lags included) and gain of the vehicle, which bound `gains`.
    gain_margin : float
        Least gain margin of the designed gains.
    axis : {"z", "x", "y", "yaw"}
        What is stepped: the height, the position to the north or to the east, or the heading.

    Examples
    --------
    >>> FlightPlan().flights
    4
    >>> FlightPlan.of_axis("yaw").step
    0.4
    >>> FlightPlan(gains=(4.0,)).check()
    Traceback (most recent call last):
    ValueError: Kp = 4 is above 2.47, half of the stability limit with a delay of 0.36 s and a gain
    of \
0.885: give a smaller gain
    """

    gains: tuple[float, ...] = (1.2, 2.4)
    step: float = 0.25
    base: float = 1.0
    settle: float = 5.0
    hold: float = 6.5
    checked_hold: float = 4.5
    sample_time: float = 0.065
    limits: Limits = field(default_factory=lambda: Limits(max_climb=1.0))
    prior_delay: float = 0.36
    prior_gain: float = 0.885
    gain_margin: float = 2.5
    axis: AxisName = "z"

    @classmethod
    def of_axis(cls, axis: AxisName, autopilot: bool = False, **changes: Any) -> Self:
        """The usual plan for an axis, with changes.

        Parameters
        ----------
        axis : {"z", "x", "y", "yaw"}
            The axis.
        autopilot : bool
            Whether ArduPilot or PX4 is flown, whose height takes longer to follow than that of an
            AR.Drone.
        **changes
            Attributes that are not the usual ones.

        Raises
        ------
        ValueError
            If there is no such axis.
        """
        if axis not in USUAL:
            raise ValueError(f"the axis {axis!r} does not exist: give one of {', '.join(USUAL)}")
        usual = AUTOPILOT if autopilot and axis == "z" else USUAL[axis]
        return cls(**{"axis": axis, **usual, **changes})

    @property
    def flown_axis(self) -> Axis:
        """The axis as an object."""
        return AXES[self.axis]

    def programme(self, hold: float) -> StepProgramme:
        """The references: at the base, a step up, a step down."""
        references = (self.base, self.base + self.step, self.base)
        return StepProgramme(references, (self.settle, hold, hold), self.sample_time)

    @property
    def flights(self) -> int:
        """Number of flights: one for each gain, then the best P, then PV."""
        return len(self.gains) + 2

    @property
    def duration(self) -> float:
        """Time under control in all flights, s, without take-off and landing."""
        learning = len(self.gains) * self.programme(self.hold).duration
        return learning + 2.0 * self.programme(self.checked_hold).duration

    def check(self) -> None:
        """Refuse a plan that is not safe.

        Raises
        ------
        ValueError
            For no gain, a gain that is too large, a step below the noise, or a programme that
            would exceed the limits.
        """
        if self.axis not in AXES:
            raise ValueError(
                f"the axis {self.axis!r} does not exist: give one of {', '.join(AXES)}"
            )
        if not self.gains:
            raise ValueError("gains is empty: give one or more gains to fly")
        axis = self.flown_axis
        if positive("step", self.step) < LEAST_STEP:
            raise ValueError(
                f"step={self.step:g} {axis.unit} is as small as the noise of the {axis.words}: "
                f"give a step of {LEAST_STEP:g} {axis.unit} or more"
            )
        for Kp in self.gains:
            check_gain(Kp, self.prior_delay, self.prior_gain)
        self.programme(self.hold).check(self.limits, axis)

    def line(self) -> str:
        """The plan in words, without its limits."""
        axis = self.flown_axis
        gains = ", ".join(f"{Kp:g}" for Kp in self.gains)
        where = f"from {self.base:g} {axis.unit} " if axis.absolute else f"of the {axis.words} "
        return (
            f"{self.flights} flights with steps of {self.step:g} {axis.unit} {where}under P "
            f"control with Kp = {gains}, then flights with gains designed from these"
        )

    def lines(self) -> list[str]:
        """Plan and limits in words, to be shown before a flight."""
        return [self.line(), *self.limits.lines((self.axis,))]
