"""Estimate on logs of rate loops, and print bias, spread and coverage beside the bounds."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import chain
from multiprocessing import get_context
from typing import NamedTuple

import deadtime as dtm
import numpy as np
from deadtime.estimation import OutputError

from rate_loops.bound import covariance, deviation_of, deviation_of_sum
from rate_loops.field_tools import (
    Measured,
    correlation_lag,
    step_crossing,
    true_crossing,
    true_lag,
)
from rate_loops.generator import SAMPLE, Array, Log, Vehicle, low_pass, record

#: What the loop is guessed to be before the estimate: motor lag, s, and gain.
GUESS = 0.05, 50.0

#: The low-passes of the gyro by their order.
FILTERS = {1: "first-order low-pass", 2: "second-order low-pass"}


class Outcome(NamedTuple):
    """One answer: its error and the least standard deviation, s."""

    error: float
    bound: float
    held: bool
    reliable: bool
    seconds: float


#: Ours, and two of the field.
OURS, STEP, CORRELATION = (
    "output_error: delay + lag",
    "deconvolved step response: 50 % time",
    "masked cross-correlation: lag of peak",
)


def ours(log: Log, bound: float) -> Outcome:
    """The sum of delay and motor lag; the low-pass of the gyro is told, and that torques drift."""
    begin = time.process_time()
    lag, gain = GUESS
    loop = dtm.ControlLoop(dtm.Integrator(gain, lag), dtm.P(1.0), sample_time=SAMPLE)
    recording = dtm.Recording(log.time, log.setpoint, log.response, log.actuator)
    method = OutputError(output_filter=low_pass(log.vehicle.order), air="vehicle")
    fit = dtm.estimate_delay(recording, loop, method=method, free=["delay", "gain", "lag"])
    low, high = fit.ci(0.95, "delay+lag") if fit.calibrated else (math.nan, math.nan)
    seconds = time.process_time() - begin
    truth = log.vehicle.delay + log.vehicle.lag
    return Outcome(
        fit.delay_plus_lag - truth, bound, low <= truth <= high, fit.verdict == "reliable", seconds
    )


def theirs(
    log: Log,
    tool: Callable[[Array, Array], Measured],
    truth: Callable[[Vehicle], float],
    covered: Array,
) -> Outcome:
    """What a tool of the field measures, beside the true value of just that."""
    begin = time.process_time()
    found = tool(log.setpoint, log.response)
    seconds = time.process_time() - begin
    error = found.value - truth(log.vehicle)
    held = abs(error) <= found.half
    return Outcome(error, deviation_of(truth, log.vehicle, covered), held, True, seconds)


def outcome(log: Log, name: str, covered: Array) -> Outcome | None:
    """None where there is no answer."""
    try:
        if name == OURS:
            found = ours(log, deviation_of_sum(covered))
        elif name == STEP:
            found = theirs(log, step_crossing, true_crossing, covered)
        else:
            of_setpoint = lambda vehicle: true_lag(vehicle, log.setpoint)  # noqa: E731
            found = theirs(log, correlation_lag, of_setpoint, covered)
    except (dtm.DeadtimeError, ValueError, ArithmeticError):
        return None
    return found if math.isfinite(found.error) else None


def outcomes(
    order: int, numbers: Sequence[int], names: Sequence[str]
) -> list[list[Outcome | None]]:
    """Answers of all methods on each of these runs; this runs in other processes."""
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about feedback, in every run
        for number in numbers:
            log = record(order, number)
            covered = covariance(log)
            found.append([outcome(log, name, covered) for name in names])
    return found


HEADER = (
    f"{'':42}{'bias':>7}{'spread':>8}{'RMSE':>7}{'bound':>7}{'RMSE':>8}{'covered':>9}"
    f"{'reliable':>10}{'none':>6}{'time':>7}\n"
    f"{'':42}{'ms':>7}{'ms':>8}{'ms':>7}{'ms':>7}{'/bound':>8}{'%':>9}{'%':>10}{'%':>6}{'s':>7}"
)


def line(name: str, found: Sequence[Outcome | None]) -> str:
    """A row of the table; errors and coverage are those of the reliable answers."""
    answered = [one for one in found if one is not None]
    reliable = [one for one in answered if one.reliable]
    errors = 1e3 * np.array([one.error for one in reliable])
    bounds = 1e3 * np.array([one.bound for one in reliable])
    shares = [len(reliable) / len(found), 1.0 - len(answered) / len(found)]
    seconds = float(np.median([one.seconds for one in answered])) if answered else math.nan
    if not reliable:
        numbers = [math.nan] * 6
    else:
        rmse, bound = (float(np.sqrt(np.mean(one**2))) for one in (errors, bounds))
        spread = float(np.std(errors))
        held = 100.0 * float(np.mean([one.held for one in reliable]))
        numbers = [float(np.mean(errors)), spread, rmse, bound, rmse / bound, held]
    values = [*numbers, *(100.0 * share for share in shares), seconds]
    formats = ("7.2f", "8.2f", "7.2f", "7.2f", "8.2f", "9.1f", "10.0f", "6.0f", "7.2f")
    cells = (
        f"{'-':>{int(form.split('.')[0])}}" if math.isnan(value) else f"{value:{form}}"
        for value, form in zip(values, formats, strict=True)
    )
    return f"  {name:40}{''.join(cells)}"


def print_rates(runs: int, processes: int, text: str = "") -> None:
    """Measure and print the methods whose name contains `text`."""
    names = [name for name in (OURS, STEP, CORRELATION) if text in name]
    print(HEADER)
    begin = time.perf_counter()
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for order, title in FILTERS.items():
            parts = [pool.submit(outcomes, order, [number], names) for number in range(runs)]
            rows = list(chain.from_iterable(part.result() for part in parts))
            print(title)
            for name, column in zip(names, zip(*rows, strict=True), strict=True):
                print(line(name, column), flush=True)
    print(f"{runs} runs each, {time.perf_counter() - begin:.0f} s")
