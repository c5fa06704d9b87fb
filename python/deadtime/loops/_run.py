"""One simulation of a control loop: arguments to the stepper's, its arrays to a `Response`.

With the delay in the measurement the true output runs ahead of what the stepper calls y by the
delay, so outputs are asked for that much later and their breaks are moved back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.validation import finite, increasing, one_dimensional, real_array
from deadtime._deadtime import on_samples
from deadtime.loops._model import LoopRun
from deadtime.loops._sensitivities import output_and_input_slopes, slope_names
from deadtime.loops._specification import LoopSpecification
from deadtime.systems import Response
from deadtime.systems._run import first_duration

__all__ = ["reference_jumps", "settled_step", "simulate_loop"]

Vector = NDArray[np.float64]

#: Output times of a step response by default.
_POINTS = 501
#: Its duration is doubled, at most this many times, until the last quarter stays within _SETTLED of
#: the goal or the response is _LOST times as far away from it.
_DOUBLINGS = 10
_SETTLED = 0.005
_LOST = 20.0


class _Again:
    """Output of a run at other times: the run is repeated for them."""

    __slots__ = ("loop", "run", "start")

    def __init__(self, loop: LoopSpecification, start: float, run: LoopRun) -> None:
        self.loop, self.start, self.run = loop, start, run

    def __call__(self, times: Vector) -> Vector:
        run = _since_start(self.loop, self.start, self.run)
        return self.loop.native.outputs(times - self.start + self.loop.output_lead, run)


class _Jumps(NamedTuple):
    """A reference that holds `values` from `times` on, and `before` until the first of them."""

    times: Vector
    values: Vector
    before: float

    def at(self, times: Vector) -> Vector:
        place = np.searchsorted(self.times, times, side="right")
        return np.concatenate([[self.before], self.values])[place]

    def just_before(self, time: float) -> float:
        """The value from which it jumps, if it does, at `time`."""
        return float(self.at(np.array([np.nextafter(time, -np.inf)]))[0])


def simulate_loop(
    loop: LoopSpecification,
    time: ArrayLike,
    reference: ArrayLike,
    *,
    initial_output: float = 0.0,
    reference_before: float | None = None,
    reference_time: ArrayLike | None = None,
    command_history: ArrayLike = (),
    sample_phase: float = 0.0,
    sensitivities: Sequence[str] = (),
) -> Response:
    """Check the arguments of `ControlLoop.simulate` and run it."""
    times = one_dimensional("time", time)
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    initial = finite("initial_output", initial_output)
    before = initial if reference_before is None else finite("reference_before", reference_before)
    held: float | Vector
    past, held_from = before, None
    if type(reference) is float and reference_time is None:
        held = last = finite("reference", reference)
    else:
        jumps = reference_jumps(times, reference, reference_time, before)
        held, held_from, last = jumps.values, jumps.times, float(jumps.values[-1])
        if jumps.times[0] < times[0]:
            past = jumps.just_before(float(times[0]))
    history = None
    if not isinstance(command_history, tuple) or command_history:
        history = one_dimensional("command_history", command_history)
    phase = finite("sample_phase", sample_phase)
    run = LoopRun(*loop.rest_at(initial, past), before, held, held_from, history, phase)
    # The array belongs to the caller; the response must not change with it.
    kept = times.copy()
    found = loop.native.respond(kept, run, loop.output_lead)
    start = float(kept[0])
    again = _Again(loop, start, run)
    response = Response._of_fresh(kept, found, loop.steady_state(last), again)
    if not sensitivities:
        return response
    names = slope_names(loop, sensitivities)
    slopes, input_slopes = output_and_input_slopes(
        loop,
        names,
        (initial, past),
        _moved(loop, kept - start, start, phase),
        _since_start(loop, start, run),
    )
    return replace(response, sensitivities=slopes, input_sensitivities=input_slopes)


def _since_start(loop: LoopSpecification, start: float, run: LoopRun) -> LoopRun:
    """The run in the clock of the stepper, which is zero at the start."""
    times = np.array([start]) if run.reference_time is None else run.reference_time
    since = _moved(loop, times - start, start, run.sample_phase)
    return run._replace(reference=np.atleast_1d(run.reference), reference_time=since)


def _moved(loop: LoopSpecification, since: Vector, start: float, phase: float) -> Vector:
    """Times since the start, moved onto the samples they miss by rounding only."""
    if loop.sample_time is None:
        return since
    return on_samples(since, start, loop.sample_time, phase)


def settled_step(loop: LoopSpecification, amplitude: float) -> Response:
    """Step response up to where it has settled, found by doubling the time."""
    delay = loop.known_delay
    span = first_duration(loop.model.A, delay + (loop.sample_time or 0.0))
    for _ in range(_DOUBLINGS):
        response = simulate_loop(loop, np.linspace(0.0, span, _POINTS), amplitude)
        goal = response.outputs[-1] if response.steady_state is None else response.steady_state
        away = np.abs(response.outputs - goal)
        if away[-_POINTS // 4 :].max() <= _SETTLED * abs(goal) or away.max() > _LOST * abs(goal):
            break
        span *= 2.0
    return response


def reference_jumps(
    times: Vector, reference: ArrayLike, reference_time: ArrayLike | None, before: float
) -> _Jumps:
    """The reference as jumps: one number steps at the first of `times`."""
    values = real_array("reference", reference)
    if values.ndim == 0:
        if reference_time is not None:
            raise ValueError(
                f"reference={values} is one number, so reference_time has no meaning: give an "
                "array of as many values as there are times"
            )
        return _Jumps(times[:1], values.reshape(1), before)
    where = times if reference_time is None else increasing("reference_time", reference_time)
    if values.shape != where.shape or values.size == 0:
        raise ValueError(
            f"reference has shape {values.shape} and its times {where.shape}: give one value for "
            "each element of reference_time (or of time, without reference_time), at least one"
        )
    return _Jumps(where, values, before)
