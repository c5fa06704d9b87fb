"""Turn the likeliest plant and noise of recordings into an estimate, also from rounded rows.

What the tests of a fit say is put into words.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.digits import stated
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.verdicts import verdict_if
from deadtime.estimation._least_squares import JointModel, Model, Profile, Whiteness, places_of
from deadtime.estimation._result import REASONS, CramerRaoBound, DelayEstimate, FittedRun, of_runs
from deadtime.estimation.data._checks import LEAST_GAIN, standard_errors
from deadtime.estimation.methods._commanded_model import CommandedModel
from deadtime.estimation.methods._method import COLOURED, Run, advice
from deadtime.experiments import FlightNoise

#: What speaks against a fit, by the kernel's name of it, with its sizes.
WORDS = {
    "colour": (
        "the residuals are not white even after the "
        "noise was fitted (lag-1 autocorrelation {0:.2f})"
    ),
    "lag": "with a further lag of {0:.3g} s the recording is more likely, so the plant lacks a lag",
    "lag moves": (
        "with a further lag of {0:.3g} s, the sum of delay and "
        "lag would be {1:.3g} s, which is outside its interval"
    ),
    "overshoot": (
        "with a further lag of {0:.3g} s and a zero of {1:.3g} "
        "s the recording is more likely, so the plant lacks both"
    ),
    "below zero": (
        "the likelihood still rises as the delay falls to "
        "zero, so the plant has too much lag, or lacks a zero"
    ),
    "change": (
        "the delay is not constant over the window{where}: its standard deviation is {time}"
    ),
    "speed": (
        "the noise grows with the speed of the output{where}, so "
        "the time stamps are probably not the times of the samples"
    ),
    "restless air": (
        "the fitted disturbance{where} is too large to be wind. Within a row it changes "
        "by {0:.2g} times the sensor noise, so the plant probably lacks a lag or a zero"
    ),
    "moving air": (
        "the fitted disturbance{where} is larger while the vehicle "
        "moves than at rest, so the plant probably lacks a lag or a zero"
    ),
    "gains": "the recordings contradict one another in {name}: {values}",
    "totals": "the recordings contradict one another in {name}: {times}",
}


@dataclass(frozen=True)
class Adequacy:
    """What the tests say.

    Attributes
    ----------
    whiteness : Whiteness
        Of the whitened residuals.
    reasons : tuple of str
        Why the model does not hold; empty where it is.
    plant_lacks : bool
        Whether one of them is that the plant lacks something: a lag, or what the air stands for.
    coloured : bool
        Whether the whitened residuals have a colour that is there while the vehicle rests, too:
        then the intervals have to be made valid for it.
    """

    whiteness: Whiteness
    reasons: tuple[str, ...]
    plant_lacks: bool = False
    coloured: bool = False


def adequacy_of(profile: native.FlightProfile) -> Adequacy:
    """Test a fit."""
    found = profile.judge()
    against = [finding for finding in found.findings if finding.is_against]
    return Adequacy(
        Whiteness(*found.whiteness),
        tuple(_in_words(finding, profile) for finding in against),
        any(finding.plant_lacks for finding in against),
        found.is_coloured,
    )


def unseen_in_words(lag: float) -> str:
    """The further lag that would not be seen, up to the verb."""
    if math.isinf(lag):
        return "no further lag would"
    return f"a further lag below {lag:.2g} s would not"


def _in_words(found: native.FlightFinding, profile: native.FlightProfile) -> str:
    several = found.run is not None and len(profile.fit.numbers.noise) > 1
    pairs = list(zip(found.sizes[::2], found.sizes[1::2], strict=False))
    total = next((name for name in dict(profile.stderr) if name.startswith("delay+")), "")
    return WORDS[found.cause].format(
        *found.sizes,
        where=f" in recording {found.run + 1}" if several and found.run is not None else "",
        time=stated(found.sizes[0], math.nan, "s") if found.cause == "change" else "",
        name="gain" if found.cause == "gains" else total,
        values=", ".join(stated(value, error, "") for value, error in pairs),
        times=", ".join(stated(value, error, "s") for value, error in pairs),
    )


def profile_for(
    fit: native.FlightFit,
    intervals: Literal["all", "sum"] = "all",
    covariance: Sequence[float] | None = None,
    numbers: native.FreeNumbers | None = None,
) -> native.FlightProfile:
    """The profile over what is fitted, and over the sum of delay and lag.

    With the covariance of a fit whose commands are functions of its plant, or with numbers that
    were searched around it.
    """
    names = fit.plant.names
    total = ["delay+lag"] if "delay" in names else []
    try:
        first = total if intervals == "sum" and total else [*names, *total]
        return fit.profile(first, covariance, numbers)
    except NotIdentifiableError:
        raise NotIdentifiableError(
            f"this recording cannot separate the effects of {', '.join(names)}: give the "
            "plant fewer lags, or let deadtime.estimation.choose_plant choose the plant"
        ) from None


def concluded_flight(
    method: str,
    names: tuple[str, ...],
    runs: Sequence[Run],
    profile: native.FlightProfile,
    message: str,
    details: Mapping[str, Any],
    adequacy: Adequacy,
) -> DelayEstimate:
    """Make the estimate of a fit."""
    fit = profile.fit
    free = {} if profile.numbers is None else dict(profile.numbers.values)
    values, names = fit.values | free, (*names, *free)
    noise = tuple(_noise_of(fit, run) for run in range(len(runs)))
    unseen = fit.unseen_lag
    left_out = sum(rows.left_out for rows in fit.runs)
    fitted = tuple(
        FittedRun(run.recording, run.loop.replace(**values), part.residuals, run_noise)
        for run, part, run_noise in zip(runs, fit.parts, noise, strict=True)
    )
    held = [name for name in names if name.startswith(("lag", "delay")) and values[name] == 0.0]
    stderr, least = (
        {name: 0.0 if name in held else error for name, error in errors}
        for errors in (profile.stderr, profile.bounds)
    )
    scatter = {
        f"scatter_of_{what}": times
        for what in ("rows", "commands")
        if (times := fit.scatter(what == "rows"))
    }
    ending = f"; {unseen_in_words(unseen)} have been seen"
    if adequacy.reasons:
        ending = f"{REASONS}{'; '.join(adequacy.reasons)}{advice(names, runs[0].loop)}"
    labels = (*names, *["initial output"] * fit.runs[0].offset, *["trim"] * fit.trim)
    return DelayEstimate(
        **of_runs(fitted),
        method=method,
        free=names,
        stderr=stderr,
        cov=profile.cov,
        crb=CramerRaoBound(labels, noise[0], least),
        whiteness=adequacy.whiteness,
        verdict=verdict_if(not adequacy.reasons),
        message="; ".join([message, str(noise[0]), *_remarks(left_out, scatter, held)]) + ending,
        details={**details, "rows_left_out": left_out, "unseen_lag": unseen, **scatter},
        _profile=profile,
    )


def _noise_of(fit: native.FlightFit, run: int) -> FlightNoise:
    white, disturbance, air_time, *others = fit.noise_in_units(run)
    return FlightNoise(white, disturbance, air_time, 0.0, *others)


def gain_is_certain(profile: native.FlightProfile) -> bool:
    """Whether the gain is fitted and far from zero."""
    error = dict(profile.stderr).get("gain", math.inf)
    return abs(profile.fit.gain) > 2.0 * LEAST_GAIN * error


def without_the_plant(plain: DelayEstimate, adequacy: Adequacy) -> DelayEstimate:
    """The estimate of least squares for a plant that lacks something.

    The likelihood takes what the plant lacks for air, and weighs the rows that show it least. Least
    squares weighs all alike, and finds the plant that comes closest to the recording.
    """
    text = plain.message.split(COLOURED)[0]
    text += f"{REASONS}{'; '.join(adequacy.reasons)}"
    return replace(plain, verdict="indication", message=text + advice(plain.free, plain.loop))


def _remarks(left_out: int, scatter: Mapping[str, float], held: list[str]) -> list[str]:
    """What was left out, and what came out, in words."""
    said = [f"{left_out} rows were left out as outliers"] if left_out else []
    said += [
        f"the time stamps of the {what.removeprefix('scatter_of_')} have random errors with "
        f"a standard deviation of {size:.2g} s"
        for what, size in scatter.items()
    ]
    if held:
        said.append(f"the {' and '.join(held)} was estimated as zero, which is its bound")
    return said


def read_as_intervals(estimate: DelayEstimate, models: Sequence[CommandedModel]) -> DelayEstimate:
    """The estimate with each row as the interval that was rounded to it.

    Parameters
    ----------
    estimate : DelayEstimate
        That of one row for each step.
    models : sequence of CommandedModel
        With the rows before outliers were found, and those that repeat the one before.
    """
    profile = estimate._profile
    assert isinstance(profile, native.FlightProfile)
    fit = profile.fit
    parts = tuple(commanded_model.started(fit, {}) for commanded_model in models)
    model: Model = parts[0] if len(parts) == 1 else JointModel(parts, (1.0,) * len(parts))
    readings = native.RoundedReadings.of_rows(
        [commanded_model.rows for commanded_model in models],
        fit.runs,
        [commanded_model.repeated for commanded_model in models],
    )
    names, count = estimate.free, len(estimate.free)
    start = np.concatenate([parts[0].start[:count], *(part.start[count:] for part in parts)])
    peak = model.problem.likeliest_rounded(readings, start)
    plain, bounds = standard_errors(names, peak.cov), dict(profile.bounds)
    unseen = {name: error / bounds[name] for name, error in profile.stderr}
    freedom = readings.count - peak.point.size - len(parts)
    values = dict(zip(names, peak.point.tolist(), strict=False))
    residuals = np.split(-model.misfit(peak.point), np.cumsum(model.sizes)[:-1])
    noise = [FlightNoise(white=white) for white in peak.noise]
    runs = tuple(
        FittedRun(run.recording, run.loop.replace(**values), piece, run_noise)
        for run, piece, run_noise in zip(estimate.runs, residuals, noise, strict=True)
    )
    message = estimate.message.replace(str(estimate.noise), f"{noise[0]} before the rounding")
    return replace(
        estimate,
        **of_runs(runs),
        stderr={name: error * unseen[name] for name, error in plain.items()},
        cov=peak.cov[:count, :count],
        crb=CramerRaoBound(model.labels, noise[0], plain),
        message=f"{message}; each row is an interval as wide as its rounding",
        details={**estimate.details, "initial_output": parts[0].start_of(peak.point)},
        _profile=Profile(
            partial(_rounded_cost, model, readings, peak, runs[0].loop.parameters, freedom),
            best=float(freedom),
            freedom=freedom,
            widening=unseen,
            preferred="rows are rounded",
        ),
    )


def _rounded_cost(
    model: Model,
    readings: native.RoundedReadings,
    peak: native.RoundedPeak,
    known: Mapping[str, float],
    freedom: int,
    name: str,
    value: float,
) -> float:
    """-2 ln L with one quantity held, as the cost of a `Profile` whose variance is one.

    It is the rise, on top of what a sum of squares has at its least.
    """
    held = places_of(name, value, model, known)
    least = model.problem.rounded_held(readings, peak, *held)
    return freedom + max(0.0, least - peak.value)
