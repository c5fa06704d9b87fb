"""The effect of a hold and a lag on the time scale of the Internet loop (Figure 2).

The paper finds simulated and measured responses alike, but on different time scales. A loop of an
integrator, a gain K and a delay Td alone has one time, Td: the overshoot determines K Td, so at
equal K and equal overshoot its time scale is fixed. A hold Ts or a lag of the plant adds a second
time constant, and with it another time scale at the same overshoot:

* `stretch`: ratio of first peak and period with a given hold or lag to those with the delay alone,
at
  the same K and overshoot.
* `explain`: fit of delay and hold, or delay and lag, the same for all gains, to all overshoots of
  Table 1, which a delay alone does not explain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import deadtime as dtm
from deadtime.paper.table1 import PRINTED_OVERSHOOTS

#: Step of the tried delays, and the longest of them, s.
DELAY_STEP, LONGEST_DELAY = 5e-4, 0.14

#: Simulated time, s: the first peak of a stable loop, within 0.6 s, is the highest.
WATCHED = 1.5


@dataclass(frozen=True)
class Stretch:
    """A loop with a hold or a lag, compared with a delay alone of the same overshoot.

    Attributes
    ----------
    gain : float
        K of both, 1/s.
    overshoot : float
        Of both, percent.
    hold, lag : float
        Of the first, s.
    delay : float
        Of the first, s.
    delay_alone : float
        Of the second, s.
    peak_time, period : float
        Of the first: time of the first peak, period of the dominant roots, s.
    peak_ratio, period_ratio : float
        The same over those of the second.
    """

    gain: float
    overshoot: float
    hold: float
    lag: float
    delay: float
    delay_alone: float
    peak_time: float
    period: float
    peak_ratio: float
    period_ratio: float


def stretch(
    gain: float, overshoot: float, *, hold: float = 0.0, lag: float = 0.0
) -> Stretch | None:
    """Stretch of the response by a hold or a lag, at the same gain and overshoot.

    Parameters
    ----------
    gain : float
        K, 1/s.
    overshoot : float
        Percent.
    hold : float
        Time for which a command holds, s; 0 for none.
    lag : float
        Lag of the plant, s.

    Returns
    -------
    Stretch or None
        None where the hold or lag alone has a larger overshoot.

    Examples
    --------
    >>> from deadtime import paper
    >>> held, lagging = paper.stretch(8.0, 31.5, hold=0.1), paper.stretch(8.0, 31.5, lag=0.1)
    >>> round(held.period_ratio, 2), round(lagging.period_ratio, 2)
    (1.11, 1.47)
    """
    found = _with_overshoot(gain, overshoot, hold, lag)
    return None if found is None else time_scale(found)


def time_scale(loop: dtm.ControlLoop) -> Stretch:
    """Compare a loop with a delay alone of the same gain and overshoot.

    Parameters
    ----------
    loop : ControlLoop
        An integrator under proportional control that overshoots.

    Returns
    -------
    Stretch

    Raises
    ------
    ValueError
        If no delay alone gives the integrator this overshoot.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime import paper
    >>> loop = dtm.ControlLoop(dtm.Integrator(lag=0.1), dtm.P(Kp=8.0), delay=0.05)
    >>> round(paper.time_scale(loop).peak_ratio, 2)
    1.3
    """
    numbers = loop.parameters
    gain = numbers["Kp"] * numbers["gain"]
    overshoot, peak_time = _measured(loop)
    alone = _with_overshoot(gain, overshoot, 0.0, 0.0)
    if alone is None:
        raise ValueError(
            f"with K={gain:g}, no delay alone gives an overshoot of {overshoot:.3g} %: give an "
            "overshoot between 0 and 100 %"
        )
    period = _period(loop)
    return Stretch(
        gain=gain,
        overshoot=overshoot,
        hold=numbers.get("sample_time", 0.0),
        lag=numbers["lag"],
        delay=numbers["delay"],
        delay_alone=alone.parameters["delay"],
        peak_time=peak_time,
        period=period,
        peak_ratio=peak_time / _measured(alone)[1],
        period_ratio=period / _period(alone),
    )


def _with_overshoot(
    gain: float, overshoot: float, hold: float, lag: float
) -> dtm.ControlLoop | None:
    """The loop with a delay that gives it this overshoot, if there is one."""
    from scipy.optimize import brentq

    loop = dtm.ControlLoop(
        dtm.Integrator(lag=lag), dtm.P(Kp=gain), delay=0.1, sample_time=hold or None
    )

    def excess(delay: float) -> float:
        return _measured(loop.replace(delay=delay))[0] - overshoot

    # With a hold the overshoot is not smooth, and several delays may give it: of a scan, the first
    # delay that overshoots by more is the upper end.
    delays = np.linspace(1e-3, 1.6 / gain, 30)
    above = next((i for i, delay in enumerate(delays) if excess(float(delay)) > 0.0), None)
    if not above:
        return None
    found = brentq(excess, float(delays[above - 1]), float(delays[above]), xtol=1e-9)
    return loop.replace(delay=float(found))


def _measured(loop: dtm.ControlLoop) -> tuple[float, float]:
    """Overshoot in percent and time of the peak."""
    info = loop.simulate(np.linspace(0.0, WATCHED, 301)).info()
    return info["overshoot"], info["peak_time"]


def _period(loop: dtm.ControlLoop) -> float:
    """Period of the oscillation of the dominant roots."""
    return 2.0 * math.pi / abs(complex(loop.rightmost().roots[0]).imag)


@dataclass(frozen=True, eq=False)
class Explanation:
    """Delay and a hold or lag, the same for all gains, fitted to the overshoots of Table 1.

    Attributes
    ----------
    name : {"hold", "lag"}
        The other time.
    hold : float
        A given hold, s; 0 for none.
    values : ndarray, shape (n,)
        Holds or lags tried, s; the first is 0.
    delays : ndarray, shape (n,)
        The best delay for each, s.
    misfits : ndarray, shape (n,)
        Root of the mean square of the six differences of overshoot, in percent of the step.
    overshoots : ndarray, shape (n, 6)
        Overshoots for the gains from 5 to 10, percent.
    """

    name: str
    hold: float
    values: NDArray[np.float64]
    delays: NDArray[np.float64]
    misfits: NDArray[np.float64]
    overshoots: NDArray[np.float64]

    @property
    def words(self) -> str:
        """The fitted quantities, in words."""
        held = f", a hold of {1e3 * self.hold:.0f} ms" if self.hold else ""
        return f"delay{held} and {self.name}"

    @property
    def best(self) -> int:
        """Row of the smallest misfit."""
        return int(np.argmin(self.misfits))


def explain(name: str, values: NDArray[np.float64], *, hold: float = 0.0) -> Explanation:
    """Fit a delay to the overshoots of Table 1 for each of several holds or lags.

    Parameters
    ----------
    name : {"hold", "lag"}
        The second quantity.
    values : ndarray
        Its values above zero, s; zero is tried too.
    hold : float
        A hold beside a lag, s; 0 for none.

    Returns
    -------
    Explanation

    Raises
    ------
    ValueError
        If `name` is neither, or two holds are given.

    Examples
    --------
    >>> import numpy as np
    >>> from deadtime import paper
    >>> found = paper.explain("hold", np.array([0.1, 0.17]))
    >>> [f"{delay:.3f} {misfit:.1f}" for delay, misfit in zip(found.delays, found.misfits)]
    ['0.109 8.5', '0.060 8.6', '0.011 4.2']
    """
    gains = np.array(list(PRINTED_OVERSHOOTS), dtype=float)
    measured = np.array(list(PRINTED_OVERSHOOTS.values()))
    delays = np.arange(DELAY_STEP, LONGEST_DELAY, DELAY_STEP)
    if name not in ("hold", "lag") or (name == "hold" and hold):
        raise ValueError(
            f"name={name!r}, hold={hold}: give a hold, or a lag with or without a hold"
        )
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.0), delay=0.1, sample_time=hold or None)
    tried = np.concatenate([[0.0], np.asarray(values, dtype=float)])
    best_delays, misfits, overshoots = [], [], []
    for value in tried.tolist():
        sets = {"delay": delays[:, None], "Kp": gains[None, :]}
        if value > 0.0:
            sets["sample_time" if name == "hold" else "lag"] = np.full((1, 1), value)
        found = dtm.sweep(loop, sets, WATCHED)["overshoot"]
        # Diverged responses fit no overshoot.
        misfit = np.sqrt(np.mean((np.nan_to_num(found, nan=1e3) - measured) ** 2, axis=1))
        row = int(np.argmin(misfit))
        best_delays.append(delays[row])
        misfits.append(misfit[row])
        overshoots.append(found[row])
    return Explanation(
        name, hold, tried, np.array(best_delays), np.array(misfits), np.array(overshoots)
    )
