"""Delay estimation: the error of every method beside the Cramér-Rao bound, coverage, and time.

For the first table, each case is simulated `--runs` times, each time with different noise, and the
delay is estimated by every method. The table has the root-mean-square errors in ms, the known
errors of a correct implementation over 200 runs with its own noise, and the ratio to the bound.
Steps begin after a second at rest. The output at the start is given to the methods that can use it,
and to the bound. `arx_scan` is the method of MATLAB's `delayest`, refined between samples. It and
`gcc` take the place of peers, because no other package estimates a delay inside a loop with an
interval.

The other tables have the systematic error of the map from overshoot to delay by one pair of roots,
the share of `--coverage-runs` intervals that contain the true value, and the time of an estimate
with its intervals.

Run ``python benches/estimation.py [--runs N] [--coverage-runs N] [--case TEXT] [--method TEXT]
[--quick]``. It uses as many processes as there are processors.

Run ``python benches/estimation.py --reality [--runs N] [--rows NAME,NAME] [--free delay,gain]
[--json FILE] [--quick]`` for another table: estimates with the default method on recordings with
air, lost rows, wrong clocks and other properties of real flights, from a generator that does not
use the package (`reality`).

Run ``python benches/estimation.py --reality --oracle [--unknown-noise] [--runs N]
[--rows NAME,NAME] [--quick]`` for the rows that have a bound: estimates by one who knows the
process that made them, beside ours on the same runs (`reality.oracle`).

Run ``python benches/estimation.py --reality --detectable [--runs N] [--rows NAME,NAME] [--quick]``
for the share of recordings with lost commands, a changing delay or a lag left out that the best
test of all could tell from good ones (`reality.detection`).

Run ``python benches/estimation.py --designs [--runs N] [--quick]`` to design gains from such
estimates, 200 a row, and to print the gain margin of the true loop beside the demanded one.

Run ``python benches/estimation.py --firmware [--keep DIR | --read DIR] [--quick]`` to fly
ArduPilot's Copter in its software-in-the-loop build, and to estimate on these flights
(`reality.firmware`). The flights take 15 minutes at the speed of the clock; `--keep` keeps their
recordings and `--read` estimates on them again. With ``--drawn N [--seed SEED]`` commands wait for
drawn times, and the estimates are from the log of the vehicle (`reality.drawn`).

Run ``python benches/estimation.py --rates [--runs N] [--method TEXT] [--quick]`` to estimate on
simulated rate loops of multirotors at 1 kHz, beside the deconvolved step response and the masked
cross-correlation of the field's tools (`rate_loops`).

Run ``python benches/estimation.py --strangers [--runs N] [--rows TEXT,TEXT] [--seed S]
[--json FILE] [--quick]`` to estimate on plants and faults that the estimator does not know. Faults
are in two sizes, which move an answer by 1 and 5 standard errors, and the truth is a range
(`strangers`). The lot that chose the faults has the seed 20261203. With ``--oracle`` the widths are
those of fits that know the noise, without faults (`strangers.oracle`).

Run ``python benches/estimation.py --gains [--runs N] [--seed S] [--quick]`` to propose gains from
500 bump tests, PI loops and height steps in wind with small faults, and to print stability and
largest sensitivity of the true loops (`strangers.gains`). With ``--margins`` P, PI and PV have a
demanded gain margin, from 2000 records of all plants with small faults (`strangers.margins`).

The other tables are in folders of their own; the first ones are one file, because cases, methods
and what each method is given are read together, and the command line that chooses between all.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import deadtime as dtm
import numpy as np
from deadtime.estimation import ARXScan, Method, OutputError, Overshoot, Waveform
from deadtime.estimation._estimate import METHODS
from rate_loops.table import print_rates
from reality import drawn, firmware
from reality.designs import print_designs
from reality.detection import print_powers
from reality.oracle_table import print_oracle
from reality.table import chosen, free_of, print_table
from strangers import rows as strangers
from strangers.gains import print_gains
from strangers.margins import print_margins
from strangers.oracle import print_strangers_oracle
from strangers.table import print_strangers

SAMPLE = 0.065
REST = 16 * SAMPLE
LAST = 5.0

#: The level of the intervals. Two thousand runs distinguish coverages that differ by 1 %.
LEVEL = 0.95


@dataclass(frozen=True)
class Case:
    """A loop, the experiment that is run on it, and the known errors, in ms by column."""

    name: str
    loop: dtm.ControlLoop
    experiment: dtm.Experiment
    noise: float
    known: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ("delay",)
    assumed: Mapping[str, Any] = field(default_factory=dict)
    sensor: bool = True

    @property
    def noise_in_loop(self) -> bool:
        """Whether the controller reads the noise, as it does with sensor noise in sampled loops."""
        return self.sensor and self.loop.is_sampled

    def given(self) -> dtm.ControlLoop:
        """The loop that the estimators are given."""
        return self.loop.replace(delay=None, **self.assumed)


@dataclass(frozen=True)
class Column:
    """A method with its options."""

    name: str
    method: Method
    continuous: bool = False
    start_known: bool = True


class Tally(NamedTuple):
    """Errors by quantity in s or the gain's unit, intervals with the true value, refused runs."""

    errors: dict[str, list[float]]
    held: dict[str, int]
    refused: int


COLUMNS = [
    Column("output_error", OutputError()),
    Column("waveform", Waveform()),
    Column("wave, no hold", Waveform(), continuous=True),
    Column("frequency", METHODS["frequency"]()),
    Column("arx_scan", ARXScan(fractional=True)),
    Column("gcc", METHODS["gcc"]()),
    Column("Mo exact", Overshoot(map="exact")),
    Column("Mo paper", Overshoot(map="dominant")),
    Column("Mo saturated", Overshoot(map="saturated")),
    Column("decrement", METHODS["decrement"]()),
    Column("decay", METHODS["decay"]()),
    Column("grid", METHODS["grid"]()),
    Column("cta", METHODS["cta"]()),
    Column("graphical", METHODS["graphical"]()),
    Column("relay", METHODS["relay"]()),
]
NOTED = ["bound", *(column.name for column in COLUMNS[:8])]


def loop(
    Kp: float = 1.31,
    delay: float = 0.36,
    lag: float = 0.0,
    sample_time: float | None = SAMPLE,
    limit: float | None = 1.0,
) -> dtm.ControlLoop:
    plant = dtm.Integrator(lag=lag)
    return dtm.ControlLoop(plant, dtm.P(Kp), delay=delay, sample_time=sample_time, limit=limit)


def step(sample_time: float = SAMPLE) -> dtm.Experiment:
    return dtm.Experiment.step(REST + LAST, sample_time=sample_time, rest=REST)


def noted(*errors: float | None) -> dict[str, float]:
    """Known errors in ms: the bound, then the first columns."""
    return {name: e for name, e in zip(NOTED, errors, strict=False) if e is not None}


def cases() -> list[Case]:
    free, fine = loop(sample_time=None, limit=None), step(0.01)
    plain = step()
    lagging = loop(delay=0.30, lag=0.06)
    return [
        Case(
            "continuous 10 ms 1 %",
            free,
            fine,
            0.01,
            noted(0.88, 1.50, 0.90, 0.90, 4.8, 29.5, 10.6, 27.3, 29.0),
        ),
        Case(
            "continuous 10 ms 1 % Kp 3",
            free.replace(Kp=3.0),
            fine,
            0.01,
            noted(0.16, 2.6, 0.14, 0.14, 3.8, 6.2, 3.5, 4.6, 16.0),
        ),
        Case(
            "continuous limit 0.3 %",
            loop(sample_time=None),
            plain,
            0.003,
            noted(0.77, 5.3, 0.72, 0.72, 13.4, 4.3, 7.1, 4.9, 4.1),
        ),
        Case(
            "held limit 0.3 %",
            loop(),
            plain,
            0.003,
            noted(0.81, 0.81, 0.84, 9.7, 1.7, 3.8, 10.2, 22.1, 23.7),
        ),
        Case(
            "held limit 1 %",
            loop(),
            plain,
            0.01,
            noted(2.70, 2.70, 2.80, 10.2, 5.7, 15.9, 16.5, 32.8, 34.7),
        ),
        Case(
            "held limit 3 %",
            loop(),
            plain,
            0.03,
            noted(8.10, 8.05, 8.39, 13.3, 17.2, 90.0, 45.0, 70.0, 73.0),
        ),
        Case(
            "held limit 1 % Kp 3",
            loop(3.0),
            plain,
            0.01,
            noted(2.09, 2.10, 2.74, 22.8, 3.4, 12.2, 11.0, 118.0, 115.0),
        ),
        Case(
            "held 1 % Kp 3",
            loop(3.0, limit=None),
            plain,
            0.01,
            noted(0.94, 0.93, 1.04, 25.4, 1.1, 3.8, 4.2, 31.7, 45.5),
        ),
        Case(
            "held limit 1 % Kp 0.8",
            loop(0.8),
            plain,
            0.01,
            noted(3.44, 3.55, 3.70, 9.1, 9.1, 22.1, 21.4, 202.0, 203.0),
        ),
        Case(
            "held 10 ms limit 1 % Kp 4 Td 0.05",
            loop(4.0, delay=0.05, sample_time=0.01),
            fine,
            0.01,
            noted(1.05, 1.05, 1.06, 1.08, 5.4, None, None, 70.0, 71.0),
        ),
        Case(
            "lag 60 ms ignored",
            lagging,
            plain,
            0.01,
            noted(2.76, 59.5, 59.7, 69.0, 59.8, 52.8, 61.0, 93.0, 95.0),
            assumed={"lag": 0.0},
        ),
        Case(
            "lag 60 ms fitted",
            lagging,
            plain,
            0.01,
            noted(18.3, 20.3, 21.3),
            free=("delay", "gain", "lag"),
            assumed={"lag": 0.0},
        ),
        Case("PRBS 20 s held limit 1 %", loop(), dtm.Experiment.prbs(20.0, 0.4, 0.4), 0.01),
        Case(
            "multisine 4 x 5.2 s held limit 1 %",
            loop(),
            dtm.Experiment.multisine(0.4, 80 * SAMPLE, 12, 4, odd=True),
            0.01,
        ),
        Case("relay 0.5 m/s 10 s held 1 %", loop(), dtm.Experiment.relay(10.0, 0.5), 0.01),
    ]


def tally(
    case: Case, column: Column, seeds: range, intervals: bool = False, level: float = LEVEL
) -> Tally:
    """Simulate the case with these seeds and estimate; this runs in other processes."""
    errors: dict[str, list[float]] = {}
    held: dict[str, int] = {}
    refused = 0
    truth = dict(case.loop.parameters)
    truth["delay+lag"] = truth["delay"] + truth["lag"]
    given = case.given()
    method = column.method
    if column.start_known and "delay" in case.free and hasattr(method, "initial_output"):
        method = replace(method, initial_output=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about feedback, in every run
        for seed in seeds:
            recording = case.experiment.run(case.loop, case.noise, seed, case.noise_in_loop)
            try:
                fit = dtm.estimate_delay(
                    recording,
                    given.continuous() if column.continuous else given,
                    method=method,
                    free=case.free,
                )
            except (dtm.DeadtimeError, ValueError):
                refused += 1
                continue
            values = {**fit.loop.parameters, "delay+lag": fit.delay_plus_lag}
            for name in fit.stderr:
                errors.setdefault(name, []).append(values[name] - truth[name])
                if intervals:
                    low, high = fit.ci(level, name)
                    holds = low - 1e-9 <= truth[name] <= high + 1e-9
                    held[name] = held.get(name, 0) + int(holds)
    return Tally(errors, held, refused)


def shared(
    pool: Executor, work: Iterable[tuple[Case, Column]], runs: int, intervals: bool = False
) -> Iterator[Tally]:
    """`tally` of every pair, in batches on all processes, in the order they were given."""
    batch = max(1, min(25, runs // (2 * (os.cpu_count() or 1))))
    waiting = [
        [
            pool.submit(tally, case, column, range(i, min(i + batch, runs)), intervals)
            for i in range(0, runs, batch)
        ]
        for case, column in work
    ]
    return (joined([part.result() for part in parts]) for parts in waiting)


def joined(parts: list[Tally]) -> Tally:
    errors: dict[str, list[float]] = {}
    held: dict[str, int] = {}
    for part in parts:
        for name, some in part.errors.items():
            errors.setdefault(name, []).extend(some)
        for name, count in part.held.items():
            held[name] = held.get(name, 0) + count
    return Tally(errors, held, sum(part.refused for part in parts))


def bound_ms(case: Case) -> float:
    plan = dtm.identifiability(
        case.loop, case.experiment, noise=case.noise, free=case.free, initial_output=0.0
    )
    return 1e3 * plan.stderr["delay"]


def errors_of_methods(pool: Executor, chosen: list[Case], columns: list[Column], runs: int) -> None:
    """Print a block of lines for each case: errors, known errors, ratio to the bound."""
    wide = 14
    print(
        f"{'RMSE of the delay, ms':36}{'bound':>9}", *(f"{c.name:>{wide}}" for c in columns), sep=""
    )
    tallies = shared(pool, [(case, column) for case in chosen for column in columns], runs)
    for case in chosen:
        bound = bound_ms(case)
        lines = {"": f"{bound:9.2f}", "known": "", "to the bound": f"{'':9}", "refused": f"{'':9}"}
        lines["known"] = f"{case.known.get('bound', math.nan):9.2f}" if case.known else f"{'':9}"
        for column in columns:
            found = next(tallies)
            delays = found.errors.get("delay", [])
            rmse = 1e3 * math.sqrt(np.mean(np.square(delays))) if delays else math.nan
            lines[""] += cell(rmse, wide)
            lines["known"] += cell(case.known.get(column.name, math.nan), wide)
            lines["to the bound"] += cell(rmse / bound, wide)
            lines["refused"] += f"{found.refused or '':>{wide}}"
        if not case.known:
            del lines["known"]
        if not lines["refused"].strip():
            del lines["refused"]
        for label, text in lines.items():
            print(f"{case.name if not label else '    ' + label:36}{text}", flush=True)


def cell(value: float, wide: int) -> str:
    return f"{'-':>{wide}}" if math.isnan(value) else f"{value:>{wide}.2f}"


def error_of_the_map() -> None:
    """The error of the map by one pair of roots, without any noise."""
    known = [0.06, 0.22, 0.31, 0.43, 0.89, 1.36, 1.86, 2.36, 2.83, 3.61, 4.35, math.nan]
    gains = [0.40, 0.45, 0.4714, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.5 + 1e-9]
    print(
        f"\n{'Kp Td':>8}{'exact Mo %':>12}{'paper: error of Td %':>22}{'known':>8}{'exact map':>11}"
    )
    for x, expected in zip(gains, known, strict=True):
        known_loop = loop(Kp=x, delay=1.0, sample_time=None, limit=None)
        recording = dtm.Experiment.step(31.0, sample_time=0.005, rest=1.0).run(known_loop)
        row = f"{x:8.4f}{100.0 * (recording.output.max() - 1.0):12.2f}"
        for way, wide in (("dominant", 22), ("exact", 19)):
            try:
                fit = dtm.estimate_delay(
                    recording,
                    known_loop.replace(delay=None),
                    method=Overshoot(map=way),
                    free=("delay",),
                )
                row += f"{100.0 * (fit.delay - 1.0):>+{wide}.3f}"
            except dtm.NotIdentifiableError:
                row += f"{'no solution':>{wide}}"
            if way == "dominant":
                row += f"{'none' if math.isnan(expected) else format(expected, '+.2f'):>8}"
                wide = 11
        print(row)


def coverage(pool: Executor, runs: int, text: str) -> None:
    """The share of intervals that contain the true value."""
    plain = step()
    rows = [
        ("delay", Case("", loop(), plain, 0.01), Column("", OutputError())),
        (
            "delay, gain",
            Case("", loop(), plain, 0.01, free=("delay", "gain")),
            Column("", OutputError(), start_known=False),
        ),
        (
            "delay, gain, lag of 60 ms",
            Case("", loop(delay=0.3, lag=0.06), plain, 0.01, free=("delay", "gain", "lag")),
            Column("", OutputError(), start_known=False),
        ),
        (
            "delay, gain, lag of zero",
            Case("", loop(), plain, 0.01, free=("delay", "gain", "lag")),
            Column("", OutputError(), start_known=False),
        ),
        *(
            (
                f"noise in the {where}, assumed: {assumed}",
                Case("", loop(Kp), plain, 0.01, free=("delay", "gain"), sensor=where == "loop"),
                Column("", Waveform(noise=assumed)),
            )
            for where, Kp, assumed in (
                ("log", 1.31, "recording"),
                ("log", 1.31, "auto"),
                ("loop", 3.0, "loop"),
                ("loop", 3.0, "auto"),
            )
        ),
    ]
    print(f"\n{'coverage of 95 % intervals':44}{'runs':>6}{'refused':>9}")
    for label, case, column in rows:
        if text not in column.method.name:
            continue
        found = next(shared(pool, [(case, column)], runs, intervals=True))
        answered = runs - found.refused
        shares = "  ".join(f"{n} {100 * held / answered:.1f} %" for n, held in found.held.items())
        print(f"{column.method.name + ', ' + label:44}{runs:6d}{found.refused:9d}  {shares}")


def times(columns: list[Column], repetitions: int, most: int) -> None:
    """One estimate of 308 samples with its intervals, and one profile, in this process."""
    print(f"\n{'ms for 308 samples':36}{'estimate, intervals':>20}{'profile':>10}")
    experiment = dtm.Experiment.prbs(20.0, 0.4, 0.4)
    for free in (("delay",), ("delay", "gain"), ("delay", "gain", "lag"))[:most]:
        known_loop = loop(lag=0.06 if "lag" in free else 0.0)
        recording = experiment.run(known_loop, 0.01, seed=1)
        for column in columns:
            try:
                durations = [timed(recording, known_loop, column, free) for _ in range(repetitions)]
            except (dtm.DeadtimeError, ValueError):
                continue
            estimate, profile = (statistics.median(each) for each in zip(*durations, strict=True))
            shown = f"{profile:10.1f}" if profile else f"{'-':>10}"
            print(f"{column.name + ': ' + ', '.join(free):36}{estimate:20.1f}{shown}")


def timed(
    recording: dtm.Recording, known_loop: dtm.ControlLoop, column: Column, free: tuple[str, ...]
) -> tuple[float, float]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        begin = time.perf_counter()
        fit = dtm.estimate_delay(
            recording, known_loop.replace(delay=None), method=column.method, free=free
        )
        if fit.calibrated:
            for name in fit.stderr:
                fit.ci(LEVEL, name)
        middle = time.perf_counter()
        if fit._profile is None:
            return 1e3 * (middle - begin), 0.0
        fit.profile()
        return 1e3 * (middle - begin), 1e3 * (time.perf_counter() - middle)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--runs", type=int, help="runs of each case and method, 200, or of each row, 1000; 0: none"
    )
    parser.add_argument(
        "--coverage-runs", type=int, default=2000, help="runs of each coverage; 0: none"
    )
    parser.add_argument("--case", default="", help="only cases whose name contains this text")
    parser.add_argument("--method", default="", help="only methods whose name contains this text")
    parser.add_argument("--quick", action="store_true", help="one run of some cases")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    reality = parser.add_argument_group("recordings like those of real flights")
    reality.add_argument("--reality", action="store_true", help="print their table alone")
    reality.add_argument("--oracle", action="store_true", help="compare with an oracle instead")
    reality.add_argument("--detectable", action="store_true", help="which faults can be found")
    reality.add_argument(
        "--unknown-noise", action="store_true", help="the oracle does not know the sizes of noise"
    )
    reality.add_argument("--rows", default="", help="only the rows of these names")
    reality.add_argument("--free", help="fit in every row: delay,gain or delay,gain,lag")
    reality.add_argument("--json", type=Path, help="write the numbers of the rows to this file")
    reality.add_argument("--designs", action="store_true", help="print gains designed from them")
    rates = parser.add_argument_group("rate loops of multirotors")
    rates.add_argument("--rates", action="store_true", help="print their table alone")
    strange = parser.add_argument_group("plants and faults that the estimator does not know")
    strange.add_argument("--strangers", action="store_true", help="print their table alone")
    strange.add_argument("--gains", action="store_true", help="print gains proposed from some")
    strange.add_argument("--margins", action="store_true", help="print the margins of designs")
    flown = parser.add_argument_group("flights against ArduPilot's Copter")
    flown.add_argument("--firmware", action="store_true", help="fly, and print their table alone")
    flown.add_argument(
        "--drawn",
        type=int,
        metavar="N",
        help="N flights of each kind, whose commands wait for drawn times",
    )
    flown.add_argument(
        "--seed",
        type=int,
        help="of the drawn times, by default of the clock; of the runs of strangers, 0",
    )
    flown.add_argument("--keep", type=Path, metavar="DIR", help="keep the recordings in a folder")
    flown.add_argument("--read", type=Path, metavar="DIR", help="read the recordings, do not fly")
    given = parser.parse_args()
    # Each worker simulates its own runs; threads of NumPy's libraries would compete with them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if given.firmware and given.drawn:
        drawn.run(given.read, given.keep, given.processes, given.drawn, given.seed)
        return
    if given.firmware:
        firmware.run(given.read, given.keep, given.processes, given.quick)
        return
    if given.designs:
        print_designs(
            given.runs or (1 if given.quick else 200), given.processes, 2 if given.quick else None
        )
        return
    if given.rates:
        print_rates(given.runs or (2 if given.quick else 1000), given.processes, given.method)
        return
    if given.gains:
        print_gains(given.runs or (2 if given.quick else 500), given.seed or 0, given.processes)
        return
    if given.margins:
        print_margins(given.runs or (20 if given.quick else 2000), given.seed or 0, given.processes)
        return
    if given.strangers:
        try:
            rows = strangers.chosen(given.rows.split(",") if given.rows else [])
        except ValueError as error:
            parser.error(str(error))
        runs = given.runs or (2 if given.quick else None)
        if given.oracle:
            kinds = [row.kind for row in rows if row.fault is None]
            print_strangers_oracle(kinds, runs or 100, given.seed or 0, given.processes)
            return
        print_strangers(rows, runs, given.seed or 0, given.processes, given.json)
        return
    if given.reality:
        runs = given.runs or (2 if given.quick else 300 if given.oracle else 1000)
        try:
            conditions = chosen(given.rows.split(",") if given.rows else [])
            free = free_of(given.free) if given.free else None
        except ValueError as error:
            parser.error(str(error))
        if given.detectable:
            print_powers(conditions, min(runs, 200), given.processes)
            return
        if given.oracle:
            print_oracle(conditions, runs, given.unknown_noise, given.processes)
            return
        print_table(conditions, runs, free, given.processes, given.json)
        return
    compare_methods(given)


def compare_methods(given: argparse.Namespace) -> None:
    """Print the tables of all methods."""
    picked = [case for case in cases() if given.case in case.name]
    columns = [c for c in COLUMNS if given.method in f"{c.method.name} {c.name}"]
    runs = 200 if given.runs is None else given.runs
    covering, repetitions = given.coverage_runs, 11
    if given.quick:
        runs, covering, repetitions, picked = 1, 2, 1, picked[4:5] + picked[-3:]
    with ProcessPoolExecutor(given.processes, get_context("spawn")) as pool:
        begin = time.perf_counter()
        if runs:
            errors_of_methods(pool, picked, columns, runs)
            print(f"{runs} runs a cell, {time.perf_counter() - begin:.0f} s")
        if not given.case:
            error_of_the_map()
            if covering:
                coverage(pool, covering, given.method)
            times(columns, repetitions, 1 if given.quick else 3)


if __name__ == "__main__":
    main()
