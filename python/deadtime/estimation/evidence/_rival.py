"""Whether another plant explains a recording clearly better than the one that was named.

The family of plants is fitted to the rows of an estimate. A plant of it is a rival if

1. it leads the kind of the named plant, fitted in the same way, by more than `CLEAR` in BIC;
2. it leads in the likelihood of the method of the estimate too, which has air that moves the plant;
3. where it crosses over, gain or equivalent delay of the named plant lie outside the hull of the
   family: the intervals do not meet. Of an estimate that is an indication anyhow this is not asked.

The family has no such air. In wind a plant with further numbers follows it there, and is none here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.digits import between
from deadtime._base.errors import DeadtimeError
from deadtime._base.validation import OpenRange
from deadtime._base.verdicts import rough
from deadtime.estimation._result import DelayEstimate, bic
from deadtime.estimation.data._simulated import moves_between_rows
from deadtime.estimation.evidence._estimate import call_with
from deadtime.estimation.evidence._find import is_outside
from deadtime.estimation.evidence._found import CLEAR, PlantCandidate, candidate_of
from deadtime.estimation.evidence._question import PLANTS, Question, question_of
from deadtime.estimation.methods._method import Method, Run
from deadtime.estimation.methods._output_error import OutputError
from deadtime.loops import PAIR, FactoredPlant, FirstOrder, Integrator, P, Plant
from deadtime.recordings import Recording

#: Most rows that plants are compared on; of more, as many in which the command changes most. More:
#: a rival that shows nowhere else is found, and each estimate takes longer.
MOST_ROWS = 10_000


def beside_rivals(fit: DelayEstimate, run: Run, method: Method) -> DelayEstimate:
    """The estimate by a method, or an indication that names a plant which is clearly better."""
    kind, question = kind_of(fit.loop.plant, fit.free), _question(run)
    if kind is None or question is None:
        return fit
    if not _may_have_rivals(fit, question):
        return fit
    # The commands as they are in the estimate. Under white noise alone leads are larger.
    straight = moves_between_rows(run.recording, run.loop)
    asked = replace(question, between="straight" if straight else "held")
    quick = _answer(asked, "white")
    if quick is None or not _lead(quick, kind) > CLEAR:
        return fit
    found = _answer(asked)
    if found is None or not (lead := _lead(found, kind)) > CLEAR:
        return fit
    if fit.verdict == "reliable" and not is_outside(found, partial(_ends, fit)):
        return fit
    best = found.candidates[0]
    rival = candidate_of(best, best.bic)
    lead = min(lead, _lead_in_air(fit, rival, run, method))
    if lead > CLEAR and (named := _answer(replace(asked, plant=kind))) is not None:
        lead = min(lead, _bic_of(named, kind) - best.bic)
    if not lead > CLEAR:
        return fit
    ends = between(*found.hull["delay"], math.nan, "s")
    why = (
        f"{rival.in_words()}, explains the recording clearly better, by {lead:.3g} "
        f"in BIC, with a dead time of {rough(rival.delay, 's')} ({ends})"
    )
    plant = fit.loop.plant
    if best.plant == kind_of(plant, list(plant.parameters)):
        free = ("delay", *(name for name in plant.parameters if name in ("lag", *best.names)))
        return fit.doubted(why, f"free={free!r}")
    given = {name: value for name, value in question.options().items() if value != (None, None)}
    return fit.doubted(why, f"the call without the plant, {call_with(given)}")


def kind_of(plant: Plant, free: Sequence[str]) -> str | None:
    """The least kind of the family that has the numbers of a plant; None where none has them."""
    if isinstance(plant, FirstOrder):
        return "lag"
    if isinstance(plant, Integrator):
        return "integrator, lag" if plant.lag or "lag" in free else "integrator"
    if not isinstance(plant, FactoredPlant):
        return None
    zero = bool(plant.zero) or "zero" in free
    for order in range(len(plant.lags) + 2 * plant.has_pair, 3):
        parts = ["integrator"] * plant.integrator + [("", "lag", "two lags")[order], "zero" * zero]
        name = ", ".join(part for part in parts if part) or "delay"
        if name in PLANTS:
            return name
    return None


def _may_have_rivals(fit: DelayEstimate, question: Question) -> bool:
    """Whether the command behind lags and delays explains what a fit leaves, beyond chance.

    What least squares leaves of a plant that lacks something has no noise to compare with.
    """
    plant, noise = fit.loop.plant, None
    if isinstance(fit._profile, native.FlightProfile):
        noise = fit._profile.fit.numbers.noise[0]
    elif fit.verdict == "indication":
        return True
    rows, time = question.recording.time, fit.recording.time
    known = np.isfinite(fit.residuals)
    known &= (time >= rows[question.earlier]) & (time <= rows[-1])
    return native.follows_command(
        (rows, question.command - question.command[0]),
        (time[known], fit.residuals[known], fit.recording.sample_time),
        (fit.delay, fit.lag or 0.0),
        plant._polynomials({**plant.parameters, "gain": 1.0}),
        noise,
        CLEAR,
    )


def _question(run: Run) -> Question | None:
    """What is asked of the family; None where the command of each row is not known."""
    loop = run.loop
    computed = run.recording.command is None
    if run.recording.sent is not None or not loop.plant.is_linear:
        return None
    if computed and not isinstance(loop.controller, P):
        return None
    controller, limit = (loop.controller, loop.limit) if computed else (None, None)
    recording, window = _most_excited(run)
    try:
        return question_of(recording, window, controller, {"limit": limit, "causes": False})
    except DeadtimeError:
        return None


def _most_excited(run: Run) -> tuple[Recording, OpenRange]:
    """The window, or the `MOST_ROWS` of it in which the command, or the reference, changes most.

    As many rows before it are kept: their commands act in it.
    """
    rows = run.recording.rows(*run.window)
    if rows.stop - rows.start <= MOST_ROWS:
        return run.recording, run.window
    command = run.recording.command
    moving = run.recording.reference if command is None else command
    first = rows.start + native.most_moved(moving[rows], MOST_ROWS)
    time = run.recording.time
    window = float(time[first]), float(time[first + MOST_ROWS - 1])
    return run.recording.window(float(time[max(0, first - MOST_ROWS)]), window[1]), window


def _answer(question: Question, noise: str | None = None) -> native.FamilyFit | None:
    """The family on these rows; None where they are too few, or determine no plant."""
    try:
        found = question.answer(noise=noise)
    except ValueError:
        return None
    return found if found.verdict != "none" and found.candidates else None


def _lead(found: native.FamilyFit, kind: str) -> float:
    """By how much the best plant leads those of a kind in BIC."""
    return _bic_of(found, kind) - found.candidates[0].bic


def _bic_of(found: native.FamilyFit, kind: str) -> float:
    """BIC of the best plant of a kind; infinite where it could not be fitted."""
    return min((fit.bic for fit in found.candidates if fit.plant == kind), default=math.inf)


def _ends(fit: DelayEstimate, omega: float) -> list[tuple[float, float]]:
    """Ends of gain and angle at a frequency; the values where there are none."""
    view = fit.at(omega)
    pairs = (view.gain, view.gain_ci), (view.phase, view.phase_ci)
    every = (ends[:, 0] if np.all(np.isfinite(ends)) else own[[0, 0]] for own, ends in pairs)
    return [(float(low), float(high)) for low, high in every]


def _lead_in_air(fit: DelayEstimate, rival: PlantCandidate, run: Run, method: Method) -> float:
    """Lead of the rival in the criterion of the method of the estimate; none without a fit."""
    # A search for a pair of poles takes seconds: its numbers are held, and counted.
    absent = {*PAIR, *(() if rival.parameters.get("zero") else ("zero",))}
    free = [name for name in rival.plant.parameters if name not in absent]
    held = [name for name in PAIR if name in rival.parameters]
    loop = run.loop.replace(plant=rival.plant, delay=rival.delay)
    if isinstance(method, OutputError):
        method = replace(method, intervals="sum")
    try:
        other = method.estimate([run._replace(loop=loop)], ("delay", *free))
    except (DeadtimeError, ValueError):
        return -math.inf
    return bic(fit) - bic(other) - len(held) * math.log(other.residuals.size)
