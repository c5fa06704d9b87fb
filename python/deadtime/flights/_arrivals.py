"""When commands took effect, by the setpoints that the vehicle echoes.

On a link that scatters, each command has a delay of its own. A step under P control is mostly told
by its first command, so that an estimate from the times at which commands were sent is that of the
delays of few commands, and misses their mean by about their scatter, whatever its interval.

The vehicle stamps the setpoints that it reports. Command k took effect at a_k, between the stamp of
the report that first has its value and the stamp before; the middle is taken. Where outputs are
rounded, several reports have the value of a command: the one is meant whose a_k - t_k is next to
the median of those of the commands that one report has. A command that no report has was lost, or
replaced at once: a_k is then when the next one took effect. With the mean m of a_k - t_k over all
commands, sent at t_k, an estimate from the times

    t_k + (a_k - t_k - m)

is one of m: each command is counted from when it would have been sent on a link whose delay is
always m. The mean of n commands has the standard error of one divided by the root of n: 1.5 ms for
270 commands that scatter by 25 ms. A command that repeats the one before, or was lost, counts with
the value that was followed then: no gap in the commands stands for any that are not known.

A middle is wrong by up to half of the time g between reports, with the variance g²/12. Of the
deviations from their mean, whose variance is v, only the share 1 - g²/(12 v) is therefore applied
(their linear regression on what was measured): none on a link that is more even than reports are.
The variance r = (1 - g²/(12 v)) g²/12 of each time is left. Command k changes the output by its
change c_k times the error of its time, so that the delay is the mean of those of the commands with
the weights c_k² (least squares), and its variance grows by r (sum c_k⁴) / (sum c_k²)².
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Relative difference up to which a reported setpoint is a command: autopilots convert these, in
#: numbers of single precision, to other units and back. Commands in noise differ by far more.
SAME = 5e-7

#: Longest time from a command to its effect, s, and the least share of commands that is found.
LONGEST, FOUND = 2.0, 0.5

#: Fewest commands whose value is reported once: they tell which of several reports is meant, one at
#: most so many of their median deviations from their median.
FEWEST, FARTHEST = 10, 6.0


class Effects(NamedTuple):
    """Commands, and when they took effect; one without an effect repeats the one before.

    Attributes
    ----------
    time : ndarray, shape (n,)
        When each was sent, or would have been on a link of constant delay, s.
    values : ndarray, shape (n,)
    error : float
        Standard deviation of these times, s.
    """

    time: Array
    values: Array
    error: float = 0.0


def as_they_took_effect(sent: Effects, report: Array, setpoint: Array) -> Effects:
    """The commands that took effect, at their times on a link of constant delay.

    Parameters
    ----------
    sent : Effects
        All commands, when they were sent.
    report : ndarray, shape (n,)
        Times of the reports of the vehicle by its stamps, s on the clock of `sent`, up to a
        constant.
    setpoint : ndarray, shape (n,)
        The setpoints that they report.

    Returns
    -------
    Effects
        Those of `sent`, where too few of them are reported.
    """
    report, first = np.unique(report, return_index=True)
    setpoint = setpoint[first]
    new = np.flatnonzero(np.diff(setpoint) != 0.0) + 1
    changed = np.append(True, np.diff(sent.values) != 0.0)
    time, values = sent.time[changed], sent.values[changed]
    if new.size == 0 or time.size < 2:
        return sent
    between = report[new] - report[new - 1]
    middle = report[new] - 0.5 * between
    late = middle - time[:, None]
    fits = np.abs(setpoint[new] - values[:, None]) <= SAME * np.abs(values)[:, None]
    fits &= (late > -between) & (late < LONGEST)
    found, alone = fits.any(axis=1), fits.sum(axis=1) == 1
    if np.mean(found) < FOUND or np.sum(alone) < FEWEST:
        return sent
    known = late[alone][fits[alone]]
    usual = float(np.median(known))
    away = np.where(fits, np.abs(late - usual), np.inf)
    place = away.argmin(axis=1)
    # The report of one whose value comes again may be missing.
    reach = FARTHEST * float(np.median(np.abs(known - usual))) + 2.0 * float(np.median(between))
    found &= alone | (away.min(axis=1) <= reach)
    # A lost command waits for the next one that is found.
    effect = np.where(found, middle[place], np.inf)
    effect = np.minimum.accumulate(effect[::-1])[::-1]
    effective = np.isfinite(effect)
    delay = effect[effective] - time[effective]
    kept = delay[found[effective]]
    variance = float(np.var(kept))
    square = float(np.mean(between[place[found]] ** 2)) / 12.0
    share = max(0.0, 1.0 - square / variance) if variance > 0.0 else 0.0
    moved = time[found] + kept.mean() - delay.mean() + share * (kept - kept.mean())
    order = np.argsort(moved, kind="stable")
    moved, values = moved[order], values[found][order]
    last = np.append(np.diff(moved) > 0.0, True)
    moved, values = moved[last], values[last]
    others = np.delete(sent.time, np.flatnonzero(changed)[found]) + kept.mean() - delay.mean()
    others = np.setdiff1d(others[others > moved[0]], moved)
    held = values[np.searchsorted(moved, others) - 1]
    every, first = np.unique(np.concatenate([moved, others]), return_index=True)
    return Effects(every, np.concatenate([values, held])[first], math.sqrt(share * square))


def error_of_mean(flights: Sequence[Effects]) -> float:
    """Standard deviation of an estimate of the delay by what the times leave open, s."""
    squares = [np.diff(flight.values) ** 2 for flight in flights]
    total = sum(float(np.sum(square)) for square in squares)
    if total == 0.0:
        return 0.0
    found = sum(
        flight.error**2 * float(np.sum(square**2))
        for flight, square in zip(flights, squares, strict=True)
    )
    return math.sqrt(found) / total
