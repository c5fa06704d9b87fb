"""The vehicle alone under its logged commands, as least squares and the likelihood take it.

    y(t_i) = b + a F(t_i - Td; lag) + noise,

F the exact response of 1/(s (lag s + 1)), or of another plant, to the command as it was held
(`path_of`), a the gain, b the output at the start. For a given delay and lag the best a and b are
linear least squares (variable projection, Golub & Pereyra 1973).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import LONGEST_DELAY, SHORTEST_LAG
from deadtime.estimation.data._checks import check_moves
from deadtime.estimation.data._commands import commands_of
from deadtime.estimation.data._known_filter import KnownFilter, before_filter
from deadtime.estimation.data._simulated import limited
from deadtime.estimation.fit._least_squares import Ends, ModelOfOne
from deadtime.estimation.likelihood._flight import NoiseFit, PlantModel
from deadtime.estimation.likelihood._missing import HeldCommands, with_lost, with_missing
from deadtime.estimation.likelihood._rows import FlightRows, on_same_step, rounding_of
from deadtime.estimation.methods._method import Run
from deadtime.estimation.models._held import RATE_LIMITS, Path, path_of
from deadtime.loops import Plant, RateLimited
from deadtime.recordings import RecordingCheck


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
    output_filter: KnownFilter | None = None
    air: Literal["command", "vehicle"] = "command"
    intervals: Literal["all", "sum"] = "all"
    complete: bool = False


@dataclass(frozen=True, eq=False)
class CommandedModel(ModelOfOne):
    """Residuals of one recording."""

    path: Path
    plant: Plant
    known: Mapping[str, float]
    source: str
    logged: Array
    commands: HeldCommands
    start: Array
    air: Literal["command", "vehicle"]

    def refilled(self, rows: FlightRows, commands: HeldCommands, gain: float) -> FlightRows:
        """The rows with these commands, computed from outputs with errors, for this gain."""
        return rows._replace(
            command_time=commands.time,
            command=commands.command,
            unknown=(*self._before, *commands.unknown),
            uncertain=tuple((a, b, gain * slope) for a, b, slope in commands.computed if slope),
        )

    def rows(self, initial_output: float | None, check: RecordingCheck | None) -> FlightRows:
        """The rows for the likelihood, without repeated rows."""
        used = np.ones(len(self.recording), dtype=bool)
        if check is not None:
            used[check.repeated] = False
        rounding = rounding_of(self.recording.output)
        if rounding:
            used &= ~on_same_step(self.recording.output)
            if np.count_nonzero(used) < _fewest(self.names):
                raise NotIdentifiableError(
                    f"the output moves over {np.count_nonzero(used)} steps of {rounding:g}, to "
                    f"which it is rounded: too few for {len(self.names)} parameters and an initial "
                    "output; widen the window, or choose one in which it moves more"
                )
        return FlightRows(
            time=self.recording.time,
            row_time=float(np.median(np.diff(self.recording.time))),
            output=self.recording.output - (initial_output or 0.0),
            used=used,
            command_time=self.commands.time,
            command=self.commands.command,
            unknown=(*self._before, *self.commands.unknown),
            offset=initial_output is None,
            rounding=rounding,
        )

    def limited(self, rows: FlightRows, values: Mapping[str, float]) -> FlightRows:
        """The rows with the command that the plant gets within these limits of its rate."""
        if not isinstance(self.plant, RateLimited):
            return rows
        limits = {name: values[name] for name in RATE_LIMITS if name in values}
        held = self.plant._replace(limits).limited(self.commands.time, self.commands.command)
        return rows._replace(command_time=held[0], command=held[1])

    def started(self, fit: NoiseFit, limits: Mapping[str, float]) -> CommandedModel:
        """The same with its search started from a fit of the likelihood within these limits."""
        numbers = fit.with_gain
        values = {"delay": numbers.delay, "gain": numbers.gain, "zero": numbers.zero, **limits}
        values |= dict(zip(fit.model.lag_names, numbers.lags, strict=True))
        known = {**self.known, **{name: values[name] for name in self.known if name in values}}
        point = np.array([*(values[name] for name in self.names), 0.0])
        moved = replace(self, known=known)
        if self.offset is not None:
            return replace(moved, start=point[:-1])
        point[-1] = -float(np.mean(moved.misfit(point)))
        return replace(moved, start=point)

    @property
    def kernel(self) -> CommandedModel:
        """The model itself."""
        return self

    @property
    def axes(self) -> list[list[float]]:
        """The point that the search starts from."""
        return [[value] for value in self.start.tolist()]

    @property
    def _before(self) -> tuple[tuple[float, float], ...]:
        """The time before the first command, if the plant still answers to the one before.

        A plant that integrates keeps that as a part of the output at the start.
        """
        first = float(self.commands.time[0])
        integrates = PlantModel.of(self.plant, ()).integrates
        if integrates or first < self.recording.time[0]:
            return ()
        return ((first - self.span, first),)

    @cached_property
    def span(self) -> float:
        return float(self.recording.time[-1] - self.recording.time[0])

    def ends(self, label: str) -> Ends:
        value = self.known.get(label, 1.0)
        if label.startswith("lag_") and value >= 0.0:
            # A shorter one acts as a delay, and takes ever longer to simulate.
            return Ends(SHORTEST_LAG * self.recording.sample_time, self.span)
        positive = Ends(1e-3 * abs(value), 1e3 * abs(value))
        return {
            "delay": Ends(0.0, LONGEST_DELAY * self.span),
            "lag": Ends(0.0, self.span),
            "time_constant": positive,
            "rate": positive,
            "rate_of_rate": positive,
        }.get(label, Ends(-np.inf, np.inf))

    def misfit(self, point: Array) -> Array:
        values = {**self.known, **self.values(point)}
        path = self.path.value(self.recording.time - values["delay"], values)
        return values["gain"] * path + (self.start_of(point) - self.recording.output)

    def jacobian(self, point: Array) -> Array:
        values = {**self.known, **self.values(point)}
        times = self.recording.time - values["delay"]
        slopes = self.path.slopes(times, values, self.names)
        columns = {name: values["gain"] * slope for name, slope in slopes.by.items()}
        columns["delay"] = -values["gain"] * slopes.rate
        if "gain" in self.names:
            columns["gain"] = self.path.value(times, values)
        columns["initial output"] = np.ones(len(self.recording))
        return np.stack([columns[label] for label in self.labels], axis=1)


def commanded_model(run: Run, names: tuple[str, ...], assumed: Assumed) -> CommandedModel:
    """Commands up to the end of the window, including those before its start where known."""
    recording, loop, window, *_ = run
    initial_output, computed, known, air, _, complete = assumed
    rows = recording.rows(*window)
    data = recording.window(*window) if known is None else before_filter(recording, rows, known)
    command, source = commands_of(recording, loop, computed)
    command = command[: rows.stop]
    if len(data) < _fewest(names):
        raise NotIdentifiableError(
            f"{len(data)} samples are too few for {len(names)} parameters and an initial output: "
            "widen the window"
        )
    check_moves(data.output, command)
    if data.sent is not None and not computed:
        sent = data.sent.time, limited(data.sent.values, loop)
        commands = HeldCommands(*sent) if complete else with_lost(*sent, data.time)
    else:
        commands = with_missing(recording, loop, command)
    missing = data.sent is None and commands.time.size > command.size
    if isinstance(loop.plant, RateLimited) and missing:
        raise NotIdentifiableError(
            "rows are further apart than the samples of the controller, and what a plant that "
            "limits the rate of its command got depends on every command: choose a window without "
            "missing rows"
        )
    return CommandedModel(
        recording=data,
        path=path_of(loop.plant, commands.time, commands.command),
        plant=loop.plant,
        logged=command,
        commands=commands,
        start=np.empty(0),
        names=names,
        known={"delay": 0.0, "gain": 1.0, **loop.parameters},
        offset=initial_output,
        source=source,
        air=air,
    )


def _fewest(names: tuple[str, ...]) -> int:
    """Rows below which these numbers are not fitted."""
    return 2 * (len(names) + 2)
