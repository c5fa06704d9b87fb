"""Distributions of one-way delays."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Protocol

from deadtime._base.validation import non_negative, positive


class Delays(Protocol):
    """A distribution of one-way delays."""

    @property
    def mean(self) -> float:
        """Mean delay, s."""

    def draw(self, numbers: random.Random) -> float:
        """One delay, s."""


@dataclass(frozen=True)
class Constant:
    """Every packet takes the same time.

    Parameters
    ----------
    mean : float
        The delay, s.
    """

    mean: float

    def __post_init__(self) -> None:
        non_negative("mean", self.mean)

    def draw(self, numbers: random.Random) -> float:
        """The delay, s."""
        return self.mean


@dataclass(frozen=True)
class Normal:
    """Normally distributed delays; those below zero are zero.

    Parameters
    ----------
    mean, deviation : float
        Mean and standard deviation, s.
    """

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        non_negative("mean", self.mean)
        non_negative("deviation", self.deviation)

    def draw(self, numbers: random.Random) -> float:
        """One delay, s."""
        return max(0.0, numbers.gauss(self.mean, self.deviation))


@dataclass(frozen=True)
class _Queued:
    """A shortest delay plus a random wait, with checked parameters."""

    least: float
    mean: float
    deviation: float

    def __post_init__(self) -> None:
        non_negative("least", self.least)
        positive("deviation", self.deviation)
        if not self.mean > self.least:
            raise ValueError(
                f"the mean delay, mean={self.mean}, must be above the least delay, "
                f"least={self.least}: give a larger mean"
            )


@dataclass(frozen=True)
class ShiftedGamma(_Queued):
    """A shortest delay plus a gamma-distributed wait, as in queues.

    Parameters
    ----------
    least : float
        The shortest delay, s.
    mean : float
        Mean delay, above `least`, s.
    deviation : float
        Standard deviation, s.
    """

    def draw(self, numbers: random.Random) -> float:
        """One delay, s."""
        wait = self.mean - self.least
        shape = (wait / self.deviation) ** 2
        return self.least + numbers.gammavariate(shape, wait / shape)


@dataclass(frozen=True)
class LogNormal(_Queued):
    """A shortest delay plus a log-normally distributed wait, which has a long tail.

    Parameters
    ----------
    least : float
        The shortest delay, s.
    mean : float
        Mean delay, above `least`, s.
    deviation : float
        Standard deviation, s.
    """

    def draw(self, numbers: random.Random) -> float:
        """One delay, s."""
        wait = self.mean - self.least
        spread = math.log1p((self.deviation / wait) ** 2)
        return self.least + numbers.lognormvariate(math.log(wait) - 0.5 * spread, math.sqrt(spread))
