"""Output error: least squares on the response of the vehicle alone to the logged command.

Because the command is known, a limit and noise that the controller acts on have no effect, and
least squares is maximum likelihood for white noise: the standard error is the Cramér-Rao bound. The
model is in `_commanded_model`. The stages of one estimate are read one after the other: one file.

A log is often stamped where it is written, some time after the sample was taken. The rows then are
regular and their stamps are not. Where each stamp is near a regular time, either may be true.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Literal, NamedTuple

import deadtime.estimation._native as native
import deadtime.estimation.methods._commanded_model as commanded
import deadtime.estimation.methods._flight_conclusion as flight
import deadtime.estimation.methods._method as base
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._least_squares import Minimum, Model, solve_jointly
from deadtime.estimation._plant import names_in_kernel, plant_model
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import VEHICLE_PARAMETERS, checked_names
from deadtime.estimation.methods._commanded_model import GivenFilter
from deadtime.estimation.methods._method import Method, Run
from deadtime.loops import ControlLoop

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
    output_filter: GivenFilter | None = None
    air: Literal["command", "vehicle"] = "command"
    intervals: Literal["all", "sum"] = "all"
    rivals: bool = True

    name: ClassVar[str] = "output_error"
    joint: ClassVar[bool] = True

    def __post_init__(self) -> None:
        base.check_initial_output(self.initial_output)
        base.check_choice("air", self.air, ("command", "vehicle"))
        base.check_choice("intervals", self.intervals, ("all", "sum"))
        commanded.known_filter(self.output_filter)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the response of the plant to the logged commands."""
        known = commanded.known_filter(self.output_filter)
        integrating = (plant_model(run.loop.plant, ()).integrates for run in runs)
        if self.air == "vehicle" and not all(integrating):
            raise ValueError(
                "air='vehicle' needs a plant such as Integrator, which "
                "integrates the effect of its motors: use air='command'"
            )
        assumed = commanded.Assumed(
            self.initial_output, output_filter=known, air=self.air, intervals=self.intervals
        )
        return estimate_from_commands(self.name, runs, free, assumed)


def estimate_from_commands(
    method: str, runs: Sequence[Run], free: Sequence[str], assumed: commanded.Assumed
) -> DelayEstimate:
    """Fit the response to the command: logged, or computed from the recorded output.

    Rows whose stamps scatter around regular times are fitted at both, and the likelier ones kept.
    """
    stamped = _estimated(method, runs, free, assumed)
    regular = [on_regular_times(run) or run for run in runs]
    if all(regular_run is run for regular_run, run in zip(regular, runs, strict=True)):
        return stamped
    even = _estimated(method, regular, free, assumed)
    # Each has as many numbers, and neither is more usual.
    if not _criterion(even) < _criterion(stamped):
        return stamped
    text = "the rows are assumed to be evenly spaced, which is more likely than their time stamps"
    return replace(
        even, message=f"{even.message}; {text}", details={**even.details, "times": "even"}
    )


def _criterion(estimate: DelayEstimate) -> float:
    """Akaike's criterion of a fit with noise; infinite of least squares."""
    profile = estimate._profile
    return profile.fit.criterion if isinstance(profile, native.FlightProfile) else math.inf


def _estimated(
    method: str, runs: Sequence[Run], free: Sequence[str], assumed: commanded.Assumed
) -> DelayEstimate:
    """The estimate in stages: commands, least squares, noise, intervals, tests."""
    names = _Names.of(free, runs[0].loop)
    begun = _begun(method, runs, names, assumed)
    if begun.is_exact:
        return begun.by_least_squares()
    profile, doubts, fitted = _likeliest(begun)
    _check_delay(begun, profile)
    adequacy = flight.adequacy_of(profile)
    adequacy = replace(adequacy, reasons=(*doubts, *adequacy.reasons))
    without = _without_the_plant(begun, profile, adequacy)
    return without or _concluded(begun, profile, fitted, adequacy)


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
    assumed: commanded.Assumed
    models: list[commanded.CommandedModel]
    white: native.FlightFit
    numbers: dict[str, float]
    whole: native.FlightFit

    @property
    def criterion(self) -> float:
        """Akaike's criterion, in which an unknown command is a number."""
        return self.whole.criterion + 2.0 * sum(model.commands.unknown for model in self.models)

    @property
    def fitted(self) -> list[Run]:
        """The recordings as they are fitted."""
        pairs = zip(self.models, self.runs, strict=True)
        return [Run(model.recording, run.loop) for model, run in pairs]

    @property
    def message(self) -> str:
        """What is fitted to what, in words."""
        sources = {model.source for model in self.models}
        text = f"over {', '.join(self.names.free)} on the response to the command"
        if self.assumed.computed:
            text += " computed from the recorded output, on whose noise the controller acts"
        elif sources != {"logged"}:
            text += ", which was not logged but computed from reference and output"
        elif lost := sum(model.commands.lost for model in self.models):
            gaps = f"gap{'s' * (lost > 1)}"
            text += f", where commands in {lost} {gaps} of their log are assumed to be lost"
        if (known := self.assumed.output_filter) is not None:
            text += f", before the filter, in means of {known.together} rows"
        return text

    def details(self, initial_output: float) -> dict[str, Any]:
        """Further results."""
        sources = sorted({model.source for model in self.models})
        noise = {"noise": "loop"} if self.assumed.computed else {}
        given = self.assumed.initial_output
        start = initial_output if given is None else given
        return {"command": " or ".join(sources), **noise, "initial_output": start}

    @cached_property
    def plain(self) -> tuple[Model, Minimum]:
        """Least squares with all its derivatives, from that of the likelihood."""
        model, found = solve_jointly([run.started(self.white, self.numbers) for run in self.models])
        return model, model.problem.without_vanishing(found, model.size)

    @property
    def is_exact(self) -> bool:
        """Whether least squares leaves rounding alone."""
        nearly = self.names.are_common and self.whole.leaves_less_than(NEARLY_EXACT)
        return nearly and base.is_exact(*self.plain, self.fitted)

    def by_least_squares(self) -> DelayEstimate:
        """The estimate of least squares."""
        model, found = self.plain
        start = [*found.point[len(self.names.common) :], math.nan][0]
        details, message = self.details(float(start)), f"least squares {self.message}"
        return base.concluded(
            self.method, model, found, self.fitted, message=message, details=details
        )


def _likeliest(begun: _Begun) -> tuple[native.FlightProfile, tuple[str, ...], list[Run]]:
    """The likeliest plant and noise, doubts about its commands, and the recordings with it.

    Intervals cover the numbers around them, and gaps between commands are filled.
    """
    models, fitted = begun.models, begun.fitted
    fit = begun.whole.beside_noise()
    numbers = covariance = None
    unclear = False
    if begun.numbers:
        given = partial(_given, begun.names, begun.assumed, models, fit.runs)
        fit, numbers = fit.with_numbers(given, list(begun.numbers.items()))
        if numbers is None:
            raise NotIdentifiableError(
                f"this recording cannot separate the effect of {' and '.join(begun.numbers)} "
                "from other fitted parameters: fix one of them, or record larger steps"
            )
        values = dict(numbers.values)
        fitted = [run._replace(loop=run.loop.replace(**values)) for run in fitted]
    if any(model.commands.are_computed for model in models):
        commands = [model.commands for model in models]
        fit, unclear, covariance = fit.between_rows(commands, not begun.numbers)
    profile = flight.profile_for(fit, begun.assumed.intervals, covariance, numbers)
    doubts = (
        "rows are further apart than samples, and the recording does "
        "not show at which times between rows the reference changes",
    )
    return profile, doubts * unclear, fitted


def _check_delay(begun: _Begun, profile: native.FlightProfile) -> None:
    """Refuse a fit at the longest delay, and one that explains hardly more than a constant does."""
    longest = min(native.LONGEST_DELAY * model.span for model in begun.models)
    if "delay" in begun.names.free and profile.fit.numbers.delay >= longest * (1.0 - 1e-3):
        raise NotIdentifiableError(
            f"the search ends at its longest delay, {longest:g} s, which is "
            f"{native.LONGEST_DELAY:g} of the window. So the output is not a response "
            "to this command. Check columns and units, or choose a longer window"
        )
    if not flight.gain_is_certain(profile):
        base.check_fit(*begun.plain, begun.fitted)


def _without_the_plant(
    begun: _Begun, profile: native.FlightProfile, adequacy: flight.Adequacy
) -> DelayEstimate | None:
    """The estimate of least squares where the noise stands for what the plant lacks."""
    astray = adequacy.reasons and profile.fit.explains_less(begun.whole)
    if not (begun.names.are_common and (adequacy.plant_lacks or astray)):
        return None
    try:
        return flight.without_the_plant(begun.by_least_squares(), adequacy)
    except NotIdentifiableError:
        # Where air moves the output far more than the command does, least squares sees nothing.
        if not flight.gain_is_certain(profile):
            raise
    return None


def _concluded(
    begun: _Begun, profile: native.FlightProfile, fitted: list[Run], adequacy: flight.Adequacy
) -> DelayEstimate:
    """The estimate of the likelihood; of rounded rows alone, with each as an interval."""
    message = f"maximum likelihood {begun.message}"
    if adequacy.coloured:
        profile = profile.coloured()
        message += ", with wider intervals because the residuals are coloured also at rest"
    fit, details = profile.fit, begun.details(profile.fit.initial_output)
    estimate = flight.concluded_flight(
        begun.method, begun.names.linear, fitted, profile, message, details, adequacy
    )
    plain = begun.names.are_common and profile.is_plain and not adequacy.coloured
    if plain and not fit.is_long and estimate.verdict == "reliable" and fit.is_rounding_alone:
        return flight.read_as_intervals(estimate, begun.models)
    return estimate


def _begun(method: str, runs: Sequence[Run], names: _Names, assumed: commanded.Assumed) -> _Begun:
    """Least squares on recordings, with gaps in their commands or without if that is likelier."""
    begun = _begun_with(method, runs, names, assumed)
    if any(model.commands.lost for model in begun.models):
        held = _begun_with(method, runs, names, assumed._replace(complete=True))
        begun = min(begun, held, key=lambda start: start.criterion)
    return begun


def _begun_with(
    method: str, runs: Sequence[Run], names: _Names, assumed: commanded.Assumed
) -> _Begun:
    """Least squares on recordings whose commands are as `assumed`."""
    models = [commanded.commanded_model(run, names.common, assumed) for run in runs]
    _check_others(names.others, models[0].known)
    rows, known = [model.rows for model in models], models[0].known
    given = partial(_given, names, assumed, models, rows)
    first = [known[name] for name in names.others]
    white, found = native.FlightFit.first(given, first, known["delay"], known["gain"])
    numbers = dict(zip(names.others, found, strict=True))
    whole = white.on(given(found)[1])
    return _Begun(method, runs, names, assumed, models, white, numbers, whole)


def _check_others(names: Sequence[str], known: Mapping[str, float]) -> None:
    """Refuse numbers that cannot be searched around the rest."""
    if len(names) > native.MOST_NUMBERS:
        raise ValueError(
            f"besides gain, delay, lags and zero, the plant has {len(names)} free "
            f"parameters ({', '.join(names)}): fit at most {native.MOST_NUMBERS} of them"
        )
    for name in names:
        if known[name] == 0.0:
            raise ValueError(
                f"{name}=0: give an initial value other than zero, with the right sign"
            )


def _given(
    names: _Names,
    assumed: commanded.Assumed,
    models: Sequence[commanded.CommandedModel],
    rows: Sequence[native.FlightRows],
    found: Sequence[float],
) -> tuple[native.FlightPlant, list[native.FlightRows]]:
    """The plant with such other numbers, and the rows with the commands that it gets."""
    plant, values = models[0].plant, dict(zip(names.others, found, strict=True))
    if values:
        plant = plant._replace({**plant.parameters, **values})
    within = [model.limited(part, values) for model, part in zip(models, rows, strict=True)]
    return plant_model(plant, names.linear, assumed.air == "vehicle"), within


def on_regular_times(run: Run) -> Run | None:
    """The run with the regular times that its stamps scatter around; None where there are none."""
    check, sample_time, recording = run.check, run.loop.sample_time, run.recording
    if check is None or check.stamps != "jittered":
        return None
    if sample_time is None or recording.sent is not None:
        return None
    regular = native.regular_times(recording.time, sample_time * (check.rate_ratio or 1))
    return None if regular is None else run._replace(recording=replace(recording, time=regular))
