"""Step responses of many loops at once, one for each set of numbers: their metrics or outputs.

The kernel takes the numbers of all sets and simulates them. Over a quarter of the file is
documentation, and the sets and their results are used nowhere else: one file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.progress import Progress, Report, reported
from deadtime._base.validation import (
    finite,
    given_points,
    increasing,
    is_range,
    positive,
    real_array,
    thread_number,
)
from deadtime.loops._control_loop import ControlLoop
from deadtime.loops._load_response import DeviationQuestion, load_of
from deadtime.loops._native import Loop, sweep_deviations
from deadtime.loops._specification import refuse_discretised

#: Metrics of a step response, in the order of the native part.
_METRICS = (
    "rise_time",
    "settling_time",
    "peak_time",
    "overshoot",
    "undershoot",
    "settling_min",
    "settling_max",
    "peak",
    "steady_state",
)


#: Figures of the deviation after a step of the reference, and their rows in the native part.
_STEP_FIGURES = {"iae": 2}

#: The same after a step of a load.
_LOAD_FIGURES = {
    "load_peak": 0,
    "load_peak_time": 1,
    "load_iae": 2,
    "load_ie": 3,
    "load_recovery_time": 4,
}


class SweepStatus(IntEnum):
    """Outcome of one set of a `Sweep`."""

    OK = 0
    """Simulated to the end; if metrics were requested, the response has settled."""
    UNSETTLED = 1
    """Outside its settling band at the end, or inside it, with its command within the limit, for
    less than three of the slowest time constants of the closed loop: the settling time is NaN, and
    so is the rise time if the output did not rise through the step. An unstable loop with a bounded
    output is among these."""
    DIVERGED = 2
    """The response or its command exceeded 1e150 before the end: all values are NaN."""
    REFUSED = 3
    """Not simulated, because a loop with these numbers cannot be simulated or would take far too
    much work: all values are NaN."""


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(ReadOnlyArrays):
    """Responses of many loops, or their metrics; made by `sweep`.

    Attributes
    ----------
    values : dict of str to ndarray
        The numbers that vary, as arrays that broadcast to `shape`.
    shape : tuple of int
        Shape of the sets.
    time : ndarray, shape (n,)
        Output times, or the first and last time of the measured interval, in s.
    status : ndarray of uint8, shape `shape`
        `SweepStatus` of each set.
    metrics : dict of str to ndarray, each of shape `shape`
        The metrics of `Response.info`; empty if outputs were requested.
    outputs : ndarray, shape (..., n), or None
        Outputs, time on the last axis, if they were requested.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36, sample_time=0.065)
    >>> found = dtm.sweep(loop, {"Kp": np.array([1.0, 2.0, 9.0])}, 20.0)
    >>> found
    <Sweep: 3 sets over Kp, 1 unsettled>
    >>> found["overshoot"][:2].round(2)
    array([ 0.03, 28.74])
    """

    values: dict[str, Array]
    shape: tuple[int, ...]
    time: Array
    status: NDArray[np.uint8]
    metrics: dict[str, Array]
    outputs: Array | None = None

    def __repr__(self) -> str:
        sets = "x".join(map(str, self.shape)) or "1"
        counts = [
            f"{int(np.count_nonzero(self.status == status))} {status.name.lower()}"
            for status in SweepStatus
            if status and np.any(self.status == status)
        ]
        names = ", ".join(self.values)
        return f"<Sweep: {', '.join([f'{sets} sets over {names}', *counts])}>"

    def __getitem__(self, name: str) -> Array:
        try:
            return self.metrics[name]
        except KeyError:
            raise KeyError(
                f"{name!r} is not in this sweep, which contains "
                f"{', '.join(self.metrics) or 'outputs, no metrics'}"
            ) from None

    def best(self, metric: str = "settling_time") -> dict[str, float]:
        """Return the numbers of the set whose metric is smallest.

        Parameters
        ----------
        metric : str
            Name of a metric.

        Returns
        -------
        dict of str to float

        Raises
        ------
        KeyError
            If there is no such metric.
        ValueError
            If the metric is NaN for every set.
        """
        measured = self[metric]
        if not np.isfinite(measured).any():
            raise ValueError(
                f"no set of parameters has a {metric}: give a longer time, or change the ranges"
            )
        place = np.unravel_index(np.nanargmin(measured), self.shape)
        return {
            name: float(np.broadcast_to(array, self.shape)[place])
            for name, array in self.values.items()
        }


def sweep(
    loop: ControlLoop,
    values: Mapping[str, ArrayLike],
    time: ArrayLike | None = None,
    *,
    responses: bool = False,
    metrics: Sequence[str] | None = None,
    load_at: Literal["input", "output"] = "input",
    amplitude: float = 1.0,
    settling: float = 0.02,
    rise: tuple[float, float] = (0.1, 0.9),
    threads: int | None = None,
    progress: Progress = False,
) -> Sweep:
    """Simulate the step response of a loop for many sets of its numbers.

    Every set starts at rest at zero when the reference steps to `amplitude`, and is simulated as
    exactly as by `ControlLoop.step_response`.

    Parameters
    ----------
    loop : ControlLoop
        The loop, with the numbers that are the same in all sets.
    values : mapping of str to (low, high, n) or array_like
        Numbers that vary, by their names in `ControlLoop.parameters`, or ``delay``,
        ``sample_time``, ``limit`` and ``rate_limit``. Each range ``(low, high, n)`` of n points is
        an axis of the results, in the order given; two of them make a grid. Arrays broadcast
        against one another on the axes after these: arrays of equal length give one set for each
        index.
    time : float or array_like, shape (n,)
        For metrics, the time in s up to which responses are measured, from zero; of an array, the
        first and the last time. By default ten times the longest delay or time constant; for sets
        that have not settled by then, as long as their closed-loop poles require, up to a thousand
        times that. For responses, the output times, increasing; the step is at the first one.
    responses : bool
        Return outputs instead of metrics.
    metrics : sequence of str, optional
        Which metrics; by default those of `Response.info`. There are also ``iae``, the integral of
        the distance of the output from where it comes to rest, after the step of the reference,
        and of the response to a step of a load of one ``load_peak``, ``load_peak_time``,
        ``load_iae``, ``load_ie`` and ``load_recovery_time``, as in `LoadResponse`.
    load_at : {"input", "output"}
        Where the load acts, as in `ControlLoop.load_response`.
    amplitude : float
        Height of the step, not zero.
    settling : float
        Half width of the settling band as a fraction of the step.
    rise : (float, float)
        Fractions of the step between which the rise time is measured.
    threads : int, optional
        Number of threads; by default ``DEADTIME_NUM_THREADS``, else all cores.
    progress : bool or callable
        True for a progress bar; a callable is called repeatedly with the number of finished sets.

    Returns
    -------
    Sweep

    Raises
    ------
    ValueError
        If the loop has no such number, a number is out of its range, the arrays do not broadcast,
        or no delay is known.
    TypeError
        If `loop` is not a `ControlLoop` or `values` is not a mapping.

    Notes
    -----
    Metrics are those of `Response.info`, but measured on the continuous response instead of on a
    grid of times: no peak is missed, and the interval for ``settling_min`` and ``settling_max``
    begins exactly where the rise ends. A set that diverges has NaN for all metrics and its status
    in `Sweep.status`; other NaN mean the same as in `Response.info`: the settling or rise time was
    not reached. An unstable loop that is cut off before it diverges is unsettled, and its metrics
    are against the steady state; `Response.info` has the peak alone of it. A settling time is given
    only if the output was in the band for three of the slowest time constants 1/abs(abscissa) of
    the closed loop before the end, or if it had decayed to a twentieth of the band and neither
    plant nor controller has a slow pole or zero; and if the command was within its limit in all
    this time, since at the limit the output may pass through the band while the integral unwinds. A
    loop whose reference needs the whole limit or more rests with its command there: the time
    constants are then those of plant and controller. This is evidence, not a proof; `design` proves
    the stability of its result.

    Integrals are those to infinity where no time is given. Those of a load are infinite where an
    offset remains. All are NaN where the output does not come to rest. The status is that of the
    step of the reference if one of its metrics of `Response.info` is asked for, otherwise that of
    the last of the others.

    Loops with up to four states are computed with SIMD instructions, several sets at once, if they
    are sampled, or have a delay and a command that does not exceed its limit once it is within it;
    the others one at a time on each thread. The result for a set does not depend on the other sets,
    on the number of threads or on the machine's instruction set.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.065, limit=1.0)
    >>> delays = np.array([0.1, 0.2, 0.36])
    >>> found = dtm.sweep(loop, {"Kp": (0.5, 2.5, 5), "delay": delays}, 15.0)
    >>> found["settling_time"].round(2)
    array([[7.39, 7.07, 6.5 ],
           [3.46, 3.09, 2.2 ],
           [2.26, 1.85, 2.48],
           [1.72, 1.35, 3.19],
           [1.42, 1.78, 3.95]])
    >>> found.best()
    {'Kp': 2.0, 'delay': 0.2}
    """
    require_loop(loop)
    names = _chosen(metrics, responses)
    arrays, shape = _sets(values)
    common = _checked(loop, arrays)
    height = finite("amplitude", amplitude)
    if height == 0.0:
        raise ValueError("amplitude=0 is not a step: give a number other than zero")
    parts = (finite("rise", rise[0]), finite("rise", rise[1]))
    if not 0.0 <= parts[0] < parts[1]:
        raise ValueError(
            f"rise={rise}: give two shares of the step, the smaller one first, such as (0.1, 0.9)"
        )
    band = positive("settling", settling)
    sampled = 1.0 if "sample_time" in values else common.sample_time
    refuse_discretised(common.controller, sampled, "a sweep")
    sets = _Sets(common, arrays, shape, height, band, parts, thread_number(threads))
    times = None if time is None and not responses else _times(time, responses)
    with reported(progress, math.prod(shape)) as report:
        if responses and times is not None:
            return sets.outputs(times, report)
        found = None
        if metrics is None or not set(_METRICS).isdisjoint(names):
            found = sets.measured(times, report)
        if metrics is None and found is not None:
            return found
        return sets.with_deviations(found, names, load_of(load_at), times, report)


class LoopSets(NamedTuple):
    """The numbers of loops that differ, one for each, and the step of their reference."""

    values: dict[str, Array]
    #: The polynomials of a plant that gives them.
    given: tuple[list[Any], list[Any]] | None
    size: int
    amplitude: float


@dataclass(frozen=True, eq=False)
class _Sets:
    """The arguments of `sweep`, checked."""

    loop: ControlLoop
    arrays: Mapping[str, Array]
    shape: tuple[int, ...]
    amplitude: float
    settling: float
    rise: tuple[float, float]
    threads: int | None

    @cached_property
    def native(self) -> LoopSets:
        """The sets as the kernel takes them."""
        flat = {name: np.broadcast_to(a, self.shape).reshape(-1) for name, a in self.arrays.items()}
        given = self.loop.plant._given(self.loop.parameters | flat)
        return LoopSets(flat, given, math.prod(self.shape), self.amplitude)

    @property
    def kernel(self) -> Loop:
        """The loop with the numbers that are the same in all sets."""
        return self.loop.specification.kernel

    def outputs(self, times: Array, progress: Report | None) -> Sweep:
        """Outputs at given times."""
        found = self.kernel.sweep_responses(
            self.native, times - times[0], threads=self.threads, progress=progress
        )
        outputs = found.outputs.reshape(*self.shape, len(times))
        status = found.status.reshape(self.shape)
        return Sweep(dict(self.arrays), self.shape, times, status, {}, outputs)

    def with_deviations(
        self,
        found: Sweep | None,
        names: tuple[str, ...],
        load: str,
        times: Array | None,
        progress: Report | None,
    ) -> Sweep:
        """The metrics of these names, in their order."""
        known = {} if found is None else dict(found.metrics)
        status = None if found is None else found.status
        end = None if times is None else float(times[-1] - times[0])
        for of, size, rows in (
            ("reference", self.amplitude, _STEP_FIGURES),
            (load, 1.0, _LOAD_FIGURES),
        ):
            if set(rows).isdisjoint(names):
                continue
            question = DeviationQuestion(of, size, self.settling, end)
            deviations = sweep_deviations(
                self.kernel, self.native, question, threads=self.threads, progress=progress
            )
            known |= {
                name: deviations.figures[row].reshape(self.shape) for name, row in rows.items()
            }
            if found is None:
                status = deviations.status.reshape(self.shape)
        if status is None:
            status = np.zeros(self.shape, dtype=np.uint8)
        shown = np.array([0.0, end or 0.0]) if found is None else found.time
        return Sweep(dict(self.arrays), self.shape, shown, status, {n: known[n] for n in names})

    def measured(self, times: Array | None, progress: Report | None) -> Sweep:
        """Metrics between the first and the last time, or until the responses have settled."""
        found = self.kernel.sweep_metrics(
            self.native,
            span=None if times is None else float(times[-1] - times[0]),
            settling=self.settling,
            rise=self.rise,
            threads=self.threads,
            progress=progress,
        )
        shaped = {
            name: row.reshape(self.shape) for name, row in zip(_METRICS, found.metrics, strict=True)
        }
        shown = np.array([0.0, found.span]) if times is None else times
        return Sweep(dict(self.arrays), self.shape, shown, found.status.reshape(self.shape), shaped)


def _chosen(metrics: Sequence[str] | None, responses: bool) -> tuple[str, ...]:
    """Check the names of metrics."""
    if metrics is None:
        return _METRICS
    if responses:
        raise ValueError("a sweep gives either metrics or responses: leave one of the two out")
    if isinstance(metrics, str):
        raise TypeError(f"metrics={metrics!r}: give a sequence of names, such as ({metrics!r},)")
    known = (*_METRICS, *_STEP_FIGURES, *_LOAD_FIGURES)
    unknown = [name for name in metrics if name not in known]
    if unknown or not metrics:
        raise ValueError(f"metrics={list(metrics)}: choose from {', '.join(known)}")
    return tuple(dict.fromkeys(metrics))


def require_loop(loop: object) -> None:
    """Raise TypeError if `loop` is not a `ControlLoop`."""
    if not isinstance(loop, ControlLoop):
        raise TypeError(
            f"a {type(loop).__name__} is not a ControlLoop: write the plant as Integrator, "
            "FirstOrder or RationalPlant, and give ControlLoop(plant, P(1.0), delay=...)"
        )


def _sets(values: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], tuple[int, ...]]:
    if not isinstance(values, Mapping) or not values:
        raise TypeError(f"values={values!r}: give a dict such as {{'Kp': (0.5, 2.5, 5)}}")
    arrays = {name: given_points(name, given) for name, given in values.items()}
    ranges = [name for name, given in values.items() if is_range(given)]
    behind = max((array.ndim for name, array in arrays.items() if name not in ranges), default=0)
    for place, name in enumerate(ranges):
        arrays[name] = arrays[name].reshape(-1, *[1] * (len(ranges) - place - 1 + behind))
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(
                f"{name} contains {array[~np.isfinite(array)][0]}: give finite numbers"
            )
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(
            f"the arrays do not broadcast: {shapes}. Give arrays of one length, or numpy.ix_ of "
            "them for a grid"
        ) from error
    return arrays, shape


def _checked(loop: ControlLoop, arrays: Mapping[str, Array]) -> ControlLoop:
    """Set extreme values of each array in the loop, which refuses invalid ones; return the loop."""
    gains = loop.controller.gains
    for name, array in arrays.items():
        flat = array.ravel()
        if flat.size and name not in gains:
            for place in {int(flat.argmin()), int(flat.argmax()), int(np.abs(flat).argmin())}:
                loop = loop.replace(**{name: float(flat[place])})
    _ = loop.specification.known_delay
    given = [arrays.get(name, gain) for name, gain in gains.items()]
    # Most loops have a gain that is never zero.
    if not any(np.all(gain) for gain in given) and np.any(sum(map(np.abs, given)) == 0.0):
        raise ValueError(
            f"in one set {', '.join(gains)} is zero, so the loop is open: give a gain other "
            "than zero"
        )
    return loop


def _times(time: ArrayLike | None, responses: bool) -> Array:
    if time is None:
        raise ValueError("responses need output times: give an array of times as time")
    times = real_array("time", time)
    if times.ndim == 0 and not responses:
        return np.array([0.0, positive("time", float(times))])
    if times.ndim == 0:
        raise ValueError(f"time={times}: responses need several output times, so give an array")
    times = np.array(increasing("time", times))
    if times.size < 2 and not responses:
        raise ValueError(
            "time has only one entry: give several times, or only the last time as a number"
        )
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    return times
