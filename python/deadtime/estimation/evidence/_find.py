"""Ask for the plant of a recording, and put the answer into words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias, cast

import numpy as np

import deadtime.estimation._native as native
import deadtime.estimation.evidence._estimate as evidence
from deadtime._base.validation import OpenRange
from deadtime._base.verdicts import Verdict
from deadtime.estimation.evidence._estimate import TAKEN_AT_REST, PlantEstimate
from deadtime.estimation.evidence._found import CLEAR, candidate_of, causes_of, sensor_faults_of
from deadtime.estimation.evidence._numbers import FittedRecording
from deadtime.estimation.evidence._question import Question, questions_of
from deadtime.recordings import Recording

#: Lower and upper end of an interval.
Ends: TypeAlias = tuple[float, float]


def estimate_by_evidence(
    recording: Recording | Sequence[Recording],
    window: OpenRange | Sequence[OpenRange | None] | None,
    known: Mapping[str, Any],
    progress: Callable[[int], object] | None,
) -> PlantEstimate:
    """The plant that recordings show; what is not `known` by its name is taken from them."""
    question = questions_of(recording, window, known)
    found = question.answer(progress=progress)
    first = estimate_of(question, found)
    moves_at_all = any(np.ptp(part.command) > 0.0 for part in question.each)
    if first.at_rest or evidence.moves_in(first) or not moves_at_all:
        return _beside_all(first, found)
    if question.at_rest is False:
        return replace(first, verdict="none", reason=evidence.TOO_EARLY)
    question = replace(question, at_rest=True)
    found = question.answer()
    return _taken_at_rest(_beside_all(estimate_of(question, found), found))


def _beside_all(fit: PlantEstimate, found: native.FamilyFit) -> PlantEstimate:
    """An estimate with a plant that was named, beside all other plants."""
    question = fit._question
    if question.plant is None:
        return fit
    whole = replace(question, plant=None).answer()
    best, least = whole.candidates[0], found.candidates[0].bic
    if not least - best.bic > CLEAR:
        return fit
    better = candidate_of(best, least)
    named = replace(fit, better=better)
    # A cause may imitate the lag that the plant lacks.
    is_open = bool(fit.causes) or is_outside(whole, partial(_ends, found))
    if named.verdict != "reliable" or not is_open:
        return named
    reason = f"{better.in_words()}, explains the recording clearly better"
    return replace(named, verdict="indication", reason=reason)


def _taken_at_rest(fit: PlantEstimate) -> PlantEstimate:
    """An estimate from all rows, where nothing shows that the plant was at rest at the first."""
    if fit.verdict == "none":
        return fit
    reason = "; ".join(filter(None, [fit.reason, TAKEN_AT_REST]))
    return replace(fit, verdict="indication", reason=reason, _code=fit._code or TAKEN_AT_REST)


def refit(
    fit: PlantEstimate, recordings: Sequence[Recording], *, likeliest: bool = False
) -> PlantEstimate:
    """The plants that an estimate leaves, fitted to these recordings in place of its own.

    They are looked for beside the numbers of the estimate alone, so that many rows take little
    time; with `likeliest` only its likeliest kind of plant is.

    Raises
    ------
    RecordingError, ValueError
        When a recording has too few rows.
    """
    first, *others = (
        replace(fit._question, recording=recording, earlier=0, window=None, shift=0, others=())
        for recording in recordings
    )
    plant = fit.best.name if likeliest else first.plant
    question = replace(first, others=tuple(others), plant=plant)
    return estimate_of(question, question.answer(known=fit._answer()))


def is_outside(whole: native.FamilyFit, own: Callable[[float], Iterable[Ends]]) -> bool:
    """Whether gain or angle of another fit lie outside the hull of the family.

    They are compared where the likeliest plant crosses over, or at the highest frequency of the
    command; `own` has their ends there.
    """
    omega = whole.crossover
    if not math.isfinite(omega):
        omega = max(whole.excited, default=math.nan)
    if not omega > 0.0:
        return False
    pairs = zip(own(omega), _ends(whole, omega), strict=True)
    return any(low > top or high < bottom for (low, high), (bottom, top) in pairs)


def _ends(found: native.FamilyFit, omega: float) -> list[Ends]:
    """Ends of gain and angle at a frequency."""
    view = found.at([omega])
    return [(float(view[name][1][0]), float(view[name][2][0])) for name in ("gain", "phase")]


def estimate_of(question: Question, found: native.FamilyFit) -> PlantEstimate:
    """The answer of the kernel as a result."""
    answering = [fit for fit in found.candidates if fit.values[fit.names.index("gain")] != 0.0]
    candidates = tuple(candidate_of(fit, answering[0].bic) for fit in answering)
    first = answering[0] if answering else None
    runs = [_run(part, first, place) for place, part in enumerate(question.each)]
    numbers: dict[str, Any] = {"delay": math.nan, "plant": None, "parameters": {}}
    if candidates:
        numbers = {name: getattr(candidates[0], name) for name in numbers}
    steps = [native.coarse_step(run.recording.output, run.noise_std) for run in runs]
    step = next(filter(None, steps), 0.0)
    is_one_step = not question.others and np.count_nonzero(np.diff(question.command)) == 1
    verdict = "indication" if step and found.verdict == "reliable" else found.verdict
    return PlantEstimate(
        verdict=cast(Verdict, verdict),
        reason=evidence.reason_of(found.reason, found, is_one_step, step),
        **numbers,
        **found.shown,
        candidates=candidates,
        shift=found.shift + question.shift,
        recording=question.recording,
        fitted=runs[0].fitted,
        residuals=runs[0].residuals,
        others=tuple(runs[1:]),
        causes=causes_of(found),
        sensor_faults=sensor_faults_of(found),
        _own_noise=runs[0].noise_std,
        _code=found.reason,
        _question=question,
        _native=[found],
    )


def _run(question: Question, first: native.FamilyCandidate | None, place: int) -> FittedRecording:
    """One of the recordings with what the likeliest plant explains of it."""
    if first is None:
        unknown = np.full(len(question.recording), math.nan)
        return FittedRecording(question.recording, unknown, unknown.copy(), math.nan)
    fitted, residuals = np.array(first.fitted[place]), np.array(first.residuals[place])
    return FittedRecording(question.recording, fitted, residuals, first.noise_stds[place])
