"""The estimate from rows that are rounded, where nothing but white noise is beside the plant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from deadtime._base.arrays import Array, Indices, Mask
from deadtime.estimation._result import CramerRaoBound, DelayEstimate, FittedRun
from deadtime.estimation.data._checks import standard_errors
from deadtime.estimation.fit._least_squares import JointModel, Model
from deadtime.estimation.fit._profile import Profile
from deadtime.estimation.likelihood._flight import NoiseFit
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rounded import RoundedCost, RoundedLikelihood
from deadtime.estimation.likelihood._rows import FlightRows
from deadtime.estimation.methods._commanded_model import CommandedModel
from deadtime.experiments import FlightNoise


def rounding_is_all(fit: NoiseFit) -> bool:
    """Whether every recording is rounded, and has no other noise than white beside."""
    return all(
        rows.rounding > 0.0 and not (one.air or one.sensor or one.stamps or one.arrivals)
        for rows, one in zip(fit.runs, fit.numbers.noise, strict=True)
    )


def read_as_intervals(
    estimate: DelayEstimate,
    models: Sequence[CommandedModel],
    first: Sequence[FlightRows],
    repeated: Sequence[Indices],
) -> DelayEstimate:
    """The estimate with each row as the interval that was rounded to it.

    Parameters
    ----------
    estimate : DelayEstimate
        That of one row for each step.
    models : sequence of CommandedModel
    first : sequence of FlightRows
        The rows before outliers were found.
    repeated : sequence of ndarray
        Rows of each recording that repeat the one before.
    """
    profile = estimate._profile
    assert isinstance(profile, LikelihoodProfile)
    fit = profile.fit
    parts = tuple(one.started(fit, {}) for one in models)
    model: Model = parts[0] if len(parts) == 1 else JointModel(parts, (1.0,) * len(parts))
    start = model.starts()[0]
    outputs = [one.recording.output for one in parts]
    steps = np.array([rows.rounding for rows in fit.runs])
    used = np.concatenate(_read(first, fit.runs, repeated))
    likelihood = _likelihood_of(model, start, outputs, steps, used)
    peak = likelihood.likeliest(start)
    cov = likelihood.covariance(peak)
    names, count = estimate.free, len(estimate.free)
    plain = standard_errors(names, cov)
    unseen = {name: math.sqrt(profile.unseen[name]) for name in plain}
    freedom = int(np.sum(likelihood.used)) - start.size - steps.size
    values = dict(zip(names, peak.point.tolist(), strict=False))
    residuals = np.split(-model.misfit(peak.point), np.cumsum(model.sizes)[:-1])
    noise = [FlightNoise(white=float(one)) for one in np.exp(peak.logs)]
    runs = tuple(
        FittedRun(run.recording, run.loop.replace(**values), piece, one)
        for run, piece, one in zip(estimate.runs, residuals, noise, strict=True)
    )
    message = estimate.message.replace(str(estimate.noise), f"{noise[0]} before the rounding")
    return replace(
        estimate,
        loop=runs[0].loop,
        stderr={name: error * unseen[name] for name, error in plain.items()},
        cov=cov[:count, :count],
        crb=CramerRaoBound(model.labels, noise[0], plain),
        residuals=runs[0].residuals,
        noise=noise[0],
        message=f"{message}; each row is read as the interval of its rounding",
        details={**estimate.details, "initial_output": parts[0].start_of(peak.point)},
        others=runs[1:],
        _profile=Profile(
            RoundedCost(likelihood, peak, runs[0].loop.parameters, freedom),
            best=float(freedom),
            freedom=freedom,
            widening=unseen,
            preferred="rows are rounded",
        ),
    )


def _read(
    first: Sequence[FlightRows], fitted: Sequence[FlightRows], repeated: Sequence[Indices]
) -> list[Mask]:
    """Rows that are read as intervals: all but outliers and those that repeat the one before."""
    masks = []
    for rows, own, places in zip(first, fitted, repeated, strict=True):
        mask = ~(rows.used & ~own.used)
        mask[places] = False
        masks.append(mask)
    return masks


def _likelihood_of(
    model: Model, start: Array, outputs: Sequence[Array], steps: Array, used: Mask
) -> RoundedLikelihood:
    """The likelihood of the readings, with the scale of each number from least squares."""
    jacobian = model.jacobian(start)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    return RoundedLikelihood(
        model,
        np.concatenate(outputs),
        steps,
        np.repeat(np.arange(steps.size), [one.size for one in outputs]),
        used,
        float(steps.max()) / math.sqrt(12.0) * np.sqrt(np.diag(inverse)),
    )
