"""Simulation of linear systems and loops: one function for all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.validation import finite
from deadtime.loops._control_loop import ControlLoop
from deadtime.systems import Response
from deadtime.systems._realisation import Realisable
from deadtime.systems._run import Given, respond

__all__ = ["simulate"]


@overload
def simulate(
    system: ControlLoop,
    time: ArrayLike,
    inputs: Given = ...,
    *,
    input_time: ArrayLike | None = ...,
    input_before: ArrayLike = ...,
) -> Response: ...
@overload
def simulate(
    system: Realisable,
    time: ArrayLike,
    inputs: Given = ...,
    *,
    interpolation: Literal["hold", "linear"] = ...,
    input_time: ArrayLike | None = ...,
    input_before: ArrayLike = ...,
    input_breaks: Iterable[float] = ...,
    history: Given = ...,
    history_derivative: Callable[..., ArrayLike] | None = ...,
    history_breaks: Iterable[float] = ...,
    initial_state: ArrayLike | None = ...,
    vectorized: bool = ...,
    max_step: float | None = ...,
) -> Response: ...
def simulate(
    system: ControlLoop | Realisable,
    time: ArrayLike,
    inputs: Given = 1.0,
    *,
    interpolation: str = "hold",
    input_time: ArrayLike | None = None,
    input_before: ArrayLike = 0.0,
    input_breaks: Iterable[float] = (),
    history: Given = 0.0,
    history_derivative: Callable[..., ArrayLike] | None = None,
    history_breaks: Iterable[float] = (),
    initial_state: ArrayLike | None = None,
    vectorized: bool = False,
    max_step: float | None = None,
) -> Response:
    """Response of a linear system with delays, exact to rounding.

    The run starts at ``time[0]``.

    Parameters
    ----------
    system : DelaySystem, TransferFunction or ControlLoop
        A loop is passed on to `ControlLoop.simulate`, with the inputs as its reference.
    time : array_like, shape (n,)
        Output times in s, increasing.
    inputs : float, array_like or callable
        A number, or one number for each of the p inputs: constant from the start on. An array of
        shape (p, m), or (m,) for one input: values at the times in `input_time`. A callable:
        ``u(t)`` in s, one number or p of them, smooth but for jumps and the times in
        `input_breaks`.
    interpolation : {"hold", "linear"}
        What values of an array do between their times: hold, or join by straight lines.
    input_time : array_like, shape (m,), optional
        Times of the values of an array, increasing, in the same clock as `time`; `time` itself
        where the lengths agree. The last value holds.
    input_before : float or array_like, shape (p,)
        Inputs before the first of those times, or before the start. A transfer function starts
        from rest under it.
    input_breaks : iterable of float
        Times at which a callable `inputs` or one of its derivatives jumps. Jumps of the callable
        itself are found, jumps of a derivative refused.
    history : float, array_like of shape (n_states,), or callable
        The state before the start: constant, or ``x(t)`` as far back as the longest delay, smooth
        but for the times in `history_breaks`. For a transfer function only zero.
    history_derivative : callable, optional
        Derivative of a callable history, for systems with delayed derivatives; by default that of
        its approximation, which loses about three digits.
    history_breaks : iterable of float
        Times at which the history or one of its derivatives jumps.
    initial_state : array_like, shape (n_states,), optional
        The state at the start, where that is not what the history comes to.
    vectorized : bool
        Whether the callables take an array of m times and give m numbers, or an array of shape
        (p, m).
    max_step : float, optional
        Largest gap between even samples of a callable, s: what it does for longer is seen, what is
        shorter may be missed unless its times are named as breaks. By default a thousandth of the
        run, or of the longest delay for a history.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, a value is not finite or a callable not smooth
        where it should be (the message says when), E is singular, a transfer function is improper
        or not causal, the response grows beyond 1e150, or there would be more work than anyone
        waits for.
    TypeError
        If `system` is none of these, or an argument has no meaning for it.

    Notes
    -----
    Method of steps on elements that end at every breaking point that more than rounding would
    show; on each, the equation is solved for a Legendre series carried to rounding. Elements are
    no longer than the shortest delay. A callable is replaced by such series too.

    Where the state of a neutral system jumps at the start (`initial_state`), the equation is read
    as that of ``E x(t) + sum_j N_j x(t - tau_j)``, which has no jump later: the state itself then
    jumps again one delay after each jump.

    Examples
    --------
    Two delays, one of them not a multiple of the other, from a constant history:

    >>> import deadtime as dtm
    >>> system = dtm.DelaySystem({1 / 3: -1.0, 1 / 5: -1.0})
    >>> response = dtm.simulate(system, [0.0, 0.2, 0.5, 1.0], initial_state=1.0)
    >>> print(response.outputs[0].round(6))
    [ 1.        1.        0.538333 -0.034597]

    A ramp into a closed loop:

    >>> T = dtm.feedback(2.0 / dtm.s * dtm.delay(0.36))
    >>> ramp = dtm.simulate(T, [0.0, 5.0, 10.0], [0.0, 5.0, 10.0], interpolation="linear")
    >>> print(ramp.outputs.round(4))
    [0.     4.4998 9.5   ]
    """
    if isinstance(system, ControlLoop):
        no_meaning = {
            "interpolation": interpolation != "hold",
            "input_breaks": tuple(input_breaks) != (),
            "history": callable(history) or np.any(history),
            "history_derivative": history_derivative is not None,
            "max_step": max_step is not None,
            "initial_state": initial_state is not None,
            "a callable": callable(inputs),
        }
        for name, is_given in no_meaning.items():
            if is_given:
                raise TypeError(
                    f"{name} has no meaning for a ControlLoop, which sees a reference that jumps "
                    "and starts at rest: see ControlLoop.simulate, or simulate its DelaySystem"
                )
        before = finite("input_before", cast(float, input_before))
        reference = cast(ArrayLike, inputs)
        return system.simulate(time, reference, reference_time=input_time, reference_before=before)
    return respond(
        system,
        time,
        inputs,
        interpolation=interpolation,
        input_time=input_time,
        input_before=input_before,
        input_breaks=input_breaks,
        history=history,
        history_derivative=history_derivative,
        history_breaks=history_breaks,
        initial_state=initial_state,
        vectorized=vectorized,
        max_step=max_step,
    )
