"""`compare_methods`: estimates of one delay by several methods, and why they differ."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import get_args
from warnings import catch_warnings, simplefilter

import numpy as np

from deadtime._base.errors import NotIdentifiableError, RecordingError
from deadtime._base.validation import OpenRange
from deadtime.estimation._estimate import METHODS, bound, checked_run
from deadtime.estimation._native import independent_samples
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.evidence._rival import beside_rivals
from deadtime.estimation.methods._method import paired_runs
from deadtime.estimation.methods._step_response import Overshoot, OvershootMap
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Headings of the columns of `Comparison.rows`.
COLUMNS = (
    "method",
    "delay / s",
    "95 % interval",
    "gain",
    "lag / s",
    "sum / s",
    "off / s",
    "off / σ",
    "verdict",
)

#: Largest relative difference of two delays that agree.
AGREEMENT = 0.03

#: Names of the overshoot methods; the others are called by their own.
LABELS = {
    "dominant": "paper's overshoot",
    "exact": "exact overshoot",
    "saturated": "overshoot with limit",
}

#: The methods that read a part of the recording, and those that fit all of it, of which the last
#: needs the command.
READINGS = ("decrement", "decay", "graphical", "relay", "gcc", "arx_scan")
FITS = ("waveform", "output_error")

#: Names of the fits of all samples within a sentence.
IN_WORDS = {
    "waveform": "the fit of the whole waveform",
    "output_error": "the fit to the logged command",
}


@dataclass(frozen=True)
class MethodDifference:
    """How far an estimate is from that of the preferred method, and what biases it.

    Attributes
    ----------
    delay : float
        The estimated delay, s.
    interval : (float, float) or None
        Its 95 % interval, s.
    no_interval_because : str
        Why there is none; empty where there is one.
    seconds : float
        Delay and lag together, less those of the preferred estimate, s.
    standard_errors : float or None
        The same in standard errors of the preferred estimate; None where it has none.
    rows : int
    window : (float, float)
        The rows it was computed on: how many, and their first and last time, s.
    limits : str
        What biases the method, in a sentence; empty for methods of maximum likelihood.
    """

    delay: float
    interval: tuple[float, float] | None
    no_interval_because: str
    seconds: float
    standard_errors: float | None
    rows: int
    window: tuple[float, float]
    limits: str


@dataclass(frozen=True)
class Comparison:
    """Estimates of one delay by several methods.

    Attributes
    ----------
    estimates : dict of str to DelayEstimate
        By name: ``dominant``, ``exact``, ``saturated``, ``waveform``, ``waveform with lag``; where
        a command was logged ``output_error`` and ``output_error with lag``; ``decrement``,
        ``decay``, ``graphical``, ``relay``, ``gcc`` and ``arx_scan`` where they give an estimate.
    refusals : dict of str to str
        The reasons of the other methods that gave no estimate.
    """

    estimates: Mapping[str, DelayEstimate]
    refusals: Mapping[str, str]

    @property
    def trusted(self) -> str:
        """Name of the preferred method: the logged command holds more information than the loop."""
        return "output_error" if "output_error" in self.estimates else "waveform"

    @property
    def best(self) -> DelayEstimate:
        """The preferred estimate.

        The fit with a lag if the interval of the lag is above zero and, for least squares, the
        Bayesian information criterion favours it, for the number of independent samples that the
        autocorrelation of the residuals gives; otherwise the fit of delay and gain.
        """
        return self.estimates[self._name_of_best]

    @property
    def _name_of_best(self) -> str:
        plain, lagged = self._fits()
        with_lag = f"{self.trusted} with lag"
        if lagged is None or lagged.ci(0.95, "lag")[0] <= 0.0:
            return self.trusted
        if lagged.noise is not None:  # the interval is that of the likelihood
            return with_lag
        effective = independent_samples(lagged.residuals.size, lagged.whiteness.autocorrelation)
        gain = 2.0 * effective * np.log(plain.rms / lagged.rms) if lagged.rms > 0 else np.inf
        return with_lag if gain > np.log(max(effective, 2.0)) else self.trusted

    def _fits(self) -> tuple[DelayEstimate, DelayEstimate | None]:
        """The trusted fit of delay and gain, and the one with a lag, if there is one."""
        return self.estimates[self.trusted], self.estimates.get(f"{self.trusted} with lag")

    def differences(self) -> dict[str, MethodDifference]:
        """How far each estimate is from the preferred one, and what biases its method."""
        best = self.best
        error = best.stderr["delay+lag"]
        found = {}
        for name, fit in self.estimates.items():
            seconds = fit.delay_plus_lag - best.delay_plus_lag
            time = fit.recording.time
            found[name] = MethodDifference(
                delay=fit.delay,
                interval=fit.ci(0.95) if fit.calibrated else None,
                no_interval_because=fit.uncalibrated,
                seconds=seconds,
                standard_errors=seconds / error if error > 0.0 else None,
                rows=len(fit.recording),
                window=(float(time[0]), float(time[-1])),
                limits=METHODS[fit.method].limits,
            )
        return found

    def limitations(self) -> list[str]:
        """On which rows, by how much and why the methods without an interval are off."""
        reference = _label(self._name_of_best)
        sentences: list[str] = []
        for name, gap in self.differences().items():
            if not gap.limits:
                continue
            label = _label(name)
            said = any(gap.limits in sentence for sentence in sentences)
            side = "more than" if gap.seconds >= 0.0 else "less than"
            errors = ""
            if gap.standard_errors is not None:
                errors = f" ({abs(gap.standard_errors):.2g} standard errors of this difference)"
            sentences.append(
                f"{label[0].upper()}{label[1:]}, on {gap.rows} rows from {gap.window[0]:g} to "
                f"{gap.window[1]:g} s: {abs(gap.seconds):.3f} s {side} {reference}{errors}."
                f"{'' if said else f' {gap.limits}'}"
            )
        return sentences

    def pictured(self) -> dict[str, DelayEstimate]:
        """The estimates for one plot, by their labels in its legend."""
        names = ("dominant", self.trusted, f"{self.trusted} with lag")
        return {
            f"{_label(name)}: {self.estimates[name].delay:.3f} s": self.estimates[name]
            for name in names
            if name in self.estimates
        }

    def rows(self) -> list[list[str]]:
        """The estimates as cells of a table with the headings `COLUMNS`.

        Values that were given, not fitted, are in brackets. A method that refused has one cell with
        its reason.
        """
        rows = []
        differences = self.differences()
        for name, fit in self.estimates.items():
            interval, total = "–", "–"
            if fit.verdict != "reliable":
                interval, total = "not reliable", f"about {fit.delay_plus_lag:.3f}"
            elif fit.calibrated:
                interval = "{:.3f} – {:.3f}".format(*fit.ci(0.95))
                total = f"{fit.delay_plus_lag:.3f} ±{fit.stderr['delay+lag']:.3f}"
            rows.append(
                [
                    _label(name),
                    f"{fit.delay:.3f}",
                    interval,
                    _number(fit.gain, "gain" in fit.free),
                    _number(fit.lag, "lag" in fit.free),
                    total,
                    f"{differences[name].seconds:+.3f}",
                    _signed(differences[name].standard_errors),
                    fit.verdict,
                ]
            )
        rows += [[_label(name), f"refused: {why}"] for name, why in self.refusals.items()]
        return rows

    def explanation(self) -> list[str]:
        """Why the methods differ, in sentences."""
        plain, lagged = self._fits()
        dominant = self.estimates.get("dominant")
        sentences = []
        if dominant is None:
            sentences.append(
                f"The overshoot method gives no estimate: {self.refusals['dominant']}."
            )
        else:
            sentences += _overshoot_against_fit(dominant, plain, IN_WORDS[self.trusted])
        if lagged is not None and lagged.ci(0.95, "lag")[0] > 0.0 and lagged.lag is not None:
            sentences.append(
                f"The vehicle has a lag: a fit with a lag gives {lagged.delay:.3f} "
                f"s of delay and {lagged.lag:.3f} s of lag. So part of the "
                "apparent dead time is dynamics of the vehicle. The recording "
                f"determines only the sum well, {lagged.delay_plus_lag:.3f} s."
            )
        if plain.verdict != "reliable":
            sentences.append(
                f"The fit without a further lag is only an indication: {plain.reason}."
            )
        return sentences


def truth_row(numbers: Mapping[str, float]) -> list[str]:
    """The true parameters of a simulated run, as a further row of `Comparison.rows`."""
    names = ("delay", "gain", "lag", "delay+lag")
    delay, *others = (f"{numbers[name]:.3f}" for name in names)
    return ["the truth", delay, "", *others, "", "", ""]


def _label(name: str) -> str:
    return LABELS.get(name, name.replace("_", " "))


def _signed(value: float | None) -> str:
    return "–" if value is None else f"{value:+.1f}"


def _number(value: float | None, fitted: bool) -> str:
    if value is None:
        return "–"
    return f"{value:.3f}" if fitted else f"({value:g})"


def _overshoot_against_fit(dominant: DelayEstimate, plain: DelayEstimate, fit: str) -> list[str]:
    difference = plain.delay - dominant.delay
    if abs(difference) <= AGREEMENT * plain.delay:
        return [
            f"The paper's overshoot method ({dominant.delay:.3f} s) and {fit} "
            f"({plain.delay:.3f} s) agree."
        ]
    sentences = [
        f"The paper's overshoot method gives {dominant.delay:.3f} s, but {fit} "
        f"gives {plain.delay:.3f} s. The difference is {abs(difference):.3f} s."
    ]
    assumed, gain = dominant.gain, plain.gain
    if assumed is None or gain is None or "gain" not in plain.stderr:
        return sentences
    low, high = plain.ci(0.95, "gain")
    if not low <= assumed <= high:
        weaker, less, short = (
            ("weaker", "less", "short") if gain < assumed else ("stronger", "more", "long")
        )
        sentences.append(
            f"The overshoot method assumes a gain of {assumed:g}, but the gain is "
            f"{gain:.3f} ({low:.3f} to {high:.3f}). A {weaker} loop overshoots "
            f"{less}, so the estimated delay is too {short}. With this gain, the "
            f"same overshoot would mean {dominant.delay * assumed / gain:.3f} s."
        )
    return sentences


def compare_methods(
    recording: Recording, loop: ControlLoop, window: OpenRange | None = None
) -> Comparison:
    """Estimate the delay of a recording by every method that applies.

    Parameters
    ----------
    recording, loop, window
        As for `estimate_delay`.

    Returns
    -------
    Comparison

    Raises
    ------
    NotIdentifiableError
        When no fit of delay and gain has a result.
    """
    runs = [checked_run(run) for run in paired_runs(recording, loop, window)]
    estimates: dict[str, DelayEstimate] = {}
    refusals: dict[str, str] = {}
    plain = ["delay", *(["gain"] if "gain" in loop.parameters else [])]
    named = [*plain, *(["lag"] if "lag" in loop.parameters else [])]
    for name in get_args(OvershootMap):
        try:
            estimates[name] = Overshoot(map=name).estimate(runs, plain)
        except (NotIdentifiableError, ValueError) as error:
            refusals[name] = str(error).rstrip(".")
    # Each is for another kind of experiment; their refusals need no report, and what they warn of
    # is said by `limitations`.
    for name in READINGS:
        with suppress(NotIdentifiableError, RecordingError, ValueError), catch_warnings():
            simplefilter("ignore")
            estimates[name] = METHODS[name]().estimate(runs, plain)
    fits = FITS if recording.command is not None else FITS[:1]
    for fit in fits:
        for name, free in {fit: plain, f"{fit} with lag": named}.items():
            if name != fit and named == plain:
                continue
            try:
                found = METHODS[fit]().estimate(runs, free)
                estimates[name] = bound(found, runs, of_loop=fit == "waveform")
            except NotIdentifiableError as error:
                refusals[name] = str(error).rstrip(".")
    if not any(name in estimates for name in fits):
        raise NotIdentifiableError(refusals["waveform"])
    name = Comparison(estimates, refusals)._name_of_best
    best = beside_rivals(estimates[name], runs[0], METHODS[estimates[name].method]())
    return Comparison(estimates | {name: best}, refusals)
