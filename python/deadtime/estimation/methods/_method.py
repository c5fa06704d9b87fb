"""What every estimation method is, what it is given, and how it gives an estimate.

A method is a frozen object that holds its options. It gives an estimate from a minimum of least
squares, or from what it has read from a response.

White residuals: covariance sigma^2 (J^T J)^-1, which is the Cramér-Rao bound. Coloured residuals:
the robust covariance, because the model is only an approximation of the vehicle. Where a lag is
fitted (the cost is then far from quadratic, and the lag may be at its bound) and where samples are
few, intervals are those of the profile likelihood.

The residuals of methods that read the delay from a few features of the response are those of the
loop with the estimated parameters, so they show how well it explains the whole recording.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

import deadtime.estimation._least_squares as least_squares
import deadtime.estimation._result as result
import deadtime.estimation.data._checks as checks
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import OpenRange, finite, open_interval
from deadtime._base.verdicts import Verdict, verdict_if
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.experiments import FlightNoise
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording, RecordingCheck

#: One recording, or several of the same vehicle.
Recordings: TypeAlias = Recording | Sequence[Recording]

#: One loop for all recordings, or one for each.
Loops: TypeAlias = ControlLoop | Sequence[ControlLoop]

#: The part to use: one window for all recordings, or a list of them, one for each.
Windows: TypeAlias = OpenRange | list[OpenRange | None] | None


class Run(NamedTuple):
    """One recording, the loop that made it, the part to use, and what was found there.

    `corrected` says in words what of it has been put right.
    """

    recording: Recording
    loop: ControlLoop
    window: OpenRange = (None, None)
    check: RecordingCheck | None = None
    corrected: tuple[str, ...] = ()

    @property
    def simulated(self) -> SimulatedRecording:
        """Simulations of the loop over the window."""
        return SimulatedRecording(self.recording, self.loop, self.window)


def paired_runs(recording: Recordings, loop: Loops, window: Windows = None) -> list[Run]:
    """Pair recordings with loops and windows; a single loop or window applies to all."""
    recordings = checks.given_recordings(recording)
    loops = checks.one_each("loop", loop, len(recordings))
    windows = checks.one_each("window", window, len(recordings))
    runs = []
    for index, (record, its_loop, ends) in enumerate(zip(recordings, loops, windows, strict=True)):
        if not isinstance(record, Recording):
            raise TypeError(f"recording[{index}] must be a Recording, not {type(record).__name__}")
        if not isinstance(its_loop, ControlLoop):
            raise TypeError(f"loop[{index}] must be a ControlLoop, not {type(its_loop).__name__}")
        open_interval("window", ends)
        low, high = (None, None) if ends is None else ends
        runs.append(Run(record.complete(), its_loop, (low, high)))
    plants = {type(run.loop.plant).__name__ for run in runs}
    if len(plants) > 1:
        raise ValueError(
            f"the loops have different plants ({', '.join(sorted(plants))}), "
            "but recordings that are fitted together must come from one vehicle"
        )
    return runs


@dataclass(frozen=True)
class Method(ABC):
    """A method of estimation with its options, for the `method` of `estimate_delay`.

    Attributes
    ----------
    name : str
        Short form of the object with its default options: ``method="waveform"`` means
        ``method=Waveform()``.
    joint : bool
        Whether it fits several recordings together.
    limits : str
        What biases it, in a sentence; empty for methods of maximum likelihood and least squares.
    """

    name: ClassVar[str]
    joint: ClassVar[bool] = False
    limits: ClassVar[str] = ""

    @abstractmethod
    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the runs; to exactly one unless the method is `joint`."""


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse an option that is not one of its choices."""
    if value not in choices:
        raise ValueError(f"{name}={value!r} is not one of {', '.join(map(repr, choices))}")


def check_initial_output(value: float | None) -> None:
    """Refuse a known output at the start that is no finite number."""
    if value is not None:
        finite("initial_output", value)


#: Samples for each fitted parameter below which intervals are those of the profile likelihood.
FEW = 12

#: What a message says of residuals that are not white.
COLOURED = f"{result.REASONS}the residuals are not white"

#: A lag within so many standard errors of zero may be zero. The statistic of the delay is then no
#: chi-square of one degree of freedom, but at most an even mixture of those with one and two (Self
#: & Liang 1987), whose 95 % quantile is larger by this factor.
NEAR_BOUND = 1.96
MIXTURE = 5.138 / 3.841

#: Relative distance to a bound below which a parameter counts as being on it.
AT_BOUND = 1e-4


def concluded(
    method: str,
    model: least_squares.Model,
    found: least_squares.Minimum,
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
    fixed = np.isfinite(close) & at_bound & (np.arange(len(labels)) >= count)
    loose = [i for i, label in enumerate(labels) if label not in held and not fixed[i]]
    residuals = -found.misfit
    white, robust = spreads_of(found, labels, loose, model.sizes)
    whiteness = check_fit(model, found, fitted)
    reliable = whiteness.white or is_exact(model, found, fitted)
    spread = white if reliable else robust
    errors, plain = checks.standard_errors(names, spread), checks.standard_errors(names, white)
    freedom = residuals.size - len(loose)
    reason = _why_profile(values, residuals.size, count)
    of_loop = {name: value for name, value in values.items() if name != "start"}
    runs = tuple(
        result.FittedRun(part.recording, part.loop.replace(**of_loop), -misfit)
        for part, misfit in zip(fitted, _misfits(model, found), strict=True)
    )
    return DelayEstimate(
        **result.of_runs(runs),
        method=method,
        free=names,
        stderr=errors,
        cov=spread[:count, :count],
        crb=result.CramerRaoBound(labels, FlightNoise(math.sqrt(found.cost / freedom)), plain),
        whiteness=whiteness,
        verdict=verdict_if(reliable),
        message=_message(message, held, reason, reliable, advice(names, runs[0].loop)),
        details={**details, **{name: values[name] for name in ("start",) if name in values}},
        _profile=least_squares.Profile(
            cost=partial(least_squares.least_cost, model, found, runs[0].loop.parameters),
            best=found.cost,
            freedom=freedom,
            widening=_widening(values, errors, plain),
            preferred=reason,
        ),
    )


def spreads_of(
    found: least_squares.Minimum, labels: Sequence[str], loose: list[int], sizes: Sequence[int]
) -> tuple[Array, Array]:
    """Covariances at a minimum, for white residuals and for those with memory.

    Zero for parameters that are not `loose`; refuses those that the recording does not distinguish.
    """
    checks.check_distinguishable(found.jacobian[:, loose], [labels[i] for i in loose])
    white, robust = found.spreads(loose, sizes)
    return white, robust


def check_fit(
    model: least_squares.Model, found: least_squares.Minimum, fitted: Sequence[Run]
) -> least_squares.Whiteness:
    """Refuse outputs that are hardly better explained than by a constant; test the residuals."""
    count = len(model.names)
    whiteness = least_squares.whiteness_of(-found.misfit, count, model.sizes)
    for part, misfit in zip(fitted, _misfits(model, found), strict=True):
        checks.check_response(part.recording.output, misfit, count, whiteness.autocorrelation)
    return whiteness


def is_exact(
    model: least_squares.Model, found: least_squares.Minimum, fitted: Sequence[Run]
) -> bool:
    """Whether all that is left is rounding."""
    pairs = zip(fitted, _misfits(model, found), strict=True)
    return all(is_rounding(misfit, part.recording) for part, misfit in pairs)


def _misfits(model: least_squares.Model, found: least_squares.Minimum) -> list[Array]:
    """The misfit of each recording, without weights."""
    pieces = least_squares.pieces_of(found.misfit, model.sizes)
    return [piece / weight for piece, weight in zip(pieces, model.weights, strict=True)]


def _why_profile(values: Mapping[str, float], samples: int, numbers: int) -> str:
    for slow in ("lag", "time_constant"):
        if slow in values:
            if values[slow] == 0.0:
                return f"the {slow} was estimated as zero, which is its bound"
            return f"delay and {slow.replace('_', ' ')} have similar effects"
    if values.get("delay") == 0.0:
        return "the delay was estimated as zero, which is its bound"
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
        return f"{result.ADVICE}free=('delay', 'gain', '{slow[0]}'))"
    return f"{result.ADVICE}a window around one step, a smaller step, or another plant)"


def _message(done: str, held: list[str], reason: str, reliable: bool, advice: str) -> str:
    text = done
    if held:
        text += (
            f". The {' and '.join(held)} was estimated as zero, which "
            "is its bound, so its standard error is not meaningful"
        )
    if reason:
        text += f". Because {reason}, intervals are those of the profile likelihood"
    if not reliable:
        text += (
            f"{COLOURED}, so the model only approximates the vehicle, "
            f"and the intervals use robust standard errors{advice}"
        )
    return text


def is_rounding(residuals: Array, recording: Recording) -> bool:
    """Whether the model explains the recording to rounding."""
    return float(np.max(np.abs(residuals))) <= checks.ROUNDING * float(np.ptp(recording.output))


class Read(NamedTuple):
    """What a method reads from one recording: numbers, and what is said of them.

    Attributes
    ----------
    values : dict of str to float
    cov : ndarray or float or None
        Covariance, or the standard error of one number; None where there is none.
    start : float
        The output at which the loop was at rest.
    message, uncalibrated : str
        How it was read, and why it claims no interval.
    details : dict
    recording : Recording, optional
        The part that was used, with its `residuals`; of the simulated loop where there are none.
    verdict : str, optional
        Reliable where the residuals are white or rounding, if not given.
    """

    values: Mapping[str, float]
    cov: Array | float | None
    start: float
    message: str
    uncalibrated: str
    details: Mapping[str, Any]
    recording: Recording | None = None
    residuals: Array | None = None
    crb: result.CramerRaoBound | None = None
    verdict: Verdict | None = None
    profile: least_squares.Profile | None = None


class OfOne(Method):
    """A method for one recording, which reads the delay alone if it does not say otherwise."""

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """The numbers that are asked for; the others are taken as given."""
        if "delay" not in free:
            raise ValueError(
                f"the {self.name} method estimates only the delay, but "
                f"free={tuple(free)!r} does not contain the delay: add 'delay'"
            )
        return ("delay",)

    @abstractmethod
    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from one recording."""

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Read `free` from the one recording."""
        (run,) = runs
        found = self.read(run, self.names(free, run.loop))
        recording, residuals = found.recording, found.residuals
        if recording is None or residuals is None:
            recording, residuals = self._simulated(run, found)
        names = tuple(found.values)
        cov = np.nan if found.cov is None else found.cov
        if not isinstance(cov, np.ndarray):
            cov = np.full((len(names), len(names)), cov**2)
        whiteness = least_squares.whiteness_of(residuals, len(names))
        passes = whiteness.white or is_rounding(residuals, recording)
        return DelayEstimate(
            method=self.name,
            loop=run.loop.replace(**found.values),
            free=names,
            stderr=checks.standard_errors(names, cov),
            cov=cov,
            crb=found.crb,
            recording=recording,
            residuals=residuals,
            whiteness=whiteness,
            verdict=found.verdict or verdict_if(passes),
            message=found.message,
            uncalibrated=found.uncalibrated,
            details=found.details,
            _profile=found.profile,
        )

    def _simulated(self, run: Run, found: Read) -> tuple[Recording, Array]:
        """The window and its residuals: how well the loop with the numbers read explains it."""
        simulated = run.simulated
        try:
            return simulated.recording, simulated.residuals(found.values, found.start)
        except ValueError as error:
            values = ", ".join(f"{name} {value:.4g}" for name, value in found.values.items())
            raise NotIdentifiableError(
                f"the {self.name} method reads {values}, but a loop with these values could "
                f"not have made this recording ({error}): check gains, signs and units"
            ) from None
