"""Gains for a loop with a delay: the best ones on the map, made good by a local search."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import minimize

from deadtime._controllers import PV, Controller, P
from deadtime._loop import ControlLoop
from deadtime._stability import StabilityMap, stability_map

__all__ = ["Design", "critical_gain", "design"]

Objective = Literal["abscissa", "settling_time"]

#: How many cells of the map are simulated when the objective is the settling time.
SIMULATED_CELLS = 150

#: A step response that has not settled by then has not settled at all, in units of 1/|abscissa|.
HORIZON = 12.0

#: Output times of a simulation that looks for the settling time.
SETTLING_POINTS = 800

#: The band the search keeps to. It is narrower than the 2 % that are promised, because the best
#: settling time is had by a peak that just touches the band, which the next rounding would break.
SEARCH_BAND = 0.018

#: What a loop costs that does not settle, so that the search turns away from it, s.
NEVER = 1e6


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """Gains, and the loop that has them.

    Attributes
    ----------
    loop : ControlLoop
        The loop with the gains, at the middle of the delay's interval.
    gains : dict of str to float
        The gains.
    abscissa : float
        Spectral abscissa with these gains, 1/s, the largest over the interval of the delay;
        negative: stable.
    delays : tuple of float
        The delays the gains were judged at, s.
    objective : str
        What was made small.
    value : float
        What it came out at: 1/s or s.
    charts : tuple of StabilityMap
        The map the search began from, one for each delay.
    """

    loop: ControlLoop
    gains: dict[str, float]
    abscissa: float
    delays: tuple[float, ...]
    objective: Objective
    value: float
    charts: tuple[StabilityMap, ...]

    def __repr__(self) -> str:
        kind = type(self.loop.controller).__name__
        gains = ", ".join(f"{name} = {gain:.4g}" for name, gain in self.gains.items())
        late = " to ".join(f"{end:g}" for end in dict.fromkeys((self.delays[0], self.delays[-1])))
        return (
            f"<Design {kind}, {gains}: spectral abscissa {self.abscissa:.4g} 1/s at a delay of "
            f"{late} s>"
        )


def design(
    loop: ControlLoop,
    *,
    controller: type[Controller] | Controller = PV,
    delay: float | tuple[float, float] | None = None,
    objective: Objective = "abscissa",
    ranges: Mapping[str, tuple[float, float]] | None = None,
    shape: tuple[int, int] = (61, 61),
    threads: int | None = None,
) -> Design:
    """Find gains for a loop.

    Parameters
    ----------
    loop : ControlLoop
        Plant, delay, hold and limit; its controller is replaced.
    controller : Controller or class of one
        A class of controllers with two gains (`PV`, `PD`, `PI`), or an instance whose other
        numbers, such as the filter of its derivative, are to be kept.
    delay : float or (float, float), optional
        The delay, s, or the interval it lies in; every gain is then judged by the worst of the
        two ends and the middle. The loop's own delay if not given.
    objective : {"abscissa", "settling_time"}
        Make the spectral abscissa smallest (the most stable gains), or the 2 % settling time
        of the response to a unit step, limit included.
    ranges : mapping of str to (float, float), optional
        Where to look for each gain; from the stability limit under proportional control if not
        given.
    shape : (int, int)
        Cells of the map that the search starts from.
    threads : int, optional
        Number of threads; all cores if not given.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        When the delay is not known, the controller has not two gains, or no gains in the ranges
        are stable.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
    >>> best = dtm.design(loop, ranges={"Kp": (1.0, 4.0), "Kv": (0.0, 0.9)}, shape=(25, 25))
    >>> best.abscissa < -3.6
    True
    """
    delays = _delays(loop, delay)
    template = _template(controller)
    template_loop = loop.replace(controller=template, delay=delays[len(delays) // 2])
    names = tuple(template.gains)
    if len(names) != 2:
        raise ValueError(
            f"{type(template).__name__} has {len(names)} gains ({', '.join(names)}): the map is "
            "over two; take PV, PD or PI"
        )
    if objective not in ("abscissa", "settling_time"):
        raise ValueError(f"objective={objective!r} is not 'abscissa' or 'settling_time'")
    spans = dict(ranges) if ranges is not None else _ranges(template_loop, names)
    if set(spans) != set(names):
        raise ValueError(f"ranges are for {sorted(spans)}, the gains are {sorted(names)}")
    charts = tuple(
        stability_map(
            template_loop.replace(delay=late),
            {name: spans[name] for name in names},
            shape=shape,
            threads=threads,
        )
        for late in delays
    )
    worst = np.max([chart.abscissa for chart in charts], axis=0)
    stable = np.all([chart.stable for chart in charts], axis=0)
    worst = np.where(stable, worst, np.inf)
    if not np.any(stable):
        tried = ", ".join(f"{name} in {spans[name]}" for name in names)
        raise ValueError(
            f"no gains in {tried} are stable for a delay of {' or '.join(f'{d:g}' for d in delays)}"
            " s: widen or move the ranges"
        )
    axes = [charts[0].axes[name] for name in names]

    def loops(gains: np.ndarray) -> list[ControlLoop]:
        values = dict(zip(names, (float(gain) for gain in gains), strict=True))
        return [template_loop.replace(**values, delay=late) for late in delays]

    def abscissa(gains: np.ndarray) -> float:
        return max(one.spectral_abscissa() for one in loops(gains))

    def settling(gains: np.ndarray) -> float:
        return max(_settling_time(one, SEARCH_BAND) for one in loops(gains))

    def promised(gains: np.ndarray) -> float:
        return max(_settling_time(one, 0.02) for one in loops(gains))

    cost = abscissa if objective == "abscissa" else settling
    start = _start(worst, axes, cost if objective == "settling_time" else None)
    gains = _refine(cost, start, axes)
    values = dict(zip(names, (float(gain) for gain in gains), strict=True))
    return Design(
        loop=template_loop.replace(**values),
        gains=values,
        abscissa=abscissa(gains),
        delays=delays,
        objective=objective,
        value=abscissa(gains) if objective == "abscissa" else promised(gains),
        charts=charts,
    )


def _template(controller: type[Controller] | Controller) -> Controller:
    """A controller of the wanted class; its gains are replaced throughout."""
    if isinstance(controller, Controller):
        return controller
    if isinstance(controller, type) and issubclass(controller, Controller):
        names = inspect.signature(controller).parameters
        return controller(**{name: 1.0 for name in names if name.startswith("K")})
    raise TypeError(
        f"controller={controller!r} is no controller: give PV, PD or PI, or one of them"
    )


def _delays(loop: ControlLoop, delay: float | tuple[float, float] | None) -> tuple[float, ...]:
    if delay is None:
        if loop.delay is None:
            raise ValueError("the delay of the loop is not known: give delay=, or estimate it")
        return (loop.delay,)
    if isinstance(delay, (int, float)):
        return (float(delay),)
    low, high = (float(end) for end in delay)
    if not 0.0 <= low <= high:
        raise ValueError(f"delay={delay!r} is not an interval (low, high) of times >= 0")
    return (low, 0.5 * (low + high), high) if low < high else (low,)


def _ranges(loop: ControlLoop, names: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """Ranges around what proportional control bears: the second gain through time constants."""
    critical = critical_gain(loop)
    if not np.isfinite(critical):
        raise ValueError("no proportional gain makes this loop unstable: give ranges=")
    late = (loop.delay or 0.0) + loop.parameters.get("lag", 0.0) + 0.5 * (loop.sample_time or 0.0)
    if names[1] == "Ki":
        second = (0.0, 0.5 * critical / max(late, 1e-9))
    else:
        second = (-0.1 * critical * late, critical * late)
    return {names[0]: (0.02 * critical, 1.25 * critical), names[1]: second}


def critical_gain(loop: ControlLoop) -> float:
    """Proportional gain at which a loop loses stability, infinite where none is found.

    From a gain that is stable, found by halving, one walk upwards covers three decades; a few
    walks cover all that has a meaning.
    """
    gain = 1.0
    for _ in range(60):
        if loop.replace(controller=P(gain)).is_stable():
            break
        gain *= 0.5
    else:
        raise ValueError("no proportional gain stabilises this loop: give ranges= and a controller")
    for _ in range(4):
        edge = loop.replace(controller=P(gain)).stable_range("Kp")[1]
        if np.isfinite(edge):
            return float(edge)
        gain *= 500.0
    return float("inf")


def _settling_time(loop: ControlLoop, band: float) -> float:
    """Time from which the response to a unit step stays within `band` of 1."""
    abscissa = loop.spectral_abscissa()
    if not abscissa < 0.0:
        return NEVER
    end = (loop.delay or 0.0) + HORIZON / -abscissa
    if end > 1e4 * max(loop.delay or 0.0, 1e-3):
        return NEVER
    time = np.linspace(0.0, end, SETTLING_POINTS)
    outputs = loop.simulate(time).outputs
    outside = np.flatnonzero(np.abs(outputs - 1.0) > band)
    if outside.size and outside[-1] == time.size - 1:
        return NEVER
    return float(time[outside[-1] + 1]) if outside.size else 0.0


def _start(
    worst: np.ndarray, axes: list[np.ndarray], cost: Callable[[np.ndarray], float] | None
) -> np.ndarray:
    """The best cell of the map; by simulation where the objective is not on the map."""
    order = np.argsort(worst, axis=None, kind="stable")
    order = order[np.isfinite(worst.ravel()[order])]
    cells = [
        np.array(
            [axis[i] for axis, i in zip(axes, np.unravel_index(flat, worst.shape), strict=True)]
        )
        for flat in (order[:1] if cost is None else order[:: max(1, order.size // SIMULATED_CELLS)])
    ]
    return cells[0] if cost is None else min(cells, key=cost)


def _refine(
    cost: Callable[[np.ndarray], float], start: np.ndarray, axes: list[np.ndarray]
) -> np.ndarray:
    """Nelder and Mead's search: both objectives have kinks where roots or peaks change places."""
    spacing = np.array([abs(axis[-1] - axis[0]) / (axis.size - 1) for axis in axes])
    simplex = start + np.vstack([np.zeros(2), np.diag(0.5 * spacing)])
    bounds = [(float(min(axis)), float(max(axis))) for axis in axes]
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        bounds=bounds,
        options={
            "initial_simplex": np.clip(simplex, *np.array(bounds).T),
            "xatol": 1e-4 * float(spacing.min()),
            "fatol": 1e-6,
            "maxfev": 200,
        },
    )
    return np.asarray(found.x if found.fun <= cost(start) else start, dtype=np.float64)
