"""The response of a system with any number of inputs and outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays
from deadtime.systems._response import Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["SystemResponse"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class SystemResponse(ReadOnlyArrays):
    """Outputs, states and inputs of a system over time.

    Unpacks into ``time, outputs``. Where a signal jumps, its value is that after the jump.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s.
    outputs : ndarray, shape (n_outputs, n)
        The outputs y; shape (n,) for a system with one input and one output.
    inputs : ndarray, shape (n_inputs, n)
        The inputs u; shape (n,) for a system with one input and one output.
    states : ndarray, shape (n_states, n)
        The states x.
    breaks : ndarray, shape (m,)
        Times in s between the first and the last of `time` at which output, state or input, or
        one of their first ten derivatives, jumps by more than rounding.

    Examples
    --------
    >>> import deadtime as dtm
    >>> system = dtm.DelaySystem(A={0.36: -2.0}, B={0.36: 2.0})
    >>> time, outputs = dtm.simulate(system, [0.0, 0.5, 1.0])
    >>> print(outputs)
    [0.     0.28   1.1232]
    """

    time: Array
    outputs: Array
    inputs: Array
    states: Array
    breaks: Array
    #: Outputs, shape (n_outputs, n), at other times of the same run.
    _dense: Callable[[Array], Array] | None = None
    #: Outputs, shape (n_outputs,), at which the system rests under the last inputs.
    _rest: Callable[[], Array | None] | None = None

    def __repr__(self) -> str:
        outputs = "1 output" if self.outputs.ndim == 1 else f"{len(self.outputs)} outputs"
        return (
            f"<SystemResponse: {outputs} at {len(self.time)} times, {self.time[0]:g} to "
            f"{self.time[-1]:g} s>"
        )

    def __iter__(self) -> Iterator[Array]:
        yield self.time
        yield self.outputs

    @property
    def steady_state(self) -> float | Array | None:
        """Outputs at rest under the last inputs, if those stay constant; None if there are none."""
        found = None if self._rest is None else self._rest()
        return float(found[0]) if found is not None and self.outputs.ndim == 1 else found

    def info(
        self,
        output: int = 0,
        *,
        settling: float = 0.02,
        rise: tuple[float, float] = (0.1, 0.9),
        steady_state: float | None = None,
    ) -> dict[str, float]:
        """Figures of a step response of one output, as `Response.info` gives them.

        Parameters
        ----------
        output : int, default 0
            Which one, from zero.
        settling, rise, steady_state
            As in `Response.info`.

        Returns
        -------
        dict of str to float

        Raises
        ------
        IndexError
            If there is no such output.
        ValueError
            As in `Response.info`.

        Examples
        --------
        >>> import deadtime as dtm
        >>> T = dtm.feedback(2.0 / dtm.s * dtm.delay(0.36))
        >>> round(T.step_response().info()["overshoot"], 3)
        22.475
        """
        outputs = np.atleast_2d(self.outputs)
        if not 0 <= output < len(outputs):
            raise IndexError(f"output={output}: the system has {len(outputs)} of them, from 0")
        rests = None if self._rest is None else self._rest()
        dense = self._dense
        nothing = np.zeros_like(self.time)
        single = Response(
            time=self.time,
            outputs=outputs[output],
            inputs=nothing,
            breaks=self.breaks,
            reference=nothing,
            steady_state=None if rests is None else float(rests[output]),
            _dense=None if dense is None else lambda times: dense(times)[output],
        )
        return single.info(settling=settling, rise=rise, steady_state=steady_state)

    def plot(self, ax: Axes | None = None, *, inputs: bool = False, **style: Any) -> Axes:
        """Draw the outputs.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; new axes by default.
        inputs : bool
            Draw the inputs as well, as thin lines.
        **style
            Passed to `matplotlib.axes.Axes.plot` for the outputs.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        from deadtime._base.drawing import shown_axes

        ax = shown_axes(ax)
        for name, signals, looks in (
            ("output", np.atleast_2d(self.outputs), style),
            ("input", np.atleast_2d(self.inputs), {"linewidth": 0.8}),
        ):
            if name == "input" and not inputs:
                continue
            for i, values in enumerate(signals):
                label = name if len(signals) == 1 else f"{name} {i}"
                ax.plot(self.time, values, **({"label": label} | looks))
        ax.set_xlabel("time in s")
        ax.legend()
        return ax
