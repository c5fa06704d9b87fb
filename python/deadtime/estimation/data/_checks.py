"""Checks of what a fit can determine: excitation, free parameters, distinguishability, errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import is_range
from deadtime.estimation._native import independent_samples
from deadtime.loops import ControlLoop, FactoredPlant, Integrator, ParametricPlant, Plant
from deadtime.recordings import Finding, Recording, no_excitation, no_motion

#: Ratio of singular values of the scaled Jacobian below which the data do not distinguish two
#: parameters. Rounding in difference quotients is at about 1e-8, so smaller values mistake rounding
#: for information.
INDISTINGUISHABLE = 1e-6

#: Parameters of the vehicle, in the order in which fits report them, and those of the whole loop:
#: `start` is by how much the clock of the output is later than that of the reference. A sample time
#: is not among them: the cost jumps where a sample moves from before a step to after it.
VEHICLE_PARAMETERS = ("delay", "gain", "lag", "time_constant", "rate", "rate_of_rate")
LOOP_PARAMETERS = (*VEHICLE_PARAMETERS, "start", "limit")

#: Relative step of the difference quotient of the total lag.
QUOTIENT = 1e-5

#: Significance level of the F test that the response explains the output better than a constant.
#: Over all delays that are tried, noise alone passes about once in some hundred recordings.
F_TEST_LEVEL = 1e-4

#: Largest unexplained share of the variance at which residuals count as independent samples in that
#: test. Above it, autocorrelation reduces the number of samples.
MOSTLY_EXPLAINED = 0.5

#: A fitted gain below so many standard errors is indistinguishable from zero.
LEAST_GAIN = 3.0

#: Residuals below this share of the output's range count as rounding.
ROUNDING = 1e-9


def checked_names(
    free: Sequence[str], loop: ControlLoop, known: tuple[str, ...] = VEHICLE_PARAMETERS
) -> tuple[str, ...]:
    """Return the names of what is to be fitted, or raise where this loop has no such parameter."""
    if isinstance(free, str):
        free = (free,)
    unknown = [name for name in free if name not in known]
    if unknown or not free:
        raise ValueError(f"free={tuple(free)!r}: choose one or more from {known}")
    given = {"delay", "start"}
    missing = [name for name in free if name not in given and name not in loop.parameters]
    if missing:
        raise ValueError(
            f"this loop has no {missing[0]} that could be fitted (its parameters "
            f"are {', '.join(loop.parameters)}): give the loop an initial value "
            "of this parameter, or leave the parameter out of `free`"
        )
    if "delay" not in free and loop.delay is None:
        raise ValueError(
            "the delay of the loop is unknown, so it must be fitted: add 'delay' to `free`"
        )
    return tuple(name for name in known if name in free)


def integrator_of(loop: ControlLoop, method: str) -> Integrator:
    """The plant of the loop, which has to be an integrator."""
    if not isinstance(loop.plant, Integrator):
        raise ValueError(
            f"the {method} method is for an Integrator, but the loop has a "
            f"{type(loop.plant).__name__}: use method='waveform'"
        )
    return loop.plant


def delay_and(free: Sequence[str], loop: ControlLoop, method: str) -> tuple[str, ...]:
    """The checked names of what is fitted, for a method that searches the delay."""
    names = checked_names(free, loop)
    if "delay" not in names:
        raise ValueError(f"the {method} method estimates the delay: add 'delay' to `free`")
    return names


def check_distinguishable(jacobian: Array, names: Sequence[str]) -> None:
    """Refuse parameters that the recording does not distinguish, by name."""
    norms = np.linalg.norm(jacobian, axis=0)
    if not np.all(np.isfinite(norms)) or np.any(norms == 0.0):
        unseen = [name for name, norm in zip(names, norms, strict=True) if not norm > 0.0]
        raise NotIdentifiableError(
            f"the recording does not depend on the {' or '.join(unseen) or 'parameters'}. "
            "Either the window has no response to a step, or the command is at its limit "
            "throughout"
        )
    # The thin factor: the full one has as many entries as samples squared.
    _, singular, directions = np.linalg.svd(jacobian / norms, full_matrices=False)
    if singular[-1] < INDISTINGUISHABLE * singular[0]:
        weights = np.abs(directions[-1])
        mixed = [name for name, weight in zip(names, weights, strict=True) if weight > 0.2]
        raise NotIdentifiableError(
            f"this recording cannot separate the effects of {' and '.join(mixed)}. Fix "
            "one, or record a step that does not keep the command at its limit throughout"
        )


def excited(recording: Recording) -> float:
    """Size of the excitation: the range of the reference, or of the output if that is constant."""
    return float(np.ptp(recording.reference)) or float(np.ptp(recording.output))


def _refuse(finding: Finding | None) -> None:
    """Raise what a check of the recording found, if anything."""
    if finding is not None:
        raise NotIdentifiableError(finding.message)


def check_response(output: Array, misfit: Array, numbers: int, autocorrelation: float) -> None:
    """Refuse an output that the fitted response explains hardly better than a constant: noise.

    The test is an F test. Coloured residuals count as fewer independent samples, unless most of
    the variance is explained: then the model is incomplete, but there is a response.
    """
    from scipy import special

    centred = output - output.mean()
    constant, fitted = float(centred @ centred), float(misfit @ misfit)
    if fitted == 0.0:
        return
    samples = float(misfit.size)
    if fitted > MOSTLY_EXPLAINED * constant:
        samples = independent_samples(misfit.size, autocorrelation)
    freedom = max(1.0, samples - numbers - 1)
    ratio = (constant - fitted) / numbers * freedom / fitted
    if not ratio > 0.0 or special.fdtrc(numbers, freedom, ratio) > F_TEST_LEVEL:
        explained = 100.0 * max(0.0, 1.0 - fitted / constant) if constant > 0.0 else 0.0
        raise NotIdentifiableError(
            "the output does not respond to the excitation, because the best fit explains "
            f"only {explained:.0f} % of the output's variance, as for noise alone. Check "
            "columns, signs and gains, choose a window with a step, or record a larger step"
        )


def standard_errors(
    names: tuple[str, ...], cov: Array, plant: Plant | None = None
) -> dict[str, float]:
    """Standard errors of `names`, and of ``delay+lag`` where the delay is among them.

    `plant` is needed where a name is none of the plain lags.
    """
    errors = {name: float(np.sqrt(cov[i, i])) for i, name in enumerate(names)}
    if "delay" in names:
        slow = "time_constant" if "time_constant" in names else "lag"
        total = np.array([1.0 if name == "delay" else by_lag(name, plant) for name in names])
        count = len(names)
        errors[f"delay+{slow}"] = float(np.sqrt(total @ cov[:count, :count] @ total))
    return errors


def by_lag(name: str, plant: Plant | None) -> float:
    """Derivative of the total lag of a plant by one of its numbers."""
    if not isinstance(plant, (FactoredPlant, ParametricPlant)):
        return 1.0 if name in ("lag", "time_constant") else 0.0
    if name not in plant.parameters:
        return 0.0
    value = plant.parameters[name]
    step = QUOTIENT * abs(value) or QUOTIENT
    higher, lower = (plant._replace({name: value + sign * step}) for sign in (1.0, -1.0))
    return (higher.lag - lower.lag) / (2.0 * step)


def check_moves(output: Array, command: Array | None = None) -> None:
    """Refuse a constant command, and a constant output."""
    _refuse(no_motion(output, command))


def check_even(data: Recording, share: float, why: str) -> None:
    """Refuse rows whose distance differs from the median by more than a share of it."""
    steps, row = np.diff(data.time), data.sample_time
    if float(np.max(np.abs(steps - row))) > share * row:
        raise NotIdentifiableError(
            f"the samples are {float(steps.min()):g} to {float(steps.max()):g} s apart, but {why}"
        )


def check_excitation(data: Recording, numbers: int, *, in_motion: bool = False) -> None:
    """Refuse a window without excitation, or in which the output does not move.

    A window with rows before it (`in_motion`) has to contain a step; a whole recording may begin
    with one.
    """
    _refuse(no_excitation(data.reference, data.output, in_motion=in_motion))
    steps = data.steps()
    left = len(data) - (steps[0].index if steps else 0)
    if left < 2 * (numbers + 1):
        raise NotIdentifiableError(
            f"{left} samples after the step are too few to fit {numbers} "
            "parameters and an initial output: choose a longer window"
        )
    check_moves(data.output)


def start_and_span(data: Recording) -> tuple[float, float]:
    """Output before the first step, and the time from that step to the end, s.

    If the reference is constant, the step is taken to be at the first sample.
    """
    steps = data.steps()
    rest = data.output[: max(1, steps[0].index)] if steps else data.output[:1]
    begin = steps[0].time if steps else data.time[0]
    return float(rest.mean()), float(data.time[-1] - begin)


def check_gain(values: Mapping[str, float], errors: Mapping[str, float]) -> None:
    """Refuse a fitted gain that may be zero: any delay would then fit as well."""
    if "gain" in values and abs(values["gain"]) < LEAST_GAIN * errors["gain"]:
        raise NotIdentifiableError(
            f"the gain is estimated as {values['gain']:.2g} ± {errors['gain']:.2g}, "
            "so it may be zero. Either the output does not respond to the input, "
            "or noise hides the response. Check columns and units"
        )


def check_ends(names: Sequence[str], point: Array, low: Array, high: Array) -> None:
    """Refuse a fit at a bound of its search; a delay or lag of zero is a valid result."""
    for name, value, least, most in zip(names, point, low, high, strict=False):
        for end in (most,) if name in ("delay", "lag") else (least, most):
            if np.isfinite(end) and abs(value - end) <= 1e-3 * abs(end):
                raise NotIdentifiableError(
                    f"the search ends at its bound, a {name} of {end:g}. So the output "
                    "is not a response of this loop to this reference. Check columns, "
                    "signs, units and gains, and choose a window around one step"
                )


def given_recordings(recording: Any) -> list[Any]:
    """The recordings, of which one may be given alone."""
    is_several = isinstance(recording, (list, tuple, Iterator))
    recordings = list(recording) if is_several else [recording]
    if not recordings:
        raise ValueError("no recording was given: give a recording, or a list of recordings")
    return recordings


def one_each(name: str, given: Any, number: int) -> list[Any]:
    """What was given for all recordings, or one each, as a list."""
    is_window = name == "window" and is_range(given) and len(given) == 2
    is_several = isinstance(given, (list, tuple)) and not is_window
    found = list(given) if is_several else [given] * number
    if len(found) != number:
        raise ValueError(
            f"{number} recordings and {len(found)} of `{name}`: give one for all, or one each"
        )
    return found
