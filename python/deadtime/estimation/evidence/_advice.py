"""Why an estimate is not reliable, and what to do next, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import OpenRange
from deadtime.estimation.evidence._numbers import FoundPlant
from deadtime.estimation.evidence._question import Question
from deadtime.loops import Controller
from deadtime.recordings import MINIMUM_SAMPLES

#: Parts of a window that are tried where a disturbance spoils the whole, as shares of it. More or
#: finer parts: more of a good stretch is used, and the advice takes longer.
PARTS = ((0.0, 0.75), (0.25, 1.0), (0.0, 0.5), (0.5, 1.0))


@dataclass(frozen=True, eq=False)
class Advice(ReadOnlyArrays):
    """What to do next.

    Attributes
    ----------
    words : str
        A sentence.
    options : dict of str to object
        What to give `estimate_delay` besides what was given, if it is to be asked again; None for
        what to leave out.
    given : dict of str to object
        What was given.
    controller : str
        Kind of controller to design, ``"P"`` or ``"PI"``; empty where none can be.
    draw : bool
        Whether to look at the residuals.
    asked : str
        The variable of the recording, ``"recordings"`` for several.
    """

    words: str
    options: dict[str, Any] = field(default_factory=dict)
    given: dict[str, Any] = field(default_factory=dict)
    controller: str = ""
    draw: bool = False
    asked: str = "recording"

    @property
    def statement(self) -> str:
        """The line of Python that does it; empty where another recording is needed."""
        if self.options:
            named = {**self.given, **self.options}
            asked = "".join(
                f", {name}={_python(value)}" for name, value in named.items() if value is not None
            )
            return f"dtm.estimate_delay({self.asked}{asked})"
        if self.controller:
            kind, gains = f"dtm.{self.controller}", ", ".join(["1.0"] * len(self.controller))
            return f"dtm.design(fit.loop({kind}({gains})), controller={kind}, delay=fit.ci())"
        return "fit.plot()" if self.draw else ""


def _python(value: Any) -> str:
    """A value as Python writes it where the package is `dtm`."""
    if isinstance(value, list):
        return f"[{', '.join(map(_python, value))}]"
    return f"dtm.{value!r}" if isinstance(value, Controller) else repr(value)


#: Why an estimate is none, or no more than an indication, where the command moves at the beginning.
TOO_EARLY = "the command moves only before the rows that are fitted"
TAKEN_AT_REST = "the plant is assumed at rest at the first row, which the recording does not show"

#: The kernel's reason where residuals are no noise of a sensor.
NOT_WHITE = "residuals not white"

#: Reasons that are those of one step, if the command is one.
FEW_NUMBERS = ("too few told", "classes contradict", "crossover not told")


def reason_of(code: str, found: native.FamilyFit, is_one_step: bool, step: float) -> str:
    """Why an estimate is not reliable; `step` is that of a coarse sensor, or zero."""
    size, determined, asked = found.reason_size, found.told, found.asked
    if step and code in ("", NOT_WHITE, "no response"):
        return (
            f"the sensor reads in steps of {step:.4g}, too coarse for the "
            "range of the output, so the residuals are mostly rounding errors"
        )
    if is_one_step and code in FEW_NUMBERS:
        return (
            "one step cannot distinguish two lags from a dead time and a "
            "lag, but the largest stable gain depends on this difference"
        )
    sentences: Mapping[str, str] = {
        "": "",
        "too few told": "the command changes too little, so the recording determines "
        f"only {determined} of the {asked} parameters of the plant"
        if determined < asked
        else "the command is a single sine, which determines gain and phase only at its frequency",
        "classes contradict": "plants of different kinds explain the recording equally well, "
        "but have different crossover frequencies",
        NOT_WHITE: "the residuals are larger than sensor noise, so there "
        "is a disturbance, or the plant is of another kind",
        "command shifted": "the recording fits better if the command is shifted by a "
        f"row (by {size:.3g} in 2 ln L), so the command was shifted",
        "delay at its limit": f"the dead time, {size:.4g} s, is the largest that was tried",
        "lag at its limit": f"a time constant, {size:.4g} s, is the largest "
        "that was tried, far longer than the recording",
        "zero at its limit": f"the zero, {size:.4g} s, is the largest that was tried",
        "crossover not told": "the largest stable gain is uncertain by more than a factor of 2",
        "no response": "the output does not respond to the command",
    }
    return sentences.get(code, code)


def advice_on(fit: FoundPlant) -> Advice:
    """What to do next, by why the estimate is not reliable."""
    advice = _advice_on(fit, fit._question.options())
    return replace(advice, asked="recordings") if fit.others else advice


def _advice_on(fit: FoundPlant, given: dict[str, Any]) -> Advice:
    if fit.verdict == "reliable":
        if fit.best.name == "delay":
            return Advice("nothing, because the output is the delayed command")
        kind = "P" if fit.best.integrates else "PI"
        return Advice(
            f"design a {kind} controller for the whole interval of the dead time", controller=kind
        )
    if fit._better is not None:
        words = "leave out the plant, because another kind of plant is more likely"
        return Advice(words, {"plant": None}, given)
    if fit._code == TAKEN_AT_REST or fit.reason == TOO_EARLY:
        words = "if the plant was at rest at the first row, give this information"
        return Advice(words, {"at_rest": True}, given)
    advice = _advice_by_reason(fit, given)
    if advice.options and fit.reason.endswith(TAKEN_AT_REST):
        return replace(advice, options={"at_rest": True, **advice.options})
    return advice


def _advice_by_reason(fit: FoundPlant, given: dict[str, Any]) -> Advice:
    if fit._code in FEW_NUMBERS:
        known = [plant for plant in fit.candidates if len(plant.parameters) <= fit.determined]
        words = "record again with a command that steps up and down at irregular intervals"
        if known and "plant" not in given:
            words += (
                f"; or, if you know that the plant is {known[0].in_words()}, name this kind of "
                "plant"
            )
            return Advice(words, {"plant": known[0].name}, given)
        return Advice(words)
    if fit.reason.startswith("the sensor reads in steps"):
        return Advice("use larger changes of the command, or a sensor with finer steps")
    if fit._code == "no response":
        return Advice("check that command and output are the right columns", draw=True)
    window = None if fit.others else _reliable_part(fit._question)
    if window is not None:
        ends = " to ".join(f"{end:g}" for end in window)
        words = f"use only the part from {ends} s, which the plant explains"
        return Advice(words, {"window": window}, given)
    if fit._code == "delay at its limit":
        larger = float(f"{2.0 * fit.delay:.3g}")
        return Advice("allow a longer dead time", {"largest_delay": larger}, given)
    return Advice(
        "find the times at which the residuals are large, and leave these times out with a window",
        draw=True,
    )


def _reliable_part(question: Question) -> OpenRange | None:
    """The first of `PARTS` of the window that is explained reliably."""
    for low, high in PARTS:
        part = question.part(low, high)
        enough = len(part.recording) - part.earlier >= MINIMUM_SAMPLES
        if enough and part.answer().verdict == "reliable":
            return part.window
    return None


def moves_in(fit: FoundPlant) -> bool:
    """Whether the command changes in the rows that count."""
    for run, question in zip(fit.runs, fit._question.each, strict=True):
        used = ~np.isnan(run.residuals)
        first = int(used.argmax()) if used.any() else 0
        command = question.command[max(first - 1, 0) :]
        if bool((command != command[0]).any()):
            return True
    return False


def _isnan(values: Any) -> Any:
    return values != values
