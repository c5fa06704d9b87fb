"""Delay differential equations with constant delays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

import deadtime.dde._native as native
from deadtime._base.arrays import Array
from deadtime._base.validation import finite, positive, real_array, whole_number
from deadtime.dde._compiled import addresses
from deadtime.dde._solution import DelayResult, DelaySolution

_METHODS = ("auto", "spectral")
#: What `DelayResult.status` is where the run did not fail.
_STATUS = {"finished": 0, "event": 1}


def solve_dde(
    fun: Any,
    t_span: tuple[SupportsFloat, SupportsFloat],
    history: ArrayLike | Callable[[float], ArrayLike] | tuple[Callable[..., Any], ...],
    delays: ArrayLike,
    *,
    y0: ArrayLike | None = None,
    neutral: bool = False,
    method: str = "auto",
    rtol: float = 1e-6,
    atol: ArrayLike = 1e-9,
    t_eval: ArrayLike | None = None,
    dense_output: bool = False,
    events: Callable[..., Any] | Sequence[Callable[..., Any]] | None = None,
    jumps: Iterable[Any] = (),
    history_breaks: ArrayLike = (),
    args: tuple[Any, ...] = (),
    vectorized: bool = False,
    max_step: float = np.inf,
    max_steps: int | None = 100_000,
    jac_sparsity: Any = None,
) -> DelayResult:
    r"""Solve :math:`y'(t) = f(t, y(t), y(t - \tau_1), \dots, y(t - \tau_m))`, constant delays.

    Parameters
    ----------
    fun : callable or compiled function
        ``fun(t, y, z)``, where ``z[j]`` is y(t − τ_j): `y` of shape (dim,), `z` of shape (delay,
        dim), and (dim,) returned, also as a list. For neutral equations ``fun(t, y, z, dz)`` with
        ``dz[j]`` = y'(t − τ_j). With `vectorized` it is called for many nodes at once: `t` of
        shape (node,), `y` (dim, node), `z` (delay, dim, node), and (dim, node) returned; that is
        by far the fastest way in Python. A compiled function, a `scipy.LowLevelCallable`, a numba
        ``cfunc`` or a ctypes function pointer, has the signature ``void (double t, const double
        *y, const double *z, const double *dz, double *dy, void *user_data)`` with `z` and `dz`
        delay by delay; it is called a node at a time without the interpreter. One that is
        declared with other types is refused.
    t_span : (float, float)
        Start and end.
    history : float, array_like, callable or (callable, callable)
        y up to the start: constant, one number for all components or (dim,), or a function of
        one time that returns a number or (dim,). A pair is the function and its derivative.
    delays : float or array_like, shape (m,)
        The delays τ_j, each above zero.
    y0 : array_like, optional
        y at the start where it is not the end of the history: y then jumps there.
    neutral : bool
        Whether `fun` takes delayed derivatives. In a history without its derivative they are
        those of the polynomials through it.
    method : {'auto', 'spectral'}
        The method; there is one so far.
    rtol, atol : float, float or array_like
        Tolerances: an element may err by ``atol + rtol * abs(y)`` in each component, between its
        nodes as well as at them.
    t_eval : array_like, optional
        Ascending times at which y is wanted. By default all nodes of all elements are returned,
        so that a plot is smooth.
    dense_output : bool
        Keep all polynomials, as ``sol``.
    events : callable or list of callable, optional
        As in `scipy.integrate.solve_ivp`: zeros of ``event(t, y, *args)``, with attributes
        ``terminal`` (True, or the number of the crossing that ends the run) and ``direction``.
        Every change of sign is found, to rounding, where the event is smooth along the solution,
        one in `y` itself above all; features narrower than a twentieth of an element may be
        missed, and `max_step` makes elements shorter. A change of sign at a jump of `y` is an
        event at the time of the jump, with `y` after it. A zero at the start is none.
    jumps : iterable of float or (float, callable)
        Times at which the right-hand side jumps, with ``change(t, y)`` the times at which y
        becomes what that returns. Those outside `t_span` are left out.
    history_breaks : array_like
        Times at which the history or one of its derivatives jumps. Undeclared ones are found,
        at some cost, where they are further apart than a thousandth of the largest delay.
    args : tuple
        Further arguments of `fun` and the events.
    vectorized : bool
        Whether `fun` takes many nodes at once; never guessed.
    max_step : float
        Largest length of an element, and largest gap between samples of the history. `fun` is
        called at nodes alone, so what it does with `t` for a shorter time may be missed.
    max_steps : int or None
        Elements tried at most, accepted or not, None for no limit. A run that reaches it ends with
        status -1.
    jac_sparsity : array_like or sparse matrix, shape (dim, dim), optional
        As in `scipy.integrate.solve_ivp`: other than zero where a component of `fun` depends on a
        component of `y`, or of ``z[j]`` for a delay shorter than the elements. Without it the
        pattern is found by differences, where a Jacobian is wanted at all: that takes a column a
        component once. A pattern that lacks entries is noticed and replaced.

    Returns
    -------
    DelayResult
        ``t, y, sol, t_events, y_events, breaks, nfev, status, message, success`` and counts.
        ``status`` is -1, with ``y`` as far as it is known, where elements become too short or
        too many or `fun` is not finite; the message says where and what to try.

    Raises
    ------
    ValueError
        For delays that are zero, negative (an equation of advanced type) or not finite, values of
        the history or of `fun` at the start that are not finite, wrong shapes, times out of
        order, unknown methods.
    TypeError
        If `fun`, an event or a change is no function, or returned None or complex numbers.
    Exception
        Whatever a function raises comes through unchanged.

    Notes
    -----
    The solution is a polynomial of degree 4 to 24 on each element, or up to 48 where components
    are not coupled by y, by collocation at Radau points (the Radau IIA family), so that stiff
    equations take long elements too. The Jacobian that this needs is taken by differences;
    large systems that are coupled by y have one only where sweeps without it fail, banded or
    full as it comes out, and its diagonal alone beyond 4 million entries. Elements end on
    breaking points: the start, the jumps, and what follows from them one delay later, an order
    smoother each time, or as rough as before in neutral equations. Through a breaking point of
    a neutral equation with a jump of y itself only the step is followed, not the impulse in y'.
    Without `dense_output` the past is kept only as far as the largest delay.

    Examples
    --------
    The equation of Mackey and Glass (1977):

    >>> import deadtime as dtm
    >>> def blood(t, y, z):
    ...     return 0.2 * z[0] / (1 + z[0] ** 10) - 0.1 * y
    >>> found = dtm.solve_dde(blood, (0, 100), 0.5, 17.0, vectorized=True, t_eval=[50, 100])
    >>> print(found.y.round(4))
    [[0.6441 1.05  ]]
    """
    if method not in _METHODS:
        names = ", ".join(repr(name) for name in _METHODS)
        raise ValueError(f"method={method!r}: give one of {names}")
    start, end = (finite("t_span", time) for time in t_span)
    lags = np.atleast_1d(real_array("delays", delays)).ravel()
    past, derivative = _history(history)
    initial = _initial(past, y0, start)
    if not callable(past) and past.size == 1:
        past = np.repeat(past, initial.size)
    compiled = addresses(fun)
    if compiled is None and not callable(fun):
        raise TypeError(f"fun={fun!r} is not a function: give a function")
    if compiled is not None and args:
        raise ValueError(
            "a compiled function takes no args: leave args out, and put the data into the "
            "LowLevelCallable"
        )
    run = native.solve_dde(
        DelayProblem(
            fun=fun if compiled is None else compiled,
            t_span=(start, end),
            history=past,
            history_derivative=derivative,
            delays=lags,
            y0=initial,
            neutral=bool(neutral),
            rtol=finite("rtol", rtol),
            atol=_vector("atol", atol),
            t_eval=None if t_eval is None else _vector("t_eval", t_eval),
            dense_output=bool(dense_output),
            events=_events(events),
            jumps=_jumps(jumps, start, end),
            history_breaks=_vector("history_breaks", history_breaks),
            args=tuple(args),
            vectorized=bool(vectorized),
            max_step=max_step if max_step == np.inf else positive("max_step", max_step),
            max_steps=None if max_steps is None else whole_number("max_steps", max_steps),
            jac_sparsity=_pattern(jac_sparsity, initial.size),
        )
    )
    status = _STATUS.get(run.outcome, -1)
    return DelayResult(
        t=run.t,
        y=run.y,
        sol=DelaySolution(run.pieces) if dense_output else None,
        t_events=None if events is None else run.t_events,
        y_events=None if events is None else run.y_events,
        breaks=run.breaks,
        nfev=run.nfev,
        n_nodes=run.n_nodes,
        n_elements=run.n_elements,
        n_rejected=run.n_rejected,
        status=status,
        message=_message(run),
        success=status >= 0,
    )


class DelayEvent(NamedTuple):
    """A function whose zeros count, which of them, and which one ends the run (0 for none)."""

    function: Callable[..., Any]
    direction: int
    terminal: int


class DelayJump(NamedTuple):
    """A time at which the right-hand side jumps, and what makes y jump there."""

    time: float
    change: Callable[..., Any] | None


@dataclass(frozen=True, eq=False)
class DelayProblem:
    """The arguments of `solve_dde`, checked, as the native part takes them."""

    fun: Any
    t_span: tuple[float, float]
    history: Any
    history_derivative: Callable[..., Any] | None
    delays: Array
    y0: Array
    neutral: bool
    rtol: float
    atol: Array
    t_eval: Array | None
    dense_output: bool
    events: list[DelayEvent]
    jumps: list[DelayJump]
    history_breaks: Array
    args: tuple[Any, ...]
    vectorized: bool
    max_step: float
    max_steps: int | None
    jac_sparsity: tuple[list[int], list[int]] | None


def _message(run: native.DelayRun) -> str:
    if run.outcome == "finished":
        return "The end of t_span was reached."
    if run.outcome == "event":
        return "A terminal event occurred."
    if run.outcome == "max_steps":
        return (
            f"max_steps={run.n_elements + run.n_rejected} elements were tried by t={run.end!r}, "
            f"and {run.n_rejected} of them were refused. If fun switches on y and the switch "
            "keeps y in place (a sliding mode), smooth the switch. If fun is noisy, or rtol "
            "and atol demand more than double precision, raise rtol and atol. If the run is "
            "long, give a larger max_steps."
        )
    if run.outcome == "short":
        return (
            f"At t={run.end!r} the elements became as short as rounding allows. Either the "
            "solution grows without bound there, or the right-hand side is rough. If the "
            "right-hand side jumps, give the times of the jumps (jumps). Or raise rtol and atol, "
            "or limit max_step. For a linear loop with a limit, ControlLoop.simulate is exact."
        )
    return (
        f"The right-hand side is not finite from t={run.end!r} on, so the solution leaves the "
        "domain of fun. Check the roots, logarithms and divisions in fun, or end the run with a "
        "terminal event."
    )


def _vector(name: str, values: ArrayLike) -> Array:
    """Return `values` as one row of finite floats."""
    array = np.ascontiguousarray(real_array(name, values).ravel())
    if not np.isfinite(array).all():
        raise ValueError(f"{name}={array}: give finite numbers")
    return array


def _history(history: Any) -> tuple[Any, Any]:
    """Return the history, as a function or an array, and the function of its derivative."""
    if callable(history):
        return history, None
    if isinstance(history, tuple) and any(callable(part) for part in history):
        if len(history) != 2 or not all(callable(part) for part in history):
            raise TypeError(
                f"history={history!r}: a pair must contain two functions, the history and its "
                "derivative"
            )
        return history
    return np.atleast_1d(_vector("history", history)), None


def _initial(past: Any, y0: ArrayLike | None, start: float) -> Array:
    """Return y at the start."""
    if y0 is not None:
        return _vector("y0", y0)
    if not callable(past):
        return np.asarray(past)
    found = past(start)
    if found is None:
        raise TypeError(f"history returned None at t={start}: let the function return its values")
    value = np.atleast_1d(real_array(f"history at t={start}", found))
    if value.ndim != 1:
        raise ValueError(
            f"history returned an array of shape {value.shape} at t={start}: return a "
            "number, or an array of shape (dim,)"
        )
    if not np.isfinite(value).all():
        raise ValueError(
            f"history is {value} at t={start}: give finite values. If only the start is "
            "known, give its value as y0"
        )
    return np.ascontiguousarray(value)


def _pattern(pattern: Any, dim: int) -> tuple[list[int], list[int]] | None:
    """Return the rows and columns of the entries of a Jacobian."""
    if pattern is None:
        return None
    if not hasattr(pattern, "tocoo"):
        pattern = real_array("jac_sparsity", pattern)
    if pattern.shape != (dim, dim):
        raise ValueError(
            f"jac_sparsity has shape {pattern.shape}: give an array of shape ({dim}, {dim})"
        )
    rows, columns = pattern.nonzero()
    return rows.tolist(), columns.tolist()


def _events(events: Any) -> list[DelayEvent]:
    """Return the events as the native part takes them."""
    if events is None:
        return []
    found = []
    for event in (events,) if callable(events) else events:
        if not callable(event):
            raise TypeError(f"events contains {event!r}, which is not a function: give functions")
        direction = int(np.sign(finite("direction", getattr(event, "direction", 0))))
        terminal = finite("terminal", getattr(event, "terminal", None) or 0)
        if not 0 <= terminal < 2**31 or terminal != int(terminal):
            raise ValueError(
                f"terminal={terminal}: give True, or the number of crossings after which the "
                "run ends"
            )
        found.append(DelayEvent(event, direction, int(terminal)))
    return found


def _jumps(jumps: Iterable[Any], start: float, end: float) -> list[DelayJump]:
    """Return the jumps within the span, in order."""
    found = []
    for jump in jumps:
        time, change = jump if isinstance(jump, tuple) else (jump, None)
        if change is not None and not callable(change):
            raise TypeError(
                f"jumps contains {change!r}, which is not a function: give functions of t and y"
            )
        found.append(DelayJump(finite("jumps", time), change))
    found.sort(key=lambda jump: jump.time)
    return [jump for jump in found if start < jump.time < end]
