"""The vehicle alone under its logged commands, as least squares and the likelihood take it.

    y(t_i) = b + a F(t_i - Td; lag) + noise,

F the exact response of 1/(s (lag s + 1)), or of another plant, to the command as it was held, a the
gain, b the output at the start. For a given delay and lag the best a and b are
linear least squares (variable projection, Golub & Pereyra 1973).

Rows before a known digital filter are averaged, at least in pairs. They are averaged over the time
by which the filter is late, in which filtered rows are alike. The filter and its inverse are those
of the kernel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._least_squares import Ends, ModelOfOne
from deadtime.estimation._plant import behind_limits, plant_model
from deadtime.estimation.data._checks import check_moves
from deadtime.estimation.data._simulated import commands_of, limited
from deadtime.estimation.methods._method import Run
from deadtime.loops import FirstOrder, Integrator, P, Plant, RateLimited
from deadtime.recordings import Recording

#: Names of the limits of the rate of a command.
RATE_LIMITS = ("rate", "rate_of_rate")


class Assumed(NamedTuple):
    """What is assumed of the rows.

    Attributes
    ----------
    initial_output : float, optional
    computed : bool
        Whether the commands are computed from the recorded output.
    output_filter : KnownFilter, optional
    air : {"command", "vehicle"}
    intervals : {"all", "sum"}
    complete : bool
        Whether commands with times of their own are all there: each holds until the next.
    """

    initial_output: float | None = None
    computed: bool = False
    output_filter: native.KnownFilter | None = None
    air: Literal["command", "vehicle"] = "command"
    intervals: Literal["all", "sum"] = "all"
    complete: bool = False


@dataclass(frozen=True, eq=False)
class CommandedModel(ModelOfOne):
    """Residuals of one recording."""

    plant: Plant
    known: Mapping[str, float]
    source: str
    commands: native.HeldCommands
    rows: native.FlightRows
    repeated: list[int]
    start: Array

    def limited(self, rows: native.FlightRows, values: Mapping[str, float]) -> native.FlightRows:
        """The rows with the command that the plant gets within these limits of its rate."""
        if not isinstance(self.plant, RateLimited):
            return rows
        limits = {name: values[name] for name in RATE_LIMITS if name in values}
        held = self.plant._replace(limits).limited(self.commands.time, self.commands.command)
        return rows.under(*held)

    def started(self, fit: native.FlightFit, limits: Mapping[str, float]) -> CommandedModel:
        """The same with its search started from a fit of the likelihood within these limits."""
        numbers = fit.with_gain
        values = {"delay": numbers.delay, "gain": numbers.gain, "zero": numbers.zero, **limits}
        values |= dict(zip(fit.plant.lag_names, numbers.lags, strict=True))
        known = {**self.known, **{name: values[name] for name in self.known if name in values}}
        point = np.array([*(values[name] for name in self.names), 0.0])
        moved = replace(self, known=known, start=point[: len(self.labels)])
        if self.offset is None:
            point[-1] = -float(np.mean(moved.misfit(point)))
        return moved

    @property
    def kernel(self) -> native.CommandedMisfit:
        """The misfit of the kernel."""
        plant, data, commands = behind_limits(self.plant), self.recording, self.commands
        integrates, rests = isinstance(plant, Integrator), isinstance(plant, FirstOrder)
        slow = "lag" if integrates else "time_constant" if rests else ""
        numbers = {**plant.parameters, **self.known, "gain": 1.0}
        return native.CommandedMisfit(
            data.time,
            data.output,
            (commands.time, commands.command),
            plant=None if slow else plant._polynomials(numbers),
            slow=slow,
            is_limited=isinstance(self.plant, RateLimited),
            names=self.names,
            known=self.known,
            start=self.offset,
        )

    @cached_property
    def span(self) -> float:
        return float(self.recording.time[-1] - self.recording.time[0])

    def ends(self, label: str) -> Ends:
        size = abs(self.known.get(label, 1.0))
        found = {
            "delay": Ends(0.0, native.LONGEST_DELAY * self.span),
            "lag": Ends(0.0, self.span),
            **dict.fromkeys(("time_constant", *RATE_LIMITS), Ends(1e-3 * size, 1e3 * size)),
        }.get(label, Ends(-np.inf, np.inf))
        return found._replace(starts=[float(self.start[self.labels.index(label)])])


def commanded_model(run: Run, names: tuple[str, ...], assumed: Assumed) -> CommandedModel:
    """Commands up to the end of the window, including those before its start where known."""
    recording, loop, window, *_ = run
    initial_output, computed, known, _, _, complete = assumed
    rows = recording.rows(*window)
    data = recording.window(*window) if known is None else before_filter(recording, rows, known)
    command, source = commands_of(recording, loop, computed)
    command = command[: rows.stop]
    if len(data) < _fewest(names):
        raise NotIdentifiableError(
            f"{len(data)} samples are too few to fit {len(names)} "
            "parameters and an initial output: choose a longer window"
        )
    check_moves(data.output, command)
    integrates = plant_model(loop.plant, ()).integrates
    if data.sent is not None and not computed:
        sent = data.sent.time, limited(data.sent.values, loop)
        commands = native.HeldCommands.with_times(*sent, data.time, integrates, complete)
    else:
        commands = native.HeldCommands.of_rows(
            recording.time[: rows.stop],
            recording.reference[: rows.stop],
            recording.output[: rows.stop],
            command,
            sample_time=loop.sample_time,
            gain=loop.controller.gains.get("Kp", 0.0),
            is_proportional=isinstance(loop.controller, P),
            limit=math.inf if loop.limit is None else loop.limit,
            window=data.time,
            integrates=integrates,
        )
    if isinstance(loop.plant, RateLimited) and data.sent is None and commands.are_computed:
        raise NotIdentifiableError(
            "rows are further apart than the samples of the controller, so "
            "commands are missing. But a plant with a rate limit depends "
            "on every command. Choose a window without missing rows"
        )
    repeated = [] if run.check is None or known is not None else run.check.repeated.tolist()
    read = native.FlightRows.read(data.time, data.output, repeated, commands, initial_output)
    if read.rounding and read.count < _fewest(names):
        raise NotIdentifiableError(
            f"the output is rounded to {read.rounding:g}, and moves over only {read.count} such "
            f"steps, too few to fit {len(names)} parameters and an initial output. Choose "
            "a longer window, or one in which the output moves more"
        )
    return CommandedModel(
        recording=data,
        names=names,
        offset=initial_output,
        plant=loop.plant,
        known={"delay": 0.0, "gain": 1.0, **loop.parameters},
        source=source,
        commands=commands,
        rows=read,
        repeated=repeated,
        start=np.empty(0),
    )


def _fewest(names: tuple[str, ...]) -> int:
    """Rows below which these numbers are not fitted."""
    return 2 * (len(names) + 2)


#: Coefficients (b, a) in powers of 1/z.
GivenFilter: TypeAlias = tuple[Sequence[float], Sequence[float]]

#: Largest difference between two steps of time in rows of a filter, as a share of the mean step.
EVEN = 0.5


def known_filter(given: GivenFilter | None) -> native.KnownFilter | None:
    """The filter (b, a), as scipy.signal designs and takes it, with its inverse.

    Raises
    ------
    TypeError
        If it is not a pair of sequences of numbers.
    ValueError
        If it is not finite or not stable, or cannot be undone.
    """
    if given is None:
        return None
    try:
        b, a = (np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in given)
    except (TypeError, ValueError):
        raise TypeError(
            f"output_filter={given!r}: give (b, a), two lists of coefficients in powers of 1/z"
        ) from None
    for name, part in (("b", b), ("a", a)):
        if part.ndim != 1 or not np.all(np.isfinite(part)) or not np.any(part):
            raise ValueError(f"{name}={part.tolist()}: give finite coefficients, not all zero")
    found, is_stable = native.KnownFilter.inverted(b.tolist(), a.tolist())
    if not is_stable:
        raise ValueError(
            f"a={a.tolist()}: the filter with these "
            "coefficients is not stable. Check the coefficients"
        )
    if found is None:
        raise ValueError(
            f"b={b.tolist()}: the filter cannot be undone. It removes a frequency that "
            "the response needs, or has a zero outside the unit circle. Leave the filter "
            "out"
        )
    return found


def before_filter(recording: Recording, rows: slice, known: native.KnownFilter) -> Recording:
    """What the sensor read in these rows, averaged, at the times it read it.

    Raises
    ------
    NotIdentifiableError
        If the rows are not the samples of the filter, one after the other.
    """
    steps = np.diff(recording.time)
    between = float(np.mean(steps))
    if np.max(np.abs(steps - between)) > EVEN * between:
        raise NotIdentifiableError(
            f"rows are {steps.min():g} to {steps.max():g} s apart, but a filter can be "
            "undone only in evenly spaced rows: choose a window without missing rows"
        )
    together = known.together
    first = max(rows.start, known.start)
    count = max(0, rows.stop - first) // together
    if count < together:
        raise NotIdentifiableError(
            f"{len(recording)} rows are too few to undo the filter: give a longer recording"
        )
    kept = slice(first, first + count * together)

    def mean(values: Array) -> Array:
        return np.asarray(values[kept].reshape(count, together).mean(axis=1))

    command = None if recording.command is None else mean(recording.command)
    return Recording(
        mean(recording.time) - known.remaining * between,
        mean(recording.reference),
        mean(known.undone(recording.output)),
        command,
        dict(recording.units),
        recording.source,
    )
