"""Step responses of many loops at once: one loop a set of numbers, their figures or their outputs.

The matrices of all sets are built together, the equations of a loop being evaluated on arrays, and
handed to the native part in blocks, so that memory stays bounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._deadtime import sweep_figures, sweep_responses
from deadtime._frozen import ReadOnlyArrays
from deadtime._loop import ControlLoop
from deadtime._loop_model import LoopModel, refuse_discretised, rest_of
from deadtime._loop_run import LEAST, SHORTEST
from deadtime._validation import finite, increasing, positive, real_array, thread_number

__all__ = ["Sweep", "SweepStatus", "sweep"]

Vector = NDArray[np.float64]

#: Sets built and simulated together.
_BLOCK = 1 << 15

# How often the time is doubled for the sets that have not settled.
_DOUBLINGS = 4

#: Figures in the order in which the native part gives them.
_FIGURES = (
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


class SweepStatus(IntEnum):
    """What became of one set of a `Sweep`."""

    OK = 0
    """Simulated to the end; where metrics were asked for, settled."""
    UNSETTLED = 1
    """Outside its settling band at the end: the settling time is NaN, and the rise time where the
    step was not climbed either. An unstable loop held by its limit ends here."""
    DIVERGED = 2
    """Grown beyond 1e150 before the end: all NaN."""
    REFUSED = 3
    """Not simulated: the numbers make no loop that can be simulated, or endless work: all NaN."""


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(ReadOnlyArrays):
    """Responses of many loops, or their metrics; made by `sweep`.

    Attributes
    ----------
    values : dict of str to ndarray
        The numbers that vary, each as it was given; they broadcast to `shape`.
    shape : tuple of int
        Shape of the sets.
    time : ndarray, shape (n,)
        Output times, or first and last time of what was measured, in s.
    status : ndarray of uint8, shape `shape`
        `SweepStatus` of each set.
    metrics : dict of str to ndarray, each of shape `shape`
        The figures of `Response.info`; empty where outputs were asked for.
    outputs : ndarray, shape (..., n), or None
        Outputs, behind the axes of `shape`, where they were asked for.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36, sample_time=0.065)
    >>> found = dtm.sweep(loop, {"Kp": [1.0, 2.0, 9.0]}, 20.0)
    >>> found
    <Sweep: 3 sets over Kp, 1 unsettled>
    >>> found["overshoot"][:2].round(2)
    array([ 0.03, 28.74])
    """

    values: dict[str, Vector]
    shape: tuple[int, ...]
    time: Vector
    status: NDArray[np.uint8]
    metrics: dict[str, Vector]
    outputs: Vector | None = None

    def __repr__(self) -> str:
        sets = "x".join(map(str, self.shape)) or "1"
        told = [
            f"{int(np.count_nonzero(self.status == status))} {status.name.lower()}"
            for status in SweepStatus
            if status and np.any(self.status == status)
        ]
        names = ", ".join(self.values)
        return f"<Sweep: {', '.join([f'{sets} sets over {names}', *told])}>"

    def __getitem__(self, name: str) -> Vector:
        try:
            return self.metrics[name]
        except KeyError:
            raise KeyError(
                f"{name!r}: this sweep holds {', '.join(self.metrics) or 'outputs, no metrics'}"
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
            If no set has one.
        """
        measured = self[metric]
        if not np.isfinite(measured).any():
            raise ValueError(f"no set has a {metric}: lengthen the time or change the ranges")
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
    amplitude: float = 1.0,
    settling: float = 0.02,
    rise: tuple[float, float] = (0.1, 0.9),
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> Sweep:
    """Simulate the step response of a loop for many sets of its numbers.

    Every set starts at rest at zero when the reference steps to `amplitude`, as in
    `ControlLoop.step_response`, and is simulated as exactly.

    Parameters
    ----------
    loop : ControlLoop
        What all sets have in common.
    values : mapping of str to array_like
        Arrays of numbers that vary, by their names in `ControlLoop.parameters`, or ``delay``,
        ``sample_time`` and ``limit``. They broadcast against one another: arrays of one length
        are sets of numbers, and arrays from `numpy.ix_` or `numpy.meshgrid` make a grid. Results
        have their common shape.
    time : float or array_like, shape (n,)
        For metrics, the time in s up to which responses are measured, from zero; of an array, the
        first and the last time. By default ten times the longest delay or time constant, and up to
        16 times longer for the sets that have not settled by then. For responses, the output
        times, increasing, the first one being that of the step.
    responses : bool
        Return outputs instead of metrics.
    amplitude : float
        Height of the step, not zero.
    settling : float
        Half width of the settling band as a part of the step.
    rise : (float, float)
        Parts of the step between which the rise time is measured.
    threads : int, optional
        Number of threads; by default ``DEADTIME_NUM_THREADS``, else all cores.
    progress : callable, optional
        Called now and then with the number of finished sets.

    Returns
    -------
    Sweep

    Raises
    ------
    ValueError
        If the loop has no such number, a number is out of its range, the arrays do not broadcast,
        or no delay is known.

    Notes
    -----
    Metrics are those of `Response.info`, but measured on the response itself instead of a grid of
    times: no peak is missed and the settling range begins where the rise ends, not at the first
    output after it. A set that diverges has NaN for all metrics, and `Sweep.status` says so; NaN
    elsewhere is what `Response.info` gives: a settling or rise time that was not reached.

    Sampled loops with a plain integrator run in vector registers, one set a lane; the others one
    by one on all threads. The result for a set does not depend on which other sets there are, on
    the number of threads or on the machine's instruction set.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.065, limit=1.0)
    >>> gains, delays = np.ix_(np.linspace(0.5, 2.5, 5), [0.1, 0.2, 0.36])
    >>> found = dtm.sweep(loop, {"Kp": gains, "delay": delays}, 15.0)
    >>> found["settling_time"].round(2)
    array([[7.39, 7.07, 6.5 ],
           [3.46, 3.09, 2.2 ],
           [2.26, 1.85, 2.48],
           [1.72, 1.35, 3.19],
           [1.42, 1.78, 3.95]])
    >>> found.best()
    {'Kp': 2.0, 'delay': 0.2}
    """
    arrays, shape = _sets(values)
    common = _checked(loop, arrays)
    if time is None and not responses:
        options = {"amplitude": amplitude, "settling": settling, "rise": rise, "threads": threads}
        return _until_settled(common, arrays, options, progress)
    times = _times(time, responses)
    height = finite("amplitude", amplitude)
    if height == 0.0:
        raise ValueError("amplitude=0: there is no step, give a number other than zero")
    band = positive("settling", settling)
    sampled = 1.0 if "sample_time" in values else common.sample_time
    refuse_discretised(common.controller, sampled, "a sweep")
    parts = (finite("rise", rise[0]), finite("rise", rise[1]))
    if not 0.0 <= parts[0] < parts[1]:
        raise ValueError(f"rise={rise}: give two parts of the step, the smaller one first")
    number = thread_number(threads)

    count = math.prod(shape)
    width = len(times) if responses else len(_FIGURES)
    found = np.full((count, width), np.nan)
    status = np.empty(count, dtype=np.uint8)
    flat = {name: np.broadcast_to(array, shape).ravel() for name, array in arrays.items()}
    done = 0
    for place, part in _blocks(loop, flat, count):
        numbers: dict[str, Any] = common.parameters | part
        model = LoopModel.build(common.plant, common.controller, numbers)
        row = model.row(*(numbers.get(name) for name in ("delay", "sample_time", "limit")))
        rows = np.ascontiguousarray(np.broadcast_to(row, (len(place), row.shape[-1])))
        states = model.B.shape[-1]
        ahead = common.delay_path == "measurement"
        report = None if progress is None else lambda n, done=done: progress(done + n)
        if responses:
            found[place], status[place] = sweep_responses(
                states, rows, height, ahead, times - times[0], number, report
            )
        else:
            steady = np.broadcast_to(_steady(common, numbers, height), (len(place),))
            span = float(times[-1] - times[0])
            found[place], status[place] = sweep_figures(
                states, rows, height, ahead, steady, span, band, parts, number, report
            )
        done += len(place)

    columns = {} if responses else dict(zip(_FIGURES, found.T, strict=True))
    return Sweep(
        values=arrays,
        shape=shape,
        time=times,
        status=status.reshape(shape),
        metrics={name: column.reshape(shape).copy() for name, column in columns.items()},
        outputs=found.reshape(*shape, width) if responses else None,
    )


def _sets(values: Mapping[str, ArrayLike]) -> tuple[dict[str, Vector], tuple[int, ...]]:
    if not isinstance(values, Mapping) or not values:
        raise TypeError(f"values={values!r}: give a dict such as {{'Kp': [1.0, 2.0]}}")
    arrays = {name: np.array(real_array(name, given)) for name, given in values.items()}
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds {array[~np.isfinite(array)][0]}: give finite numbers")
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(
            f"the arrays do not broadcast: {shapes}; give equal lengths, or numpy.ix_ of them for "
            "a grid"
        ) from error
    return arrays, shape


def _checked(loop: ControlLoop, arrays: Mapping[str, Vector]) -> ControlLoop:
    """Have the loop itself refuse what lies outside its ranges; the loop with numbers of all."""
    gains = loop.controller.gains
    for name, array in arrays.items():
        flat = array.ravel()
        if flat.size and name not in gains:
            for place in {int(flat.argmin()), int(flat.argmax()), int(np.abs(flat).argmin())}:
                loop = loop.replace(**{name: float(flat[place])})
    loop._known_delay()
    sizes = [np.abs(arrays.get(name, gain)) for name, gain in gains.items()]
    if np.any(sum(sizes) == 0.0):
        raise ValueError(
            f"a set has {', '.join(gains)} of zero: its loop is open, give it a gain other than "
            "zero"
        )
    return loop


def _until_settled(
    loop: ControlLoop,
    arrays: Mapping[str, Vector],
    options: dict[str, Any],
    progress: Callable[[int], object] | None,
) -> Sweep:
    """Measure all sets, and those that have not settled over twice the time, again and again."""
    numbers: dict[str, Any] = loop.parameters | dict(arrays)
    waits = np.add(numbers["delay"], numbers.get("sample_time", 0.0))
    slowest = [1.0 / abs(pole) for pole in np.linalg.eigvals(loop._model.A) if abs(pole) > 0.0]
    span = SHORTEST * max([float(np.max(waits, initial=0.0)), *slowest, LEAST])
    found = sweep(loop, arrays, span, progress=progress, **options)
    flat = {name: np.broadcast_to(array, found.shape) for name, array in arrays.items()}
    metrics = {name: figures.copy() for name, figures in found.metrics.items()}
    status = found.status.copy()
    for _ in range(_DOUBLINGS):
        late = status == SweepStatus.UNSETTLED
        if not late.any():
            break
        span *= 2.0
        longer = sweep(loop, {name: array[late] for name, array in flat.items()}, span, **options)
        for name, figures in longer.metrics.items():
            metrics[name][late] = figures
        status[late] = longer.status
    return replace(found, time=np.array([0.0, span]), metrics=metrics, status=status)


def _times(time: ArrayLike | None, responses: bool) -> Vector:
    if time is None:
        raise ValueError("responses need output times: give an array of them as time")
    times = real_array("time", time)
    if times.ndim == 0 and not responses:
        return np.array([0.0, positive("time", float(times))])
    if times.ndim == 0:
        raise ValueError(f"time={times}: responses need an array of output times")
    times = np.array(increasing("time", times))
    if times.size < 2 and not responses:
        raise ValueError("time holds one time: give the first and the last one, or a number")
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    return times


def _blocks(
    loop: ControlLoop, flat: Mapping[str, Vector], count: int
) -> Iterator[tuple[NDArray[np.intp], dict[str, Vector]]]:
    """Places and numbers of sets of one structure, not too many at a time."""
    for first in range(0, count, _BLOCK):
        places = np.arange(first, min(first + _BLOCK, count))
        part = {name: array[places] for name, array in flat.items()}
        # A leading coefficient of zero, such as a lag of none, takes a state away.
        orders = np.zeros(len(places), dtype=np.int64)
        for coefficients in loop.plant._polynomials(loop.parameters | part):
            leads = np.ones(len(places), dtype=bool)
            for c in coefficients:
                leads = leads & (c == 0.0)
                orders = 2 * orders + leads
        for order in np.unique(orders):
            chosen = np.flatnonzero(orders == order)
            yield places[chosen], {name: array[chosen] for name, array in part.items()}


def _steady(loop: ControlLoop, numbers: Mapping[str, Any], amplitude: float) -> Any:
    """Steady output of every set, NaN where there is none within the limit."""
    output, command = rest_of(loop.plant, loop.controller, numbers)
    limit = numbers.get("limit", np.inf)
    return np.where(np.abs(command * amplitude) <= limit, output * amplitude, np.nan)
