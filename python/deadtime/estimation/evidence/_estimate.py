"""`PlantEstimate`: the plant that a recording shows, and what a loop around it feels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from deadtime._base.digits import between, shown
from deadtime._base.drawing import Axes, Figure, new_figure, shown_rows
from deadtime._base.notebook import Pictured
from deadtime._base.plain import plain
from deadtime._base.verdicts import rough
from deadtime.estimation.evidence._advice import Advice, advice_on
from deadtime.estimation.evidence._found import CLEAR, Cause, SensorFault
from deadtime.estimation.evidence._numbers import FoundPlant

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
        told = self._code in ("too few told", "classes contradict")
        if not told or not self.excited.size or self.determined < 2:
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
        return advice_on(self)

    def __repr__(self) -> str:
        return f"<PlantEstimate {self.headline()}>"


def _ends(ends: Iterable[float], unit: str = "") -> str:
    low, high = map(float, ends)
    return between(low, high, 0.25 * (high - low), unit)


def _plain(found: Cause | SensorFault) -> dict[str, Any]:
    """A finding as plain values, with its words."""
    own = {name: value for name, value in vars(found).items() if not name.startswith("_")}
    return own | {"words": found.in_words()}
