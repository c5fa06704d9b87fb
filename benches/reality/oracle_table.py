"""The package beside the oracle, on the same runs."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality.bound import is_defined
from reality.conditions import Condition
from reality.generator import Array
from reality.oracle import OracleRun, oracle_estimate
from reality.table import ANSWERED, Outcome, estimated, mean, pool_of


class Compared(NamedTuple):
    """Estimates of one run by the package and by the oracle."""

    ours: Outcome
    oracle: OracleRun


def compared(condition: Condition, numbers: range, unknown: bool) -> list[Compared]:
    """Estimates of these runs; this runs in other processes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about feedback, in every run
        return [
            Compared(
                estimated(condition, number, condition.free),
                oracle_estimate(condition, number, unknown),
            )
            for number in numbers
        ]


def line(name: str, found: Sequence[Compared]) -> str:
    """A row of the table: errors of the delay over the bound, and covered shares in per cent."""
    reliable = [one for one in found if one.ours.status == ANSWERED and one.ours.reliable]
    least = np.array([one.oracle.bounds[0] for one in found])
    text = f"{name:24}{ratio([one.oracle.errors[0] for one in found], least):10.2f}"
    for share in np.transpose([one.oracle.held for one in found]):
        text += f"{100.0 * mean(share):7.0f}"
    least = np.array([one.oracle.bounds[0] for one in reliable])
    best = np.array([one.oracle.errors[0] for one in reliable])
    ours = [one.ours.errors[0] for one in reliable]
    return text + (
        f"{100.0 * len(reliable) / len(found):12.0f}{ratio(best, least):12.2f}"
        f"{ratio(ours, least):8.2f}{ratio(ours, best):15.2f}"
    )


def ratio(errors: Sequence[float] | Array, least: Array) -> float:
    """Root mean square of errors over that of others."""
    return math.sqrt(mean(np.square(errors)) / mean(np.square(least)))


def print_oracle(conditions: list[Condition], runs: int, unknown: bool, processes: int) -> None:
    """Measure the rows that have a bound, and print them."""
    batch = max(1, min(10, runs // (2 * processes)))
    pool = pool_of(processes)
    print(f"{'errors over the bound':24}{'oracle':>10}   covers, %: {'reliable: ':>30}ours over")
    titles = "".join(f"{name:>7}" for name in ("delay", "gain", "sum"))
    print(f"{'':34}{titles}{'share, %':>12}{'oracle':>12}{'ours':>8}{'that of oracle':>15}")
    begin = time.perf_counter()
    try:
        waiting = [
            (
                each.name,
                [
                    pool.submit(compared, each, range(i, min(i + batch, runs)), unknown)
                    for i in range(0, runs, batch)
                ],
            )
            for each in conditions
            if is_defined(each, each.free)
        ]
        for name, parts in waiting:
            print(line(name, [one for part in parts for one in part.result()]), flush=True)
        print(f"{runs} runs a row, {time.perf_counter() - begin:.0f} s")
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    finally:
        pool.shutdown(cancel_futures=True)
