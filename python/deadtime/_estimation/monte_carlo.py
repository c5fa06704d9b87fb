"""Many flights of one experiment, an estimate from each: what a method makes of the noise.

Flights are independent, so they are shared out among processes in small batches; each flight has
a seed of its own, so that results do not depend on how.
"""

from __future__ import annotations

import os
import re
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._errors import DeadtimeError, NotIdentifiableError
from deadtime._estimation.estimate import estimate_delay
from deadtime._excitation import Experiment
from deadtime._frozen import ReadOnlyArrays, read_only
from deadtime._loop import ControlLoop
from deadtime._validation import whole_number

__all__ = ["MonteCarlo", "Plan", "flown_many_times"]

Array = NDArray[np.float64]
Report = Callable[[int, int], object]

#: Fewer runs than this are over before other processes have started.
FEW = 100

#: Flights of one batch, at most: so often progress is reported.
BATCH = 25


@dataclass(frozen=True, eq=False, repr=False)
class MonteCarlo(ReadOnlyArrays):
    """What a method found in many flights of one experiment.

    Attributes
    ----------
    method : str
        Name of the method.
    runs : int
        Number of flights.
    truth : dict of str to float
        The true value of each quantity.
    estimates : dict of str to ndarray, shape (m,)
        The estimates from the flights that were not refused, in the order of their seeds.
    rmse, bias : dict of str to float
        Root mean square and mean of the error of each quantity.
    mean_bound : dict of str to float
        Mean over the flights of the Cramér-Rao bounds that were reported with the estimates;
        empty where the method reports none.
    level : float
        Level of the intervals.
    coverage : dict of str to float
        Share of the intervals that held the truth; empty where the method gives none.
    failures : dict of str to int
        How many flights were refused, by reason; numbers in reasons are left out.
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

    def __post_init__(self) -> None:
        read_only(self.estimates)

    def summary(self) -> str:
        """The figures as a few lines of text."""
        refused = sum(self.failures.values())
        lines = [
            f"{self.method}: {self.runs} flights, {refused} refused",
            f"  {'':<12}{'rmse':>11}{'bias':>11}{'mean bound':>12}{'coverage':>10}",
        ]
        for name in self.rmse:
            bound = f"{self.mean_bound[name]:.3g}" if name in self.mean_bound else "-"
            held = f"{100.0 * self.coverage[name]:.1f} %" if name in self.coverage else "-"
            lines.append(
                f"  {name:<12}{self.rmse[name]:>11.3g}{self.bias[name]:>11.2g}{bound:>12}{held:>10}"
            )
        lines += [f"  refused {count}: {reason}" for reason, count in self.failures.items()]
        return "\n".join(lines)

    def __repr__(self) -> str:
        errors = ", ".join(f"{name} {error:.3g}" for name, error in self.rmse.items())
        return f"<MonteCarlo of {self.method}: {self.runs} flights, rmse {errors}>"


@dataclass(frozen=True, eq=False)
class Plan:
    """What is flown, and how each flight is estimated from."""

    loop: ControlLoop
    experiment: Experiment
    noise: float
    free: tuple[str, ...]
    initial_output: float | None
    known: ControlLoop
    method: str
    options: Mapping[str, Any]
    circulates: bool
    level: float


class _Outcome(NamedTuple):
    """One flight: estimates, bounds and whether intervals held the truth, or why it was refused."""

    values: dict[str, float]
    bounds: dict[str, float]
    held: dict[str, bool]
    refusal: str = ""


def flown_many_times(
    plan: Plan,
    runs: int,
    seed: int,
    processes: int | None,
    progress: bool | Report,
) -> MonteCarlo:
    """Fly and estimate `runs` times and sum up."""
    count = whole_number("runs", runs)
    if not 0.0 < plan.level < 1.0:
        raise ValueError(f"level={plan.level!r} is not between 0 and 1: 0.95 is usual")
    workers = os.cpu_count() or 1
    if processes is not None:
        workers = whole_number("processes", processes)
    elif count < FEW:
        workers = 1
    size = max(1, min(BATCH, count // (4 * workers)))
    batches = [range(start, min(start + size, count)) for start in range(0, count, size)]
    with _reporting(progress, count) as report:
        if workers == 1:
            outcomes = _here(plan, seed, batches, report, count)
        else:
            outcomes = _elsewhere(plan, seed, batches, report, count, workers)
    return _summed_up(plan, outcomes)


def _here(
    plan: Plan, seed: int, batches: list[range], report: Report, count: int
) -> list[_Outcome]:
    outcomes: list[_Outcome] = []
    for batch in batches:
        outcomes += _batch(plan, seed, batch)
        report(len(outcomes), count)
    return outcomes


def _elsewhere(
    plan: Plan, seed: int, batches: list[range], report: Report, count: int, workers: int
) -> list[_Outcome]:
    """Batches on other processes; an interrupt waits for those that are at work and no others."""
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _left_to_the_parent)
    try:
        futures = {pool.submit(_batch, plan, seed, batch): i for i, batch in enumerate(batches)}
        found: dict[int, list[_Outcome]] = {}
        done = 0
        for future in as_completed(futures):
            found[futures[future]] = future.result()
            done += len(found[futures[future]])
            report(done, count)
    except BrokenProcessPool as error:
        raise RuntimeError(
            "the processes for the flights cannot start or were killed: in a script, keep what it "
            'does under `if __name__ == "__main__":`, or give processes=1'
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return [outcome for i in range(len(batches)) for outcome in found[i]]


def _left_to_the_parent() -> None:
    """Ctrl-C goes to every process of a terminal: only the one that asked answers to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _batch(plan: Plan, seed: int, flights: range) -> list[_Outcome]:
    # The children of one seed, as its `spawn` makes them.
    return [_outcome(plan, np.random.SeedSequence(seed, spawn_key=(i,))) for i in flights]


def _outcome(plan: Plan, seed: np.random.SeedSequence) -> _Outcome:
    flight = plan.experiment.fly(plan.loop, plan.noise, seed, plan.circulates)
    options = dict(plan.options)
    logged = plan.method in ("auto", "output_error") and flight.command is not None
    if plan.initial_output is not None and logged and plan.loop.is_sampled:
        options.setdefault("initial_output", plan.initial_output)
    try:
        fit = estimate_delay(flight, plan.known, method=plan.method, free=plan.free, **options)
        truth = _truth(plan)
        values = {name: fit._value(name) for name in fit.stderr if name in truth}
        bounds = {} if fit.crb is None else {name: fit.crb.stderr[name] for name in values}
        held = {}
        if fit.calibrated:
            for name in values:
                low, high = fit.ci(plan.level, name)
                # An end that is at the truth but for rounding holds it, as at a lag of zero.
                slack = 1e-9 * (1.0 + abs(truth[name]))
                held[name] = bool(low - slack <= truth[name] <= high + slack)
    except DeadtimeError as refusal:
        return _Outcome({}, {}, {}, str(refusal))
    return _Outcome(values, bounds, held)


def _truth(plan: Plan) -> dict[str, float]:
    values = plan.loop.parameters
    slow = values.get("lag", 0.0)
    return values | {"delay+lag": values["delay"] + slow}


def _summed_up(plan: Plan, outcomes: list[_Outcome]) -> MonteCarlo:
    told = [outcome for outcome in outcomes if not outcome.refusal]
    reasons = Counter(_without_numbers(outcome.refusal) for outcome in outcomes if outcome.refusal)
    if not told:
        raise NotIdentifiableError(
            f"all {len(outcomes)} flights were refused, most of them because "
            f"{reasons.most_common(1)[0][0]}"
        )
    everything = _truth(plan)
    truth = {name: everything[name] for name in told[0].values}
    estimates = {name: np.array([one.values[name] for one in told]) for name in truth}
    errors = {name: estimates[name] - truth[name] for name in truth}
    return MonteCarlo(
        method=plan.method,
        runs=len(outcomes),
        truth=truth,
        estimates=estimates,
        rmse={name: float(np.sqrt(np.mean(error**2))) for name, error in errors.items()},
        bias={name: float(np.mean(error)) for name, error in errors.items()},
        mean_bound={
            name: float(np.mean([one.bounds[name] for one in told])) for name in told[0].bounds
        },
        level=plan.level,
        coverage={name: float(np.mean([one.held[name] for one in told])) for name in told[0].held},
        failures=dict(reasons.most_common()),
    )


def _without_numbers(reason: str) -> str:
    """Reasons that differ in their numbers only are one."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "…", reason)


@contextmanager
def _reporting(progress: bool | Report, count: int) -> Iterator[Report]:
    """What to call with the numbers of flights done and of all flights."""
    if callable(progress):
        yield progress
        return
    if not progress:
        yield lambda done, total: None
        return
    try:
        from rich.progress import Progress
    except ImportError as error:
        raise ImportError(
            "a progress bar needs rich: install it with pip install 'deadtime[cli]', or give a "
            "function as progress"
        ) from error
    with Progress(transient=True) as bar:
        task = bar.add_task("flights", total=count)
        yield lambda done, total: bar.update(task, completed=done)
