"""The filter of a derivative, continuous or on samples, as a computer runs it.

The filter x' = F x + G v, d = C x, driven by the samples v_k of what it filters, becomes

    x_{k+1} = Fd x_k + Gd v_k,   d_k = Cd x_k + Dd v_k.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias, get_args

from deadtime._base.arrays import Array
from deadtime._base.validation import positive
from deadtime.loops._native import sampled_filter

Discretisation: TypeAlias = Literal["hold", "tustin", "backward"]


@dataclass(frozen=True)
class DerivativeFilter:
    """H(s) = omega^2 s / (s^2 + 2 damping omega s + omega^2), a derivative that rolls off.

    Parameters
    ----------
    omega : float
        Corner in rad/s, above zero.
    damping : float
        Damping ratio, above zero.
    discretisation : {"hold", "tustin", "backward"}, optional
        How the filter runs in a loop with a sample time: on samples, by the rule named
        (zero-order hold, the trapezoidal rule, Euler's implicit rule). By default it is a
        continuous filter before the sampler, as an analogue one or one that runs much faster. A
        continuous loop takes the continuous filter in any case.

    Raises
    ------
    ValueError
        If a number is not above zero or not finite, or there is no such rule.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(), dtm.PV(2.0, 0.3, filter=dtm.DerivativeFilter(38.0)), delay=0.36
    ... )
    >>> loop.characteristic().kind          # with an ideal derivative: neutral
    'retarded'

    With 38 rad/s and samples of 0.065 s, the rule is a matter of a third of the stable gains:

    >>> for rule in (None, "hold", "tustin", "backward"):
    ...     smooth = dtm.DerivativeFilter(38.0, discretisation=rule)
    ...     loop = dtm.ControlLoop(
    ...         dtm.Integrator(), dtm.PV(2.0, 0.3, smooth), delay=0.36, sample_time=0.065
    ...     )
    ...     print(rule, round(loop.stable_range("Kv")[1], 3))
    None 0.894
    hold 1.268
    tustin 0.879
    backward 0.887
    """

    omega: float
    damping: float = 1.0
    discretisation: Discretisation | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", positive("omega", self.omega))
        object.__setattr__(self, "damping", positive("damping", self.damping))
        rules = get_args(Discretisation)
        if self.discretisation not in (None, *rules):
            raise ValueError(
                f"discretisation={self.discretisation!r}: give one of "
                f"{', '.join(map(repr, rules))}, or None"
            )


#: The derivative of the paper's PV controller: its vehicle reports no vertical speed.
PAPER_FILTER = DerivativeFilter(omega=38.0, damping=1.0)


class SampledFilter(NamedTuple):
    """Fd, Gd, Cd, Dd."""

    F: Array
    G: Array
    C: Array
    D: float


def discretised(
    F: Array, G: Array, C: Array, sample_time: float, method: Discretisation
) -> SampledFilter:
    """Return the filter of a sample time in s by one of the methods."""
    return SampledFilter(*sampled_filter(F, G, C, sample_time, method))
