"""`latency`: the time from command to response of every loop in a log."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deadtime._base.digits import stated
from deadtime._base.drawing import Figure
from deadtime._base.frozen import FrozenDict, ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.plain import plain_fields
from deadtime._base.progress import Stages, stage_report
from deadtime.estimation import SharedNumber, shared_number
from deadtime.logs._link import Link
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._open import open_log
from deadtime.logs.latencies._budget import Stage, stages_of
from deadtime.logs.latencies._contradictions import doubted_by_others
from deadtime.logs.latencies._controller import (
    Command,
    between_rows,
    hidden_between_rows,
    hold_of,
    known_commands,
    smeared,
)
from deadtime.logs.latencies._filters import FilterDelay, filters_of
from deadtime.logs.latencies._live import around_the_vehicle
from deadtime.logs.latencies._relation import LoopLatency, doubted_by_clocks, relation_of
from deadtime.logs.latencies._windows import (
    Window,
    best_of,
    others_of,
    parts_of,
    rows_of_a_window,
    seen_windows,
    window_of,
)
from deadtime.logs.latencies._words import said_of
from deadtime.recordings import Recording


@dataclass(frozen=True, eq=False)
class Latency(ReadOnlyArrays, Pictured):
    """Where in a vehicle the time goes, from one log.

    Attributes
    ----------
    source, vehicle : str
        The file, and autopilot and vehicle.
    loops : tuple of LoopLatency
        For each loop the time from setpoint to response, and from what its controller commands to
        the response; with the reason where it was refused.
    stages : dict of str to tuple of Stage
        The budget of each loop.
    filters : tuple of FilterDelay
        The filters that the parameters of the log name.
    remarks : tuple of str
        What was damaged or left out of the log.
    link : Link or None
        The way of the messages to the ground station, in a tlog.
    """

    source: str
    vehicle: str
    loops: tuple[LoopLatency, ...]
    stages: Mapping[str, tuple[Stage, ...]] = field(default_factory=dict)
    filters: tuple[FilterDelay, ...] = ()
    remarks: tuple[str, ...] = ()
    link: Link | None = None

    def loop(self, name: str, command: Command = "setpoint") -> LoopLatency:
        """The time of one loop.

        Raises
        ------
        ValueError
            When there is no such loop; the message lists those there are.
        """
        for one in self.loops:
            if one.loop == name and one.command == command:
                return one
        has = ", ".join(f"{one.loop!r} from {one.command}" for one in self.loops) or "none"
        raise ValueError(f"no time of {name!r} from its {command}: there are {has}")

    @property
    def estimated(self) -> tuple[LoopLatency, ...]:
        """The loops whose time was not refused."""
        return tuple(one for one in self.loops if one.estimate is not None)

    def shared(self, kind: str, command: Command = "actuator", name: str = "delay") -> SharedNumber:
        """What the loops of one kind say together about a number that they share.

        Parameters
        ----------
        kind : str
            ``"rate"``, ``"attitude"``, ``"velocity"`` or ``"position"``.
        command : {"actuator", "setpoint"}
            From what the time counts.
        name : str
            ``"delay"``, or ``"delay+lag"`` where the axes are alike.

        Returns
        -------
        SharedNumber
            Of the reliable estimates, each with its own gain, lag and noise. The vertical axis is
            one of them; ``axes=`` of `latency` chooses.

        Raises
        ------
        ValueError
            When fewer than two of these loops have a reliable estimate.
        """
        asked = [one for one in self.loops if (one.kind, one.command) == (kind, command)]
        fits = [one.estimate for one in asked if one.estimate is not None]
        told = [fit for fit in fits if fit.verdict == "reliable"]
        if len(told) < 2:
            raise ValueError(
                f"{len(told)} of the {len(asked)} loops of {kind} have a reliable estimate from "
                f"the {command}: a shared number needs two"
            )
        return shared_number(told, name)

    def headline(self) -> str:
        """The shortest answer: the fastest loop of the vehicle that is told, in one line."""
        told = sorted(self.estimated, key=_order)
        if not told:
            return f"none: no loop of {self.source} tells how long it takes to respond"
        return told[0].headline()

    def summary(self) -> str:
        """All loops, their budget and what it costs, in lines of text."""
        lines = [self.headline(), f"{self.source}: {self.vehicle}", ""]
        for one in self.estimated:
            lines += self._lines(one)
        refused = [one for one in self.loops if one.estimate is None]
        if refused:
            lines.append("refused:")
            lines += [f"  {one.name}: {one.refusal}" for one in refused]
        if self.link is not None:
            lines.append(self.link.summary())
        return "\n".join([*lines, *self.remarks])

    def _lines(self, one: LoopLatency) -> list[str]:
        first, *others = said_of(one)
        lines = [first, *(f"  {words}" for words in others)]
        if one.command == "actuator" or (one.loop, "actuator") not in {
            (other.loop, other.command) for other in self.estimated
        }:
            lines += [f"  {stage.line()}" for stage in self.stages.get(one.loop, ()) if stage.part]
        return lines

    def to_dict(self) -> dict[str, Any]:
        """All results as plain values for JSON."""
        return plain_fields(
            {
                "source": self.source,
                "vehicle": self.vehicle,
                "loops": [one.to_dict() for one in self.loops],
                "stages": {
                    name: [one.to_dict() for one in some] for name, some in self.stages.items()
                },
                "filters": [one._asdict() for one in self.filters],
                "remarks": self.remarks,
                "link": None if self.link is None else self.link.to_dict(),
            }
        )

    def plot(self) -> Figure:
        """Draw delay and lag of each loop with their intervals. Needs matplotlib."""
        from deadtime.logs.latencies._plots import plot_latency

        return plot_latency(self.source, self.estimated)

    def _picture(self) -> Figure | None:
        return self.plot() if self.estimated else None

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write one HTML file with all of it: the budget, each fit and the gains.

        Needs matplotlib.
        """
        from deadtime._base.page import page, write_page
        from deadtime.logs.latencies._page import budget_of, fit_of, row_of, sentence

        told = self.estimated
        text = page(
            "logs/latencies/page.html",
            title=f"Latencies in {self.source}",
            described=self.vehicle,
            verdict=self.headline(),
            rows=[row_of(one) for one in told],
            all=self._picture(),
            budget=budget_of(self.stages),
            filters=[
                (one.name, one.path, stated(one.delay, 0.0, "s"), one.source)
                for one in self.filters
            ],
            link="" if self.link is None else sentence(self.link.summary()),
            fits=[fit_of(one) for one in told],
            refused=[one for one in self.loops if one.estimate is None],
            remarks=self.remarks,
            around=around_the_vehicle(told),
        )
        return write_page(text, Path(path))

    def __repr__(self) -> str:
        return f"<Latency of {self.source}: {len(self.estimated)} of {len(self.loops)} loops told>"


def _order(one: LoopLatency) -> tuple[bool, int, bool, float]:
    """Reliable estimates first, inner loops before outer ones, then the vehicle alone."""
    kinds = ("rate", "attitude", "velocity", "position", "")
    assert one.estimate is not None
    kind = kinds.index(one.kind) if one.kind in kinds else len(kinds)
    return (one.estimate.verdict != "reliable", kind, one.command == "setpoint", one.promise)


def latency(
    log: Log | Recording | str | os.PathLike[str],
    *,
    axes: Iterable[str] | None = None,
    loops: Iterable[str] | None = None,
    progress: Stages = False,
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
        Print the time of each loop as soon as it is found, or call a function with that line.

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
    Of each loop the windows are ranked by the Cramér-Rao bound of delay and lag together that they
    promise. The best is fitted by gain, delay and one lag, or two lags where one is an indication;
    where that is, together with up to two others. From the setpoint, two lags that come out alike
    give way to a pair of complex poles if that is reliable, as of a rate loop that is closed by a
    proportional controller. From the setpoint the plant follows its command;
    from what the controller commands it integrates.

    Where command and response are stamped by clocks that drift apart, by more than a tenth of the
    interval over the log, the estimate is an indication. The time of each window over the log tells
    that, and stamps that are regular. Nor is an estimate reliable if one of the two next best
    windows, fitted by itself, contradicts it, nor those of north and east whose intervals lie apart
    by more than a factor of two.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(600) * 0.01
    >>> told = np.where(time < 0.3, 0.0, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))))
    >>> vehicle = dtm.FactoredPlant([0.08]).transfer_function() * dtm.delay(0.03)
    >>> angle = np.ravel(vehicle.simulate(time, told).outputs)
    >>> angle = angle + 0.003 * np.random.default_rng(1).standard_normal(600)
    >>> found = dtm.latency(dtm.Recording(time, told, angle))
    >>> time, stderr, (low, high) = found.loops[0].sum_of()
    >>> low < 0.11 < high
    True
    """
    report = stage_report(progress)
    if isinstance(log, Recording):
        return _of_recording(log)
    if not isinstance(log, Log):
        log = open_log(log)
    chosen = _chosen(log, axes, loops)
    wanted = [(loop, one) for loop in chosen for one in _commands(loop)]
    found = doubted_by_others(_all_told(log, wanted, report))
    filters = filters_of(log)
    stages = {loop.name: stages_of(log, loop.name, found, filters) for loop in chosen}
    vehicle = " ".join(one for one in (log.autopilot, log.vehicle, log.firmware) if one)
    return Latency(
        source=log.source,
        vehicle=vehicle or log.format,
        loops=tuple(found),
        stages=FrozenDict({name: some for name, some in stages.items() if some}),
        filters=filters,
        remarks=(*log.remarks, *_sent_from_the_ground(log, chosen)),
        link=log.link,
    )


def _sent_from_the_ground(log: Log, loops: list[LogLoop]) -> list[str]:
    """A remark on setpoints that the ground station stamped when it sent them."""
    if log.link is None:
        return []
    names = [one.name for one in loops if one.setpoint.source.startswith("SET_")]
    if not names:
        return []
    half = log.link.half_round_trip
    worth = (
        "which this log does not tell"
        if half is None
        else f"at least {stated(2.0 * half, 0.0, 's')}"
    )
    return [
        f"{', '.join(names)}: the setpoint is stamped where it was sent, on the ground; its time "
        f"to the response holds the link there and back, {worth}"
    ]


def _chosen(log: Log, axes: Iterable[str] | None, names: Iterable[str] | None) -> list[LogLoop]:
    """The loops asked for."""
    found = list(log.loops.values())
    for what, wanted in (("axis", axes), ("name", names)):
        if wanted is None:
            continue
        asked = [wanted] if isinstance(wanted, str) else list(wanted)
        has = list(dict.fromkeys(getattr(loop, what) for loop in log.loops.values()))
        for one in asked:
            if one not in has:
                raise ValueError(
                    f"{log.source} has no loop with the {what} {one!r}, it has "
                    f"{', '.join(has) or 'none'}"
                )
        found = [loop for loop in found if getattr(loop, what) in asked]
    return found


def loops_asked_for(
    log: Log, axes: Iterable[str] | None = None, loops: Iterable[str] | None = None
) -> int:
    """How many times `latency` will estimate."""
    return sum(len(list(_commands(loop))) for loop in _chosen(log, axes, loops))


def _all_told(
    log: Log, wanted: list[tuple[LogLoop, Command]], report: Callable[[str], object]
) -> list[LoopLatency]:
    """Each in a thread: the kernel computes beside the interpreter.

    One of few rows comes first, for an early answer, then those of many: no core waits long for the
    last.
    """
    pool = ThreadPoolExecutor(min(len(wanted), os.cpu_count() or 1) or 1)
    order = sorted(range(len(wanted)), key=lambda k: rows_of_a_window(wanted[k][0]))
    order = [*order[:1], *order[:0:-1]]
    try:
        begun = {pool.submit(_told, log, *wanted[k]): k for k in order}
        found = {}
        for one in as_completed(begun):
            found[begun[one]] = one.result()
            report(one.result().headline())
        return [found[k] for k in range(len(wanted))]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _commands(loop: LogLoop) -> Iterator[Command]:
    yield "setpoint"
    if loop.actuator is not None:
        yield "actuator"


def _told(log: Log, loop: LogLoop, command: Command) -> LoopLatency:
    if not loop.segments:
        why = "; ".join(loop.why_left_out) or "it is never followed"
        return LoopLatency(loop.name, loop.axis, loop.kind, command, (), math.inf, None, why)
    told = loop.signals[command]
    between = between_rows(log, loop.kind, told)
    loop = known_commands(log, loop, command, between)
    told = loop.signals[command]
    seen = seen_windows(loop, command, between)
    windows = best_of(seen)

    def held(window: Window) -> Recording:
        return loop.recording(window.start, window.stop, command=command, between="held")

    hidden = 0.0
    unsure = hold_of(log, loop.kind)[1] if between == "lines" else 0.0
    if windows:
        first = (windows[0].start, windows[0].stop)
        hidden = hidden_between_rows(told, between, *first)
        if between == "lines":
            unsure = math.hypot(unsure, smeared(log, loop.kind, told, *first))
    found = relation_of(
        loop.name, loop.axis, loop.kind, command, windows, between,
        held if between is None else None, hidden, unsure, others_of(seen, windows),
    )  # fmt: skip
    named = ((one.source, one.time) for one in (told, loop.response))
    return doubted_by_clocks(found, [one for one in seen if one.tells], *named)


def _of_recording(recording: Recording) -> Latency:
    """A single recording: from its command, or from its reference where it has none."""
    follows = recording.command is None
    command: Command = "setpoint" if follows else "actuator"
    told = recording
    if follows:
        told = Recording(
            recording.time, recording.reference, recording.output,
            command=recording.reference, units=recording.units, source=recording.source,
        )  # fmt: skip
    window = window_of(told, not follows)
    one = relation_of(recording.source or "recording", "", "", command, [window])
    if recording.sent is not None:
        one = doubted_by_clocks(
            one, parts_of(told, not follows),
            ("the commands", recording.sent.time), ("the rows", recording.time),
        )  # fmt: skip
    return Latency(recording.source or "recording", "a recording", (one,))
