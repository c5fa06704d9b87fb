"""Altitude steps on a vehicle in the air: one command a sample, every row saved as it comes."""

from __future__ import annotations

import asyncio
import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, replace

from deadtime._base.errors import FlightAbortedError, LinkError
from deadtime._base.validation import finite, positive
from deadtime.flights._height_control import HeightControl
from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.links.safety import Limits, Watch, largest_gain
from deadtime.links.vehicle import Vehicle

__all__ = ["ROW", "StepProgramme", "check_gain", "fly_steps"]

#: Columns of a recording.
ROW = (
    "time_s",
    "reference_m",
    "height_m",
    "command_m_s",
    "climb_m_s",
    "climb_demand_m_s",
    "vehicle_time_s",
    "sequence",
    "age_s",
    "roll_rad",
    "pitch_rad",
    "battery_percent",
)

#: A stable loop never errs by more than the step it was given; beyond this much of it and of the
#: room for disturbances, m, the error is growing.
GROWTH, ROOM = 1.5, 0.1


@dataclass(frozen=True)
class StepProgramme:
    """References to hold one after the other.

    Attributes
    ----------
    heights : tuple of float
        m.
    holds : tuple of float
        How long each is held, s.
    sample_time : float
        s.

    Examples
    --------
    >>> programme = StepProgramme((1.0, 1.25, 1.0), (4.0, 7.0, 7.0))
    >>> programme.samples, programme.reference(5.0), programme.largest_step
    (277, 1.25, 0.25)
    """

    heights: tuple[float, ...]
    holds: tuple[float, ...]
    sample_time: float = 0.065

    def __post_init__(self) -> None:
        positive("sample_time", self.sample_time)
        if len(self.heights) != len(self.holds) or not self.heights:
            raise ValueError(
                f"{len(self.heights)} heights and {len(self.holds)} holds: give one hold for each "
                "height"
            )
        for height, hold in zip(self.heights, self.holds, strict=True):
            finite("heights", height)
            positive("holds", hold)

    @property
    def duration(self) -> float:
        """How long it takes, s."""
        return sum(self.holds)

    @property
    def samples(self) -> int:
        """How many commands are given."""
        return math.ceil(self.duration / self.sample_time - 1e-9)

    @property
    def largest_step(self) -> float:
        """Largest change of the reference, m."""
        return max((abs(b - a) for a, b in itertools.pairwise(self.heights)), default=0.0)

    def reference(self, time: float) -> float:
        """The reference at a time since the beginning, m."""
        until = 0.0
        for height, hold in zip(self.heights, self.holds, strict=True):
            until += hold
            if time < until - 1e-9:
                return height
        return self.heights[-1]

    def check(self, limits: Limits) -> None:
        """Refuse what the limits would end.

        Raises
        ------
        ValueError
            If a height is outside, or so close to a limit that an overshoot of the whole step would
            be; if a step alone is an error that ends a flight; or if a command would be too old
            before the next.
        """
        if self.largest_step + ROOM > limits.max_error:
            raise ValueError(
                f"a step of {self.largest_step:g} m is an error that ends a flight, at "
                f"{limits.max_error:g} m: fly steps of {limits.max_error - ROOM:g} m or less"
            )
        if self.sample_time >= limits.command_age:
            raise ValueError(
                f"sample_time={self.sample_time:g} s is no less than the {limits.command_age:g} s "
                "that a command is good for: command more often"
            )
        for height in self.heights:
            for end in (height - self.largest_step, height + self.largest_step):
                if not limits.min_height <= end <= limits.max_height:
                    raise ValueError(
                        f"a reference of {height:g} m with steps of {self.largest_step:g} m may "
                        f"come to {end:g} m, outside {limits.min_height:g} to "
                        f"{limits.max_height:g} m: fly smaller steps, or elsewhere"
                    )


def check_gain(Kp: float, delay: float, gain: float) -> None:
    """Refuse a gain that may be unstable, as far as is known before a flight.

    Parameters
    ----------
    Kp : float
        Proportional gain, 1/s.
    delay, gain : float
        What delay (s) and gain of the vehicle are believed to be.

    Raises
    ------
    ValueError
        If the gain is not above zero or more than `deadtime.links.largest_gain`.
    """
    most = largest_gain(delay, gain)
    if not 0.0 < positive("Kp", Kp) <= most:
        raise ValueError(
            f"Kp = {Kp:g} is above {most:.3g}, half of what is stable with a delay of {delay:g} s "
            f"and a gain of {gain:g}: fly a smaller gain"
        )


async def fly_steps(
    vehicle: Vehicle,
    control: HeightControl,
    programme: StepProgramme,
    limits: Limits,
    journal: Journal,
    begin: float | None = None,
) -> None:
    """Fly a programme with a vehicle that is in the air; it hovers afterwards.

    Parameters
    ----------
    vehicle : Vehicle
        In the air.
    control : HeightControl
        Makes the commands; its sample time is that of the programme.
    programme : StepProgramme
        The references.
    limits : Limits
        What ends the flight, the growth of the error included.
    journal : Journal
        Takes a row of `ROW` for each sample.
    begin : float, optional
        Time of the first sample, s of `deadtime.links.now`; now if not given.

    Raises
    ------
    FlightAbortedError
        If a rule is broken; the vehicle hovers, and whoever holds it lands it.
    LinkError
        If the link is lost.
    """
    begin = now() if begin is None else begin
    first = await vehicle.state()
    base = programme.heights[0]
    way = abs(first.height - base)
    if way + ROOM > limits.max_error:
        raise FlightAbortedError(
            f"the vehicle hovers at {first.height:.2f} m: the way to the first reference, "
            f"{base:g} m, is an error that ends a flight, at {limits.max_error:g} m: begin closer"
        )
    largest = max(programme.largest_step, way)
    watch = Watch(replace(limits, max_error=min(limits.max_error, GROWTH * largest + ROOM)))
    sample = 0
    try:
        while sample < programme.samples:
            await asyncio.sleep(max(0.0, begin + sample * programme.sample_time - now()))
            state = await vehicle.state()
            if not state.flying:
                raise FlightAbortedError("the vehicle no longer flies, without having been told so")
            time = now()
            reference = programme.reference(sample * programme.sample_time)
            watch.check(state, time, reference)
            command = vehicle.command(control.command(reference, state.height, state.climb))
            journal.write(
                (
                    time - begin,
                    reference,
                    state.height,
                    command,
                    state.climb,
                    state.climb_demand,
                    state.vehicle_time,
                    state.sequence,
                    time - state.time,
                    state.roll,
                    state.pitch,
                    state.battery,
                )
            )
            # A sample that was missed is left out, not made up for: two commands at once would
            # shorten the hold of the first.
            passed = math.floor((time - begin) / programme.sample_time + 1e-9)
            sample = max(sample, passed) + 1
    except BaseException:
        with suppress(LinkError):  # what ended the flight is said, not that it cannot hover
            vehicle.hover()
        raise
    vehicle.hover()
