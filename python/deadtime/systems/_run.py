"""Simulation of a linear system: arguments for the native part, and a response from its result.

Before the start the state is given by the history, and the inputs have the value `input_before`.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import deadtime.systems._signals as signals
from deadtime._base.arrays import Array
from deadtime._base.validation import finite, increasing, positive, real_array
from deadtime.roots import proves_instability
from deadtime.systems._native import Signal
from deadtime.systems._poles import HasPoles
from deadtime.systems._realisation import Differentiable, Realisable, Realisation
from deadtime.systems._response import Response, until_settled

#: Share of an output that rounding may make up. A larger one lets outputs pass of which fewer
#: digits are right; a smaller one refuses runs whose digits suffice for a plot.
_ROUNDING = 1e-6

Given: TypeAlias = ArrayLike | Callable[..., ArrayLike]


@dataclass(frozen=True, eq=False)
class Drive:
    """The arguments of `simulate` besides the time."""

    inputs: Given = 1.0
    interpolation: str = "hold"
    input_time: ArrayLike | None = None
    input_before: ArrayLike = 0.0
    input_breaks: Sequence[float] = ()
    history: Given = 0.0
    history_derivative: Callable[..., ArrayLike] | None = None
    history_breaks: Sequence[float] = ()
    initial_state: ArrayLike | None = None
    vectorized: bool = False
    max_step: float | None = None


@dataclass(frozen=True, eq=False)
class _Run:
    """The arguments of a simulation, which is repeated for other times."""

    system: Realisable
    start: float
    drive: Drive

    def __call__(self, times: Array) -> Array:
        inner = times[times > self.start]
        response = respond(self.system, np.concatenate([[self.start], inner]), self.drive)
        outputs = np.atleast_2d(response.outputs)
        return outputs if len(inner) < len(times) else outputs[:, 1:]

    def grows(self) -> bool:
        """Whether the system is proved to be unstable."""
        return isinstance(self.system, HasPoles) and proves_instability(self.system.rightmost())


def _rest(system: Realisable, inputs: Array | None) -> Array | None:
    """Steady outputs under constant inputs; None if there are none."""
    gains = None if inputs is None else system._gains_at_rest()
    if gains is None or inputs is None or not np.isfinite(gains).all():
        return None
    rest: Array = gains @ inputs
    return rest


def respond(system: Realisable, time: ArrayLike, drive: Drive) -> Response:
    """Check the arguments of `simulate` and run the system."""
    model, history = _realisation(system), drive.history
    has_past = callable(history) or np.any(history) or drive.initial_state is not None
    if not model.has_states and has_past:
        raise TypeError(
            "a transfer function has no state, so it cannot start from a history. Give a "
            "DelaySystem for a history other than zero"
        )
    times = increasing("time", time)
    if times.size == 0:
        raise ValueError("time is empty: give at least one output time")
    start = float(times[0])
    _refuse_hidden_growth(float(times[-1]) - start, model.hidden_rate)
    before = _vector("input_before", drive.input_before, model.inputs)
    step = None if drive.max_step is None else positive("max_step", drive.max_step)
    smooth: dict[str, Any] = {"start": start, "vectorized": drive.vectorized, "max_step": step}
    source, last = _input(model, times, drive, before, smooth)
    past, slopes, state = _past(model, drive, smooth)
    if not model.has_states and before.any():
        if model.rest is None:
            raise ValueError(
                f"input_before={before[0]}: {system!r} has a pole at zero, so it can rest only "
                "under an input of zero. To start otherwise, give a DelaySystem with its "
                "history"
            )
        state = model.rest * before
        past = signals.constant(state)
    if drive.initial_state is not None:
        state = _vector("initial_state", drive.initial_state, model.states, "states")
    found = model.native.simulate(times - start, state, past, slopes, source)
    count = len(times)
    outputs = found.outputs.reshape(count, model.outputs).T
    shown = found.inputs.reshape(count, model.inputs).T
    if (model.inputs, model.outputs) == (1, 1):
        outputs, shown = outputs[0], shown[0]
    if drive.input_time is None and _is_sampled(drive.inputs, model):
        drive = replace(drive, input_time=times)
    rest = _rest(system, last)
    return Response(
        time=times,
        outputs=outputs,
        inputs=shown,
        states=found.states.reshape(count, model.states).T,
        breaks=found.breaks + start,
        steady_state=float(rest[0]) if rest is not None and outputs.ndim == 1 else rest,
        _dense=_Run(system, start, drive) if len(times) > 1 else None,
    )


def _refuse_hidden_growth(duration: float, rate: float) -> None:
    """Refuse a run in which a hidden mode amplifies rounding until it shows."""
    if rate * duration > math.log(_ROUNDING / np.finfo(float).eps):
        raise ValueError(
            f"numerator and denominator have a common mode that grows with exp({rate:.6g} t), "
            "see hidden_modes(). The mode amplifies rounding errors, which hide the output "
            f"before the end of this run of {duration:.6g} s. Divide the common factor out, or "
            "end the run earlier"
        )


def step_response(
    system: Realisable,
    time: ArrayLike | None,
    amplitude: float,
    input: int,  # noqa: A002
) -> Response:
    """Response to a step of one input from rest at zero; by default until it has settled."""
    model = _realisation(system)
    index = operator.index(input)
    if not 0 <= index < model.inputs:
        raise IndexError(f"input={index}: the system has {model.inputs} inputs, numbered from 0")
    height = np.zeros(model.inputs)
    height[index] = finite("amplitude", amplitude)
    if time is not None:
        return respond(system, time, Drive(height))
    return until_settled(
        lambda times: respond(system, times, Drive(height)), model.A, model.longest
    )


def impulse_response(system: Differentiable, time: ArrayLike | None, input: int) -> Response:  # noqa: A002
    """Response to an impulse: the derivative of the step response."""
    found = step_response(system._differentiated(), time, 1.0, input)
    return replace(found, inputs=np.zeros_like(found.inputs), states=None)


def _realisation(system: object) -> Realisation:
    realised = getattr(system, "_realised", None)
    if realised is not None:
        model: Realisation = realised()
        return model
    raise TypeError(f"system={system!r}: give a DelaySystem or a TransferFunction")


def _is_sampled(inputs: Given, model: Realisation) -> bool:
    if callable(inputs):
        return False
    shape = np.shape(inputs)
    return len(shape) == 2 or (len(shape) == 1 and model.inputs == 1 and shape != (1,))


def _input(
    model: Realisation, times: Array, drive: Drive, before: Array, smooth: dict[str, Any]
) -> tuple[Signal, Array | None]:
    """Give the native inputs, and their last values if these stay constant."""
    start, p = smooth["start"], model.inputs
    inputs, input_time, interpolation = drive.inputs, drive.input_time, drive.interpolation
    if interpolation not in ("hold", "linear"):
        raise ValueError(f"interpolation={interpolation!r}: give 'hold' or 'linear'")
    if callable(inputs):
        if input_time is not None:
            raise ValueError(
                "inputs is a function, which needs no input_time: leave input_time out"
            )
        span = (start, float(times[-1]))
        if span[0] == span[1]:
            value = signals.sampled("input u(t)", inputs, times, p, smooth["vectorized"])[:, 0]
            return signals.step(before, value), None
        found = signals.fitted("input u(t)", inputs, span, drive.input_breaks, p, **smooth)
        return found.input_signal(before), None
    if p == 0:
        return signals.constant(before), np.zeros(0)
    values = real_array("inputs", inputs)
    if not (_is_sampled(inputs, model) or input_time is not None):
        after = _vector("inputs", values, p)
        return signals.step(before, after), after
    where = times if input_time is None else increasing("input_time", input_time)
    rows = values[None, :] if values.ndim == 1 and p == 1 else values
    if rows.shape != (p, where.size) or where.size == 0:
        expected = f"({where.size},)" if p == 1 else f"({p}, {where.size})"
        raise ValueError(
            f"inputs has shape {values.shape}, but it must have shape {expected}: give one "
            "value of each input for each time in input_time, or in time if input_time is left "
            "out"
        )
    if not np.isfinite(rows).all():
        at = int(np.argmin(np.isfinite(rows).all(axis=0)))
        raise ValueError(
            f"inputs at t = {where[at]} s is {rows[:, at][~np.isfinite(rows[:, at])][0]}: give "
            "finite values"
        )
    make = signals.held if interpolation == "hold" else signals.lines
    return make(where - start, rows, before), rows[:, -1]


def _past(
    model: Realisation, drive: Drive, smooth: dict[str, Any]
) -> tuple[Signal, Signal | None, Array]:
    """Give the native history, its derivative if needed, and the state at the start."""
    start, breaks = smooth["start"], drive.history_breaks
    history, derivative = drive.history, drive.history_derivative
    if not callable(history):
        if derivative is not None:
            raise ValueError(
                "history_derivative is the derivative of a history that is a function, but "
                "history is none: leave history_derivative out"
            )
        state = _vector("history", history, model.states, "states")
        return signals.constant(state), None, state
    now = np.array([start])
    state = signals.sampled("history x(t)", history, now, model.states, smooth["vectorized"])[:, 0]
    if model.memory == 0.0:
        return signals.constant(state), None, state
    span = (start - model.memory, start)
    found = signals.fitted("history x(t)", history, span, breaks, model.states, **smooth)
    slopes = None
    if model.needs_slopes:
        slopes = found.derivative()
        if derivative is not None:
            slopes = signals.fitted(
                "history derivative x'(t)", derivative, span, breaks, model.states, **smooth
            )
    return found.signal(), None if slopes is None else slopes.signal(), state


def _vector(name: str, given: ArrayLike, width: int, what: str = "inputs") -> Array:
    """Check a constant: a vector; a number if it is zero or there is only one component."""
    values = real_array(name, given)
    if values.ndim == 0 and (width == 1 or not values):
        values = np.full(width, float(values))
    if values.shape != (width,):
        raise ValueError(
            f"{name} has shape {values.shape}, but it must have shape ({width},): give one "
            f"number for each of the {width} {what}"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{name} contains {values[~np.isfinite(values)][0]}: give finite numbers")
    return values
