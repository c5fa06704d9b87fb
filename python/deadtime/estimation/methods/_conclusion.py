"""Turn a minimum of least squares, or what was read from a response, into an estimate.

White residuals: covariance sigma^2 (J^T J)^-1, which is the Cramér-Rao bound. Coloured residuals:
the robust covariance, because the model is only an approximation of the vehicle. Where a lag is
fitted (the cost is then far from quadratic, and the lag may be at its bound) and where samples are
few, intervals are those of the profile likelihood.

The residuals of methods that read the delay from a few features of the response are those of the
loop with the estimated parameters, so they show how well it explains the whole recording.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.verdicts import Verdict, verdict_if
from deadtime.estimation._result import ADVICE, REASONS, CramerRaoBound, DelayEstimate, FittedRun
from deadtime.estimation.data._checks import (
    ROUNDING,
    check_distinguishable,
    check_response,
    embedded,
    standard_errors,
)
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.fit._directions import Directions
from deadtime.estimation.fit._least_squares import Minimum, Model, minimise
from deadtime.estimation.fit._profile import Profile, ProfileCost
from deadtime.estimation.fit._residuals import (
    Whiteness,
    robust_covariance,
    white_covariance,
    whiteness_of,
)
from deadtime.estimation.methods._method import Run
from deadtime.experiments import FlightNoise
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Samples for each fitted parameter below which intervals are those of the profile likelihood.
FEW = 12

#: What a message says of residuals that are not white.
COLOURED = f"{REASONS}the residuals are not white"

#: A delay or lag is set to zero where this raises the cost by less than this share.
VANISHING = 1e-6

#: Zero is tried only where moving to it multiplies the cost by no more than this (saves fits).
WORTH_TRYING = 2.0

#: A lag within so many standard errors of zero may be zero. The statistic of the delay is then no
#: chi-square of one degree of freedom, but at most an even mixture of those with one and two (Self
#: & Liang 1987), whose 95 % quantile is larger by this factor.
NEAR_BOUND = 1.96
MIXTURE = 5.138 / 3.841

#: Relative distance to a bound below which a parameter counts as being on it.
AT_BOUND = 1e-4


def without_vanishing(model: Model, found: Minimum) -> Minimum:
    """Set lags and delays to zero where this does not change the cost beyond rounding.

    To first order a small lag acts like a delay. Next to zero the two cannot be distinguished, and
    the search stops anywhere along that line. The same holds for a delay next to zero.
    """
    kept = np.eye(found.point.size)
    held: list[int] = []
    rounding = found.misfit.size * (1e-12 * model.size) ** 2
    for name in ("lag", "delay"):
        if name not in model.names:
            continue
        place = model.names.index(name)
        start = found.point.copy()
        start[place] = 0.0
        if name == "lag" and "delay" in model.names:
            start[model.names.index("delay")] += found.point[place]
        at_end = found.point[place] <= model.low[place] * (1.0 + 1e-6)
        if (
            not at_end
            and float(np.sum(model.misfit(start) ** 2)) > WORTH_TRYING * found.cost + rounding
        ):
            continue
        free = np.delete(kept, [*held, place], axis=1)
        space = Directions(np.zeros(start.size), free)
        moved = minimise(model, np.clip(start, model.low, model.high), space)
        if at_end or moved.cost <= found.cost * (1.0 + VANISHING) + rounding:
            found, held = moved, [*held, place]
    return found


def concluded(
    method: str,
    model: Model,
    found: Minimum,
    fitted: Sequence[Run],
    *,
    message: str,
    details: Mapping[str, Any],
) -> DelayEstimate:
    """Make the estimate of a minimum.

    Parameters
    ----------
    method : str
    model : Model
    found : Minimum
    fitted : sequence of Run
        The recordings, in the order of the model.
    message : str
        Description of the fit.
    details : mapping
        Further results of the method.
    """
    names, labels = model.names, model.labels
    count = len(names)
    values = dict(zip(names, found.point.tolist(), strict=False))
    held = [name for name in ("lag", "delay") if values.get(name) == 0.0]
    # A further fitted parameter at its bound is held there too.
    close = AT_BOUND * (model.high - model.low)
    at_bound = (found.point - model.low <= close) | (model.high - found.point <= close)
    along = np.arange(len(labels)) >= count
    fixed = np.isfinite(close) & at_bound & along
    loose = [i for i, label in enumerate(labels) if label not in held and not fixed[i]]
    jacobian, residuals = found.jacobian, -found.misfit
    check_distinguishable(jacobian[:, loose], [labels[i] for i in loose])
    whiteness = check_fit(model, found, fitted)
    exact = is_exact(model, found, fitted)
    pieces = np.split(residuals, np.cumsum(model.sizes)[:-1])
    white = embedded(white_covariance(jacobian[:, loose], residuals), loose, len(labels))
    spread = white
    if not (whiteness.white or exact):
        robust = robust_covariance(jacobian[:, loose], residuals, model.sizes)
        spread = embedded(robust, loose, len(labels))
    errors, plain = standard_errors(names, spread), standard_errors(names, white)
    freedom = residuals.size - len(loose)
    reason = _why_profile(values, residuals.size, count)
    reliable = whiteness.white or exact
    runs = tuple(
        FittedRun(part.recording, _with(part.loop, values), piece / weight)
        for part, piece, weight in zip(fitted, pieces, model.weights, strict=True)
    )
    return DelayEstimate(
        method=method,
        loop=runs[0].loop,
        free=names,
        stderr=errors,
        cov=spread[:count, :count],
        crb=CramerRaoBound(labels, FlightNoise(math.sqrt(found.cost / freedom)), plain),
        recording=runs[0].recording,
        residuals=runs[0].residuals,
        whiteness=whiteness,
        verdict=verdict_if(reliable),
        message=_message(message, held, reason, reliable, advice(names, runs[0].loop)),
        details={**details, **{name: values[name] for name in ("start",) if name in values}},
        others=runs[1:],
        _profile=Profile(
            cost=ProfileCost(model, found, runs[0].loop.parameters),
            best=found.cost,
            freedom=freedom,
            widening=_widening(values, errors, plain),
            preferred=reason,
        ),
    )


def check_fit(model: Model, found: Minimum, fitted: Sequence[Run]) -> Whiteness:
    """Refuse outputs that are hardly better explained than by a constant; test the residuals."""
    count = len(model.names)
    whiteness = whiteness_of(-found.misfit, count, model.sizes)
    pieces = np.split(found.misfit, np.cumsum(model.sizes)[:-1])
    for part, piece, weight in zip(fitted, pieces, model.weights, strict=True):
        check_response(part.recording.output, piece / weight, count, whiteness.autocorrelation)
    return whiteness


def is_exact(model: Model, found: Minimum, fitted: Sequence[Run]) -> bool:
    """Whether all that is left is rounding."""
    pieces = np.split(found.misfit, np.cumsum(model.sizes)[:-1])
    return all(
        float(np.max(np.abs(piece))) <= ROUNDING * weight * float(np.ptp(part.recording.output))
        for piece, part, weight in zip(pieces, fitted, model.weights, strict=True)
    )


def _with(loop: ControlLoop, values: Mapping[str, float]) -> ControlLoop:
    return loop.replace(**{name: value for name, value in values.items() if name != "start"})


def _why_profile(values: Mapping[str, float], samples: int, numbers: int) -> str:
    for slow in ("lag", "time_constant"):
        if slow in values:
            if values[slow] == 0.0:
                return f"the {slow} came out at zero, its bound"
            return f"delay and {slow.replace('_', ' ')} have similar effects"
    if values.get("delay") == 0.0:
        return "the delay came out at zero, its bound"
    if samples < FEW * (numbers + 1):
        return f"{samples} samples are few"
    return ""


def _widening(
    values: Mapping[str, float], errors: Mapping[str, float], plain: Mapping[str, float]
) -> dict[str, float]:
    """Ratio of robust to plain standard errors; larger for the delay where the lag may be zero."""
    found = {name: errors[name] / error if error > 0.0 else 1.0 for name, error in plain.items()}
    lag = values.get("lag")
    if lag is not None and "delay" in found and lag <= NEAR_BOUND * plain["lag"]:
        found["delay"] *= math.sqrt(MIXTURE)
    return found


def advice(names: Sequence[str], loop: ControlLoop) -> str:
    """Advice for an estimate that is an indication."""
    slow = [name for name in ("lag", "time_constant") if name in loop.parameters]
    if slow and slow[0] not in names:
        return f"{ADVICE}free=('delay', 'gain', '{slow[0]}'))"
    return f"{ADVICE}a window around one step, a smaller step, or another plant)"


def _message(done: str, held: list[str], reason: str, reliable: bool, advice: str) -> str:
    text = done
    if held:
        text += (
            f"; the {' and '.join(held)} came out at zero, its bound, so its standard error "
            "is not meaningful"
        )
    if reason:
        text += f"; {reason}, so intervals are those of the profile likelihood"
    if not reliable:
        text += (
            f"{COLOURED}, so the model only approximates the vehicle and "
            f"the intervals are robust ones{advice}"
        )
    return text


def is_rounding(residuals: Array, recording: Recording) -> bool:
    """Whether the model explains the recording to rounding."""
    return float(np.max(np.abs(residuals))) <= ROUNDING * float(np.ptp(recording.output))


def check_delay_alone(method: str, free: Sequence[str]) -> None:
    """Refuse `free` without the delay; its other names are taken as given."""
    if "delay" not in free:
        raise ValueError(
            f"the {method} method determines the delay alone, and free={tuple(free)!r} does not "
            "ask for it"
        )


def read_off_estimate(
    method: str,
    simulated: SimulatedRecording,
    values: Mapping[str, float],
    cov: Array | None,
    start: float,
    *,
    message: str,
    uncalibrated: str,
    details: Mapping[str, Any],
) -> DelayEstimate:
    """The result for these `values`, with the loop at rest at the output `start`.

    Without a covariance the standard errors are NaN.
    """
    try:
        residuals = simulated.residuals(values, start)
    except ValueError as error:
        found = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        raise NotIdentifiableError(
            f"the {method} method reads {found}, and a loop with these values cannot have been "
            f"recorded ({error}): check gains, signs and units"
        ) from None
    return estimate_with_residuals(
        method,
        simulated.loop,
        simulated.recording,
        values,
        cov,
        residuals,
        message=message,
        uncalibrated=uncalibrated,
        details=details,
    )


def estimate_with_residuals(
    method: str,
    loop: ControlLoop,
    recording: Recording,
    values: Mapping[str, float],
    cov: Array | None,
    residuals: Array,
    *,
    message: str,
    uncalibrated: str,
    details: Mapping[str, Any],
    crb: CramerRaoBound | None = None,
    verdict: Verdict | None = None,
    profile: Profile | None = None,
) -> DelayEstimate:
    """The result for these `values` of a method that has its own residuals.

    By default it is reliable where they are white or rounding.
    """
    names = tuple(values)
    if cov is None:
        cov = np.full((len(names), len(names)), np.nan)
    whiteness = whiteness_of(residuals, len(names))
    if verdict is None:
        verdict = verdict_if(whiteness.white or is_rounding(residuals, recording))
    return DelayEstimate(
        method=method,
        loop=loop.replace(**values),
        free=names,
        stderr=standard_errors(names, cov),
        cov=cov,
        crb=crb,
        recording=recording,
        residuals=residuals,
        whiteness=whiteness,
        verdict=verdict,
        message=message,
        uncalibrated=uncalibrated,
        details=details,
        _profile=profile,
    )
