"""Output error: least squares on the response of the vehicle alone to the logged command.

Because the command is known, a limit and noise that the controller acts on have no effect, and
least squares is maximum likelihood for white noise: the standard error is the Cramér-Rao bound. The
model is in `_commanded_model`. The stages of one estimate are read one after the other: one file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import LAG_FACTORS, LONGEST_DELAY
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import VEHICLE_PARAMETERS, checked_names
from deadtime.estimation.data._known_filter import KnownFilter
from deadtime.estimation.data._stamps import on_regular_times
from deadtime.estimation.fit._least_squares import Minimum, Model, solve_jointly
from deadtime.estimation.likelihood._coloured import coloured_profile
from deadtime.estimation.likelihood._flight import (
    NoiseFit,
    PlantModel,
    fitted_flight,
    least_squares,
    names_in_kernel,
)
from deadtime.estimation.likelihood._free_numbers import (
    MOST_NUMBERS,
    NumbersProfile,
    fit_numbers,
    numbers_under_white_noise,
)
from deadtime.estimation.likelihood._judgement import Adequacy, adequacy_of
from deadtime.estimation.likelihood._lost_commands import (
    LostCommandsProfile,
    Refilled,
    is_calm,
    with_lost_commands,
)
from deadtime.estimation.likelihood._missing import predicted_commands, with_missing
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows, excited_part, is_long
from deadtime.estimation.methods._commanded_model import Assumed, CommandedModel, commanded_model
from deadtime.estimation.methods._conclusion import (
    check_fit,
    concluded,
    is_exact,
    without_vanishing,
)
from deadtime.estimation.methods._flight_conclusion import (
    concluded_flight,
    explains_less,
    gain_is_certain,
    profile_for,
    profiled,
    values_of,
    without_the_plant,
)
from deadtime.estimation.methods._method import Method, Run, check_choice, check_initial_output
from deadtime.estimation.methods._rounded_conclusion import read_as_intervals, rounding_is_all
from deadtime.loops import ControlLoop
from deadtime.recordings import RecordingCheck

#: Most rounds of predicting the commands between rows and fitting again, and the change of Akaike's
#: criterion that ends them. The most samples at which a reference may have changed that are tried,
#: and by how much of that criterion one of them has to be the best.
REFILLS, SETTLED, MOST_STEPS, CLEARLY = 6, 0.5, 8, 6.0

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
    intervals : {"all", "sum"}
        Which intervals are computed with the fit, in a recording that is not long: those of all
        numbers, or that of delay and lag together alone. The search for the ends of an interval may
        find a likelier fit than the first, from which all begins anew; most of the time goes there.
        The others are computed when they are asked for.
    rivals : bool
        Whether other kinds of plant are fitted to one recording too, where something in it is left
        that they could explain. Where one is clearly better, the answer is an indication that
        names it.

    Raises
    ------
    TypeError, ValueError
        If the filter is no pair of coefficients, is not stable, or cannot be undone; if there is no
        such place for the air, or no such intervals.

    Examples
    --------
    >>> from scipy import signal
    >>> from deadtime.estimation import OutputError
    >>> gyro = OutputError(output_filter=signal.butter(2, 100.0, fs=1000.0))
    """

    initial_output: float | None = None
    output_filter: tuple[Sequence[float], Sequence[float]] | None = None
    air: Literal["command", "vehicle"] = "command"
    intervals: Literal["all", "sum"] = "all"
    rivals: bool = True

    name: ClassVar[str] = "output_error"
    joint: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_initial_output(self.initial_output)
        check_choice("air", self.air, ("command", "vehicle"))
        check_choice("intervals", self.intervals, ("all", "sum"))
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
        assumed = Assumed(
            self.initial_output, output_filter=known, air=self.air, intervals=self.intervals
        )
        return estimate_from_commands(self.name, runs, free, assumed)


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
    # Each has as many numbers, and neither is more usual.
    if not _criterion(even) < _criterion(stamped):
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
    method: str, runs: Sequence[Run], free: Sequence[str], assumed: Assumed
) -> DelayEstimate:
    """The estimate in stages: commands, least squares, noise, intervals, tests."""
    names = _Names.of(free, runs[0].loop)
    begun = _begun(method, runs, names, assumed)
    if begun.is_exact:
        return begun.by_least_squares()
    found = _likeliest(begun)
    _check_delay(begun, found.profile)
    adequacy = adequacy_of(found.profile)
    adequacy = replace(adequacy, reasons=(*found.doubts, *adequacy.reasons))
    without = _without_the_plant(begun, found.profile, adequacy)
    return without or _concluded(begun, found, adequacy)


class _Names(NamedTuple):
    """What is fitted: all, what least squares knows with all derivatives, what the kernel fits."""

    free: tuple[str, ...]
    common: tuple[str, ...]
    linear: tuple[str, ...]

    @classmethod
    def of(cls, free: Sequence[str], loop: ControlLoop) -> _Names:
        """The checked names of a loop."""
        known = tuple(dict.fromkeys([*VEHICLE_PARAMETERS, *loop.plant.parameters]))
        names, in_kernel = checked_names(free, loop, known), names_in_kernel(loop.plant)
        common = tuple(name for name in names if name in VEHICLE_PARAMETERS)
        return cls(names, common, tuple(name for name in names if name in in_kernel))

    @property
    def others(self) -> list[str]:
        """Those that are fitted around the search of the kernel."""
        return [name for name in self.free if name not in self.linear]

    @property
    def are_common(self) -> bool:
        """Whether least squares knows all of them."""
        return self.common == self.free


@dataclass(frozen=True, eq=False)
class _Begun:
    """Recordings with their commands, and least squares on them.

    Attributes
    ----------
    method : str
    runs : sequence of Run
    names : _Names
    assumed : Assumed
    models : list of CommandedModel
    rows : list of FlightRows
    checks : list of RecordingCheck or None
    white : NoiseFit
        The fit to parts of the rows.
    numbers : dict of str to float
        The numbers that the kernel does not fit.
    whole : NoiseFit
        The same with all rows.
    """

    method: str
    runs: Sequence[Run]
    names: _Names
    assumed: Assumed
    models: list[CommandedModel]
    rows: list[FlightRows]
    checks: list[RecordingCheck | None]
    white: NoiseFit
    numbers: dict[str, float]
    whole: NoiseFit

    @property
    def criterion(self) -> float:
        """Akaike's criterion, in which an unknown command is a number."""
        return self.whole.criterion + 2.0 * sum(len(one.unknown) for one in self.rows)

    @property
    def fitted(self) -> list[Run]:
        """The recordings as they are fitted."""
        pairs = zip(self.models, self.runs, strict=True)
        return [Run(one.recording, run.loop) for one, run in pairs]

    @property
    def message(self) -> str:
        """What is fitted to what, in words."""
        sources = {one.source for one in self.models}
        text = f"over {', '.join(self.names.free)} on the response to the command"
        if self.assumed.computed:
            text += " computed from the recorded output, on whose noise the controller acts"
        elif sources != {"logged"}:
            text += ", which was not logged but computed from reference and output"
        elif lost := sum(one.commands.lost for one in self.models):
            gaps = f"gap{'s' * (lost > 1)}"
            text += f", with commands taken for lost in {lost} {gaps} of their log"
        if (known := self.assumed.output_filter) is not None:
            text += f", before the filter, in means of {known.together} rows"
        return text

    def details(self, initial_output: float) -> dict[str, Any]:
        """Further results."""
        sources = sorted({one.source for one in self.models})
        noise = {"noise": "loop"} if self.assumed.computed else {}
        given = self.assumed.initial_output
        start = initial_output if given is None else given
        return {"command": " or ".join(sources), **noise, "initial_output": start}

    @cached_property
    def plain(self) -> tuple[Model, Minimum]:
        """Least squares with all its derivatives, from that of the likelihood."""
        model, found = solve_jointly([one.started(self.white, self.numbers) for one in self.models])
        return model, without_vanishing(model, found)

    @property
    def is_exact(self) -> bool:
        """Whether least squares leaves rounding alone."""
        nearly = self.names.are_common and _is_nearly_exact(self.white)
        return nearly and is_exact(*self.plain, self.fitted)

    def by_least_squares(self) -> DelayEstimate:
        """The estimate of least squares."""
        model, found = self.plain
        start = [*found.point[len(self.names.common) :], math.nan][0]
        details, message = self.details(float(start)), f"least squares {self.message}"
        return concluded(self.method, model, found, self.fitted, message=message, details=details)


class _Likeliest(NamedTuple):
    """The likeliest plant and noise, doubts about its commands, and the recordings with it."""

    profile: LikelihoodProfile
    doubts: tuple[str, ...]
    fitted: list[Run]


def _likeliest(begun: _Begun) -> _Likeliest:
    """Plant, noise and intervals, with the numbers around them and the commands between rows."""
    linear, models, fitted = begun.names.linear, begun.models, begun.fitted
    fit = begun.whole.beside_noise()
    free = None
    if begun.numbers:
        fit, free = fit_numbers(fit, partial(_given, linear, models, fit.runs), begun.numbers)
        fitted = [run._replace(loop=run.loop.replace(**free.values)) for run in fitted]
    doubts: tuple[str, ...] = ()
    if any(one.commands.computed for one in models):
        fit, step, doubts = _with_predicted_commands(linear, fit, models, begun.runs)
        if (lost := _with_lost_commands(begun, fit, step)) is not None:
            return _Likeliest(lost, doubts, fitted)
    profile = profile_for(fit, linear, begun.assumed.intervals)
    if free is not None:
        profile = NumbersProfile(profile.fit, profile.names, profile.preferred, free=free)
    return _Likeliest(profile, doubts, fitted)


def _with_lost_commands(
    begun: _Begun, fit: NoiseFit, step: int | None
) -> LostCommandsProfile | None:
    """The profile whose commands in missing rows follow from its plant; None where they need not.

    Single rows are predicted well enough. Where most are missing, as in a log at a lower rate, the
    likelihood has too many kinks.
    """
    linear, models = begun.names.linear, begun.models
    missing = max(one.commands.longest for one in models)
    few = all(one.commands.time.size < 2 * one.logged.size for one in models)
    period = max(run.loop.sample_time or 0.0 for run in begun.fitted)
    if missing <= 1 or not few or not period or begun.numbers or is_long(begun.rows):
        return None
    found = with_lost_commands(fit, _refilling(linear, models, begun.runs, step), period)
    if found is None:
        return None
    fit, cov = found
    return LostCommandsProfile(fit, profiled(fit.model, linear), cov=cov)


def _check_delay(begun: _Begun, profile: LikelihoodProfile) -> None:
    """Refuse a fit at the longest delay, and one that explains hardly more than a constant does."""
    longest = min(LONGEST_DELAY * one.span for one in begun.models)
    if "delay" in begun.names.free and profile.fit.numbers.delay >= longest * (1.0 - 1e-3):
        raise NotIdentifiableError(
            f"the fit ends at a delay of {longest:g} s, {LONGEST_DELAY:g} of the window: the "
            "output is no response to this command; check columns and units, or choose a longer "
            "window"
        )
    if not gain_is_certain(profile):
        check_fit(*begun.plain, begun.fitted)


def _without_the_plant(
    begun: _Begun, profile: LikelihoodProfile, adequacy: Adequacy
) -> DelayEstimate | None:
    """The estimate of least squares where the noise stands for what the plant lacks."""
    astray = adequacy.reasons and explains_less(profile.fit, begun.whole)
    if not (begun.names.are_common and (adequacy.plant_lacks or astray)):
        return None
    try:
        return without_the_plant(begun.by_least_squares(), adequacy)
    except NotIdentifiableError:
        # Where air moves the output far more than the command does, least squares sees nothing.
        if not gain_is_certain(profile):
            raise
    return None


def _concluded(begun: _Begun, found: _Likeliest, adequacy: Adequacy) -> DelayEstimate:
    """The estimate of the likelihood; of rounded rows alone, with each as an interval."""
    profile, message = found.profile, f"maximum likelihood {begun.message}"
    if adequacy.coloured:
        profile = coloured_profile(profile)
        message += ", intervals widened for residuals that are coloured at rest, too"
    estimate = concluded_flight(
        begun.method,
        begun.names.linear,
        found.fitted,
        profile,
        begun.models[0].known,
        message,
        begun.details(profile.initial_output),
        adequacy,
    )
    plain = begun.names.are_common and type(profile) is LikelihoodProfile
    if (
        plain
        and not is_long(begun.rows)
        and estimate.verdict == "reliable"
        and rounding_is_all(profile.fit)
    ):
        repeated = [np.empty(0, int) if one is None else one.repeated for one in begun.checks]
        return read_as_intervals(estimate, begun.models, begun.rows, repeated)
    return estimate


def _begun(method: str, runs: Sequence[Run], names: _Names, assumed: Assumed) -> _Begun:
    """Least squares on recordings, with gaps in their commands or without if that is likelier."""
    begun = _begun_with(method, runs, names, assumed)
    if any(one.commands.lost for one in begun.models):
        held = _begun_with(method, runs, names, assumed._replace(complete=True))
        begun = min(begun, held, key=lambda one: one.criterion)
    return begun


def _begun_with(method: str, runs: Sequence[Run], names: _Names, assumed: Assumed) -> _Begun:
    """Least squares on recordings whose commands are as `assumed`."""
    models = [commanded_model(run, names.common, assumed) for run in runs]
    _check_others(names.others, models[0].known)
    checks = [run.check if assumed.output_filter is None else None for run in runs]
    rows = [
        one.rows(assumed.initial_output, check) for one, check in zip(models, checks, strict=True)
    ]
    white, numbers = _first(names.linear, models, rows, names.others)
    whole = replace(white, runs=tuple(_given(names.linear, models, rows, numbers)[1]))
    return _Begun(method, runs, names, assumed, models, rows, checks, white, numbers, whole)


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
    models: Sequence[CommandedModel],
    rows: Sequence[FlightRows],
    others: Sequence[str],
) -> tuple[NoiseFit, dict[str, float]]:
    """Least squares on parts of the rows, and the other numbers under which it is best."""
    known = models[0].known
    found = []

    def within(values: Mapping[str, float]) -> tuple[PlantModel, list[FlightRows]]:
        model, whole = _given(names, models, rows, values)
        return model, [excited_part(one) for one in whole]

    for factors in product(LAG_FACTORS, repeat=len(others)):
        values = {name: factor * known[name] for name, factor in zip(others, factors, strict=True)}
        fit = least_squares(*within(values), known["delay"], known["gain"])
        found.append((fit, values))
    best, values = min(found, key=lambda one: one[0].numbers.objective)
    return numbers_under_white_noise(best, within, values) if others else (best, values)


def _given(
    names: tuple[str, ...],
    models: Sequence[CommandedModel],
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
    names: tuple[str, ...], fit: NoiseFit, models: Sequence[CommandedModel], runs: Sequence[Run]
) -> tuple[NoiseFit, int | None, tuple[str, ...]]:
    """The fit with the commands between rows that its plant predicts, and doubts about them.

    Where the reference changes between rows that are further apart than samples, each sample at
    which it may have changed is tried.
    """
    steps = [one.commands.steps for one in models]
    unclear = max(steps) > 1 and sum(step > 1 for step in steps) == 1
    tried: list[tuple[NoiseFit, int | None]] = []
    size = abs(fit.gain)
    for step in range(max(steps)) if unclear and max(steps) <= MOST_STEPS else (None,):
        refilled = _refilling(names, models, runs, step, unsure=True)
        between = [
            one.refilled(rows, with_missing(run.recording, run.loop, one.logged, step=step), size)
            if one.commands.computed
            else rows
            for one, run, rows in zip(models, runs, fit.runs, strict=True)
        ]
        again = fitted_flight(fit.model, between, fit.with_gain)
        # Predicted outputs are better than a straight line between rows, or not, as where they
        # depend on each other through the controller.
        for _ in range(REFILLS):
            further = fitted_flight(again.model, refilled(again), again.with_gain)
            gained = again.criterion - further.criterion
            again = further if gained > 0.0 else again
            if gained < SETTLED:
                break
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
    models: Sequence[CommandedModel],
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
                calm = not unsure and is_calm(fit, i)
                commands[i] = predicted_commands(
                    run.recording, loop, one.logged, commands[i], step, unsure, calm
                )
                rows = one.refilled(rows, commands[i], abs(fit.gain))
            found.append(rows)
        return found

    return refilled


def _is_nearly_exact(fit: NoiseFit) -> bool:
    """Whether all that is left may be rounding."""
    return all(
        float(np.max(np.abs(part.residuals))) <= NEARLY_EXACT * float(np.ptp(rows.output))
        for part, rows in zip(fit.parts, fit.runs, strict=True)
    )
