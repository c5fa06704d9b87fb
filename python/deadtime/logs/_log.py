"""What a log of an autopilot tells: its loops, modes and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Literal

from deadtime._base.errors import RecordingError, printable
from deadtime._base.frozen import FrozenDict, ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime.logs._contents import LogContents
from deadtime.logs._link import Link
from deadtime.logs._names import AutopilotNames, Kind, LoopNames
from deadtime.logs._recording import recording_of
from deadtime.logs._segments import segments_of
from deadtime.logs._series import DAY, Series, first_series, increasing
from deadtime.recordings import Recording


@dataclass(frozen=True, eq=False)
class LogLoop(ReadOnlyArrays):
    """One loop in a log: what was asked for, what came, and when it was followed.

    Attributes
    ----------
    name : str
        For example ``"roll rate"``, ``"pitch"``, ``"vertical speed"``, ``"north position"``.
    axis : str
        ``"roll"``, ``"pitch"``, ``"yaw"``, ``"north"``, ``"east"``, ``"vertical"`` or, of a
        rover, ``"forward"``.
    kind : str
        ``"rate"``, ``"attitude"``, ``"velocity"`` or ``"position"``; an altitude is a position.
    setpoint, response : Series
        Each with its own times, in rad, rad/s, m or m/s. Vertical ones count upwards.
    actuator : Series or None
        What the controller of this loop sets: the setpoint of the next inner loop, or the torque
        or thrust; None if it is not logged.
    segments : tuple of (float, float)
        Windows, s from the start of the log, in which the setpoint is really followed: the vehicle
        is armed and in the air, the mode closes the loop, both signals are finite and without
        gaps, and the setpoint is no copy of the estimate.
    why_left_out : tuple of str
        A sentence for each reason why other time is no segment.
    """

    name: str
    axis: str
    kind: Kind
    setpoint: Series
    response: Series
    actuator: Series | None
    segments: tuple[tuple[float, float], ...]
    why_left_out: tuple[str, ...]

    def __repr__(self) -> str:
        return (
            f"<LogLoop {self.name}: {self.setpoint.source} to {self.response.source}, "
            f"{len(self.segments)} segments, {self.followed:.4g} s>"
        )

    @property
    def signals(self) -> dict[str, Series]:
        """Setpoint, response and, if it is logged, actuator."""
        found = {"setpoint": self.setpoint, "response": self.response}
        return found if self.actuator is None else {**found, "actuator": self.actuator}

    @property
    def followed(self) -> float:
        """Length of all segments, s."""
        return float(sum(stop - start for start, stop in self.segments))

    def recording(
        self,
        start: float | None = None,
        stop: float | None = None,
        *,
        command: Literal["setpoint", "actuator"] = "setpoint",
    ) -> Recording:
        """The loop as a recording: how the response follows the setpoint, or the actuator.

        Parameters
        ----------
        start, stop : float, optional
            The part to take, s; by default the longest window in which the setpoint is followed.
        command : {"setpoint", "actuator"}
            What counts as the command. With ``"setpoint"`` the loop is closed inside the vehicle,
            and a plant that follows the command describes it; with ``"actuator"`` it is what the
            controller of this loop commands.

        Returns
        -------
        Recording
            Its rows are those of the response. Commands have the times of their rows
            (`Recording.sent`). Where the controller computes them more often than the log has
            them, `estimate_delay` takes them with ``between="straight"``.

        Raises
        ------
        RecordingError
            When the loop is never followed and no part is given, when the actuator is not logged,
            or when fewer than 8 rows lie in the part.
        """
        if command not in ("setpoint", "actuator"):
            raise ValueError(f"command={command!r}: give 'setpoint' or 'actuator'")
        if command not in self.signals:
            raise RecordingError(
                f"the log does not contain the command that the controller of {self.name} gives"
            )
        if start is None and stop is None:
            if not self.segments:
                why = "; ".join(self.why_left_out)
                raise RecordingError(f"{self.name} never follows its setpoint: {why}")
            start, stop = max(self.segments, key=lambda ends: ends[1] - ends[0])
        sent = self.signals[command]
        return recording_of(self.name, self.setpoint, self.response, sent, (start, stop))

    def headline(self) -> str:
        """The loop in one line."""
        rates = f"{self.setpoint.rate:.4g} and {self.response.rate:.4g} Hz"
        windows = f"{len(self.segments)} window{'s' if len(self.segments) > 1 else ''}"
        followed = f"{self.followed:.2f} s in {windows}" if self.segments else "never"
        return (
            f"{self.name}: {self.setpoint.source} → {self.response.source} "
            f"[{self.response.unit}], {rates}; followed: {followed}"
        )

    def summary(self) -> str:
        """The loop in lines of text."""
        lines = [self.headline()]
        for name, series in self.signals.items():
            gaps = f", {len(series.gaps)} gaps" if series.gaps else ""
            unit = f" [{series.unit}]" if series.unit else ""
            lines.append(f"  {name}: {series.source}{unit}, {series.rate:.4g} Hz{gaps}")
            if series.conversion:
                lines.append(f"    converted: {series.conversion}")
        shown = ", ".join(f"{start:.2f} to {stop:.2f}" for start, stop in self.segments)
        if shown:
            lines.append(f"  followed from {shown} s")
        lines.extend(f"  {reason}" for reason in self.why_left_out)
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """What the loop is, as plain values; without the rows."""
        signals = {
            name: {
                "source": series.source,
                "unit": series.unit,
                "conversion": series.conversion,
                "rate": series.rate,
                "rows": len(series),
                "gaps": series.gaps,
            }
            for name, series in self.signals.items()
        }
        return plain_fields(
            {
                "name": self.name,
                "axis": self.axis,
                "kind": self.kind,
                "signals": signals,
                "segments": self.segments,
                "followed": self.followed,
                "why_left_out": self.why_left_out,
            }
        )


@dataclass(frozen=True, eq=False)
class Log(ReadOnlyArrays):
    """A log of an autopilot.

    Attributes
    ----------
    source : str
        Name of the file.
    format : str
        ``"ULog"``, ``"DataFlash"``, ``"DataFlash text"``, ``"sdlog2"`` (PX4 before ULog),
        ``"tlog"``, ``"Blackbox"`` or ``"Crazyflie uSD"``.
    autopilot, vehicle, firmware : str
        As the log tells; empty if it does not.
    start : float
        Time of the first message on the vehicle's clock, s. All other times count from it.
    duration : float
        From the first to the last message, s.
    parameters, key_parameters : dict of str to float
        Parameters of the autopilot; those of them that matter to a delay, which are gains, loop
        rates and filter corners.
    modes : tuple of (float, str)
        Flight modes, each with the time from which it holds, s.
    loops : dict of str to LogLoop
        The loops that are in the log, by name.
    gaps : tuple of (float, float)
        Where the logger lost data, s.
    remarks : tuple of str
        What was damaged or left out, in sentences.
    link : Link or None
        The way of the messages to the ground station, in a tlog.
    contents : LogContents
        All topics, by their names in the log, with times on the vehicle's clock.
    """

    source: str
    format: str
    autopilot: str
    vehicle: str
    firmware: str
    start: float
    duration: float
    parameters: dict[str, float]
    key_parameters: dict[str, float]
    modes: tuple[tuple[float, str], ...]
    loops: Mapping[str, LogLoop]
    gaps: tuple[tuple[float, float], ...]
    remarks: tuple[str, ...]
    link: Link | None
    contents: LogContents = field(repr=False)

    def __repr__(self) -> str:
        who = " ".join(part for part in (self.autopilot, self.vehicle) if part)
        return (
            f"<Log {self.source}: {self.format}{' of ' if who else ''}{who}, "
            f"{self.duration:.4g} s, {len(self.loops)} loops>"
        )

    def _shown(self) -> dict[str, Any]:
        """Two logs are equal by what was made of their contents."""
        return {name: value for name, value in super()._shown().items() if name != "contents"}

    def loop(self, name: str) -> LogLoop:
        """The loop of this name.

        Raises
        ------
        ValueError
            When the log has no such loop; the message lists those it has.
        """
        if name not in self.loops:
            has = ", ".join(self.loops) or "none"
            raise ValueError(f"{self.source} has no loop {name!r}. Its loops are {has}")
        return self.loops[name]

    def summary(self) -> str:
        """The log in lines of text."""
        from deadtime.logs.latencies._filters import filter_lines

        kind = f"{self.source}: {self.format}, {self.duration:.2f} s"
        lines = [", ".join(part for part in (kind, self.autopilot, self.vehicle) if part)]
        if self.firmware:
            lines.append(f"firmware: {self.firmware}")
        if self.modes:
            spans = ", ".join(f"{name} from {at:.2f} s" for at, name in self.modes)
            lines.append(f"modes: {spans}")
        lines.extend(loop.headline() for loop in self.loops.values())
        if not self.loops:
            lines.append("for no loop the log contains both the setpoint and the response")
        if self.key_parameters:
            shown = ", ".join(f"{name} = {value:g}" for name, value in self.key_parameters.items())
            lines.append(f"parameters: {shown}")
        lines.extend(filter_lines(self))
        if self.link is not None:
            lines.append(self.link.summary())
        lines.extend(self.remarks)
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """What the log is, as plain values; without the rows."""
        names = "source format autopilot vehicle firmware start duration parameters key_parameters"
        found = {name: getattr(self, name) for name in names.split()}
        modes = [{"from": at, "name": name} for at, name in self.modes]
        loops = [loop.to_dict() for loop in self.loops.values()]
        link = None if self.link is None else self.link.to_dict()
        rest = {"modes": modes, "loops": loops, "gaps": self.gaps, "remarks": self.remarks}
        return plain_fields({**found, **rest, "link": link})


def log_of(contents: LogContents, names: AutopilotNames, source: str) -> Log:
    """The log with the loops of the table that are in it."""
    start, stop = _span(contents, source)
    remarks = list(contents.remarks)
    loops = {}
    for named in names.loops:
        loop = _loop(contents, named, start, remarks)
        if loop is not None and loop.name not in loops:
            loops[loop.name] = loop
    key = {
        printable(name): value
        for pattern in names.key_parameters
        for name, value in sorted(contents.parameters.items())
        if fnmatchcase(name, pattern)
    }
    return Log(
        source=source,
        format=contents.format,
        autopilot=contents.autopilot,
        vehicle=printable(contents.vehicle),
        firmware=printable(contents.firmware),
        start=start,
        duration=stop - start,
        parameters=dict(contents.parameters),
        key_parameters=key,
        modes=tuple((max(0.0, at - start), printable(name)) for at, name in contents.modes),
        loops=FrozenDict(loops),
        gaps=tuple((low - start, high - start) for low, high in contents.gaps),
        remarks=tuple(dict.fromkeys(map(printable, remarks))),
        link=contents.link,
        contents=contents,
    )


def _span(contents: LogContents, source: str) -> tuple[float, float]:
    """First and last time of the log."""
    if contents.span is not None:
        return contents.span
    ends = []
    for topic in contents.topics.values():
        time = topic.time[increasing(topic.time)]
        if time.size:
            ends.append((time.size, float(time[0]), float(time[-1])))
    if not ends:
        raise RecordingError(f"{source} is a {contents.format} log that contains no message")
    _, first, last = max(ends)
    near = [(low, high) for _, low, high in ends if low > first - DAY and high < last + DAY]
    return min(low for low, _ in near), max(high for _, high in near)


def _loop(
    contents: LogContents, names: LoopNames, start: float, remarks: list[str]
) -> LogLoop | None:
    """One loop of the table, or None if it is not in the log."""
    setpoint, lost = first_series(contents, names.setpoint, start)
    response, lost_too = first_series(contents, names.response, start)
    if setpoint is None or response is None:
        return None
    actuator, _ = first_series(contents, names.actuator, start)
    for series, count in ((setpoint, lost), (response, lost_too)):
        if count:
            topic = series.source.partition(".")[0]
            remarks.append(
                f"{topic}: {count} rows are left out because their time repeats or goes back"
            )
    segments, reasons = segments_of(contents, setpoint, response, names.conditions, start)
    return LogLoop(
        names.name, names.axis, names.kind, setpoint, response, actuator, segments, reasons
    )
