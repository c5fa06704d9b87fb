"""The end with the plant: what it is told, and what it tells at its end."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deadtime._base.validation import finite, non_negative, positive
from deadtime.links.addresses import Address
from deadtime.links.udp.policies import JitterBuffer, NewestWins, Policy
from deadtime.links.udp.statistics import LinkReport, Percentiles
from deadtime.recordings import Recording

__all__ = ["PlantOptions", "PlantReport"]


@dataclass(frozen=True)
class PlantOptions:
    """The plant's end, as a description.

    Parameters
    ----------
    controller : (str, int)
        Where the controller listens, or a relay in its place.
    listen : (str, int)
        Where to receive; port 0 takes a free one.
    gain, lag : float
        Of the integrator; the lag in s.
    sample_time : float
        Time between two measurements, s.
    duration : float
        How long to run, s.
    rest, amplitude : float
        When the reference steps from 0, s, and to what.
    limit : float
        Largest size of the command.
    policy : Policy
        What is done with late commands.
    watchdog : float
        Longest time without a command, and largest age of one, s.
    safe : float
        The command that is applied when the watchdog bites.
    recording : Path or None
        CSV file, written row by row.
    doubles : (int, int) or None
        Speak in bare doubles, so many from the controller and to it.
    """

    controller: Address
    listen: Address = ("127.0.0.1", 0)
    gain: float = 1.0
    lag: float = 0.0
    sample_time: float = 0.01
    duration: float = 5.0
    rest: float = 1.0
    amplitude: float = 1.0
    limit: float = 20.0
    policy: Policy = field(default_factory=NewestWins)
    watchdog: float = 0.5
    safe: float = 0.0
    recording: Path | None = None
    doubles: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        for name in ("sample_time", "duration", "limit", "watchdog"):
            positive(name, getattr(self, name))
        if self.watchdog <= self.sample_time:
            raise ValueError(
                f"watchdog={self.watchdog} s is no longer than sample_time={self.sample_time} s: "
                "it would bite between any two commands; give a longer one"
            )
        buffer = self.policy
        if isinstance(buffer, JitterBuffer) and buffer.delay > self.watchdog:
            raise ValueError(
                f"{buffer} makes every command older than watchdog={self.watchdog} s bears: give a "
                "shorter delay or a longer watchdog"
            )
        non_negative("rest", self.rest)
        finite("amplitude", self.amplitude)
        if abs(finite("safe", self.safe)) > self.limit:
            raise ValueError(f"safe={self.safe} is beyond limit={self.limit}: give a smaller one")
        if self.doubles is not None and self.policy.needs_times:
            raise ValueError(
                f"{self.policy} needs time stamps, which bare doubles do not have: use NewestWins "
                "or HoldThenZero"
            )


@dataclass(frozen=True, eq=False)
class PlantReport:
    """What happened at the plant; recording, arrivals and times are those of the last 100 000.

    Attributes
    ----------
    link : LinkReport
        The packets from the controller.
    period : Percentiles
        Time between two measurements, s.
    overruns : int
        Measurements left out because the process woke up too late for them.
    applied : int
        Commands that were applied.
    age : float
        Age of the measurement behind the command in force, on average over time, s: the delay
        of the loop, measured. NaN without time stamps.
    oldest : float
        Largest age that a command in force reached, s.
    age_when_applied : Percentiles
        Age at the moment a command is applied, s.
    trips, safe_time : int, float
        How often the safe command took over after the first command, and for how long, s.
    largest_command, largest_output : float
        Largest sizes.
    arrivals : tuple of (int, float)
        Number of each measurement that was answered, and when after it the answer came, s; empty
        without time stamps.
    recording : Recording or None
        Time, reference, output and the command in force; None where the run was too short.
    """

    link: LinkReport
    period: Percentiles
    overruns: int
    applied: int
    age: float
    oldest: float
    age_when_applied: Percentiles
    trips: int
    safe_time: float
    largest_command: float
    largest_output: float
    arrivals: tuple[tuple[int, float], ...]
    recording: Recording | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; without the recording."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        del plain["recording"]
        plain["link"] = self.link.to_dict()
        plain["period"] = vars(self.period)
        plain["age_when_applied"] = vars(self.age_when_applied)
        return plain
