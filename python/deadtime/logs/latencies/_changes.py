"""What changed between two logs of a vehicle.

The time of a loop is an equivalent delay at the frequencies at which it moved. Two logs are
compared at those of both, each with half of the weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import Verdict, verdict_if
from deadtime.logs.latencies._latency import Latency
from deadtime.logs.latencies._relation import TWO_SIDED, Frequencies, LoopLatency

#: Probability below which a difference counts as real.
REAL = 0.05


@dataclass(frozen=True)
class LatencyChange:
    """The time of one loop in two logs.

    Attributes
    ----------
    loop, command : str
        The loop, and from what the time counts.
    before, after : float
        The time in the first log and in the second, at the frequencies of both, s.
    before_error, after_error : float
        Their standard errors, s.
    p_value : float
        Probability of such a difference, or a larger one, if nothing had changed.
    verdict : {"reliable", "indication"}
        Whether both estimates are reliable; if not, the probability is not known.
    """

    loop: str
    command: str
    before: float
    before_error: float
    after: float
    after_error: float
    p_value: float
    verdict: Verdict

    @property
    def change(self) -> float:
        """How much longer the loop takes in the second log, s."""
        return self.after - self.before

    @property
    def stderr(self) -> float:
        """Standard error of the change, s."""
        return math.hypot(self.before_error, self.after_error)

    @property
    def ci(self) -> tuple[float, float]:
        """95 % interval of the change, s."""
        reach = 0.5 * TWO_SIDED * self.stderr
        return self.change - reach, self.change + reach

    @property
    def outcome(self) -> str:
        """Whether the difference is real, in words."""
        if self.verdict != "reliable":
            return "not known, because one of the two estimates is only an indication"
        if self.p_value >= REAL:
            return f"no difference was found (p = {self.p_value:.2g})"
        way = "longer" if self.change > 0.0 else "shorter"
        return f"{way}, and not by chance (p = {self.p_value:.2g})"

    def to_dict(self) -> dict[str, Any]:
        """The change as plain values for JSON."""
        own = {"change": self.change, "interval_95": self.ci, "outcome": self.outcome}
        return plain_fields({**vars(self), **own})


def compare_latencies(before: Latency, after: Latency) -> tuple[LatencyChange, ...]:
    """Compare the loops of which two logs show the time.

    Parameters
    ----------
    before, after : Latency

    Returns
    -------
    tuple of LatencyChange
        With a two-sided z test of the difference of the times.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(600) * 0.01
    >>> command = np.where(time < 0.3, 0.0, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))))
    >>> noise = 0.003 * np.random.default_rng(1).standard_normal((2, 600))
    >>> found = []
    >>> for delay, error in zip((0.03, 0.05), noise):
    ...     vehicle = dtm.FactoredPlant([0.08]).transfer_function() * dtm.delay(delay)
    ...     angle = np.ravel(vehicle.simulate(time, command).outputs) + error
    ...     found.append(dtm.latency(dtm.Recording(time, command, angle)))
    >>> (change,) = dtm.logs.compare_latencies(*found)
    >>> low, high = change.ci
    >>> low < 0.02 < high, change.p_value < 0.05
    (True, True)
    """
    from scipy import special

    found = []
    for earlier in before.estimated:
        for other in after.estimated:
            if (earlier.loop, earlier.command) != (other.loop, other.command):
                continue
            seen = _seen_by_both(earlier, other)
            (first, first_error), (second, second_error) = (
                _at(seen, each) for each in (earlier, other)
            )
            spread = math.hypot(first_error, second_error)
            z = abs(second - first) / spread if spread > 0.0 else math.inf
            reliable = earlier.verdict == other.verdict == "reliable"
            found.append(
                LatencyChange(
                    earlier.loop, earlier.command, first, first_error, second, second_error,
                    float(2.0 * special.ndtr(-z)), verdict_if(reliable),
                )
            )  # fmt: skip
    return tuple(found)


def _seen_by_both(first: LoopLatency, second: LoopLatency) -> Frequencies:
    """Where the responses of both move, each with half of the weight."""
    omega = np.concatenate([first.frequencies, second.frequencies])
    return Frequencies(omega, 0.5 * np.concatenate([first.weights, second.weights]))


def _at(seen: Frequencies, loop: LoopLatency) -> tuple[float, float]:
    """The time of a loop at other frequencies, and its standard error, s."""
    assert loop.estimate is not None
    value, (low, high) = loop.estimate.mean_delay(*seen)
    own, _ = loop.estimate.mean_delay(loop.frequencies, loop.weights)
    return loop.time + value - own, max(loop.stderr, (high - low) / TWO_SIDED)
