"""`PlantEstimate`: the plant that a recording shows, and what a loop around it feels.

Why an estimate is not reliable, and what to do next, is put into words here too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.digits import between, shown
from deadtime._base.drawing import Axes, Figure, new_figure, shown_rows
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.plain import plain
from deadtime._base.validation import OpenRange
from deadtime._base.verdicts import rough
from deadtime.estimation.evidence._found import CLEAR, Cause, SensorFault
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
            return call_with({**self.given, **self.options}, self.asked)
        if self.controller:
            kind, gains = f"dtm.{self.controller}", ", ".join(["1.0"] * len(self.controller))
            return f"dtm.design(fit.loop({kind}({gains})), controller={kind}, delay=fit.ci())"
        return "fit.plot()" if self.draw else ""


def call_with(given: Mapping[str, Any], asked: str = "recording") -> str:
    """The call that estimates without a loop, with what is given."""
    named = [f", {name}={_python(value)}" for name, value in given.items() if value is not None]
    return f"dtm.estimate_delay({asked}{''.join(named)})"


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

#: Reasons that the command told too little; of a single step they are those of the step.
LITTLE_TOLD = ("too few told", "classes contradict")
FEW_NUMBERS = (*LITTLE_TOLD, "crossover not told")


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


def _advice_on(fit: FoundPlant, given: dict[str, Any]) -> Advice:
    """What to do next, by why the estimate is not reliable."""
    if fit.verdict == "reliable":
        if fit.best.name == "delay":
            return Advice("nothing, because the output is the delayed command")
        kind = "P" if fit.best.integrates else "PI"
        return Advice(
            f"design a {kind} controller for the whole interval of the dead time", controller=kind
        )
    if fit.better is not None:
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
        first = int(np.argmax(~np.isnan(run.residuals)))
        command = question.command[max(first - 1, 0) :]
        if bool((command != command[0]).any()):
            return True
    return False


#: Ratio of the ends of an interval of the gain below which it is shown for a frequency. Larger:
#: frequencies that the command hardly moves are listed too.
KNOWN = 2.0

#: Names of numbers with the words and unit for each.
NUMBERS = (
    ("delay", "dead time", "s"),
    ("gain", "gain", ""),
    ("lag", "time constant", "s"),
    ("largest_gain", "largest stable gain", ""),
    ("crossover", "crossover at half gain", "rad/s"),
    ("delay_at_crossover", "equivalent delay there", "s"),
    ("gain_at_crossover", "gain there", ""),
)


@dataclass(frozen=True, eq=False, repr=False)
class PlantEstimate(FoundPlant, Pictured):
    """The plant that a recording shows, chosen by evidence from a family of plants.

    Attributes
    ----------
    verdict : {"reliable", "indication", "none"}
        Whether the intervals are claimed to hold; whether the numbers are an indication, whose
        intervals are not; or whether the recording determines too little.
    reason : str
        Why the verdict is not ``"reliable"``, in a sentence; empty where it is.
    delay : float
        Dead time of the likeliest plant, s.
    plant : Plant or None
        The likeliest plant, without its dead time; None if no plant could be fitted.
    parameters : dict of str to float
        The numbers of the likeliest plant, the delay among them.
    crossover : float
        Frequency, rad/s, at which half of `largest_gain` crosses over; NaN if no gain is largest.
    largest_gain : float
        Largest proportional gain of a controller that keeps the loop stable, without a hold;
        infinite if none is largest.
    candidates : tuple of PlantCandidate
        All kinds of plant that were tried, the likeliest first.
    intervals : dict of str to (float, float)
        The 95 % intervals by name, over all kinds of plant that the recording does not rule
        out.
    determined, asked : int
        How many numbers the recording determines, and how many the likeliest plant has.
    shift : int
        Rows by which the command was moved: below zero where it was logged late, above zero where
        it was logged early.
    at_rest : bool
        Whether the plant was taken to be at rest at the first row.
    excited : ndarray
        Frequencies, rad/s, at which the command moves.
    recording : Recording
        The rows that were used, and those before them.
    fitted, residuals : ndarray, shape (n,)
        Output of the likeliest plant, and measured less fitted output; NaN in rows not used.
    causes : tuple of Cause
        What a linear plant lacks, such as play of the actuator or a load, with sizes. The numbers
        are those of the plant without it.
    sensor_faults : tuple of SensorFault
        Rows that are no readings of the sensor, such as frozen ones. They were left out.
    better : PlantCandidate or None
        A plant that explains the recording clearly better than the one that was named.
    others : tuple of FittedRecording
        The further recordings of a joint estimate; `recording`, `fitted` and `residuals` are those
        of the first, `runs` has all.

    See Also
    --------
    deadtime.estimate_delay : Makes it.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(200.0)
    >>> heater = np.where(time < 20, 40.0, 45.0)
    >>> warmth = 9.0 * (1.0 - np.exp(-np.maximum(time - 32.0, 0.0) / 20.0))
    >>> warmth += np.random.default_rng(1).normal(0.0, 0.05, time.size)
    >>> fit = dtm.estimate_delay(dtm.Recording(time, None, warmth, heater))
    >>> fit.best.in_words()
    'a process that comes to rest, time constant 20 s'
    >>> low, high = fit.ci(0.95, "largest_gain")
    >>> fit.loop(dtm.P(0.5 * low)).is_stable()
    True
    """

    def headline(self) -> str:
        """The verdict and what it is about, in a line."""
        if self.verdict == "none":
            return f"none: {self.reason}"
        plant = self.best.in_words()
        if self.verdict == "indication":
            return f"indication: dead time about {rough(self.delay, 's')}, {plant}; {self.reason}"
        ends, value = _ends(self.ci(), "s"), self._stated("delay", "s")
        return f"reliable: dead time {value} (95 %: {ends}), {plant}"

    def advice(self) -> Advice:
        """What to do next, computed from the recording."""
        return self._advice

    def lines(self) -> list[str]:
        """The summary without what to do next, a line each."""
        lines = [self.headline()]
        if self.verdict != "none":
            lines += self._numbers()
        return [*lines, *self._seen(), *self._beside()]

    def summary(self) -> str:
        """The answer as a few lines of text, the verdict first."""
        first, *rest = self.lines()
        advice = self._advice
        lines = [first, *(f"  {line}" for line in rest), f"next: {advice.words}"]
        return "\n".join([*lines, f"  {advice.statement}"] if advice.statement else lines)

    def _numbers(self) -> list[str]:
        """A line a number, with its interval where that is claimed."""
        lines = []
        for name, words, unit in NUMBERS:
            value = self.value(name) if name in self.intervals else math.nan
            if not math.isfinite(value):
                continue
            if self.verdict == "reliable":
                ends = _ends(self.intervals[name], unit)
                lines.append(f"{words:<24} {self._stated(name, unit):<14} 95 %: {ends}")
            else:
                lines.append(f"{words:<24} about {rough(value, unit)}")
        omega = self.crossover_in_loop
        if math.isfinite(omega):
            lines.append(f"with its controller, the loop has its crossover at {omega:.3g} rad/s")
        if not math.isfinite(self.largest_gain):
            lines.append("no proportional gain makes the loop unstable")
        return lines

    def _seen(self) -> list[str]:
        """Gain and equivalent delay at frequencies of the command, where no more is determined."""
        if self._code not in LITTLE_TOLD or not self.excited.size or self.determined < 2:
            return []
        view = self.at(self.excited)
        each = zip(self.excited.tolist(), view.gain_ci.T, view.delay_ci.T, strict=True)
        return [
            f"at {omega:.4g} rad/s: gain {_ends(gain)}, equivalent delay {_ends(delay, 's')} (95 "
            f"%), or this delay plus multiples of half a period, {rough(math.pi / omega, 's')}"
            for omega, gain, delay in each
            if gain[1] < KNOWN * gain[0]
        ]

    def _beside(self) -> list[str]:
        """What came second, what is clearly better, what was changed, and the noise."""
        lines = []
        if self.better is not None:
            lines.append(
                f"{self.better.in_words()} explains the recording "
                f"clearly better: by {-self.better.behind:.3g} in BIC"
            )
        for second in self.candidates[1:2] if self.verdict != "none" else ():
            clear = "clearly behind" if second.behind >= CLEAR else "possible too, but behind"
            words = second.in_words()
            lines.append(f"second best: {words}; {clear}, by {second.behind:.3g} in BIC")
        if self.shift:
            lines.append(
                f"in the recording the command is {abs(self.shift)} row "
                f"{'early' if self.shift > 0 else 'late'}, so the command was shifted"
            )
        lines += [f"found: {cause.in_words()}: {cause.remedy}" for cause in self.causes]
        for fault in self.sensor_faults:
            done = "found" if fault.name == "smoothed" else "left out"
            lines.append(f"{done}: {fault.in_words()}")
        for place, run in enumerate(self.runs, 1):
            rows = int((~np.isnan(run.residuals)).sum())
            where = f" of recording {place}" if self.others else ""
            if rows:
                lines.append(
                    f"unexplained: a standard deviation of {run.noise_std:.3g} in {rows} rows, "
                    f"which are {shown(run.recording.sample_time, 0.0, 's')} apart{where}"
                )
        return lines

    def _stated(self, name: str, unit: str) -> str:
        """A number with the digits that its interval supports."""
        low, high = self.intervals[name]
        return shown(self.value(name), 0.25 * (high - low), unit)

    def to_dict(self) -> dict[str, Any]:
        """All results but the arrays, as plain values for JSON."""
        names = ["name", "delay", "parameters", "behind", "determined", "noise_std"]
        tried = [
            {name: getattr(candidate, name) for name in names} | {"words": candidate.in_words()}
            for candidate in self.candidates
        ]
        has_plant = self.verdict != "none"
        found: dict[str, Any] = {
            "verdict": self.verdict,
            "reason": self.reason,
            "headline": self.headline(),
            "plant": self.best.in_words() if has_plant else None,
            "parameters": dict(self.parameters) if has_plant else None,
            "interval_95": dict(self.intervals) if self.verdict == "reliable" else None,
            "crossover": self.crossover if has_plant else None,
            "largest_gain": self.largest_gain if has_plant else None,
            "delay_at_crossover": self.delay_at_crossover if has_plant else None,
            "candidates": tried,
            "determined": self.determined,
            "asked": self.asked,
            "shift": self.shift,
            "at_rest": self.at_rest,
            "causes": [_plain(cause) for cause in self.causes],
            "sensor_faults": [_plain(fault) for fault in self.sensor_faults],
            "noise_std": self.noise_std,
            "recordings": [{"noise_std": run.noise_std} for run in self.runs],
        }
        return {name: plain(value) for name, value in found.items()}

    def plot(self, ax: Sequence[Axes] | None = None) -> list[Axes]:
        """Draw the output with the fitted one over it, and the residuals.

        Needs matplotlib.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            One for the output, one for the residuals. By default those of a new figure.

        Returns
        -------
        list of matplotlib.axes.Axes
        """
        upper, lower = shown_rows(ax, 2)
        time = self.recording.time
        upper.plot(time, self.recording.output, ".", color="0.35", ms=3, label="measured")
        upper.plot(time, self.fitted, lw=1.6, label=self.best.in_words())
        upper.set(ylabel="output", title=self.headline())
        upper.legend(frameon=False, fontsize="small")
        lower.plot(time, self.residuals, lw=0.9)
        lower.set(xlabel="time / s", ylabel="residual")
        return [upper, lower]

    def _picture(self) -> Figure:
        figure, axes = new_figure(7.0, 4.6, rows=2)
        self.plot(axes)
        return figure

    @cached_property
    def _advice(self) -> Advice:
        advice = _advice_on(self, self._question.options())
        return replace(advice, asked="recordings") if self.others else advice

    def __repr__(self) -> str:
        return f"<PlantEstimate {self.headline()}>"


def _ends(ends: Iterable[float], unit: str = "") -> str:
    low, high = map(float, ends)
    return between(low, high, 0.25 * (high - low), unit)


def _plain(found: Cause | SensorFault) -> dict[str, Any]:
    """A finding as plain values, with its words."""
    own = {name: value for name, value in vars(found).items() if not name.startswith("_")}
    return own | {"words": found.in_words()}
