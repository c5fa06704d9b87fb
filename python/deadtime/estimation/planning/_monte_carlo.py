"""Monte Carlo simulation of an experiment: many noisy runs, and an estimate from each.

Each run has a seed of its own, so results do not depend on how runs are divided among processes.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import shown, stated
from deadtime._base.errors import DeadtimeError, NotIdentifiableError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.processes import shared_out
from deadtime._base.progress import Progress
from deadtime._base.validation import confidence, whole_number
from deadtime.estimation._least_squares import unit_of
from deadtime.estimation._result import DelayEstimate
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Parameters whose effect is similar to that of a delay.
SLOW = ("lag", "time_constant")


@dataclass(frozen=True, eq=False, repr=False)
class MonteCarlo(ReadOnlyArrays):
    """Errors of a method over many simulated runs of one experiment.

    Attributes
    ----------
    method : str
        Name of the method.
    runs : int
        Number of runs.
    truth : dict of str to float
        The true value of each quantity.
    estimates : dict of str to ndarray, shape (m,)
        The estimates from the runs that were not refused, in the order of their seeds.
    rmse, bias : dict of str to float
        Root mean square and mean of the error of each quantity.
    mean_bound : dict of str to float
        Mean over the runs of the Cramér-Rao bounds that were reported with the estimates;
        empty where the method reports none.
    level : float
        Level of the intervals.
    coverage : dict of str to float
        Share of the intervals that held the truth; empty where the method gives none.
    failures : dict of str to int
        How many runs were refused, by reason; numbers in reasons are left out.
    """

    method: str
    runs: int
    truth: dict[str, float]
    estimates: dict[str, Array]
    rmse: dict[str, float]
    bias: dict[str, float]
    mean_bound: dict[str, float]
    level: float
    coverage: dict[str, float]
    failures: dict[str, int]

    def summary(self) -> str:
        """The figures as a few lines of text."""
        refused = sum(self.failures.values())
        lines = [
            f"{self.method}: {self.runs} runs, of which {refused} were refused",
            f"  {'':<20}{'rmse':>20}{'bias':>20}{'mean bound':>12}{'coverage':>14}",
        ]
        for name, rmse in self.rmse.items():
            unit, error, count = unit_of(name), self._error(name), self.estimates[name].size
            deviation = float(np.std(self.estimates[name])) / math.sqrt(count)
            bias = stated(self.bias[name], deviation, unit)
            bound = held = "-"
            if name in self.mean_bound:
                bound = shown(self.mean_bound[name], error, unit)
            if name in self.coverage:
                # Two successes and failures more: no deviation is none (Agresti & Coull 1998).
                share = (self.coverage[name] * count + 2.0) / (count + 4.0)
                deviation = math.sqrt(share * (1.0 - share) / count)
                held = stated(100.0 * self.coverage[name], 100.0 * deviation, "%")
            lines.append(
                f"  {name:<20}{stated(rmse, error, unit):>20}{bias:>20}{bound:>12}{held:>14}"
            )
        lines += [f"  refused {count}: {reason}" for reason, count in self.failures.items()]
        return "\n".join(lines)

    def _error(self, name: str) -> float:
        """Standard error of a root mean square of Gaussian errors."""
        return self.rmse[name] / math.sqrt(2.0 * self.estimates[name].size)

    def __repr__(self) -> str:
        errors = ", ".join(
            f"{name} {shown(rmse, self._error(name), unit_of(name))}"
            for name, rmse in self.rmse.items()
        )
        return f"<MonteCarlo of {self.method}: {self.runs} runs, rmse {errors}>"


class _Outcome(NamedTuple):
    """Result of one run: estimates, bounds, whether intervals held the truth; or the refusal."""

    values: dict[str, float]
    bounds: dict[str, float]
    held: dict[str, bool]
    refusal: str = ""


class Trials(NamedTuple):
    """How each of many runs is simulated, from one seed, and estimated, and the truth."""

    truth: Mapping[str, float]
    simulate: Callable[[np.random.SeedSequence], Recording]
    estimate: Callable[[Recording], DelayEstimate]
    seed: int
    level: float

    def outcomes(self, runs: range) -> list[_Outcome]:
        """The results of some of the runs."""
        return [self._outcome(run) for run in runs]

    def _outcome(self, run: int) -> _Outcome:
        # The children of one seed, as its `spawn` makes them.
        recording = self.simulate(np.random.SeedSequence(self.seed, spawn_key=(run,)))
        try:
            fit = self.estimate(recording)
            fitted = with_sums(fit.loop)
            values = {name: fitted[name] for name in fit.stderr}
            bounds = {} if fit.crb is None else {name: fit.crb.stderr[name] for name in values}
            claimed = values if fit.calibrated else ()
            held = {name: _holds(fit, name, self.truth[name], self.level) for name in claimed}
            return _Outcome(values, bounds, held)
        except DeadtimeError as refusal:
            return _Outcome({}, {}, {}, str(refusal))

    def run(self, method: str, runs: int, processes: int | None, progress: Progress) -> MonteCarlo:
        """Simulate and estimate `runs` times, and collect the statistics."""
        count = whole_number("runs", runs)
        confidence(self.level)
        outcomes = shared_out(self.outcomes, count, processes, progress)
        answered = [outcome for outcome in outcomes if not outcome.refusal]
        # Numbers are left out, so that equal reasons are counted together.
        refusals = [outcome.refusal for outcome in outcomes if outcome.refusal]
        reasons = Counter(re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "…", why) for why in refusals)
        if not answered:
            raise NotIdentifiableError(
                f"all {len(outcomes)} runs were refused. The most "
                f"frequent reason: {reasons.most_common(1)[0][0]}"
            )
        truth = {name: self.truth[name] for name in answered[0].values}
        estimates = {name: np.array([run.values[name] for run in answered]) for name in truth}
        errors = {name: estimates[name] - truth[name] for name in truth}
        return MonteCarlo(
            method=method,
            runs=len(outcomes),
            truth=truth,
            estimates=estimates,
            rmse={name: float(np.sqrt(np.mean(error**2))) for name, error in errors.items()},
            bias={name: float(np.mean(error)) for name, error in errors.items()},
            mean_bound=_means([run.bounds for run in answered]),
            level=self.level,
            coverage=_means([run.held for run in answered]),
            failures=dict(reasons.most_common()),
        )


def _holds(fit: DelayEstimate, name: str, truth: float, level: float) -> bool:
    """Whether the interval holds the truth.

    One value of the profile decides it; the ends of the interval would take about ten each.
    """
    from scipy import special

    profile = fit._profile
    if profile is not None and profile.preferred:
        quantile = float(special.stdtrit(profile.freedom_of(name), 0.5 + level / 2.0)) ** 2
        return profile.statistic(name, truth) <= quantile
    low, high = fit.ci(level, name)
    return low <= truth <= high


def with_sums(loop: ControlLoop) -> dict[str, float]:
    """The parameters of a loop, and the sum of its delay and its lag or time constant."""
    values = loop.parameters
    lag = float(getattr(loop.plant, "lag", 0.0))
    sums = {"delay+lag": values["delay"] + lag}
    if "time_constant" in values:
        sums["delay+time_constant"] = values["delay"] + values["time_constant"]
    return values | sums


def _means(each: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The mean of each number over the runs."""
    return {name: float(np.mean([run[name] for run in each])) for name in each[0]}
