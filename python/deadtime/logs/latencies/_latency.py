"""`latency`: the time from command to response of every loop in a log."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

from deadtime._base.digits import stated
from deadtime._base.drawing import Figure
from deadtime._base.frozen import FrozenDict, ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.plain import plain_fields
from deadtime.logs._link import Link
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._open import open_log
from deadtime.logs.latencies._advice import Advice, advice
from deadtime.logs.latencies._below import below, refused_of
from deadtime.logs.latencies._beside import beside_plain_numbers
from deadtime.logs.latencies._budget import Stage, stages_of
from deadtime.logs.latencies._clocks import why_two_clocks
from deadtime.logs.latencies._commands import Command, averaged, sampling_of
from deadtime.logs.latencies._contradictions import ALIKE, doubted_by_others
from deadtime.logs.latencies._filters import FilterDelay, filters_of
from deadtime.logs.latencies._live import around_the_vehicle
from deadtime.logs.latencies._moves import Moves
from deadtime.logs.latencies._relation import FEW, LoopLatency, relation_of
from deadtime.logs.latencies._table import HEADS, LatencyTable, cells_of
from deadtime.logs.latencies._windows import (
    moving_of,
    parts_of,
    prepared,
    together_of,
    windows_of,
)
from deadtime.logs.latencies._words import in_full
from deadtime.recordings import Recording

#: Standard error as a share of a time above which it is no headline while there is a better one.
WIDE = 0.5

#: Where a recording of few moves belongs.
OF_A_PROCESS = Advice(
    "for a bump test, `deadtime estimate` finds the dead time, and `deadtime tune` proposes gains",
    "",
)

#: A function that is called with the time of each loop, or whether to print them.
Found: TypeAlias = bool | Callable[[LoopLatency], object]


@dataclass(frozen=True, eq=False)
class Latency(ReadOnlyArrays, Pictured):
    """How long the loops of a vehicle take to respond, from one log.

    Attributes
    ----------
    source, vehicle : str
        The file, and autopilot and vehicle.
    loops : tuple of LoopLatency
        For each loop the time from setpoint to response, and from what its controller commands to
        the response; with the reason where there is none.
    stages : dict of str to tuple of Stage
        Where the time of each loop goes.
    filters : tuple of FilterDelay
        The filters that the parameters of the log name.
    remarks : tuple of str
        What was damaged or left out of the log.
    link : Link or None
        The way of the messages to the ground station, in a tlog.
    advice : tuple of Advice
        What to log and to fly to know more.
    """

    source: str
    vehicle: str
    loops: tuple[LoopLatency, ...]
    stages: Mapping[str, tuple[Stage, ...]] = field(default_factory=dict)
    filters: tuple[FilterDelay, ...] = ()
    remarks: tuple[str, ...] = ()
    link: Link | None = None
    advice: tuple[Advice, ...] = ()

    def loop(self, name: str, command: Command = "setpoint") -> LoopLatency:
        """The time of one loop.

        Raises
        ------
        ValueError
            When there is no such loop; the message lists those there are.
        """
        for loop in self.loops:
            if loop.loop == name and loop.command == command:
                return loop
        has = ", ".join(f"{loop.loop!r} from {loop.command}" for loop in self.loops) or "none"
        raise ValueError(
            f"{name!r} has no time from its {command} to its response. There are times for {has}"
        )

    @property
    def estimated(self) -> tuple[LoopLatency, ...]:
        """The loops that have a time."""
        return tuple(loop for loop in self.loops if loop.verdict != "none")

    def headline(self) -> str:
        """The shortest answer: the fastest loop of the vehicle that has a time, in one line."""
        found = sorted(self.estimated, key=_order)
        if not found:
            return f"none: no loop of {self.source} shows how long it takes to respond"
        return found[0].headline()

    def summary(self) -> str:
        """All loops in one table, a line each, and what is most worth knowing."""
        table = LatencyTable([(loop.loop, loop.command) for loop in self.loops])
        lines = [self.heading(), "", table.head(), *table.rows(self.loops), "", *self.below()]
        return "\n".join(lines).rstrip()

    def heading(self) -> str:
        """File and vehicle."""
        return f"{self.source}: {self.vehicle}"

    def below(self) -> list[str]:
        """What is most worth knowing, in at most five lines."""
        return below(self.loops, self.advice)

    def details(self) -> str:
        """Every loop with its plant, its windows, its stages and what they cost."""
        lines = [self.heading()]
        for loop in self.estimated:
            lines += ["", *in_full(loop, self.stages.get(loop.loop, ()))]
        if refused := refused_of(self.loops):
            lines += ["", *(f"none: {names}: {reason}" for names, reason in refused)]
        if self.link is not None:
            lines += ["", self.link.summary()]
        ends = [*(part.line() for part in self.filters), *self.remarks]
        ends += [f"to know more: {suggestion.line()}" for suggestion in self.advice]
        return "\n".join([*lines, "", *ends]).rstrip()

    def to_dict(self) -> dict[str, Any]:
        """All results as plain values for JSON."""
        return plain_fields(
            {
                "source": self.source,
                "vehicle": self.vehicle,
                "loops": [loop.to_dict() for loop in self.loops],
                "stages": {
                    name: [stage.to_dict() for stage in some] for name, some in self.stages.items()
                },
                "filters": [part._asdict() for part in self.filters],
                "remarks": self.remarks,
                "link": None if self.link is None else self.link.to_dict(),
                "advice": [suggestion._asdict() for suggestion in self.advice],
            }
        )

    def plot(self) -> Figure:
        """Draw the time of each loop with its interval. Needs matplotlib."""
        from deadtime.logs.latencies._plots import plot_latency

        return plot_latency(self.source, self.estimated)

    def _picture(self) -> Figure | None:
        return self.plot() if self.estimated else None

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write one HTML file with all of it: the times, each fit and the gains.

        Needs matplotlib.
        """
        from deadtime._base.page import page, write_page
        from deadtime.logs.latencies._page import budget_of, fit_of, sentence

        found = self.estimated
        rows = [cells_of(loop) for loop in found]
        used = [k for k in range(len(HEADS)) if any(row[k] for row in rows)]
        text = page(
            "logs/latencies/page.html",
            title=f"Latencies in {self.source}",
            described=self.vehicle,
            verdict=self.headline(),
            heads=[HEADS[k] for k in used],
            rows=[[row[k] for k in used] for row in rows],
            below=[sentence(line) for line in below(self.loops, self.advice, "below")],
            all=self._picture(),
            budget=budget_of(self.stages),
            filters=[
                (part.name, part.path, stated(part.delay, 0.0, "s"), part.source)
                for part in self.filters
            ],
            link="" if self.link is None else sentence(self.link.summary()),
            fits=[fit_of(loop, *_moves_of(loop)) for loop in found],
            refused=refused_of(self.loops),
            remarks=self.remarks,
            around=around_the_vehicle(found),
        )
        return write_page(text, Path(path))

    def __repr__(self) -> str:
        return f"<Latency of {self.source}: {len(self.estimated)} of {len(self.loops)} loops>"


def _moves_of(loop: LoopLatency) -> tuple[Moves | None, Moves | None]:
    return (None if loop.plain is None else loop.plain.aligned), loop.answered


def _order(loop: LoopLatency) -> tuple[bool, bool, int, bool, float]:
    """Reliable times first, well known ones, inner loops before outer ones, the vehicle alone."""
    kinds = ("rate", "attitude", "velocity", "position", "")
    kind = kinds.index(loop.kind) if loop.kind in kinds else len(kinds)
    wide = not loop.stderr < WIDE * loop.time
    return (loop.verdict != "reliable", wide, kind, loop.command == "setpoint", loop.stderr)


def latency(
    log: Log | Recording | str | os.PathLike[str],
    *,
    axes: Iterable[str] | None = None,
    loops: Iterable[str] | None = None,
    progress: Found = False,
) -> Latency:
    """Estimate for every loop of a log how long it takes to respond.

    Parameters
    ----------
    log : Log, path or Recording
        A log of an autopilot, or one recording, whose response to its command, or to its reference
        if it has none, is taken.
    axes : iterable of str, optional
        Only loops of these axes, such as ``("roll", "pitch")``.
    loops : iterable of str, optional
        Only loops of these names, such as ``("roll rate",)``.
    progress : bool or callable, optional
        Print the row of each loop as soon as it is found, or call a function with each
        `LoopLatency`; in the order of the loops.

    Returns
    -------
    Latency

    Raises
    ------
    RecordingError
        When the file is no log.
    ValueError
        When the log has no loop of these axes or names.

    Notes
    -----
    Each loop is divided into windows. Those in which the command moves the most are fitted
    together, and then all of it: from the setpoint a plant that comes to rest, from what the
    controller commands one that integrates. The time is the equivalent delay of that plant, in the
    mean over the frequencies at which the response moves.

    Where the log holds each command of the controller, commands hold between rows. Where it holds
    only some of them they are straight, or a cubic where they are smooth, and what they may have
    been between the rows is part of the interval. So is the spread of the time between windows,
    each estimated by itself.

    From the setpoint, the plain numbers of the field stand beside the time. Where they differ from
    what the same methods give for the fit, the time is an indication.

    Where command and response are stamped by clocks that drift apart, by more than a tenth of the
    interval over the log, the time is an indication; so is one that another loop contradicts.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(600) * 0.01
    >>> command = np.where(time < 0.3, 0.0, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))))
    >>> vehicle = dtm.FactoredPlant([0.08]).transfer_function() * dtm.delay(0.03)
    >>> angle = np.ravel(vehicle.simulate(time, command).outputs)
    >>> angle = angle + 0.003 * np.random.default_rng(1).standard_normal(600)
    >>> found = dtm.latency(dtm.Recording(time, command, angle)).loops[0]
    >>> w = found.frequencies
    >>> true = float((0.03 + np.arctan(0.08 * w) / w) @ found.weights)
    >>> low, high = found.interval
    >>> bool(low < true < high)
    True
    """
    if isinstance(log, Recording):
        report = _reported(progress, loops_asked_for(log, axes, loops))
        found = _of_recording(log)
        report(found.loops[0])
        return found
    if not isinstance(log, Log):
        log = open_log(log)
    chosen = _chosen(log, axes, loops)
    wanted = [(loop, command) for loop in chosen for command in _commands(loop)]
    report = _reported(progress, [(loop.name, command) for loop, command in wanted])
    times = []
    for result in _each_of(log, wanted):
        times.append(result)
        report(result)
    filters = filters_of(log)
    stages = {loop.name: stages_of(log, loop.name, times, filters) for loop in chosen}
    return Latency(
        source=log.source,
        vehicle=_vehicle_of(log),
        loops=tuple(times),
        stages=FrozenDict({name: some for name, some in stages.items() if some}),
        filters=filters,
        remarks=(*log.remarks, *_sent_from_the_ground(log, chosen)),
        link=log.link,
        advice=advice(log, [loop.name for loop in chosen]),
    )


def heading_of(log: Log | Recording) -> str:
    """File and vehicle, as the times of a log begin."""
    return f"{_name_of(log) if isinstance(log, Recording) else log.source}: {_vehicle_of(log)}"


def _vehicle_of(log: Log | Recording) -> str:
    if isinstance(log, Recording):
        return "a recording"
    return " ".join(part for part in (log.autopilot, log.vehicle, log.firmware) if part) or (
        log.format
    )


def _sent_from_the_ground(log: Log, loops: list[LogLoop]) -> list[str]:
    """A remark on setpoints that the ground station stamped when it sent them."""
    if log.link is None:
        return []
    names = [loop.name for loop in loops if loop.setpoint.source.startswith("SET_")]
    if not names:
        return []
    half = log.link.half_round_trip
    long = (
        "but this log does not show how long the link takes"
        if half is None
        else f"at least {stated(2.0 * half, 0.0, 's')}"
    )
    return [
        f"{', '.join(names)}: the setpoint has the time at which the ground sent it. So the "
        f"time to the response contains the way over the link and back, {long}"
    ]


def _chosen(log: Log, axes: Iterable[str] | None, names: Iterable[str] | None) -> list[LogLoop]:
    """The loops asked for."""
    found = list(log.loops.values())
    for what, wanted in (("axis", axes), ("name", names)):
        if wanted is None:
            continue
        asked = [wanted] if isinstance(wanted, str) else list(wanted)
        has = list(dict.fromkeys(getattr(loop, what) for loop in log.loops.values()))
        for name in asked:
            if name not in has:
                raise ValueError(
                    f"{log.source} has no loop with the {what} {name!r}. It has "
                    f"{', '.join(has) or 'none'}"
                )
        found = [loop for loop in found if getattr(loop, what) in asked]
    return found


def loops_asked_for(
    log: Log | Recording, axes: Iterable[str] | None = None, loops: Iterable[str] | None = None
) -> list[tuple[str, Command]]:
    """The loops whose times `latency` estimates, and from what, in its order."""
    if isinstance(log, Recording):
        if axes is not None or loops is not None:
            raise ValueError(
                f"{log.source or 'the recording'} has only one loop: leave axis and loop out"
            )
        return [(_name_of(log), "setpoint" if log.command is None else "actuator")]
    return [(loop.name, signal) for loop in _chosen(log, axes, loops) for signal in _commands(loop)]


def _reported(
    progress: Found, wanted: Sequence[tuple[str, Command]]
) -> Callable[[LoopLatency], object]:
    """The function to call with each time; True prints the rows of the table on stderr."""
    if not isinstance(progress, bool):
        if not callable(progress):
            raise TypeError(
                f"progress={progress!r}: give True to print each time, or a function that takes "
                "each time"
            )
        return progress
    if not progress:
        return lambda _: None
    table = LatencyTable(wanted)
    print(table.head(), file=sys.stderr, flush=True)

    def show(result: LoopLatency) -> None:
        if (row := table.row(result)) is not None:
            print(row, file=sys.stderr, flush=True)

    return show


def _each_of(log: Log, wanted: list[tuple[LogLoop, Command]]) -> Iterator[LoopLatency]:
    """The times in their order, each as soon as those before it are found.

    Each in a thread: the kernel computes beside the interpreter. Loops that may contradict each
    other are awaited together.
    """
    pool = ThreadPoolExecutor(min(len(wanted), os.cpu_count() or 1) or 1)
    done = False
    try:
        # The first has the kernel for itself, for an early answer.
        begun = [pool.submit(latency_of, log, *asked) for asked in wanted[:1]]
        wait(begun)
        begun += [pool.submit(latency_of, log, *asked) for asked in wanted[1:]]
        alike = [place for place, (loop, _) in enumerate(wanted) if loop.axis in ALIKE]
        judged: dict[int, LoopLatency] = {}
        for place, task in enumerate(begun):
            if place in alike and not judged:
                both = doubted_by_others([begun[k].result() for k in alike])
                judged = dict(zip(alike, both, strict=True))
            yield judged[place] if place in judged else task.result()
        done = True
    finally:
        # After Ctrl-C nobody waits for what the kernel still computes.
        pool.shutdown(wait=done, cancel_futures=True)


def _commands(loop: LogLoop) -> Iterator[Command]:
    yield "setpoint"
    if loop.actuator is not None:
        yield "actuator"


def latency_of(log: Log, loop: LogLoop, command: Command) -> LoopLatency:
    """The time of one loop from one of its commands."""
    if not loop.segments:
        why = "; ".join(loop.why_left_out) or "the response never follows its setpoint"
        return LoopLatency(loop.name, loop.axis, loop.kind, command, "none", why)
    signal = loop.signals[command]
    sampling = sampling_of(log, loop.kind, signal)
    together = together_of(loop.response, loop.kind)

    def part(start: float, stop: float) -> Recording:
        rows = loop.recording(start, stop, command=command)
        return prepared(rows, loop.kind, sampling, together)

    found = relation_of(
        LoopLatency(loop.name, loop.axis, loop.kind, command, "none", "", sampling=sampling),
        windows_of(log, loop, command, sampling),
        part,
        averaged(sampling, together),
        command == "actuator",
    )
    if command == "setpoint":
        found = beside_plain_numbers(found, loop, sampling)
    # Two signals of one message have one clock.
    if found.verdict == "none" or signal.topic == loop.response.topic:
        return found
    named = ((series.source, series.time) for series in (signal, loop.response))
    why = why_two_clocks(found, *named)
    return found.doubted(why) if why else found


def _of_recording(recording: Recording) -> Latency:
    """A single recording: from its command, or from its reference where it has none."""
    ((name, command),) = loops_asked_for(recording)
    driven = recording
    if command == "setpoint":
        driven = Recording(
            recording.time, recording.reference, recording.output,
            command=recording.reference, units=recording.units, source=recording.source,
        )  # fmt: skip
    whole, parts = parts_of(driven)
    result = relation_of(LoopLatency(name, "", "", command, "none", ""), parts, whole.window)
    further: tuple[Advice, ...] = ()
    count = len(moving_of(parts))
    if result.verdict == "none" and count < min(FEW, len(parts)):
        why = (
            f"the {command} moves in {count} of {len(parts)} parts of the recording, but a time "
            f"needs {FEW}"
        )
        result, further = replace(result, reason=why), (OF_A_PROCESS,)
    if recording.sent is not None and result.verdict != "none":
        clocks = (("the commands", recording.sent.time), ("the rows", recording.time))
        if why := why_two_clocks(result, *clocks):
            result = result.doubted(why)
    return Latency(name, _vehicle_of(recording), (result,), advice=further)


def _name_of(recording: Recording) -> str:
    return recording.source or "recording"
