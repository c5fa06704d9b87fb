"""Output error: least squares on the response of the vehicle alone to the logged command.

    y(t_i) = b + a F(t_i - Td; lag) + noise,

F the exact response of 1/(s (lag s + 1)), or of another plant, to the command as it was held
(`plant_path`), a the gain, b the output at the start. Because the command is known, a limit and
noise that the controller acts on have no effect, and least squares is maximum likelihood for white
noise: the standard error is the Cramér-Rao bound. For a given delay and lag the best a and b are
linear least squares (variable projection, Golub & Pereyra 1973).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import VEHICLE_PARAMETERS, check_moves, checked_names
from deadtime.estimation.data._commands import commands_of
from deadtime.estimation.data._known_filter import KnownFilter, before_filter
from deadtime.estimation.data._simulated import limited
from deadtime.estimation.data._stamps import on_regular_times
from deadtime.estimation.fit._least_squares import (
    Ends,
    Minimum,
    Model,
    ModelOfOne,
    solve_jointly,
)
from deadtime.estimation.likelihood._adequacy import adequacy_of
from deadtime.estimation.likelihood._free_numbers import (
    MOST_NUMBERS,
    NumbersProfile,
    fit_numbers,
    numbers_under_white_noise,
)
from deadtime.estimation.likelihood._lost_commands import (
    LostCommandsProfile,
    Refilled,
    with_lost_commands,
)
from deadtime.estimation.likelihood._missing import (
    HeldCommands,
    predicted_commands,
    with_missing,
)
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows, on_same_step, rounding_of, spikes
from deadtime.estimation.likelihood._search import (
    FACTORS,
    LONGEST,
    NoiseFit,
    PlantModel,
    names_in_kernel,
)
from deadtime.estimation.likelihood._start import excited_part, is_long, least_squares
from deadtime.estimation.methods._conclusion import (
    check_fit,
    concluded,
    is_exact,
    without_vanishing,
)
from deadtime.estimation.methods._flight_conclusion import (
    concluded_flight,
    explains_less,
    fitted_flight,
    gain_is_certain,
    profile_for,
    profiled,
    values_of,
    without_the_plant,
)
from deadtime.estimation.methods._method import (
    Method,
    Run,
    check_choice,
    check_initial_output,
)
from deadtime.estimation.models._held import RATE_LIMITS, Path, path_of
from deadtime.loops import Plant, RateLimited
from deadtime.recordings import RecordingCheck

Array = NDArray[np.float64]

#: Rounds of predicting the commands between rows and fitting again, the most samples at which a
#: reference may have changed that are tried, and by how much of Akaike's criterion one of them has
#: to be the best.
REFILLS, MOST_STEPS, CLEARLY = 2, 8, 6.0

#: Residuals of a first fit below which, as a share of the range of the output, all may be rounding.
NEARLY_EXACT = 1e-4


@dataclass(frozen=True)
class OutputError(Method):
    """Least squares on the response of the vehicle to the command as it was logged.

    Parameters
    ----------
    initial_output : float, optional
        True output at the start of the window; fitted if not given.
    output_filter : (b, a), optional
        Coefficients, in powers of 1/z as `scipy.signal` has them, of a digital low-pass that ran on
        the output before it was logged, once a row, such as the gyro filter of a flight controller.
        The estimate is of what the sensor read before it: the noise is white there, and the lag of
        the filter is no part of the delay.
    air : {"command", "vehicle"}
        Where air acts: like a command, through the lags of the plant, as it does on a vehicle that
        drifts with it, or on the vehicle behind the lags, as the torques of gusts do beside those
        of motors that lag.

    Raises
    ------
    TypeError, ValueError
        If the filter is no pair of coefficients, is not stable, or cannot be undone; if there is no
        such place for the air.

    Examples
    --------
    >>> from scipy import signal
    >>> from deadtime.estimation import OutputError
    >>> gyro = OutputError(output_filter=signal.butter(2, 100.0, fs=1000.0))
    """

    initial_output: float | None = None
    output_filter: tuple[Sequence[float], Sequence[float]] | None = None
    air: Literal["command", "vehicle"] = "command"

    name: ClassVar[str] = "output_error"
    joint: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_initial_output(self.initial_output)
        check_choice("air", self.air, ("command", "vehicle"))
        if self.output_filter is not None:
            KnownFilter.of(self.output_filter)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the response of the plant to the logged commands."""
        known = None if self.output_filter is None else KnownFilter.of(self.output_filter)
        if self.air == "vehicle" and not all(
            PlantModel.of(r.loop.plant, ()).integrates for r in runs
        ):
            raise ValueError(
                "air='vehicle' is for a plant that integrates what its motors do, such as "
                "Integrator: use air='command'"
            )
        assumed = Assumed(self.initial_output, output_filter=known, air=self.air)
        return estimate_from_commands(self.name, runs, free, assumed)


class Assumed(NamedTuple):
    """What is assumed of the rows.

    Attributes
    ----------
    initial_output : float, optional
    computed : bool
        Whether the commands are computed from the recorded output.
    output_filter : KnownFilter, optional
    air : {"command", "vehicle"}
    """

    initial_output: float | None = None
    computed: bool = False
    output_filter: KnownFilter | None = None
    air: Literal["command", "vehicle"] = "command"


def estimate_from_commands(
    method: str,
    runs: Sequence[Run],
    free: Sequence[str],
    assumed: Assumed,
) -> DelayEstimate:
    """Fit the response to the command: logged, or computed from the recorded output.

    Rows whose stamps scatter around regular times are fitted at both, and the likelier ones kept.
    """
    stamped = _estimated(method, runs, free, assumed)
    regular = [on_regular_times(run) or run for run in runs]
    if all(one is run for one, run in zip(regular, runs, strict=True)):
        return stamped
    even = _estimated(method, regular, free, assumed)
    better = _criterion(stamped) - _criterion(even)
    if not better > CLEARLY:
        return stamped
    text = "the rows are taken as evenly spaced, which is likelier than the times of their stamps"
    return replace(
        even, message=f"{even.message}; {text}", details={**even.details, "times": "even"}
    )


def _criterion(estimate: DelayEstimate) -> float:
    """Akaike's criterion of a fit with noise; infinite of least squares."""
    profile = estimate._profile
    return profile.fit.criterion if isinstance(profile, LikelihoodProfile) else math.inf


def _estimated(
    method: str,
    runs: Sequence[Run],
    free: Sequence[str],
    assumed: Assumed,
) -> DelayEstimate:
    initial_output, computed, known_filter, _ = assumed
    known = tuple(dict.fromkeys([*VEHICLE_PARAMETERS, *runs[0].loop.plant.parameters]))
    names = checked_names(free, runs[0].loop, known)
    # What least squares with all derivatives knows; the likelihood knows other plants too.
    common = tuple(name for name in names if name in VEHICLE_PARAMETERS)
    models = [_model(run, common, assumed) for run in runs]
    fitted = [Run(one.recording, run.loop) for one, run in zip(models, runs, strict=True)]
    in_kernel = names_in_kernel(fitted[0].loop.plant)
    linear = tuple(name for name in names if name in in_kernel)
    others = [name for name in names if name not in in_kernel]
    _check_others(others, models[0].known)
    checks = [run.check if known_filter is None else None for run in runs]
    rows = [one.rows(initial_output, check) for one, check in zip(models, checks, strict=True)]
    white, numbers = _first(linear, models, rows, others)
    sources = {one.source for one in models}
    message = f"over {', '.join(names)} on the response to the command"
    if computed:
        message += " computed from the recorded output, on whose noise the controller acts"
    elif sources != {"logged"}:
        message += ", which was not logged but computed from reference and output"
    if known_filter is not None:
        message += f", before the filter, in means of {known_filter.together} rows"
    details: dict[str, Any] = {
        "command": " or ".join(sorted(sources)),
        **({"noise": "loop"} if computed else {}),
    }

    @cache
    def plain() -> tuple[Model, Minimum]:
        """Least squares with all its derivatives, from that of the likelihood."""
        started = [one.started(white, numbers) for one in models]
        model, found = solve_jointly(started)
        return model, without_vanishing(model, found)

    def concluded_plain() -> DelayEstimate:
        model, found = plain()
        start = found.point[len(common) :] if initial_output is None else [initial_output]
        return concluded(
            method,
            model,
            found,
            fitted,
            message=f"least squares {message}",
            details={**details, "initial_output": float(start[0])},
        )

    if common == names and _is_nearly_exact(white) and is_exact(*plain(), fitted):
        return concluded_plain()
    whole = replace(white, runs=tuple(_given(linear, models, rows, numbers)[1]))
    kept = [
        one._replace(used=one.used & ~spikes(part.residuals))
        for one, part in zip(whole.runs, whole.parts, strict=True)
    ]
    free_numbers = None
    fit = fitted_flight(white.model, kept, white.with_gain)
    if numbers:
        fit, free_numbers = fit_numbers(fit, partial(_given, linear, models, fit.runs), numbers)
        fitted = [run._replace(loop=run.loop.replace(**free_numbers.values)) for run in fitted]
    doubts: tuple[str, ...] = ()
    joint = None
    if any(one.commands.computed for one in models):
        fit, step, doubts = _with_predicted_commands(linear, fit, models, runs)
        # Single rows are predicted well enough.
        if any(one.commands.unknown for one in models) and not (numbers or is_long(rows)):
            joint = with_lost_commands(fit, _refilling(linear, models, runs, step))
    if joint is not None:
        fit, cov = joint
        profile: LikelihoodProfile = LostCommandsProfile(fit, profiled(fit.model, linear), cov=cov)
    else:
        profile = profile_for(fit, linear)
    if free_numbers is not None:
        profile = NumbersProfile(
            profile.fit, profile.names, profile.preferred, profile._ends, free_numbers
        )
    longest = min(LONGEST * one.span for one in models)
    if "delay" in names and profile.fit.numbers.delay >= longest * (1.0 - 1e-3):
        raise NotIdentifiableError(
            f"the fit ends at a delay of {longest:g} s, {LONGEST:g} of the window: the output is "
            "no response to this command; check columns and units, or choose a longer window"
        )
    if not gain_is_certain(profile):
        check_fit(*plain(), fitted)
    adequacy = adequacy_of(profile, len(names))
    adequacy = replace(adequacy, reasons=(*doubts, *adequacy.reasons))
    astray = adequacy.reasons and explains_less(profile.fit, whole)
    if common == names and (adequacy.lacks_lag or astray):
        try:
            return without_the_plant(concluded_plain(), adequacy)
        except NotIdentifiableError:
            # Where air moves the output far more than the command does, least squares sees nothing.
            if not gain_is_certain(profile):
                raise
    details["initial_output"] = (
        initial_output if initial_output is not None else profile.initial_output
    )
    return concluded_flight(
        method,
        linear,
        fitted,
        profile,
        models[0].known,
        f"maximum likelihood {message}",
        details,
        adequacy,
    )


def _check_others(names: Sequence[str], known: Mapping[str, float]) -> None:
    """Refuse numbers that cannot be searched around the rest."""
    if len(names) > MOST_NUMBERS:
        raise ValueError(
            f"{', '.join(names)} are {len(names)} numbers besides gain, delay, lags and zero: fit "
            f"at most {MOST_NUMBERS} of them"
        )
    for name in names:
        if known[name] == 0.0:
            raise ValueError(f"{name}=0: give another value to start from, of the sign it has")


def _first(
    names: tuple[str, ...],
    models: Sequence[_Model],
    rows: Sequence[FlightRows],
    others: Sequence[str],
) -> tuple[NoiseFit, dict[str, float]]:
    """Least squares on parts of the rows, and the other numbers under which it is best."""
    known = models[0].known
    found = []

    def within(values: Mapping[str, float]) -> tuple[PlantModel, list[FlightRows]]:
        model, whole = _given(names, models, rows, values)
        return model, [excited_part(one) for one in whole]

    for factors in product(FACTORS, repeat=len(others)):
        values = {name: factor * known[name] for name, factor in zip(others, factors, strict=True)}
        fit = least_squares(*within(values), known["delay"], known["gain"])
        found.append((fit, values))
    best, values = min(found, key=lambda one: one[0].numbers.objective)
    return numbers_under_white_noise(best, within, values) if others else (best, values)


def _given(
    names: tuple[str, ...],
    models: Sequence[_Model],
    rows: Sequence[FlightRows],
    values: Mapping[str, float],
) -> tuple[PlantModel, list[FlightRows]]:
    """The plant with these numbers and `names` free, and the rows with the commands it gets."""
    plant = models[0].plant
    if values:
        plant = plant._replace({**plant.parameters, **values})
    within = [one.limited(part, values) for one, part in zip(models, rows, strict=True)]
    model = replace(PlantModel.of(plant, names), air_behind_lags=models[0].air == "vehicle")
    return model, within


def _with_predicted_commands(
    names: tuple[str, ...], fit: NoiseFit, models: Sequence[_Model], runs: Sequence[Run]
) -> tuple[NoiseFit, int | None, tuple[str, ...]]:
    """The fit with the commands between rows that its plant predicts, and doubts about them.

    Where the reference changes between rows that are further apart than samples, each sample at
    which it may have changed is tried.
    """
    steps = [one.commands.steps for one in models]
    unclear = max(steps) > 1 and sum(step > 1 for step in steps) == 1
    tried: list[tuple[NoiseFit, int | None]] = []
    for step in range(max(steps)) if unclear and max(steps) <= MOST_STEPS else (None,):
        again, refilled = fit, _refilling(names, models, runs, step, unsure=True)
        for _ in range(REFILLS):
            again = fitted_flight(again.model, refilled(again), again.with_gain)
        tried.append((again, step))
    tried.sort(key=lambda one: one[0].criterion)
    best, step = tried[0]
    if len(tried) > 1 and tried[1][0].criterion - best.criterion < CLEARLY:
        return (
            best,
            step,
            (
                "the reference changes between rows that are further apart than samples, and the "
                "recording does not tell when",
            ),
        )
    return best, step, ()


def _refilling(
    names: tuple[str, ...],
    models: Sequence[_Model],
    runs: Sequence[Run],
    step: int | None,
    unsure: bool = False,
) -> Refilled:
    """The rows of a fit with the commands between them that its plant predicts.

    If `unsure`, the mean command over many missing rows is unknown all the same.
    """
    commands = [one.commands for one in models]

    def refilled(fit: NoiseFit) -> list[FlightRows]:
        values = values_of(fit, names, models[0].known)
        found = []
        for i, (one, run, rows) in enumerate(zip(models, runs, fit.runs, strict=True)):
            if one.commands.computed:
                loop = run.loop.replace(**values)
                # The next plant is near.
                commands[i] = predicted_commands(
                    run.recording, loop, one.logged, commands[i], step, unsure
                )
                error = math.hypot(1.0, fit.numbers.noise[i].sensor)
                rows = one.refilled(rows, commands[i], abs(fit.gain) * error)
            found.append(rows)
        return found

    return refilled


@dataclass(frozen=True, eq=False)
class _Model(ModelOfOne):
    """Residuals of one recording."""

    path: Path
    plant: Plant
    known: Mapping[str, float]
    source: str
    logged: Array
    commands: HeldCommands
    start: Array
    air: Literal["command", "vehicle"]

    def refilled(self, rows: FlightRows, commands: HeldCommands, error: float) -> FlightRows:
        """The rows with these commands, computed from outputs with errors.

        They and the gain of the plant are in `error`, in deviations of the white noise.
        """
        return rows._replace(
            command_time=commands.time,
            command=commands.command,
            unknown=(*self._before, *commands.unknown),
            uncertain=tuple((a, b, error * slope) for a, b, slope in commands.computed if slope),
        )

    def rows(self, initial_output: float | None, check: RecordingCheck | None) -> FlightRows:
        """The rows for the likelihood, without repeated rows."""
        used = np.ones(len(self.recording), dtype=bool)
        if check is not None:
            used[check.repeated] = False
        rounding = rounding_of(self.recording.output)
        if rounding:
            used &= ~on_same_step(self.recording.output)
        return FlightRows(
            time=self.recording.time,
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

    def started(self, fit: NoiseFit, limits: Mapping[str, float]) -> _Model:
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

    def starts(self) -> list[Array]:
        """The point that the search starts from."""
        return [self.start]

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

    @cached_property
    def _sample(self) -> float:
        return self.recording.sample_time

    def ends(self, label: str) -> Ends:
        size = abs(self.known.get(label, 1.0))
        return {
            "delay": Ends(0.0, LONGEST * self.span, self._sample),
            "lag": Ends(0.0, self.span, self._sample),
            "time_constant": Ends(1e-3 * size, 1e3 * size, size),
            "rate": Ends(1e-3 * size, 1e3 * size, size),
            "rate_of_rate": Ends(1e-3 * size, 1e3 * size, size),
            "initial output": Ends(-np.inf, np.inf, self.size),
        }.get(label, Ends(-np.inf, np.inf, size))

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


def _is_nearly_exact(fit: NoiseFit) -> bool:
    """Whether all that is left may be rounding."""
    return all(
        float(np.max(np.abs(part.residuals))) <= NEARLY_EXACT * float(np.ptp(rows.output))
        for part, rows in zip(fit.parts, fit.runs, strict=True)
    )


def _model(run: Run, names: tuple[str, ...], assumed: Assumed) -> _Model:
    """Commands up to the end of the window, including those before its start where known."""
    recording, loop, window, _ = run
    initial_output, computed, known, air = assumed
    rows = recording.rows(*window)
    data = recording.window(*window) if known is None else before_filter(recording, rows, known)
    command, source = commands_of(recording, loop, computed)
    command = command[: rows.stop]
    if len(data) < 2 * (len(names) + 2):
        raise NotIdentifiableError(
            f"{len(data)} samples are too few for {len(names)} parameters and an initial output: "
            "widen the window"
        )
    check_moves(data.output, command)
    if data.sent is not None and not computed:
        commands = HeldCommands(data.sent.time, limited(data.sent.values, loop))
    else:
        commands = with_missing(recording, loop, command)
    missing = data.sent is None and commands.time.size > command.size
    if isinstance(loop.plant, RateLimited) and missing:
        raise NotIdentifiableError(
            "rows are further apart than the samples of the controller, and what a plant that "
            "limits the rate of its command got depends on every command: choose a window without "
            "missing rows"
        )
    return _Model(
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
