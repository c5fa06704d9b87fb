"""The response to a step of a load, and its figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, increasing, positive, real_array
from deadtime.loops._native import DeviationFigures, deviation_figures
from deadtime.loops._specification import LoopSpecification
from deadtime.systems import Response

#: Times of a response whose times are not given: more show it finer.
_TIMES = 501

#: They reach to so many times the recovery: more show more of the rest.
_SHOWN = 2.0


class DeviationQuestion(NamedTuple):
    """What steps, and how the deviation of the output is measured, as the kernel takes it."""

    #: ``reference``, ``load`` or ``output``.
    of: str
    size: float = 1.0
    band: float = 0.02
    #: Length of the run in s; None until the output rests.
    span: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class LoadResponse(Response):
    """Response to a step of a load, with its figures; made by `ControlLoop.load_response`.

    The figures are those of the deviation of the output from the one before the load. They are
    measured on the continuous response and depend on no grid of times.

    Attributes
    ----------
    peak : float
        Largest modulus of the deviation.
    peak_time : float
        Its time from the load on, s.
    iae : float
        Integral of the modulus, in units of the output times s; to infinity where no end was given:
        infinite where the load leaves an offset, NaN where the output does not come to rest.
    ie : float
        Integral of the deviation, likewise.
    recovery_time : float
        Time from the load on after which the modulus stays within `settling` times the peak, s; NaN
        where it does not.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 5.0), dtm.PI(Kp=1.2, Ki=0.3), delay=1.0)
    >>> found = loop.load_response()
    >>> found
    <LoadResponse: peak 0.588 at 2.48 s, recovered after 16.4 s>
    >>> round(found.ie, 9)                                                  # 1/Ki
    3.333333333
    """

    peak: float = float("nan")
    peak_time: float = float("nan")
    iae: float = float("nan")
    ie: float = float("nan")
    recovery_time: float = float("nan")

    def __repr__(self) -> str:
        peak = f"peak {self.peak:.3g} at {self.peak_time:.3g} s"
        if np.isnan(self.recovery_time):
            return f"<LoadResponse: {peak}, not recovered>"
        return f"<LoadResponse: {peak}, recovered after {self.recovery_time:.3g} s>"

    def info(self, output: int = 0, **unused: Any) -> dict[str, float]:
        """Figures of the load response.

        Parameters
        ----------
        output : int
            Zero: a loop has one output.
        **unused
            The arguments of `Response.info` have no meaning here.

        Returns
        -------
        dict of str to float
            ``peak``, ``peak_time``, ``iae``, ``ie`` and ``recovery_time``.

        Raises
        ------
        IndexError
            If there is no such output.
        TypeError
            If an argument of `Response.info` is given.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.0), delay=0.2)
        >>> loop.load_response().info()["iae"]
        inf
        """
        if unused:
            raise TypeError(
                f"{', '.join(unused)}: a load response takes no arguments here, because its "
                "figures are relative to the output before the load"
            )
        if output != 0:
            raise IndexError(f"output={output}: a loop has only one output. Give 0")
        names = ("peak", "peak_time", "iae", "ie", "recovery_time")
        return {name: getattr(self, name) for name in names}


def asked(
    loop: LoopSpecification,
    time: ArrayLike | None,
    size: float,
    at: Literal["input", "output"],
    settling: float,
) -> tuple[DeviationQuestion, Array | None]:
    """Check the arguments of `ControlLoop.load_response`; None where no times are given."""
    if not loop.plant.is_rational:
        raise ValueError(
            "the load response of a plant with delays inside cannot be computed: give a plant "
            "that is rational except for one delay in series"
        )
    _ = loop.known_delay
    height = finite("size", size)
    if height == 0.0:
        raise ValueError("size=0 is not a load: give a number other than zero")
    band = positive("settling", settling)
    if band >= 1.0:
        raise ValueError(
            f"settling={settling}: give a share of the largest deviation, between 0 and 1"
        )
    question = DeviationQuestion(load_of(at), height, band)
    if time is None:
        return question, None
    given = real_array("time", time)
    if given.ndim == 0:
        times = np.linspace(0.0, positive("time", float(given)), _TIMES)
    else:
        times = np.array(increasing("time", given))
        if times.size < 2:
            raise ValueError(
                "time has only one entry: give several times, or only the last time as a number"
            )
    return question._replace(span=float(times[-1] - times[0])), times


def load_of(at: str) -> str:
    """The input of the kernel for a place of a load."""
    if at not in ("input", "output"):
        raise ValueError(f"at={at!r}: give 'input' or 'output' of the plant")
    return "load" if at == "input" else "output"


def figures_of(loop: LoopSpecification, question: DeviationQuestion) -> DeviationFigures:
    """Measure the deviation of one loop."""
    return deviation_figures(loop.kernel, question)


def shown_times(found: DeviationFigures) -> Array:
    """Times at which a response is shown whose times are not given."""
    span = found.span
    if np.isfinite(found.recovery_time):
        span = min(span, _SHOWN * found.recovery_time)
    return np.linspace(0.0, span, _TIMES)


def load_response_of(run: Response, found: DeviationFigures) -> LoadResponse:
    """The response with its figures."""
    return LoadResponse(
        time=run.time,
        outputs=run.outputs,
        inputs=run.inputs,
        breaks=run.breaks,
        reference=run.reference,
        steady_state=found.rest if np.isfinite(found.rest) else None,
        _dense=run._dense,
        peak=found.peak,
        peak_time=found.peak_time,
        iae=found.iae,
        ie=found.ie,
        recovery_time=found.recovery_time,
    )
