"""The response of a loop or a system in time, and how long that of a step is by default."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from operator import attrgetter, methodcaller
from typing import Any, Protocol

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.drawing import Axes, shown_axes
from deadtime._base.errors import DeadtimeError
from deadtime._base.frozen import FrozenDict, ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.validation import finite, positive, real_array
from deadtime.systems._native import first_duration
from deadtime.systems._step_metrics import OneSignal

# The first time of a step response is doubled, at most _DOUBLINGS times, until the last quarter of
# the _TIMES outputs is within _SETTLED of the steady state, or one is farther from it than _LOST: a
# smaller _SETTLED shows more of a slow end and less of a fast beginning.
_TIMES = 501
_DOUBLINGS = 10
_SETTLED = 0.005
_LOST = 20.0

#: The sensitivities of a response for which none were requested.
NONE = FrozenDict()

#: Figures that an unstable system has too.
_PEAK = ("peak", "peak_time")

_new = object.__new__

#: What a `KeptRun` holds.
PARTS = frozenset(("time", "outputs", "inputs", "breaks", "reference"))


class KeptRun(Protocol):
    """A run that gives parts of its response when they are read."""

    def __call__(self, times: Array) -> Array:
        """Outputs at other times."""
        ...

    @property
    def found(self) -> Any:
        """What has the `PARTS` as attributes, arrays that nobody can write to."""
        ...

    def steady_state(self) -> float | None:
        """Output at rest under the last reference, None without such a rest."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Response(ReadOnlyArrays, Pictured):
    """Outputs and inputs of a loop or a system over time.

    Unpacks into ``time, outputs``. A signal of one component has the shape (n,), as in
    python-control; where it jumps, its value is that after the jump.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s.
    outputs : ndarray, shape (n,) or (n_outputs, n)
        The outputs y; of shape (n,) for a loop and for a system with one input and one output.
    inputs : ndarray, shape (n,) or (n_inputs, n)
        The inputs u, of shape (n,) where the outputs are; for a loop the command after the limit.
    breaks : ndarray, shape (m,)
        Times in s between the first and the last of `time` at which output, input or state, or
        one of their first ten derivatives, jumps by more than rounding: jumps of what is put in,
        switching times of a limit, samples, and all of these again after each delay.
    reference : ndarray, shape (n,), or None
        The reference r of a loop.
    states : ndarray, shape (n_states, n), or None
        The states x of a system.
    steady_state : float, ndarray of shape (n_outputs,), or None
        The outputs at rest under the last inputs or the last reference, if those stay constant;
        None where there is no such rest.
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

    time: Array
    outputs: Array
    inputs: Array
    breaks: Array
    reference: Array | None = None
    states: Array | None = None
    steady_state: float | Array | None = None
    sensitivities: dict[str, Array] = field(default_factory=dict)
    input_sensitivities: dict[str, Array] = field(default_factory=dict)
    #: Outputs at other times of the same run.
    _dense: Callable[[Array], Array] | None = None

    def __post_init__(self) -> None:
        for name in ("time", "outputs", "inputs", "breaks", "reference", "states"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, np.array(real_array(name, given)))
        self._freeze()

    def __getstate__(self) -> dict[str, Any]:
        for name in PARTS:
            getattr(self, name)
        return self.__dict__

    def __repr__(self) -> str:
        outputs = "1 output" if self.outputs.ndim == 1 else f"{len(self.outputs)} outputs"
        rest = self.steady_state
        rests = f", steady state {rest:g}" if isinstance(rest, float) else ""
        return (
            f"<Response: {outputs} at {len(self.time)} times, {self.time[0]:g} to "
            f"{self.time[-1]:g} s{rests}>"
        )

    def __iter__(self) -> Iterator[Array]:
        yield self.time
        yield self.outputs

    def info(
        self,
        output: int = 0,
        *,
        settling: float = 0.02,
        rise: tuple[float, float] = (0.1, 0.9),
        steady_state: float | None = None,
    ) -> dict[str, float]:
        """Figures of a step response, measured between the first output and the steady state.

        Peaks and crossings are found between the output times too: the response is evaluated
        again around each of them. Only what happens between two output times and is over before
        the next one is missed.

        The settling time is that of the response up to its last output. A loop whose command was
        at its limit has one only if output and command then stayed in their bounds for three of
        the slowest time constants of the closed loop: at the limit the output may pass through
        the band.

        An unstable system does not come to its steady state. Unless `steady_state` is given, all
        figures but the peak are NaN where instability is proved and no limit acts.

        Parameters
        ----------
        output : int, default 0
            Which output, from zero.
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
        IndexError
            If there is no such output.
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
            raise ValueError(
                f"rise={rise}: give two shares of the step, the smaller one first, such as (0.1, "
                "0.9)"
            )
        if steady_state is not None:
            steady_state = finite("steady_state", steady_state)
        is_given = steady_state is not None
        signals = np.atleast_2d(self.outputs)
        index = operator.index(output)
        if not 0 <= index < len(signals):
            raise IndexError(f"output={output}: there are {len(signals)} outputs, numbered from 0")
        if steady_state is None and self.steady_state is not None:
            steady_state = float(np.ravel(self.steady_state)[index])
        dense = self._dense
        signal = OneSignal(
            self.time,
            signals[index],
            None if dense is None else lambda times: np.atleast_2d(dense(times))[index],
        )
        found = signal.step_metrics(settling, rise, steady_state)
        judge = getattr(dense, "stays_settled", None)
        if judge is not None and not judge(self.time, self.inputs, found["settling_time"]):
            found["settling_time"] = float("nan")
        if not is_given and np.isnan(found["settling_time"]) and _grows(dense):
            found = {name: found[name] if name in _PEAK else float("nan") for name in found}
        return found

    def plot(self, ax: Axes | None = None, *, inputs: bool = False, **style: Any) -> Axes:
        """Draw the outputs, with the reference of a loop as a thin line.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; new axes by default.
        inputs : bool
            Draw the inputs as well.
        **style
            Passed to `matplotlib.axes.Axes.plot` for the outputs.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        MissingExtraError
            If matplotlib is not installed.
        """
        ax = shown_axes(ax)
        shown = [("output", self.outputs, style)]
        if inputs:
            shown.append(("input", self.inputs, {"linewidth": 0.8}))
        for name, signals, looks in shown:
            rows = np.atleast_2d(signals)
            for i, values in enumerate(rows):
                label = name if len(rows) == 1 else f"{name} {i}"
                ax.plot(self.time, values, **({"label": label} | looks))
        if self.reference is not None:
            ax.step(self.time, self.reference, "k", where="post", linewidth=0.8, label="reference")
        ax.set_xlabel("time in s")
        ax.legend()
        return ax


class _Later:
    """What a response lacks is found when it is first read: few runs are asked for all."""

    __slots__ = ("find", "name")

    def __init__(self, name: str, find: Callable[[KeptRun], Any]) -> None:
        self.name, self.find = name, find

    def __get__(self, response: Response | None, owner: type[Response]) -> Any:
        run = None if response is None else response.__dict__.get("_dense")
        if run is None:
            raise AttributeError(f"a {owner.__name__} has no attribute {self.name!r}")
        value = response.__dict__[self.name] = self.find(run)
        return value


for _name in PARTS:
    setattr(Response, _name, _Later(_name, attrgetter(f"found.{_name}")))
for _name in ("sensitivities", "input_sensitivities"):
    setattr(Response, _name, _Later(_name, lambda run: NONE))
setattr(Response, "steady_state", _Later("steady_state", methodcaller("steady_state")))  # noqa: B010


def _grows(dense: Callable[[Array], Array] | None) -> bool:
    """Whether a run is proved to grow beyond all bounds."""
    grows = getattr(dense, "grows", None)
    try:
        return grows is not None and grows()
    except (DeadtimeError, ValueError):  # the poles are not known
        return False


def response_of(run: KeptRun) -> Response:
    """The response whose parts are those of a run, most of them taken as they are read."""
    response = _new(Response)
    parts = response.__dict__
    parts["_dense"] = run
    # Nearly everyone reads these, and a descriptor takes longer than the array.
    parts["outputs"] = run.found.outputs
    return response


def until_settled(run: Callable[[Array], Response], A: Array, delay: float) -> Response:
    """Response of `run` at times that go on until it has settled, found by doubling the last."""
    span = first_duration(A, delay)
    for _ in range(_DOUBLINGS):
        response = run(np.linspace(0.0, span, _TIMES))
        rest, outputs = response.steady_state, np.atleast_2d(response.outputs)
        final = outputs[:, -1] if rest is None else np.atleast_1d(rest)
        error = np.abs(outputs - final[:, None]).max(axis=0)
        # If the response returns to zero, its error is compared with its peak.
        size = float(np.abs(final).max()) or float(error.max())
        if error[-_TIMES // 4 :].max() <= _SETTLED * size or error.max() > _LOST * size:
            break
        span *= 2.0
    return response
