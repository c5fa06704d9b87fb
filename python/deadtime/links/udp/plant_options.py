"""Options and report of the plant's end of the loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deadtime._base.validation import finite, non_negative, positive
from deadtime.links.addresses import Address
from deadtime.links.udp.policies import JitterBuffer, NewestWins, Policy
from deadtime.links.udp.statistics import LinkReport, Percentiles
from deadtime.recordings import Recording


@dataclass(frozen=True)
class PlantOptions:
    """Options of the plant's end.

    Parameters
    ----------
    controller : (str, int)
        Address of the controller, or of a relay.
    listen : (str, int)
        Address for receiving; port 0 takes a free one.
    gain, lag : float
        Of the integrator; the lag in s.
    sample_time : float
        Time between two measurements, s.
    duration : float
        Duration of the run, s.
    rest, amplitude : float
        Time of the step of the reference from 0, s, and its size.
    limit : float
        Largest size of the command.
    policy : Policy
        Treatment of late commands.
    watchdog : float
        Longest time without a command, and largest age of one, s.
    safe : float
        The command that is applied when the watchdog trips.
    recording : Path or None
        CSV file, written row by row.
    doubles : (int, int) or None
        Use plain doubles: their number from the controller and to it.
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
                f"watchdog={self.watchdog} s is not longer than sample_time={self.sample_time} "
                "s, so it would trip between any two commands: give a longer watchdog"
            )
        buffer = self.policy
        if isinstance(buffer, JitterBuffer) and buffer.delay > self.watchdog:
            raise ValueError(
                f"with {buffer}, every command is older than watchdog={self.watchdog} s: give a "
                "shorter delay or a longer watchdog"
            )
        non_negative("rest", self.rest)
        finite("amplitude", self.amplitude)
        if abs(finite("safe", self.safe)) > self.limit:
            raise ValueError(f"safe={self.safe} exceeds limit={self.limit}: give a smaller safe")
        if self.doubles is not None and self.policy.needs_times:
            raise ValueError(
                f"{self.policy} needs time stamps, but packets of plain doubles have none: use "
                "NewestWins or HoldThenZero"
            )


@dataclass(frozen=True, eq=False)
class PlantReport:
    """Report of the plant; recording, arrivals and times are those of the last 100 000 packets.

    Attributes
    ----------
    link : LinkReport
        The packets from the controller.
    period : Percentiles
        Time between two measurements, s.
    overruns : int
        Measurements skipped because the process woke up too late for them.
    applied : int
        Commands that were applied.
    age : float
        Mean over time of the age of the measurement on which the command in force is based, s: the
        measured delay of the loop. NaN without time stamps.
    oldest : float
        Largest age of a command in force, s.
    age_when_applied : Percentiles
        Age at the moment a command is applied, s.
    trips, safe_time : int, float
        How often the safe command took over after the first command, and for how long, s.
    largest_command, largest_output : float
        Largest sizes.
    arrivals : tuple of (int, float)
        Number of each answered measurement, and the time until its answer arrived, s; empty without
        time stamps.
    recording : Recording or None
        Time, reference, output and the command in force; None if the run was too short.
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
        plain = {**vars(self), "link": self.link.to_dict(), "period": vars(self.period)}
        plain["age_when_applied"] = vars(self.age_when_applied)
        del plain["recording"]
        return plain
