"""What runs of the Internet loop say of its delay: measured, estimated, and why they differ.

With constant delays the loop is the sampled `ControlLoop` whose delay is the round trip: it samples
every Ts, and a command holds until the next. What the loop is late by on average is then the age of
the measurement behind the command in force,

    age = round trip + time an answer is held + Ts/2 + wait for what was lost or overtaken,

and it is measured, packet by packet. Methods that know of the hold estimate the age less Ts/2;
the overshoot read as that of a continuous loop has the hold in its delay, too.

A step sees few of the random delays, and what a fit takes for noise is not what makes it miss: its
interval is for the delay that this one step met. How uncertain the mean delay of a network is shows
in how much the runs differ, and better in what the steps would have shown at other moments of the
network as it was measured (`_internet_replay`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime.estimation import DelayEstimate
from deadtime.internet._replay import MAPS, interval_of_mean
from deadtime.links.udp import Trial
from deadtime.recordings import Recording

__all__ = ["METHODS", "InternetLoop", "InternetRun", "Spread"]

#: The methods, and whether they have the hold in what they call the delay.
METHODS = {
    "dominant": True,
    "exact": True,
    "waveform": False,
    "output_error": False,
}

#: What two of them are called at the beginning of a sentence.
TOLD = {"dominant": "The paper's overshoot method", "waveform": "The fit of the waveform"}

#: Part of the sample time by which ages differ where processes just wake up late.
UNSTEADY = 0.3


@dataclass(frozen=True)
class Spread:
    """What several runs say of one delay.

    Attributes
    ----------
    count : int
        Runs with an answer.
    mean : float
        Their mean, s.
    low, high : float
        Interval of 95 % for what was to be found, s: by replaying the steps (`replayed`), or by
        how much the runs differ (Student's t); NaN where neither can be had.
    replayed : bool
        Whether it is by replaying; it then has the error of the method in it.
    """

    count: int
    mean: float
    low: float
    high: float
    replayed: bool = False

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """That of these delays."""
        from scipy import special

        count = len(values)
        if count == 0:
            return Spread(0, math.nan, math.nan, math.nan)
        mean = float(np.mean(values))
        if count == 1:
            return Spread(1, mean, math.nan, math.nan)
        quantile = float(special.stdtrit(count - 1, 0.975))
        half = quantile * float(np.std(values, ddof=1)) / math.sqrt(count)
        return Spread(count, mean, mean - half, mean + half)


@dataclass(frozen=True, eq=False)
class InternetRun:
    """One run of the loop.

    Attributes
    ----------
    trial : Trial
        What was run.
    plant, controller : dict
        What happened at each end, as of `PlantReport.to_dict` and `ControllerReport.to_dict`.
    recordings : dict of str to Recording
        Of the ``plant`` and the ``controller``, by the clock of each.
    estimates : dict of str to DelayEstimate
        By ``dominant`` (the paper's overshoot), ``exact``, ``waveform`` on the plant's recording,
        ``output_error`` on the controller's.
    refusals : dict of str to str
        The methods that could not answer, and why.
    """

    trial: Trial
    plant: Mapping[str, Any]
    controller: Mapping[str, Any]
    recordings: Mapping[str, Recording]
    estimates: Mapping[str, DelayEstimate]
    refusals: Mapping[str, str]

    @property
    def round_trip(self) -> Mapping[str, float]:
        """Measured round trips: ``mean``, ``p50``, ``p95``, ``p99``, ``largest``, in s."""
        found: Mapping[str, float] = self.plant["link"]["round_trip"]
        return found

    @property
    def age(self) -> float:
        """Mean age of the measurement behind the command in force, as measured, s."""
        return _number(self.plant["age"])

    @property
    def overshoot(self) -> float:
        """Overshoot of the step; 0.3 is 30 %. NaN where none was read."""
        fit = self.estimates.get("dominant") or self.estimates.get("exact")
        return math.nan if fit is None else float(fit.details["overshoot"])

    @property
    def is_unsteady(self) -> bool:
        """Whether the age of commands differs by more than waking up late explains."""
        ages = self.plant["age_when_applied"]
        lost = self.plant["link"]["lost"] + self.controller["link"]["lost"]
        spread = _number(ages["p95"]) - _number(ages["p50"])
        return lost > 0 or not spread < UNSTEADY * self.trial.sample_time

    def delay(self, method: str) -> float:
        """The delay by a method, s; NaN where it refused."""
        fit = self.estimates.get(method)
        return math.nan if fit is None else fit.delay

    def budget(self) -> dict[str, float]:
        """What the mean age is made of, s.

        ``round trip``, ``held`` (by the controller), ``hold`` (half the sample time: a command
        is in force until the next), and ``waiting`` for what was lost, overtaken or buffered.
        """
        parts = {
            "round trip": _number(self.round_trip["mean"]),
            "held": _number(self.plant["link"]["held"]["mean"]),
            "hold": 0.5 * self.trial.sample_time,
        }
        return {**parts, "waiting": self.age - sum(parts.values())}


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


@dataclass(frozen=True, eq=False)
class InternetLoop:
    """The runs of one network.

    Attributes
    ----------
    runs : tuple of InternetRun
        One a gain.
    """

    runs: tuple[InternetRun, ...]
    _errors: tuple[Mapping[str, NDArray[np.float64]], ...] = ()
    _age_error: float = math.nan

    def spread(self, method: str) -> Spread:
        """What the runs together say by a method; NaN where none answered."""
        delays = [run.delay(method) for run in self.runs]
        answered = [index for index, delay in enumerate(delays) if math.isfinite(delay)]
        found = Spread.of([delays[index] for index in answered])
        if method not in MAPS or not self._errors or not answered:
            return found
        errors = [self._errors[index][method] for index in answered]
        low, high = interval_of_mean(found.mean, errors, self._age_error)
        if math.isnan(low):
            return found
        return replace(found, low=low, high=high, replayed=True)

    @property
    def age(self) -> float:
        """Mean measured age over the runs, s."""
        return float(np.mean([run.age for run in self.runs]))

    def expected(self, method: str) -> float:
        """What a method has to find by the age as measured, s."""
        hold = 0.5 * self.runs[0].trial.sample_time
        return self.age - (0.0 if METHODS[method] else hold)

    def explanation(self) -> list[str]:
        """The estimates against what was measured, a sentence or two each."""
        if not math.isfinite(self.age):
            return ["No command came in time in a run, so that no delay was measured."]
        budgets = [run.budget() for run in self.runs]
        mean = {name: 1e3 * float(np.mean([one[name] for one in budgets])) for name in budgets[0]}
        said = [
            f"Measured, the command in force is {1e3 * self.age:.1f} ms old on average: "
            f"{mean['round trip']:.1f} ms of round trip, {mean['held']:.1f} ms until the "
            f"controller answers, {mean['hold']:.1f} ms because a command holds for a sample time, "
            f"and {mean['waiting']:.1f} ms for packets that were lost, overtaken or buffered and "
            "processes that wake up late (below zero where the newest packets are faster than all)."
        ]
        unsteady = [run for run in self.runs if run.is_unsteady]
        if unsteady:
            said.append(
                "The delay is not constant: a step meets few of its values, and the interval of a "
                "single fit is for those. For the mean delay go by the intervals of the replayed "
                "steps, or make the delay constant with a jitter buffer."
            )
        lag = self.runs[0].trial.lag
        if lag > 0.0:
            said.append(
                f"The lag of the plant, {1e3 * lag:.1f} ms, is not in what was measured. The "
                "overshoot methods take it for delay; replaying takes it out of their intervals."
            )
        for method, label in TOLD.items():
            found = self.spread(method)
            if found.count == 0:
                said.append(f"{label} has no answer in any run.")
                continue
            wanted = self.expected(method)
            knows = "which has the hold in it" if METHODS[method] else "the hold taken out"
            interval = ""
            if math.isfinite(found.low):
                how = "corrected by replaying" if found.replayed else "by the spread of the runs"
                interval = f" ({how} {1e3 * found.low:.1f} to {1e3 * found.high:.1f})"
            said.append(
                f"{label} finds {1e3 * found.mean:.1f} ms{interval}, where "
                f"{1e3 * wanted:.1f} ms was measured, {knows}."
            )
        return said

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "runs": [
                {
                    "gain": run.trial.gain,
                    "overshoot": run.overshoot,
                    "age": run.age,
                    "budget": run.budget(),
                    "plant": {k: v for k, v in run.plant.items() if k != "arrivals"},
                    "controller": run.controller,
                    "estimates": {name: fit.to_dict() for name, fit in run.estimates.items()},
                    "refusals": run.refusals,
                }
                for run in self.runs
            ],
            "age": self.age,
            "spread": {name: vars(self.spread(name)) for name in METHODS},
            "expected": {name: self.expected(name) for name in METHODS},
            "explanation": self.explanation(),
        }
