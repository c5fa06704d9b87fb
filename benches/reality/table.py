"""Estimate on recordings of every condition, and print errors and coverage beside the demands."""

from __future__ import annotations

import json
import math
import signal
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import deadtime as dtm
import numpy as np

from reality.bound import bounds
from reality.conditions import ANSWER, CONDITIONS, LIMIT, MAY_REFUSE, SAMPLE, WITH_LAG, Condition
from reality.generator import Array, Run, record

#: Of which there are intervals; the sum is that of the delay and all lags.
QUANTITIES = ("delay", "gain", "sum")

#: Demands, in per cent. Fewer reliable results than FEWEST have no coverage.
COVERED, RELIABLE, REFUSED, FEWEST = (93.0, 97.5), 90.0, 95.0, 20

NOT_IDENTIFIABLE, BAD_RECORDING, FAILED, ANSWERED = "not", "recording", "failed", "answered"


class Outcome(NamedTuple):
    """One estimate. Errors are of delay, gain, delay + lag; bounds of delay and delay + lag."""

    status: str
    reliable: bool
    errors: tuple[float, ...]
    held: tuple[bool, ...]
    bounds: tuple[float, float]
    seconds: float
    message: str = ""


def recording_of(condition: Condition, run: Run) -> dtm.Recording:
    """What the log holds."""
    rows = run.logged
    command = run.command[rows] if condition.command_logged else None
    return dtm.Recording(run.stamps[rows], run.reference[rows], run.measured[rows], command)


def given_loop(condition: Condition, run: Run, free: tuple[str, ...]) -> dtm.ControlLoop:
    """What the estimator is told."""
    return dtm.ControlLoop(
        dtm.Integrator(1.0, lag=0.1 if "lag" in free else 0.0),
        dtm.P(run.vehicle.Kp),
        sample_time=SAMPLE if condition.sample_time_told else None,
        limit=LIMIT,
    )


def estimated(condition: Condition, number: int, free: tuple[str, ...]) -> Outcome:
    """Make one recording, estimate, and compare with the truth."""
    run = record(condition, number)
    bound = bounds(condition, run, free)
    loop = given_loop(condition, run, free)
    nothing = ((math.nan,) * 3, (False,) * 3, bound)
    begin = time.process_time()
    try:
        fit = dtm.estimate_delay(recording_of(condition, run), loop, free=free)
        # Without a lag among the fitted parameters, the sum is the delay.
        names = ["delay", "gain", "delay+lag" if "delay+lag" in fit.stderr else "delay"]
        intervals = [fit.ci(0.95, name) for name in names] if fit.calibrated else []
    except dtm.NotIdentifiableError as error:
        return Outcome(NOT_IDENTIFIABLE, False, *nothing, math.nan, str(error))
    except dtm.RecordingError as error:
        return Outcome(BAD_RECORDING, False, *nothing, math.nan, str(error))
    except (dtm.DeadtimeError, ValueError, ArithmeticError) as error:
        return Outcome(FAILED, False, *nothing, math.nan, f"{type(error).__name__}: {error}")
    seconds = time.process_time() - begin
    vehicle = run.vehicle
    truth = (vehicle.delay, vehicle.gain, vehicle.delay + sum(vehicle.lags))
    values = (fit.delay, fit.gain, fit.delay_plus_lag)
    errors = tuple(value - true for value, true in zip(values, truth, strict=True))
    ends = intervals or [(math.nan, math.nan)] * 3
    held = [
        low - 1e-9 <= true <= high + 1e-9 for (low, high), true in zip(ends, truth, strict=True)
    ]
    return Outcome(ANSWERED, fit.verdict == "reliable", errors, tuple(held), bound, seconds)


def outcomes(condition: Condition, numbers: range, free: tuple[str, ...]) -> list[Outcome]:
    """Estimates of these runs; this runs in other processes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about feedback, in every run
        return [estimated(condition, number, free) for number in numbers]


def summary(condition: Condition, found: Sequence[Outcome]) -> dict[str, Any]:
    """The numbers of a row: shares in per cent, times in ms; NaN where there is nothing."""
    runs = len(found)
    status = Counter(one.status for one in found)
    answered = [one for one in found if one.status == ANSWERED]
    reliable = [one for one in answered if one.reliable]
    row: dict[str, Any] = {
        "name": condition.name,
        "runs": runs,
        "reliable": 100.0 * len(reliable) / runs,
        "not_identifiable": 100.0 * status[NOT_IDENTIFIABLE] / runs,
        "bad_recording": 100.0 * status[BAD_RECORDING] / runs,
        "failed": 100.0 * status[FAILED] / runs,
        "milliseconds": 1e3 * float(np.median([one.seconds for one in answered] or [math.nan])),
        "messages": sorted({one.message for one in found if one.status == FAILED}),
    }
    for group, some in (("reliable", reliable), ("all", answered)):
        errors = 1e3 * np.array([one.errors for one in some]).reshape(-1, 3)
        bound = 1e3 * np.array([one.bounds for one in some]).reshape(-1, 2)
        held = np.array([one.held for one in some]).reshape(-1, 3)
        row[group + "_bias"] = mean(errors[:, 0])
        for name, error, least in (
            ("delay", errors[:, 0], bound[:, 0]),
            ("sum", errors[:, 2], bound[:, 1]),
        ):
            rmse, limit = (math.sqrt(mean(one**2)) for one in (error, least))
            row |= {f"{group}_rmse_{name}": rmse, f"{group}_bound_{name}": limit}
            row[f"{group}_ratio_{name}"] = rmse / limit
        few = len(some) < (FEWEST if group == "reliable" else 1)
        for name, share in zip(QUANTITIES, held.T, strict=True):
            row[f"{group}_covers_{name}"] = math.nan if few else 100.0 * mean(share)
    row["met"], row["missed"] = verdict(condition, row)
    return row


def mean(values: Array) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def verdict(condition: Condition, row: dict[str, Any]) -> tuple[list[str], list[str]]:
    """The demands that the row meets, and those that it misses.

    A row that may be refused is, where it is, held to nothing else.
    """
    answers = row["reliable"]
    if condition.demand == MAY_REFUSE and 100.0 - answers - row["failed"] >= REFUSED:
        return ["refused or not reliable"], []
    demands = {}
    if condition.demand in (ANSWER, MAY_REFUSE):
        demands["reliable"] = answers >= RELIABLE
    for name in QUANTITIES:
        demands[name] = COVERED[0] <= row["reliable_covers_" + name] <= COVERED[1]
    if not math.isnan(row["all_bound_delay"]):
        demands["error"] = row["reliable_ratio_delay"] <= condition.error
    if row["failed"]:
        demands["no failure"] = False
    return [name for name, holds in demands.items() if holds], [
        name for name, holds in demands.items() if not holds
    ]


#: Groups of columns by title: title, key of the row, width and digits of each.
COLUMNS = {
    "": [("reliable", "reliable", 10, 0)],
    "refused:": [("no fit", "not_identifiable", 9, 0), ("bad log", "bad_recording", 8, 0)],
    " ": [("failed", "failed", 7, 0)],
    "reliable: delay, ms": [
        ("bias", "reliable_bias", 9, 1),
        ("RMSE", "reliable_rmse_delay", 7, 1),
        ("bound", "reliable_bound_delay", 7, 1),
        ("ratio", "reliable_ratio_delay", 7, 2),
    ],
    "sum, ms": [("RMSE", "reliable_rmse_sum", 9, 1), ("ratio", "reliable_ratio_sum", 7, 2)],
    "covered, %": [(name, "reliable_covers_" + name, 7, 0) for name in QUANTITIES],
    "all: delay, ms": [("bias", "all_bias", 9, 1), ("RMSE", "all_rmse_delay", 7, 1)],
    " covered, %": [(name, "all_covers_" + name, 7, 0) for name in QUANTITIES],
    "  ": [("ms", "milliseconds", 8, 1)],
}


#: Groups of columns: title, key, width and digits of each.
Columns: TypeAlias = Mapping[str, Sequence[tuple[str, str, int, int]]]


def titles(columns: Columns, first: str, wide: int) -> str:
    """Two lines: the groups, and the columns behind one of this width."""
    groups = "".join(f"{title:>{sum(c[2] for c in some)}}" for title, some in columns.items())
    names = "".join(f"{c[0]:>{c[2]}}" for some in columns.values() for c in some)
    return f"{first:{wide}}{groups}\n{'':{wide}}{names}"


def cells(columns: Columns, row: Mapping[str, Any]) -> str:
    """The numbers of a row; a dash where there is none."""
    each = (column for some in columns.values() for column in some)
    return "".join(
        f"{'-':>{wide}}" if math.isnan(row[key]) else f"{row[key]:>{wide}.{digits}f}"
        for _, key, wide, digits in each
    )


def header() -> str:
    """Two lines: the groups, and the columns."""
    return f"{titles(COLUMNS, 'shares in %', 24)}  demands"


def line(row: dict[str, Any]) -> str:
    """A row of the table."""
    text = f"{row['name']:24}{cells(COLUMNS, row)}"
    missed = "; misses " + ", ".join(row["missed"]) if row["missed"] else ""
    return f"{text}  {', '.join(row['met']) or 'meets none'}{missed}"


def chosen(names: Iterable[str]) -> list[Condition]:
    """The conditions of these names; all for none.

    Raises
    ------
    ValueError
        If a name is not in the table.
    """
    known = {condition.name: condition for condition in CONDITIONS}
    for name in names:
        if name not in known:
            raise ValueError(f"no row {name!r}: there are {', '.join(known)}")
    return [known[name] for name in names] or CONDITIONS


def free_of(text: str) -> tuple[str, ...]:
    """Free parameters from their names with commas between.

    Raises
    ------
    ValueError
        If they are not delay and gain, with or without the lag.
    """
    free = tuple(text.split(","))
    if free not in (WITH_LAG, WITH_LAG[:2]):
        raise ValueError(f"free={text!r} must be delay,gain or delay,gain,lag")
    return free


def print_table(
    conditions: list[Condition],
    runs: int,
    free: tuple[str, ...] | None,
    processes: int,
    file: Path | None,
) -> None:
    """Measure and print, in batches on all processes; write the numbers of the rows to `file`."""
    batch = max(1, min(10, runs // (2 * processes)))
    pool = pool_of(processes)
    rows = []
    print(header())
    begin = time.perf_counter()
    try:
        waiting = [
            [
                pool.submit(outcomes, each, range(i, min(i + batch, runs)), free or each.free)
                for i in range(0, runs, batch)
            ]
            for each in conditions
        ]
        for condition, parts in zip(conditions, waiting, strict=True):
            rows.append(summary(condition, collected(condition, parts)))
            print(line(rows[-1]), flush=True)
            for message in rows[-1]["messages"]:
                print(f"    {message}")
        missed = sum(bool(row["missed"]) for row in rows)
        print(
            f"{runs} runs a row, {time.perf_counter() - begin:.0f} s; {missed} rows miss a demand"
        )
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    finally:
        pool.shutdown(cancel_futures=True)
        if file is not None:
            file.write_text(json.dumps(without_nan(rows), indent=1) + "\n", encoding="utf-8")


def pool_of(processes: int) -> ProcessPoolExecutor:
    """Processes that leave an interrupt to this one."""
    return ProcessPoolExecutor(
        processes,
        get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )


def collected(condition: Condition, parts: list[Future[list[Outcome]]]) -> list[Outcome]:
    """Results of all parts, with the progress on a terminal."""
    found: list[Outcome] = []
    for i, part in enumerate(parts):
        if sys.stderr.isatty():
            print(f"\r{condition.name}: {i}/{len(parts)}\x1b[K\r", end="", file=sys.stderr)
        found += part.result()
    return found


def without_nan(value: Any) -> Any:
    """The same with None for NaN, which JSON does not have."""
    if isinstance(value, dict):
        return {name: without_nan(one) for name, one in value.items()}
    if isinstance(value, list):
        return [without_nan(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value
