"""Turn the likeliest plant and noise of recordings into an estimate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime._base.verdicts import verdict_if
from deadtime.estimation._native import SHORTEST_LAG, unseen_lag
from deadtime.estimation._result import REASONS, CramerRaoBound, DelayEstimate, FittedRun
from deadtime.estimation.data._checks import LEAST_GAIN
from deadtime.estimation.likelihood._flight import NoiseFit, PlantModel
from deadtime.estimation.likelihood._free_numbers import NumbersProfile
from deadtime.estimation.likelihood._judgement import Adequacy, unseen_in_words
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows, on_same_step
from deadtime.estimation.methods._conclusion import COLOURED, advice
from deadtime.estimation.methods._method import Run
from deadtime.experiments import FlightNoise

#: A lag below so many times its lower bound is none.
NO_LAG = 2.0

#: Ratio of the residuals to those of least squares from which the noise stands for the plant.
LESS = 1.5


def profile_for(
    fit: NoiseFit, names: tuple[str, ...], intervals: Literal["all", "sum"] = "all"
) -> LikelihoodProfile:
    """The profile over the names, and over the sum of delay and lag."""
    found = profiled(fit.model, names)
    total = [name for name, kernel in found.items() if kernel == "total"]
    first = total if intervals == "sum" and total else found
    return LikelihoodProfile.best(fit, found, first)


def profiled(model: PlantModel, names: tuple[str, ...]) -> dict[str, str]:
    """The kernel's name of each quantity that has an interval."""
    kernel = dict(model.order)
    wanted = {name: kernel[name] for name in names}
    if "delay" in names:
        slow = "time_constant" if "time_constant" in names else "lag"
        wanted[f"delay+{slow}"] = "total"
    return wanted


def concluded_flight(
    method: str,
    names: tuple[str, ...],
    runs: Sequence[Run],
    profile: LikelihoodProfile,
    known: Mapping[str, float],
    message: str,
    details: Mapping[str, Any],
    adequacy: Adequacy,
) -> DelayEstimate:
    """Make the estimate of a fit."""
    fit = profile.fit
    values = values_of(fit, names, known)
    cov = profile.common
    order = [name for name, _ in fit.model.order]
    place = [order.index(name) for name in names]
    cov = cov[np.ix_(place, place)]
    if isinstance(profile, NumbersProfile):
        cov = profile.free.joined(names, cov)
        values |= profile.free.values
        names = tuple(values)
    noise = tuple(_noise_of(fit, run) for run in range(len(runs)))
    unseen = unseen_lag(fit.native)
    left_out = sum(_outliers(rows) for rows in fit.runs)
    fitted = tuple(
        FittedRun(run.recording, run.loop.replace(**values), part.residuals, one)
        for run, part, one in zip(runs, fit.parts, noise, strict=True)
    )
    held = [name for name in names if name.startswith(("lag", "delay")) and values[name] == 0.0]
    stderr, least = (
        {name: 0.0 if name in held else error for name, error in errors.items()}
        for errors in (profile.stderr, profile.bounds)
    )
    scatter = {
        f"scatter_of_{what}": max(times)
        for what, part in (("rows", "stamps"), ("commands", "arrivals"))
        if any(times := [fit.scatter(run, part) for run in range(len(runs))])
    }
    labels = (*names, *(["initial output"] if fit.runs[0].offset else []))
    labels += ("trim",) * fit.trim
    return DelayEstimate(
        method=method,
        loop=fitted[0].loop,
        free=names,
        stderr=stderr,
        cov=cov,
        crb=CramerRaoBound(labels, noise[0], least),
        recording=fitted[0].recording,
        residuals=fitted[0].residuals,
        whiteness=adequacy.whiteness,
        verdict=verdict_if(not adequacy.reasons),
        message=_message(
            message, names, held, noise[0], left_out, scatter, adequacy, runs[0], unseen
        ),
        details={**details, "rows_left_out": left_out, "unseen_lag": unseen, **scatter},
        others=fitted[1:],
        noise=noise[0],
        _profile=profile,
    )


def _outliers(rows: FlightRows) -> int:
    """Rows left out, but those of a rounded output that tell nothing besides another."""
    left = ~rows.used
    return int(np.sum(left & ~on_same_step(rows.output) if rows.rounding else left))


def values_of(
    fit: NoiseFit, names: tuple[str, ...], known: Mapping[str, float]
) -> dict[str, float]:
    """The fitted parameters of the loop; a lag at its lower bound is none.

    Beside no lag there is no zero: its effect would be a pulse between rows.
    """
    numbers = fit.numbers
    least = NO_LAG * SHORTEST_LAG * fit.runs[0].row_time
    found = {"delay": numbers.delay, "gain": fit.gain, "zero": numbers.zero}
    for name, lag in zip(fit.model.lag_names, numbers.lags, strict=True):
        if name.startswith("lag") and lag <= least:
            found["delay"], lag = found["delay"] + lag, 0.0
        found[name] = lag
    found["delay"] = max(0.0, found["delay"])
    kept = [found[name] for name in fit.model.lag_names]
    if numbers.zero and kept and not any(kept) and len(fit.model.den) <= 2:
        raise NotIdentifiableError(
            "the lags come out at zero, where a zero has no effect on the rows: leave 'zero' and "
            "the lags out of free=, or give the plant a further lag"
        )
    return {name: found[name] for name in names} | {
        "delay": found["delay"] if "delay" in names else known["delay"]
    }


def _noise_of(fit: NoiseFit, run: int) -> FlightNoise:
    part, one, rows = fit.parts[run], fit.numbers.noise[run], fit.runs[run]
    white = math.sqrt(part.variance)
    trim = 0.0
    if fit.trim:
        place = ("gain" in fit.model.names and len(fit.runs) == 1) + rows.offset
        trim = part.linear[place]
    return FlightNoise(
        white=white,
        air=white * one.air,
        air_time=one.air_time if one.air > 0.0 else math.inf,
        trim=trim,
        sensor=white * one.sensor,
        sensor_time=one.sensor_time if one.sensor > 0.0 else 0.0,
    )


def gain_is_certain(profile: LikelihoodProfile) -> bool:
    """Whether the gain is fitted and far from zero."""
    if "gain" not in profile.names:
        return False
    return abs(profile.fit.gain) > 2.0 * LEAST_GAIN * profile.stderr["gain"]


def explains_less(fit: NoiseFit, white: NoiseFit) -> bool:
    """Whether the plant beside the noise explains far less of a recording than by least squares."""
    return any(
        float(np.std(part.residuals)) > LESS * float(np.std(least.residuals))
        for part, least in zip(fit.parts, white.parts, strict=True)
    )


def without_the_plant(plain: DelayEstimate, adequacy: Adequacy) -> DelayEstimate:
    """The estimate of least squares for a plant that lacks something.

    The likelihood takes what the plant lacks for air, and weighs the rows that show it least. Least
    squares weighs all alike, and finds the plant that comes closest to the recording.
    """
    text = plain.message.split(COLOURED)[0]
    text += f"{REASONS}{'; '.join(adequacy.reasons)}"
    return replace(plain, verdict="indication", message=text + advice(plain.free, plain.loop))


def _message(
    done: str,
    names: tuple[str, ...],
    held: list[str],
    noise: FlightNoise,
    left_out: int,
    scatter: Mapping[str, float],
    adequacy: Adequacy,
    run: Run,
    unseen: float,
) -> str:
    text = f"{done}; {noise}"
    if left_out:
        text += f"; {left_out} rows left out as outliers"
    for what, size in scatter.items():
        text += f"; the times of the {what.removeprefix('scatter_of_')} scatter by {size:.2g} s"
    if held:
        text += f"; the {' and '.join(held)} came out at zero, its bound"
    if adequacy.reasons:
        return f"{text}{REASONS}{'; '.join(adequacy.reasons)}{advice(names, run.loop)}"
    return f"{text}; {unseen_in_words(unseen)} have been seen"
