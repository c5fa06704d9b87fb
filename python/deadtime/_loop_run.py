"""One simulation of a control loop: arguments to the stepper's, its arrays to a `Response`.

With the delay in the measurement the true output runs ahead of what the stepper calls y by the
delay, so outputs are asked for that much later and their breaks are moved back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._loop_model import state_at_rest
from deadtime._response import Response
from deadtime._validation import finite, increasing, real_array

if TYPE_CHECKING:
    from deadtime._loop import ControlLoop

__all__ = ["simulate_loop"]

Vector = NDArray[np.float64]


# The default time of a step response: at first so many times the slowest constant of the loop (at
# least so many seconds), doubled until the last quarter is settled or the response has run away.
_POINTS = 501
_SHORTEST = 10.0
_LEAST = 0.01
_DOUBLINGS = 10
_SETTLED = 0.005
_LOST = 20.0


@dataclass(frozen=True, eq=False)
class _Again:
    """The output of one run at any times: the run is made again for them.

    Holds the loop rather than its native form, which does not pickle.
    """

    loop: ControlLoop
    start: float
    ahead: float
    arguments: tuple[Any, ...]

    def __call__(self, times: Vector) -> Vector:
        since = times - self.start + self.ahead
        return self.loop._native.simulate(since, np.empty(0), *self.arguments)[0]


class _Jumps(NamedTuple):
    """A reference that holds `values` from `times` on, and `before` until the first of them."""

    times: Vector
    values: Vector
    before: float

    def at(self, times: Vector) -> Vector:
        place = np.searchsorted(self.times, times, side="right")
        return np.concatenate([[self.before], self.values])[place]


def simulate_loop(
    loop: ControlLoop,
    time: ArrayLike,
    reference: ArrayLike,
    *,
    initial_output: float,
    reference_before: float | None,
    reference_time: ArrayLike | None,
    command_history: ArrayLike,
    sample_phase: float,
) -> Response:
    """Check the arguments of `ControlLoop.simulate` and run it."""
    times = increasing("time", time)
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    start = float(times[0])
    initial = finite("initial_output", initial_output)
    before = initial if reference_before is None else finite("reference_before", reference_before)
    jumps = _jumps(times, reference, reference_time, before)
    past = jumps.at(np.array([np.nextafter(start, -np.inf)]))[0]
    state, command = state_at_rest(
        loop.plant, loop.controller, loop.parameters, initial, float(past)
    )
    native = loop._native
    delay = loop._known_delay()
    ahead = delay if loop.delay_path == "measurement" else 0.0
    arguments = (
        state,
        command,
        jumps.before,
        _on_samples(jumps.times - start, start, loop.sample_time, sample_phase),
        jumps.values,
        np.ravel(real_array("command_history", command_history)),
        finite("sample_phase", sample_phase),
    )
    since = _on_samples(times - start, start, loop.sample_time, sample_phase)
    outputs, inputs, output_breaks, input_breaks = native.simulate(since + ahead, since, *arguments)

    breaks = np.concatenate([output_breaks - ahead, input_breaks])
    return Response(
        time=times,
        outputs=outputs,
        inputs=inputs,
        breaks=_distinct(breaks[breaks >= 0.0], delay) + start,
        reference=jumps.at(times),
        steady_state=_steady_state(loop, float(jumps.values[-1])),
        _dense=_Again(loop, start, ahead, arguments),
    )


def settled_step(loop: ControlLoop, amplitude: float) -> Response:
    """Step response up to where it has settled, found by doubling the time."""
    delay = loop._known_delay()
    slowest = [1.0 / abs(pole) for pole in np.linalg.eigvals(loop._model.A) if abs(pole) > 0.0]
    span = _SHORTEST * max([delay + (loop.sample_time or 0.0), *slowest, _LEAST])
    for _ in range(_DOUBLINGS):
        response = loop.simulate(np.linspace(0.0, span, _POINTS), amplitude)
        goal = response.outputs[-1] if response.steady_state is None else response.steady_state
        away = np.abs(response.outputs - goal)
        if away[-_POINTS // 4 :].max() <= _SETTLED * abs(goal) or away.max() > _LOST * abs(goal):
            break
        span *= 2.0
    return response


def _steady_state(loop: ControlLoop, reference: float) -> float | None:
    gains = loop._model.rest_gains
    if gains is None:
        return None
    output, command = gains
    if loop.limit is not None and abs(command * reference) > loop.limit:
        return None
    return output * reference


def _jumps(
    times: Vector, reference: ArrayLike, reference_time: ArrayLike | None, before: float
) -> _Jumps:
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


def _on_samples(since: Vector, start: float, sample_time: float | None, phase: float) -> Vector:
    """Move times that miss a sample only by the rounding of the clock onto it."""
    if sample_time is None:
        return since
    samples = phase + np.rint((since - phase) / sample_time) * sample_time
    rounding = 4.0 * np.finfo(float).eps * (abs(start) + np.abs(since))
    return np.where(np.abs(since - samples) <= rounding, samples, since)


def _distinct(times: Vector, delay: float) -> Vector:
    """Sorted times, those within rounding of one another as one."""
    times = np.unique(times)
    apart = np.diff(times) > 64 * np.finfo(float).eps * (times[1:] + delay)
    return np.asarray(times[np.append(True, apart)[: times.size]])
