"""Altitude steps with a vehicle in the air: one command and one saved row for each sample."""

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

#: Columns of a recording.
ROW = (
    "time_s",
    "reference_m",
    "height_m",
    "command_m_s",
    "climb_m_s",
    "climb_setpoint_m_s",
    "vehicle_time_s",
    "sequence",
    "age_s",
    "roll_rad",
    "pitch_rad",
    "battery_percent",
)

#: The error of a stable loop does not exceed the step: a flight ends where the error exceeds the
#: step times this factor, plus this margin for disturbances, m.
GROWTH, MARGIN = 1.5, 0.1


@dataclass(frozen=True)
class StepProgramme:
    """A sequence of heights, each held for a time.

    Attributes
    ----------
    heights : tuple of float
        The reference heights, m.
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
        """Duration of the sequence, s."""
        return sum(self.holds)

    @property
    def samples(self) -> int:
        """Number of commands."""
        return math.ceil(self.duration / self.sample_time - 1e-9)

    @property
    def largest_step(self) -> float:
        """Largest change of the reference, m."""
        return max((abs(b - a) for a, b in itertools.pairwise(self.heights)), default=0.0)

    def reference(self, time: float) -> float:
        """The reference at a time after the beginning, m."""
        until = 0.0
        for height, hold in zip(self.heights, self.holds, strict=True):
            until += hold
            if time < until - 1e-9:
                return height
        return self.heights[-1]

    def check(self, limits: Limits) -> None:
        """Refuse a sequence that would exceed the limits.

        Raises
        ------
        ValueError
            If a height is outside the limits, or would be with an overshoot of a whole step; if
            a step alone exceeds the largest error; or if a command would be too old before the
            next one.
        """
        if self.largest_step + MARGIN > limits.max_error:
            raise ValueError(
                f"a step of {self.largest_step:g} m exceeds the error that ends a flight, "
                f"{limits.max_error:g} m: fly steps of {limits.max_error - MARGIN:g} m or less"
            )
        if self.sample_time >= limits.command_age:
            raise ValueError(
                f"sample_time={self.sample_time:g} s is not below the {limits.command_age:g} s "
                "for which a command is valid: use a shorter sample time"
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
            f"{delay:g} s and a gain of {gain:g}: fly a smaller gain"
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
        A vehicle in the air.
    control : HeightControl
        Computes the commands; its sample time is that of the programme.
    programme : StepProgramme
        The reference heights.
    limits : Limits
        Limits of the flight; the error is limited further, to 1.5 times the step plus 0.1 m.
    journal : Journal
        Receives a row of `ROW` for each sample.
    begin : float, optional
        Time of the first sample, s of `deadtime.links.now`; now if not given.

    Raises
    ------
    FlightAbortedError
        If a limit is exceeded; the vehicle hovers, and the caller has to land it.
    LinkError
        If the link is lost.
    """
    begin = now() if begin is None else begin
    first = await vehicle.state()
    base = programme.heights[0]
    distance = abs(first.height - base)
    if distance + MARGIN > limits.max_error:
        raise FlightAbortedError(
            f"the vehicle hovers at {first.height:.2f} m: the distance to the first "
            f"reference, {base:g} m, exceeds the error that ends a flight, {limits.max_error:g} m: "
            "begin closer to it"
        )
    largest = max(programme.largest_step, distance)
    watch = Watch(replace(limits, max_error=min(limits.max_error, GROWTH * largest + MARGIN)))
    sample = 0
    try:
        while sample < programme.samples:
            await asyncio.sleep(max(0.0, begin + sample * programme.sample_time - now()))
            state = await vehicle.state()
            if not state.flying:
                raise FlightAbortedError(
                    "the vehicle no longer flies, although it was not commanded to land"
                )
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
                    state.climb_setpoint,
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
