"""The response of a loop in time, and its figures of merit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import FrozenDict, ReadOnlyArrays
from deadtime._base.validation import finite, positive, real_array
from deadtime._deadtime import LoopResponse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Response"]

Vector = NDArray[np.float64]

# Points in one magnification around an extremum or a crossing, and how often to magnify: the
# place is then known to 1e-8 of the output step, the height of a peak to rounding.
_POINTS = 101
_MAGNIFICATIONS = 4


#: Sensitivities that nobody asked for.
NONE = FrozenDict()


@dataclass(frozen=True, eq=False, repr=False)
class Response(ReadOnlyArrays):
    """Output and command of a loop over time.

    Unpacks into ``time, outputs``.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s.
    outputs : ndarray, shape (n,)
        The output y.
    inputs : ndarray, shape (n,)
        The command u after the limit. Where it jumps, the value after the jump.
    breaks : ndarray, shape (m,)
        Times in s between the first and the last of `time` at which output or command, or one
        of their first ten derivatives, jumps: jumps of the reference, switching times of the
        limit, samples, and all of these again each time they have gone round the loop.
    reference : ndarray, shape (n,)
        The reference r.
    steady_state : float or None
        The output at which the loop rests under the last reference, None where there is no such
        rest within the limit.
    sensitivities : dict of str to ndarray, shape (n,)
        Derivatives of `outputs`, at fixed times, with respect to the numbers of the loop that
        `ControlLoop.simulate` was asked for, by name.
    input_sensitivities : dict of str to ndarray, shape (n,)
        The same of `inputs`.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.31), delay=0.36)
    >>> time, outputs = loop.simulate([0.0, 0.5, 1.0])
    >>> print(outputs)
    [0.         0.1834     0.77112888]
    """

    time: Vector
    outputs: Vector
    inputs: Vector
    breaks: Vector
    reference: Vector
    steady_state: float | None = None
    sensitivities: dict[str, Vector] = field(default_factory=dict)
    input_sensitivities: dict[str, Vector] = field(default_factory=dict)
    _dense: Callable[[Vector], Vector] | None = None

    def __post_init__(self) -> None:
        for name in ("time", "outputs", "inputs", "breaks", "reference"):
            array = np.array(real_array(name, getattr(self, name)))
            object.__setattr__(self, name, array)
        self._freeze()

    @classmethod
    def _of_fresh(
        cls,
        time: Vector,
        found: LoopResponse,
        steady_state: float | None,
        dense: Callable[[Vector], Vector],
    ) -> Response:
        """Of arrays that nobody else holds: nothing is copied or converted."""
        response = object.__new__(cls)
        fields = response.__dict__
        fields["time"] = time
        fields["outputs"] = found.outputs
        fields["inputs"] = found.inputs
        fields["breaks"] = found.breaks
        fields["reference"] = found.reference
        for array in list(fields.values()):
            # Read-only, in a fifth of the time that `flags` takes.
            array.setflags(False)
        fields["steady_state"] = steady_state
        fields["sensitivities"] = fields["input_sensitivities"] = NONE
        fields["_dense"] = dense
        return response

    def __repr__(self) -> str:
        rests = "" if self.steady_state is None else f", steady state {self.steady_state:g}"
        return (
            f"<Response: {len(self.time)} output times, {self.time[0]:g} to {self.time[-1]:g} s"
            f"{rests}>"
        )

    def __iter__(self) -> Iterator[Vector]:
        yield self.time
        yield self.outputs

    def info(
        self,
        *,
        settling: float = 0.02,
        rise: tuple[float, float] = (0.1, 0.9),
        steady_state: float | None = None,
    ) -> dict[str, float]:
        """Figures of a step response, measured between the first output and the steady state.

        Peaks and crossings are found between the output times too: the response is evaluated
        again around each of them. Only what happens between two output times and is over before
        the next one is missed.

        Parameters
        ----------
        settling : float
            Half width of the settling band as a part of the step.
        rise : (float, float)
            Parts of the step between which the rise time is measured.
        steady_state : float, optional
            The output after a long time; by default `Response.steady_state`, and where that is
            None the last output.

        Returns
        -------
        dict of str to float
            ``rise_time``, ``settling_time``, ``peak_time`` in s from the first output time (NaN
            where the response does not get there), ``overshoot`` and ``undershoot`` in percent of
            the step, ``settling_min``, ``settling_max`` (the range once risen), ``peak`` (the
            output farthest from zero) and ``steady_state``. Where the output starts at the steady
            state there is no step: all but the peak and the steady state are NaN.

        Raises
        ------
        ValueError
            If `settling` is not above zero, `rise` is no increasing pair, or a number is not
            finite.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.5), delay=0.4)
        >>> round(loop.simulate(np.linspace(0, 10, 501)).info()["overshoot"], 9)     # Kp Td - 1/2
        50.0
        """
        settling = positive("settling", settling)
        rise = (finite("rise", rise[0]), finite("rise", rise[1]))
        if not 0.0 <= rise[0] < rise[1]:
            raise ValueError(f"rise={rise}: give two parts of the step, the smaller one first")
        if steady_state is not None:
            steady_state = finite("steady_state", steady_state)
        start, first = float(self.time[0]), float(self.outputs[0])
        if steady_state is None:
            known = self.steady_state
            steady_state = float(self.outputs[-1]) if known is None else known
        span = steady_state - first
        nan = float("nan")
        peak_time, peak = self._greatest(np.abs)
        found = dict.fromkeys(
            ("rise_time", "settling_time", "settling_min", "settling_max"), nan
        ) | {
            "overshoot": nan,
            "undershoot": nan,
            "peak": peak,
            "peak_time": peak_time - start,
            "steady_state": steady_state,
        }
        if span == 0.0:
            return found

        def progress(outputs: Vector) -> Vector:
            return (outputs - first) / span

        found["overshoot"] = 100.0 * max(0.0, self._greatest(progress)[1] - 1.0)
        found["undershoot"] = 100.0 * max(0.0, self._greatest(lambda y: -progress(y))[1])
        low, high = (self._crossing(progress(self.outputs) >= part) for part in rise)
        if low is not None and high is not None:
            left = self._refined(low, lambda y: progress(y) >= rise[0])
            risen = self._refined(high, lambda y: progress(y) >= rise[1])
            found["rise_time"] = risen - left
            found["settling_min"] = -self._greatest(lambda y: -y, first=high)[1]
            found["settling_max"] = self._greatest(lambda y: y, first=high)[1]
        outside = np.abs(progress(self.outputs) - 1.0) > settling
        if not outside[-1]:
            last = self._crossing(~np.logical_or.accumulate(outside[::-1])[::-1])
            found["settling_time"] = (
                0.0
                if last is None or last == 0
                else self._refined(last, lambda y: np.abs(progress(y) - 1.0) <= settling) - start
            )
        return found

    def plot(self, ax: Axes | None = None, *, command: bool = False, **style: Any) -> Axes:
        """Draw the output, with the reference as a thin line.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; new axes by default.
        command : bool
            Draw the command as well.
        **style
            Passed to `matplotlib.axes.Axes.plot` for the output.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        MissingExtraError
            If matplotlib is not installed.
        """
        from deadtime._base.drawing import shown_axes

        ax = shown_axes(ax)
        ax.plot(self.time, self.outputs, **({"label": "output"} | style))
        ax.step(self.time, self.reference, "k", where="post", linewidth=0.8, label="reference")
        if command:
            ax.plot(self.time, self.inputs, linewidth=0.8, label="command")
        ax.set_xlabel("time in s")
        ax.legend()
        return ax

    def _greatest(self, measure: Callable[[Vector], Vector], first: int = 0) -> tuple[float, float]:
        """Time and value of the greatest `measure` of the output, from index `first` on."""
        values = measure(self.outputs[first:])
        best = int(np.argmax(values)) + first
        time, value = float(self.time[best]), float(values[best - first])
        if self._dense is None:
            return time, value
        left = float(self.time[max(best - 1, first)])
        right = float(self.time[min(best + 1, len(self.time) - 1)])
        for _ in range(_MAGNIFICATIONS):
            times = np.linspace(left, right, _POINTS)
            values = measure(self._dense(times))
            best = int(np.argmax(values))
            if values[best] > value:
                time, value = float(times[best]), float(values[best])
            left, right = times[max(best - 1, 0)], times[min(best + 1, _POINTS - 1)]
        return time, value

    @staticmethod
    def _crossing(reached: NDArray[np.bool_]) -> int | None:
        """Index of the first output for which `reached` holds."""
        return int(np.argmax(reached)) if reached.any() else None

    def _refined(self, index: int, reached: Callable[[Vector], NDArray[np.bool_]]) -> float:
        """Return the time between outputs `index` - 1 and `index` from which `reached` holds."""
        right = float(self.time[index])
        if index == 0 or self._dense is None:
            return right
        left = float(self.time[index - 1])
        for _ in range(_MAGNIFICATIONS):
            times = np.linspace(left, right, _POINTS)
            holds = reached(self._dense(times))
            holds[-1] = True
            # The last stretch that holds to the end: a settling band may be left and entered
            # between two outputs.
            held = int(np.argmin(holds[::-1])) if not holds.all() else _POINTS
            right = float(times[_POINTS - held])
            left = float(times[max(_POINTS - held - 1, 0)])
        return right
