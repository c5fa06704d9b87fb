"""What a loop feels of an estimated plant: G around crossover, with intervals.

Of the fitted numbers x with covariance C = Σ v vᵀ, a quantity f(x) has the interval

    f(x) ± (Σ (f(x ± q v) - f(x))²)^(1/2),   q the quantile,

each end from the moves that lead there: to first order that of the delta method, and secants over
the interval itself where f bends. Gains are moved by their logarithms. Times below zero are zero.

G is that of the continuous plant with its dead time, without a hold, as in `PlantEstimate`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime.estimation.evidence._numbers import AtCrossover, LoopView, frequencies
from deadtime.loops import ControlLoop
from deadtime.recordings import Columns, Recording
from deadtime.roots import delay

#: Names of what is felt, as `ci` takes them.
FELT = (
    "largest_gain",
    "crossover",
    "gain_at_crossover",
    "phase_at_crossover",
    "delay_at_crossover",
)

#: The same in words.
WORDS = {
    "largest_gain": "largest stable gain",
    "crossover": "crossover at half this gain",
    "delay_at_crossover": "equivalent delay there",
}

#: Share of the largest power of a command from which a frequency counts as excited. Smaller: noise
#: of the controller counts; larger: harmonics of steps do not.
EXCITED = 1e-3

#: Share of its value below which a time constant is not moved: one of zero is no plant.
LEAST = 1e-3


def seen(loop: ControlLoop, omega: ArrayLike) -> Array:
    """Logarithm of the size, angle and equivalent delay of a plant behind its delay, a row each."""
    num, den = loop.plant.polynomials()
    places = np.atleast_1d(omega).tolist()
    return np.array(native.felt_plant(num.tolist(), den.tolist(), loop.delay or 0.0, places))


def limits(loop: ControlLoop) -> tuple[float, float]:
    """Largest stable proportional gain around the plant, and where half of it crosses over.

    Infinite and NaN where no gain is largest; both NaN for a plant that limits rates.
    """
    if not loop.plant.is_linear:
        return math.nan, math.nan
    sign = -1.0 if loop.parameters.get("gain", 1.0) < 0.0 else 1.0
    late = sign * loop.plant.transfer_function() * delay(loop.delay or 0.0)
    found = late.margin()
    largest = min(found.gain_margins[found.phase_crossovers > 0.0].tolist(), default=math.inf)
    if not math.isfinite(largest):
        return sign * math.inf, math.nan
    halved = (0.5 * largest * late).margin().gain_crossovers
    return sign * largest, float(max(halved, default=math.nan))


def highest_excited(recording: Recording, loop: ControlLoop) -> float:
    """Highest frequency, rad/s, at which the command has power; NaN if it is unknown or rests."""
    columns = Columns(recording.time, recording.reference, recording.output, recording.command)
    command = columns.commands(loop)
    if command is None or np.ptp(command) == 0.0:
        return math.nan
    power = np.abs(np.fft.rfft(command - command.mean())) ** 2
    highest = int(np.flatnonzero(power >= EXCITED * power.max())[-1])
    return 2.0 * math.pi * highest / (command.size * recording.sample_time)


class Felt(AtCrossover):
    """What a loop feels of the plant of an estimate: part of `DelayEstimate`."""

    loop: ControlLoop
    free: tuple[str, ...]
    cov: Array

    if TYPE_CHECKING:

        def quantile(self, level: float) -> float: ...

    @cached_property
    def _limits(self) -> tuple[float, float]:
        return limits(self.loop)

    @property
    def largest_gain(self) -> float:
        """Largest stable proportional gain around the plant, without a hold; may be infinite.

        NaN for a plant that limits rates: it has none.
        """
        return self._limits[0]

    @property
    def crossover(self) -> float:
        """Frequency, rad/s, at which half of `largest_gain` crosses over; NaN without one."""
        return self._limits[1]

    @property
    def crossover_in_loop(self) -> float:
        """Highest frequency, rad/s, at which the loop with its controller crosses over.

        NaN if it crosses over nowhere, or the plant limits rates.
        """
        if not self.loop.plant.is_linear:
            return math.nan
        loop = self.loop.continuous()
        return float(max(loop.margin().gain_crossovers, default=math.nan))

    def at(self, omega: ArrayLike, level: float = 0.95) -> LoopView:
        """Gain, phase and equivalent delay at some frequencies, with intervals.

        Parameters
        ----------
        omega : array_like, shape (n,)
            Frequencies above zero, rad/s.
        level : float
            Of the intervals, between 0 and 1. They are NaN where the method has none, and not
            claimed to hold where the verdict is ``"indication"``.

        Returns
        -------
        LoopView

        Raises
        ------
        ValueError
            If a frequency is not above zero, or the plant limits rates.
        """
        given = frequencies("omega", omega)
        if not self.loop.plant.is_linear:
            raise ValueError(
                "the plant limits the rate of its command, so the plant is not linear and has "
                "no gain or phase"
            )
        size, phase, late = seen(self.loop, given)
        sizes, *others = np.swapaxes(self._ends(lambda loop: seen(loop, given), level), 0, 1)
        return LoopView(given, np.exp(size), phase, late, np.exp(sizes), *others)

    @cached_property
    def _at_crossover(self) -> tuple[float, float, float]:
        omega = self.crossover
        if not math.isfinite(omega):
            return math.nan, math.nan, math.nan
        size, phase, late = seen(self.loop, omega)[:, 0].tolist()
        return math.exp(size), phase, late

    def _felt_interval(self, level: float, name: str) -> tuple[float, float]:
        """The interval of one of `FELT`."""
        if name in ("largest_gain", "crossover"):
            place = FELT.index(name)
            sign = math.copysign(1.0, self.largest_gain) if name == "largest_gain" else 1.0
            low, high = self._ends(
                lambda loop: np.log(np.abs(np.array([limits(loop)[place]]))), level
            )
            ends = sorted((sign * math.exp(low[0]), sign * math.exp(high[0])))
            return ends[0], ends[1]
        view = self.at(self.crossover, level)
        found = getattr(view, f"{name.partition('_')[0]}_ci")[:, 0]
        return float(found[0]), float(found[1])

    def _ends(self, of: Callable[[ControlLoop], Array], level: float) -> tuple[Array, Array]:
        """Lower and upper ends of what is read from a loop, at this level."""
        middle = of(self.loop)
        if not np.all(np.isfinite(self.cov)):
            unknown = np.full_like(middle, math.nan)
            return unknown, unknown

        def moved(step: list[float]) -> list[float]:
            loop = _moved(self.loop, dict(zip(self.free, step, strict=True)))
            return np.ravel(of(loop) - middle).tolist()

        # Where no gain is largest beside one that is, the interval is open.
        below, above = native.secant_ends(moved, self.cov, self.quantile(level))
        return middle - below.reshape(middle.shape), middle + above.reshape(middle.shape)


def _moved(loop: ControlLoop, steps: Mapping[str, float]) -> ControlLoop:
    """The loop with its numbers moved; times stay at zero or above, and the gain keeps its sign."""
    found = {}
    for name in filter(loop.parameters.__contains__, steps):
        value, step = loop.parameters[name], steps[name]
        found[name] = value + step
        if name == "gain":
            found[name] = value * math.exp(step / value)
        elif name.startswith(("delay", "lag")):
            found[name] = max(found[name], 0.0)
        elif name.startswith(("time_constant", "pole_")):
            found[name] = max(found[name], LEAST * value)
    return loop.replace(**found)
