"""Results of runs of the Internet loop: its delay, measured and estimated.

With constant delays the loop is the sampled `ControlLoop` whose delay is the round trip: it samples
every Ts, and a command holds until the next. The mean delay of the loop is then the age of the
measurement on which the command in force is based,

    age = round trip + time an answer is held + Ts/2 + wait for lost or overtaken packets,

and it is measured, packet by packet. Methods that simulate the hold estimate the age minus Ts/2;
the overshoot of a continuous loop includes the hold in its delay.

A step contains few of the random delays, and they are not the noise of a fit: its interval is for
the delays within this one step. The uncertainty of the mean delay shows in the differences between
runs, and more accurately in steps that are replayed at other times of the measured network
(`_replay`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.digits import shown, stated
from deadtime.estimation import DelayEstimate
from deadtime.internet._replay import MAPS, interval_of_mean
from deadtime.internet._spread import Spread
from deadtime.links.udp import Trial
from deadtime.recordings import Recording

#: The methods, and whether their delay includes the hold.
METHODS = {
    "dominant": True,
    "exact": True,
    "waveform": False,
    "output_error": False,
}

#: Their names in tables.
NAMES = {
    "dominant": "paper's overshoot",
    "exact": "exact overshoot",
    "waveform": "waveform",
    "output_error": "output error",
}

#: Headings of the columns of `InternetLoop.rows`.
COLUMNS = ("K", "round trip p50 / p95", "lost", "late", "age", "Mo", *NAMES.values())

#: Names of two of them at the beginning of a sentence.
IN_WORDS = {"dominant": "The paper's overshoot method", "waveform": "The fit of the waveform"}

#: Largest spread of ages from processes that wake up late, as a share of the sample time.
UNSTEADY = 0.3


@dataclass(frozen=True, eq=False)
class InternetRun:
    """One run of the loop.

    Attributes
    ----------
    trial : Trial
        Description of the run.
    plant, controller : dict
        Report of each end, from `PlantReport.to_dict` and `ControllerReport.to_dict`.
    recordings : dict of str to Recording
        Recordings of the ``plant`` and the ``controller``, each by its own clock.
    estimates : dict of str to DelayEstimate
        By ``dominant`` (the paper's overshoot), ``exact``, ``waveform`` on the plant's recording,
        ``output_error`` on the controller's.
    refusals : dict of str to str
        The reasons of the methods that gave no estimate.
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
        """Measured mean age of the measurement on which the command in force is based, s."""
        return _number(self.plant["age"])

    @property
    def overshoot(self) -> float:
        """Overshoot of the step; 0.3 is 30 %. NaN where none was read."""
        fit = self.estimates.get("dominant") or self.estimates.get("exact")
        return math.nan if fit is None else float(fit.details["overshoot"])

    @property
    def is_unsteady(self) -> bool:
        """Whether the age of commands varies more than by processes that wake up late."""
        ages = self.plant["age_when_applied"]
        lost = self.plant["link"]["lost"] + self.controller["link"]["lost"]
        spread = _number(ages["p95"]) - _number(ages["p50"])
        return lost > 0 or not spread < UNSTEADY * self.trial.sample_time

    def delay(self, method: str) -> float:
        """The delay by a method, s; NaN where it refused."""
        fit = self.estimates.get(method)
        return math.nan if fit is None else fit.delay

    def row(self) -> tuple[str, ...]:
        """The run in a row with the headings `COLUMNS`; times in ms."""
        trip, link = self.round_trip, self.plant["link"]
        return (
            f"{self.trial.gain:g}",
            f"{in_ms(trip['p50'])} / {in_ms(trip['p95'])}",
            str(link["lost"] + self.controller["link"]["lost"]),
            f"{link['late']}/{link['received']}",
            in_ms(self.age),
            f"{100 * self.overshoot:.1f} %" if math.isfinite(self.overshoot) else "–",
            *(self._estimate(method) for method in NAMES),
        )

    def _estimate(self, method: str) -> str:
        fit = self.estimates.get(method)
        if fit is None:
            return "refused"
        words = stated(1e3 * fit.delay, 1e3 * fit.stderr.get("delay", math.nan))
        return words if fit.verdict == "reliable" and "±" in words else in_ms(fit.delay)

    def budget(self) -> dict[str, float]:
        """The parts of the mean age, s.

        ``round trip``, ``held`` (by the controller), ``hold`` (half the sample time: a command
        is in force until the next), and ``waiting`` for lost, overtaken or buffered packets.
        """
        parts = {
            "round trip": _number(self.round_trip["mean"]),
            "held": _number(self.plant["link"]["held"]["mean"]),
            "hold": 0.5 * self.trial.sample_time,
        }
        return {**parts, "waiting": self.age - sum(parts.values())}


def in_ms(value: float | None) -> str:
    """A time in a table, ms."""
    return "–" if value is None or not math.isfinite(value) else f"{1e3 * value:.1f}"


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


@dataclass(frozen=True, eq=False)
class InternetLoop:
    """The runs of one network.

    Attributes
    ----------
    runs : tuple of InternetRun
        One for each gain.
    """

    runs: tuple[InternetRun, ...]
    _errors: tuple[Mapping[str, NDArray[np.float64]], ...] = ()
    _age_error: float = math.nan

    def spread(self, method: str) -> Spread:
        """Mean and interval of a method over all runs; NaN where all refused."""
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
        """The delay that a method should find, from the measured age, s."""
        hold = 0.5 * self.runs[0].trial.sample_time
        return self.age - (0.0 if METHODS[method] else hold)

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each run, with the headings `COLUMNS`; times in ms."""
        return [run.row() for run in self.runs]

    def lines(self) -> list[str]:
        """A line for each method: mean, 95 % interval, and what was measured."""
        found = []
        for method, name in NAMES.items():
            spread = self.spread(method)
            mean = shown(spread.mean, spread.error, "s") if spread.count else "–"
            interval = f"; {spread.interval}" if spread.interval else ""
            measured = stated(self.expected(method), math.nan, "s")
            found.append(f"{name:<20}mean {mean}{interval}; measured {measured}")
        return found

    def refusals(self) -> list[str]:
        """Why methods gave no estimate of a run, a sentence each."""
        return [
            f"K = {run.trial.gain:g}, {NAMES[method]}: {why}"
            for run in self.runs
            for method, why in run.refusals.items()
        ]

    def explanation(self) -> list[str]:
        """Comparison of the estimates with the measured delay, in sentences."""
        if not math.isfinite(self.age):
            return ["In one run no command arrived in time, so the delay could not be measured."]
        budgets = [run.budget() for run in self.runs]
        mean = {name: 1e3 * float(np.mean([row[name] for row in budgets])) for name in budgets[0]}
        sentences = [
            f"By measurement, the command in use is {1e3 * self.age:.1f} ms old on average. The "
            f"round trip takes {mean['round trip']:.1f} ms, the controller {mean['held']:.1f} "
            f"ms, and the hold of a command for a sample time {mean['hold']:.1f} ms. The rest, "
            f"{mean['waiting']:.1f} ms, comes from packets that were lost, overtaken or "
            "buffered, and from processes that wake up late. The rest is negative if the "
            "newest packets are faster than the average."
        ]
        unsteady = [run for run in self.runs if run.is_unsteady]
        if unsteady:
            sentences.append(
                "The delay is not constant, and one step contains only few of its values. So "
                "the interval of a single fit is not an interval of the mean delay. For the "
                "mean delay use the intervals of the replayed steps, or make the delay "
                "constant with a jitter buffer."
            )
        lag = self.runs[0].trial.lag
        if lag > 0.0:
            sentences.append(
                f"The measured age does not contain the lag of the plant, {1e3 * lag:.1f} ms, "
                "but the overshoot methods count this lag as delay. The intervals of the "
                "replayed steps are corrected for it."
            )
        for method, label in IN_WORDS.items():
            found = self.spread(method)
            if found.count == 0:
                sentences.append(f"{label} gave no estimate in any run.")
                continue
            expected = self.expected(method)
            hold = "with the hold" if METHODS[method] else "without the hold"
            interval = f" ({found.interval})" if found.interval else ""
            sentences.append(
                f"{label} finds {shown(found.mean, found.error, 's')}{interval}, where "
                f"{1e3 * expected:.1f} ms was measured, {hold}."
            )
        return sentences

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
