"""Steps of one axis with a vehicle in the air: one command and one saved row for each sample."""

from __future__ import annotations

import asyncio
import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, replace

from deadtime._base.errors import FlightAbortedError, LinkError
from deadtime._base.validation import finite, positive
from deadtime.flights._axis_control import AxisControl
from deadtime.links.axes import AXES, Axis, AxisReader
from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.links.safety import Limits, Watch, largest_gain
from deadtime.links.vehicle import Vehicle, VehicleState

HEIGHT = AXES["z"]


def row_columns(axis: Axis) -> tuple[str, ...]:
    """Columns of a recording of an axis."""
    output, rate, setpoint = axis.columns
    return (
        "time_s",
        f"reference_{axis.unit}",
        output,
        f"command_{axis.unit}_s",
        rate,
        setpoint,
        "vehicle_time_s",
        "sequence",
        "age_s",
        "roll_rad",
        "pitch_rad",
        "battery_percent",
    )


#: The error of a stable loop does not exceed the step: a flight ends where the error exceeds the
#: step times this factor, plus this margin for disturbances, m or rad.
GROWTH, MARGIN = 1.5, 0.1


@dataclass(frozen=True)
class StepProgramme:
    """A sequence of references, each held for a time.

    Attributes
    ----------
    references : tuple of float
        m or rad.
    holds : tuple of float
        Time for which each is held, s.
    sample_time : float
        Time between two commands, s.

    Examples
    --------
    >>> programme = StepProgramme((1.0, 1.25, 1.0), (4.0, 7.0, 7.0))
    >>> programme.samples, programme.reference(5.0), programme.largest_step
    (277, 1.25, 0.25)
    """

    references: tuple[float, ...]
    holds: tuple[float, ...]
    sample_time: float = 0.065

    def __post_init__(self) -> None:
        positive("sample_time", self.sample_time)
        if len(self.references) != len(self.holds) or not self.references:
            raise ValueError(
                f"{len(self.references)} references and {len(self.holds)} holds: give one hold "
                "for each reference"
            )
        for reference, hold in zip(self.references, self.holds, strict=True):
            finite("references", reference)
            positive("holds", hold)

    @property
    def duration(self) -> float:
        """Duration of the sequence, s."""
        return sum(self.holds)

    @property
    def samples(self) -> int:
        """Number of commands."""
        return math.ceil(self.duration / self.sample_time - 1e-9)

    @property
    def largest_step(self) -> float:
        """Largest change of the reference."""
        return max((abs(b - a) for a, b in itertools.pairwise(self.references)), default=0.0)

    def reference(self, time: float) -> float:
        """The reference at a time after the beginning."""
        until = 0.0
        for reference, hold in zip(self.references, self.holds, strict=True):
            until += hold
            if time < until - 1e-9:
                return reference
        return self.references[-1]

    def check(self, limits: Limits, axis: Axis = HEIGHT) -> None:
        """Refuse a sequence that would exceed the limits.

        Raises
        ------
        ValueError
            If a reference is outside the limits, or would be with an overshoot of a whole step; if
            a step alone exceeds the largest error; or if a command would be too old before the
            next one.
        """
        most, unit, step = limits.error_of(axis), axis.unit, self.largest_step
        if step + MARGIN > most:
            raise ValueError(
                f"a step of {step:g} {unit} exceeds the largest error that is allowed in "
                f"flight, {most:g} {unit}: give a step of {most - MARGIN:g} {unit} or less"
            )
        if self.sample_time >= limits.command_age:
            raise ValueError(
                f"sample_time={self.sample_time:g} s is not below {limits.command_age:g} s, the "
                "time for which a command is valid: give a shorter sample time"
            )
        if axis.wraps:
            return
        low, high = limits.min_height, limits.max_height
        if not axis.absolute:
            low, high = -limits.max_distance, limits.max_distance
        for reference in self.references:
            for end in (reference - step, reference + step):
                if not low <= end <= high:
                    raise ValueError(
                        f"with a reference of {reference:g} m and steps of {step:g} m, the "
                        f"vehicle may come to {end:g} m, outside of {low:g} to {high:g} m: give "
                        "smaller steps, or another reference"
                    )


def check_gain(Kp: float, delay: float, gain: float) -> None:
    """Refuse a gain that may be unstable with the assumed delay and gain of the vehicle.

    Parameters
    ----------
    Kp : float
        Proportional gain, 1/s.
    delay, gain : float
        Assumed delay (s) and gain of the vehicle.

    Raises
    ------
    ValueError
        If the gain is not above zero or more than `deadtime.links.largest_gain`.
    """
    most = largest_gain(delay, gain)
    if not 0.0 < positive("Kp", Kp) <= most:
        raise ValueError(
            f"Kp = {Kp:g} is above {most:.3g}, half of the stability limit with a delay of "
            f"{delay:g} s and a gain of {gain:g}: give a smaller gain"
        )


async def fly_steps(
    vehicle: Vehicle,
    axis: Axis,
    control: AxisControl,
    programme: StepProgramme,
    limits: Limits,
    journal: Journal,
    begin: float | None = None,
    origin: VehicleState | None = None,
) -> None:
    """Fly a programme with a vehicle that is in the air; it hovers afterwards.

    The other axes are commanded to rest: the vehicle holds them.

    Parameters
    ----------
    vehicle : Vehicle
        A vehicle in the air.
    axis : Axis
        What is stepped.
    control : AxisControl
        Computes the commands; its sample time is that of the programme.
    programme : StepProgramme
        The references.
    limits : Limits
        Limits of the flight; the error is limited further, to 1.5 times the step plus 0.1 m or rad.
    journal : Journal
        Receives a row of `row_columns` for each sample.
    begin : float, optional
        Time of the first sample, s of `deadtime.links.now`; now if not given.
    origin : VehicleState, optional
        From which references and distances count, where the axis is not absolute; the first state
        if not given.

    Raises
    ------
    FlightAbortedError
        If a limit is exceeded; the vehicle hovers, and the caller has to land it.
    LinkError
        If the link is lost, or the vehicle does not report the axis.
    """
    begin = now() if begin is None else begin
    first = await vehicle.state()
    origin = first if origin is None else origin
    reader, watched = AxisReader(axis, origin), AxisReader(axis, origin)
    base, value = programme.references[0], reader.output(first)
    distance, most = abs(value - base), limits.error_of(axis)
    if distance + MARGIN > most:
        raise FlightAbortedError(
            f"the vehicle hovers at {value:.2f} {axis.unit}. Its distance to the first "
            f"reference, {base:g} {axis.unit}, exceeds the largest error that is allowed, "
            f"{most:g} {axis.unit}. Begin closer to this reference"
        )
    error = min(most, GROWTH * max(programme.largest_step, distance) + MARGIN)
    stricter = replace(limits, max_error=error, max_heading_error=error)
    watch = Watch(stricter, watched, origin)
    sample = 0
    try:
        while sample < programme.samples:
            await asyncio.sleep(max(0.0, begin + sample * programme.sample_time - now()))
            state = await vehicle.state()
            if not state.flying:
                raise FlightAbortedError(
                    "the vehicle is not flying any more, but no landing was commanded"
                )
            time = now()
            reference = programme.reference(sample * programme.sample_time)
            watch.check(state, time, reference)
            output, rate = reader.output(state), reader.rate(state)
            motion = axis.motion(control.command(reference, output, rate))
            command = getattr(vehicle.command_velocity(*motion), axis.command)
            journal.write(
                (
                    time - begin,
                    reference,
                    output,
                    command,
                    rate,
                    reader.setpoint(state),
                    state.vehicle_time,
                    state.sequence,
                    time - state.time,
                    state.roll,
                    state.pitch,
                    state.battery,
                )
            )
            # A missed sample is skipped: a late command would shorten the hold before the next.
            passed = math.floor((time - begin) / programme.sample_time + 1e-9)
            sample = max(sample, passed) + 1
    except BaseException:
        with suppress(LinkError):  # report the reason of the end, not that the vehicle cannot hover
            vehicle.hover()
        raise
    vehicle.hover()
