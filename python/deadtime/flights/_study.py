"""Results of the experiment on one axis: the verdict, tables, and what is written as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deadtime._base.digits import between
from deadtime._base.verdicts import NOT_CLAIMED, Verdict, claimed
from deadtime.estimation import DelayEstimate
from deadtime.flights._learn import Learned
from deadtime.flights._plan import FlightPlan
from deadtime.flights._plants import lag_of_limits
from deadtime.flights._runs import FlownSteps, settled
from deadtime.links.axes import Axis
from deadtime.loops import RateLimited

#: Headings of the columns of `FlightStudy.rows`.
COLUMNS = (
    "flight",
    "overshoot / %",
    "settled / s",
    "paper's delay / s",
    "period / ms",
    "missed",
)


#: Parts of the delay of the loop in words: only their sum is called the delay.
PART_WORDS = (("delay", "dead time"), ("lag", "lag"), ("delay+lag", "delay, both together"))


@dataclass(frozen=True)
class FlightStudy:
    """Results of the whole experiment on one axis.

    Attributes
    ----------
    plan : FlightPlan
        What was flown.
    learned : Learned
        Results of the first flights.
    checked : tuple of FlownSteps
        The flights with designed gains: the best P, then PV.
    """

    plan: FlightPlan
    learned: Learned
    checked: tuple[FlownSteps, ...]

    @property
    def axis(self) -> Axis:
        """The axis that was flown."""
        return self.plan.flown_axis

    @property
    def before(self) -> FlownSteps:
        """The one of the first flights with the largest gain."""
        return max(self.learned.flights, key=lambda flight: flight.controller.gains["Kp"])

    @property
    def after(self) -> FlownSteps:
        """The flight under the PV gains."""
        return self.checked[-1]

    @property
    def flights(self) -> tuple[FlownSteps, ...]:
        """All flights, in order of time."""
        return (*self.learned.flights, *self.checked)

    @property
    def verdict(self) -> Verdict:
        """Whether the intervals of the estimate are claimed to hold: that of `learned`."""
        return self.learned.verdict

    def headline(self) -> str:
        """The outcome in a few sentences, the verdict first, with the warnings."""
        return " ".join([self.outcome(), *self.learned.warnings()])

    def outcome(self) -> str:
        """The outcome in a few sentences, the verdict first."""
        fit = self.learned.fit

        def said(name: str, unit: str = "s") -> str:
            return claimed(self.verdict, fit._value(name), fit.stderr[name], unit)

        ends = NOT_CLAIMED
        if self.verdict == "reliable":
            low, high = fit.ci(0.95, "delay+lag")
            ends = f"{between(low, high, fit.stderr['delay+lag'], 's')} with 95 % confidence"
        parts = [f"a dead time of {said('delay')}"]
        if "lag" in fit.stderr:
            parts.append(f"a lag of {said('lag')}")
        beside = ""
        if isinstance(fit.loop.plant, RateLimited):
            beside = " besides the limits within which the vehicle follows a command"
            if slow := lag_of_limits(fit):
                beside += f". For small commands, these limits act like a further lag of {slow:g} s"
        sentences = [
            f"{self.verdict.capitalize()}: the delay of the loop on {self.axis.name}, lag "
            f"included, is {said('delay+lag')}, {ends}{beside}: {' and '.join(parts)}, at a gain "
            f"of {said('gain', '')}."
        ]
        split = self.learned.split
        if split is not None:
            link = _claimed_part(split.transport, "delay")
            own = _claimed_part(split.vehicle, split.late)
            sentences.append(
                f"According to the vehicle's reports, the link takes {link} of this delay, and "
                f"the vehicle {own}."
            )
        before, after = self.before, self.after
        sentences.append(
            f"With {before.name}, a step {_did(before)}. With {after.name}, a step {_did(after)}."
        )
        return " ".join(sentences)

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each flight, with the headings `COLUMNS`."""
        found: list[tuple[str, ...]] = []
        methods = [*self.learned.overshoot, *([""] * len(self.checked))]
        for flight, paper in zip(self.flights, methods, strict=True):
            delay = paper if isinstance(paper, str) else f"{paper.delay:.3f}"
            timing = flight.timing
            found.append(
                (
                    flight.name,
                    f"{flight.overshoot:.1f}",
                    settled(flight.settling_time),
                    delay if len(delay) < 8 else "none",
                    f"{1e3 * timing.period:.1f} ± {1e3 * timing.jitter:.1f}",
                    f"{timing.missed}",
                )
            )
        return found

    def parts(self) -> list[tuple[str, ...]]:
        """The parts of the delay: a name, a value and a 95 % interval for each row."""
        fit, split = self.learned.fit, self.learned.split
        lines: list[tuple[str, ...]] = [
            _part(fit, name, f"{words}, from command and {self.axis.words}")
            for name, words in PART_WORDS
            if name in fit.stderr
        ]
        speed = self.axis.rate.replace("_", " ")
        if split is not None:
            lines.append(_part(split.transport, "delay", "link, from the reported setpoint"))
            lines.append(_part(split.vehicle, split.late, f"vehicle, from setpoint to {speed}"))
        return lines

    def to_dict(self) -> dict[str, Any]:
        """All results but the recordings, as plain values for JSON."""
        learned = self.learned
        split, small = learned.split, self.axis.thousandth
        return {
            "verdict": self.verdict,
            "headline": self.headline(),
            "irregular": list(learned.irregular),
            "plants": [case.line(small) for case in learned.tried],
            "fit": learned.fit.to_dict(),
            "whole_delay": learned.whole_delay,
            "overshoot_method": [
                answer if isinstance(answer, str) else answer.delay for answer in learned.overshoot
            ],
            "transport": None if split is None else split.transport.to_dict(),
            "vehicle": None if split is None else split.vehicle.to_dict(),
            "vehicle_delay": None if split is None else split.vehicle_delay,
            "no_split_because": learned.unsplit,
            "designed": learned.designed.gains,
            "designed_p": learned.proportional.gains,
            "flights": [
                {
                    "controller": flight.name,
                    "overshoot": flight.overshoot,
                    "settling_time": flight.settling_time,
                    "recording": flight.path,
                    "period": flight.timing.period,
                    "jitter": flight.timing.jitter,
                    "longest_period": flight.timing.longest,
                    "missed": flight.timing.missed,
                    "age": flight.age,
                    "clock_misfit": None if flight.clock is None else flight.clock.misfit,
                }
                for flight in self.flights
            ],
        }


def _part(fit: DelayEstimate, name: str, words: str) -> tuple[str, str, str]:
    ends = NOT_CLAIMED
    if fit.verdict == "reliable":
        ends = between(*fit.ci(0.95, name), fit.stderr[name], "s")
    return words, _claimed_part(fit, name), ends


def _claimed_part(fit: DelayEstimate, name: str) -> str:
    return claimed(fit.verdict, fit._value(name), fit.stderr[name], "s")


def _did(flight: FlownSteps) -> str:
    after = flight.settling_time
    when = f"settled in {after:.1f} s" if np.isfinite(after) else "did not settle"
    return f"{when} with {flight.overshoot:.0f} % overshoot"
