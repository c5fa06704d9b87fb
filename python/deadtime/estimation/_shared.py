"""What several estimates say together about a number that they share.

Recordings of several axes share the delay of the link, not gain, lag or noise. Each estimate has a
profile over the number, with everything else of its own fitted. Their recordings are independent,
so their statistics add up: S(x) = sum of t_i(x)^2. Its minimum is the likeliest common value. The
interval holds all values at which S is above it by less than the square of a Gaussian quantile. If
they do share the number, the minimum is chi-squared with one degree of freedom less than there are
estimates (Cochran 1954). Profiles over a delay have several minima where rows are far apart, and so
has S: it is computed on a grid first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import deadtime.estimation._native as native
from deadtime._base.digits import between, shown
from deadtime._base.plain import plain_fields
from deadtime._base.validation import confidence
from deadtime._base.verdicts import Verdict, claimed, verdict_if
from deadtime.estimation._least_squares import floor_of, unit_of
from deadtime.estimation._result import DelayEstimate

#: Steps of the grid in the smallest interval, and most of them.
IN_AN_INTERVAL, ON_THE_GRID = 8, 120

#: Share of the smallest interval to which the minimum and the ends are found.
TOLERANCE = 1e-3


@dataclass(frozen=True)
class SharedNumber:
    """A number that several estimates share.

    Attributes
    ----------
    name : str
        The number, such as ``"delay"``.
    value : float
        The likeliest common value.
    interval : (float, float)
        Its interval.
    level : float
        The level of the interval.
    estimates : tuple of float
        The value of each estimate.
    p_value : float
        Probability of estimates that differ as much, or more, if they share the number.
    verdict : {"reliable", "indication"}
        Whether all estimates are reliable and do not contradict one another.
    """

    name: str
    value: float
    interval: tuple[float, float]
    level: float
    estimates: tuple[float, ...]
    p_value: float
    verdict: Verdict

    @property
    def agree(self) -> bool:
        """Whether the estimates may share the number."""
        return self.p_value >= native.LEVEL_OF_TESTS

    def summary(self) -> str:
        """The number in one line."""
        from scipy import special

        low, high = self.interval
        error = (high - low) / (2.0 * float(special.ndtri(0.5 + 0.5 * self.level)))
        unit = unit_of(self.name)
        ends = ""
        if self.verdict == "reliable":
            ends = f"{100.0 * self.level:g} %: {between(low, high, error, unit)}; "
        text = (
            f"{self.verdict}: {self.name} of {len(self.estimates)} estimates "
            f"{claimed(self.verdict, self.value, error, unit)} ({ends}probability "
            f"of such differences or larger: p = {self.p_value:.2g})"
        )
        if not self.agree:
            each = ", ".join(shown(estimate, error, unit) for estimate in self.estimates)
            return f"{text}. The estimates contradict one another: {each}"
        if self.verdict != "reliable":
            text += ". One of the estimates is only an indication"
        return text

    def to_dict(self) -> dict[str, Any]:
        """The number as plain values for JSON."""
        return plain_fields({**vars(self), "agree": self.agree})


def shared_number(
    estimates: Sequence[DelayEstimate], name: str = "delay", level: float = 0.95
) -> SharedNumber:
    """Combine estimates from independent recordings that share one number and nothing else.

    Parameters
    ----------
    estimates : sequence of DelayEstimate
        Two or more, such as those of roll, pitch and yaw, whose commands take the same way.
    name : str
        What they share: ``"delay"``, ``"gain"``, ``"delay+lag"``, or another fitted number.
    level : float
        Of the interval, between 0 and 1.

    Returns
    -------
    SharedNumber
        With gain, lag and noise of each recording fitted by themselves.

    Raises
    ------
    ValueError
        When there are fewer than two estimates, one has no profile (its method has none), or the
        number was not fitted in one of them.

    See Also
    --------
    estimate_delay : Several recordings that share all numbers, fitted together.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(300) * 0.02
    >>> command = 0.2 * np.sign(np.sin(3.7 * (time - 0.3))) * (time > 0.3)
    >>> loop = dtm.ControlLoop(dtm.FactoredPlant([0.1]), dtm.P(1.0), sample_time=0.02)
    >>> noise = 0.003 * np.random.default_rng(1).standard_normal((2, 300))
    >>> found = []
    >>> for lag, error in zip((0.05, 0.15), noise):
    ...     vehicle = dtm.FactoredPlant([lag]).transfer_function() * dtm.delay(0.06)
    ...     angle = np.ravel(vehicle.simulate(time, command).outputs) + error
    ...     axis = dtm.Recording(time, command, angle, command=command)
    ...     found.append(dtm.estimate_delay(axis, loop, free=("delay", "gain", "lag_1")))
    >>> both = dtm.estimation.shared_number(found)
    >>> both.agree, both.interval[0] < 0.06 < both.interval[1]
    (True, True)
    """
    from scipy import special

    if len(estimates) < 2:
        raise ValueError(
            f"{len(estimates)} estimates were given: a shared parameter needs two or more"
        )
    confidence(level)
    ends = [fit.ci(level, name) for fit in estimates]

    def total(value: float) -> float:
        return math.fsum(float(fit.profile(name, [value])[1][0]) ** 2 for fit in estimates)

    width = min(high - low for low, high in ends)
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    count = min(ON_THE_GRID, math.ceil(IN_AN_INTERVAL * (high - low) / width))
    rise = float(special.ndtri(0.5 + 0.5 * level)) ** 2
    best, least, interval = native.shared_number(
        total, (low, high), count, rise, floor_of(name), TOLERANCE * width
    )
    p_value = float(special.chdtrc(len(estimates) - 1, least))
    return SharedNumber(
        name=name,
        value=best,
        interval=interval,
        level=level,
        estimates=tuple(fit._value(name) for fit in estimates),
        p_value=p_value,
        verdict=verdict_if(
            p_value >= native.LEVEL_OF_TESTS and all(fit.verdict == "reliable" for fit in estimates)
        ),
    )
