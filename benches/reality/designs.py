"""Gains designed from estimates: the margin of the true loop beside the one that was demanded.

For each flight with a reliable estimate a P controller is designed for the joint region of the
estimate, with a gain margin of `DEMANDED`. The gain margin of a P loop falls as its gain grows, so
the sharpest gain, with which the worst loop of the region has exactly the demanded margin, follows
from the designed one. Both are tried on the true loop.
"""

from __future__ import annotations

import math
import time
import warnings
from typing import NamedTuple

import deadtime as dtm

from reality.conditions import CONDITIONS, SAMPLE
from reality.generator import record
from reality.table import given_loop, pool_of, recording_of

#: The gain margin that is asked for, and the rows of the table.
DEMANDED = 2.5
ROWS = ("hole of 1 s", "air 0.02", "lag free gust 0.05 1 s")

#: Share of the true loops that must have the demanded margin, in per cent.
MET = 95.0


class Designed(NamedTuple):
    """Gain margins of the true loop, and the sharpest gain over that for exact knowledge.

    NaN where `design` found no gains.
    """

    margin: float
    sharpest: float
    share: float


def gain_margin(loop: dtm.ControlLoop) -> float:
    """The gain margin; zero of an unstable loop."""
    # The delay margin takes a hundred times as long.
    return loop._margin(delay_margin=False).gain_margin if loop.is_stable() else 0.0


def designed(name: str, number: int) -> Designed | None:
    """One flight, its estimate, the gain, and the true loop; None where it is not reliable."""
    condition = next(one for one in CONDITIONS if one.name == name)
    run = record(condition, number)
    given = given_loop(condition, run, condition.free)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about feedback, in every run
        try:
            fit = dtm.estimate_delay(recording_of(condition, run), given, free=condition.free)
        except (dtm.NotIdentifiableError, dtm.RecordingError):
            return None
        if fit.verdict != "reliable":
            return None
        try:
            best = dtm.design(
                fit, controller=dtm.P(1.0), gain_margin=DEMANDED, objective="abscissa"
            )
        except ValueError:
            return Designed(math.nan, math.nan, math.nan)
    vehicle = run.vehicle
    plant = dtm.Integrator(vehicle.gain, lag=sum(vehicle.lags))
    true = dtm.ControlLoop(plant, best.loop.controller, delay=vehicle.delay, sample_time=SAMPLE)
    margin = gain_margin(true)
    least = min(gain_margin(best.loop.replace(limit=None, **one)) for one in best.region.points)
    return Designed(margin, margin * DEMANDED / least, least / margin if margin else math.inf)


def tried(name: str, numbers: range) -> list[Designed | None]:
    """Designs for these flights; this runs in other processes."""
    return [designed(name, number) for number in numbers]


def print_designs(runs: int, processes: int, rows: int | None) -> None:
    """Design for flights of the first `rows`, or of all, and print how the true loops do."""
    print(
        f"{'gain margin of 2.5':24}{'reliable':>9}{'no gains':>9}{'met, %':>8}{'unstable':>10}"
        f"{'sharpest: met, %':>18}{'unstable':>10}{'least':>8}{'of the gain, %':>16}"
    )
    begin = time.perf_counter()
    batch = max(1, min(10, runs // (2 * processes)))
    pool = pool_of(processes)
    try:
        waiting = {
            name: [
                pool.submit(tried, name, range(i, min(i + batch, runs)))
                for i in range(0, runs, batch)
            ]
            for name in ROWS[:rows]
        }
        for name, parts in waiting.items():
            found = [one for part in parts for one in part.result() if one is not None]
            print(line(name, found), flush=True)
    finally:
        pool.shutdown(cancel_futures=True)
    print(f"{runs} flights a row, {time.perf_counter() - begin:.0f} s")


def line(name: str, found: list[Designed]) -> str:
    """A row of the table."""
    text = f"{name:24}{len(found):>9}{sum(math.isnan(one.margin) for one in found):>9}"
    found = [one for one in found if not math.isnan(one.margin)]
    if not found:
        return text
    for margins, wide in (
        ([one.margin for one in found], 8),
        ([one.sharpest for one in found], 18),
    ):
        met = 100.0 * sum(margin >= DEMANDED for margin in margins) / len(margins)
        text += f"{met:>{wide}.0f}{sum(margin <= 1.0 for margin in margins):>10}"
    used = 100.0 * math.fsum(one.share for one in found) / len(found)
    least = min(one.sharpest for one in found)
    met = 100.0 * sum(one.sharpest >= DEMANDED for one in found) / len(found)
    return f"{text}{least:>8.2f}{used:>16.0f}  {'met' if met >= MET else 'missed'}"
