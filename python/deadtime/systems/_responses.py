"""The simulations of a linear system: inputs of any kind, a step, an impulse."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime.systems._realisation import Realisable, Realisation
from deadtime.systems._response import Response
from deadtime.systems._run import Drive, Given, impulse_response, respond, step_response


class HasResponses(ABC):
    """Base of systems that can be simulated, exactly to rounding."""

    __slots__ = ()

    @abstractmethod
    def _realised(self) -> Realisation: ...

    @abstractmethod
    def _differentiated(self) -> Realisable: ...

    @abstractmethod
    def _gains_at_rest(self) -> NDArray[np.float64] | None: ...

    def simulate(
        self,
        time: ArrayLike,
        inputs: Given = 1.0,
        *,
        interpolation: Literal["hold", "linear"] = "hold",
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
        """Response to inputs of any kind, exact to rounding.

        The run starts at ``time[0]``.

        Parameters
        ----------
        time : array_like, shape (n,)
            Output times in s, increasing.
        inputs : float, array_like or callable
            A number, or one number for each of the p inputs: constant from the start on. An array
            of shape (p, m), or (m,) for one input: values at the times in `input_time`. A callable:
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
            Times at which a callable `inputs` or one of its derivatives jumps. Jumps of the
            callable itself are found, jumps of a derivative refused.
        history : float, array_like of shape (n_states,), or callable
            The state before the start: constant, or ``x(t)`` as far back as the longest delay,
            smooth but for the times in `history_breaks`. For a transfer function only zero.
        history_derivative : callable, optional
            Derivative of a callable history, for systems with delayed derivatives; by default that
            of its approximation, which loses about three digits.
        history_breaks : iterable of float
            Times at which the history or one of its derivatives jumps.
        initial_state : array_like, shape (n_states,), optional
            The state at the start, where that is not what the history comes to.
        vectorized : bool
            Whether the callables take an array of m times and give m numbers, or an array of shape
            (p, m).
        max_step : float, optional
            Largest gap between even samples of a callable, s: what it does for longer is seen, what
            is shorter may be missed unless its times are named as breaks. By default a thousandth
            of the run, or of the longest delay for a history.

        Returns
        -------
        Response

        Raises
        ------
        ValueError
            If shapes do not fit, times do not increase, a value is not finite or a callable not
            smooth where it should be (the message says when), E is singular, a transfer function is
            improper or not causal, the response grows beyond 1e150, or the run would take more
            elements than the native part allows.
        TypeError
            If the past of a state is given for a transfer function, which says nothing of it.

        Notes
        -----
        Method of steps on elements that end at every breaking point that more than rounding would
        show; on each, the equation is solved for a Legendre series carried to rounding. Elements
        are no longer than the shortest delay. A callable is replaced by such series too.

        Where the state of a neutral system jumps at the start (`initial_state`), the equation is
        read as that of ``E x(t) + sum_j N_j x(t - tau_j)``, which has no jump later: the state
        itself then jumps again one delay after each jump.

        Examples
        --------
        Two delays, one of them not a multiple of the other, from a constant history:

        >>> import deadtime as dtm
        >>> system = dtm.DelaySystem({1 / 3: -1.0, 1 / 5: -1.0})
        >>> response = system.simulate([0.0, 0.2, 0.5, 1.0], initial_state=1.0)
        >>> print(response.outputs[0].round(6))
        [ 1.        1.        0.538333 -0.034597]

        A ramp into a closed loop:

        >>> T = dtm.feedback(2.0 / dtm.s * dtm.delay(0.36))
        >>> ramp = T.simulate([0.0, 5.0, 10.0], [0.0, 5.0, 10.0], interpolation="linear")
        >>> print(ramp.outputs.round(4))
        [0.     4.4998 9.5   ]
        """
        drive = Drive(
            inputs,
            interpolation,
            input_time,
            input_before,
            tuple(input_breaks),
            history,
            history_derivative,
            tuple(history_breaks),
            initial_state,
            vectorized,
            max_step,
        )
        return respond(self, time, drive)

    def step_response(
        self,
        time: ArrayLike | None = None,
        amplitude: float = 1.0,
        *,
        input: int = 0,  # noqa: A002
    ) -> Response:
        """Response to a step of one input from rest at zero.

        Parameters
        ----------
        time : array_like, optional
            Output times in s; by default 501 from the step until the response has settled, or
            has visibly failed to.
        amplitude : float
            Height of the step.
        input : int, default 0
            Which input, from zero; the others stay zero.

        Returns
        -------
        Response

        Raises
        ------
        IndexError
            If there is no such input.
        ValueError
            As in `simulate`.

        Examples
        --------
        >>> import deadtime as dtm
        >>> T = dtm.feedback(2.0 / dtm.s * dtm.delay(0.36))
        >>> time, outputs = T.step_response([0.0, 1.0])
        >>> print(outputs)
        [0.     1.1232]
        >>> round(T.step_response().info()["overshoot"], 3)
        22.475
        """
        return step_response(self, time, amplitude, input)

    def impulse_response(
        self,
        time: ArrayLike | None = None,
        *,
        input: int = 0,  # noqa: A002
    ) -> Response:
        """Response to an impulse of unit area of one input at the first time, from rest at zero.

        Parameters
        ----------
        time : array_like, optional
            As in `step_response`.
        input : int, default 0
            Which input, from zero; the others stay zero.

        Returns
        -------
        Response
            Its inputs are zero, as the impulse itself has no height to show.

        Raises
        ------
        IndexError
            If there is no such input.
        ValueError
            As in `simulate`, and if an input reaches an output directly: the response then holds
            an impulse itself.

        Notes
        -----
        The derivative of the step response: of a transfer function G, the step response of s G; of
        a system, its step response with the derivative of the state in place of the state.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> print((delay(0.5) / (s + 1)).impulse_response([0.0, 0.5, 1.5]).outputs.round(6))
        [0.       1.       0.367879]
        """
        return impulse_response(self, time, input)
