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

from deadtime._base.arrays import Array
from deadtime._base.validation import one_dimensional
from deadtime.estimation.evidence._numbers import LoopView
from deadtime.loops import ControlLoop, Plant
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


def angle(plant: Plant, late: float, omega: Array) -> Array:
    """Angle of the plant behind a delay, rad, without jumps; of -G where its gain is negative."""
    num, den = plant.polynomials()
    zeros, poles = np.roots(num), np.roots(den)
    turn = -omega * late - 0.5 * np.pi * np.count_nonzero(poles == 0.0)
    for roots, sign in ((zeros, 1.0), (poles[poles != 0.0], -1.0)):
        for root in roots:
            turn = turn + sign * np.angle(1.0 - 1j * omega / root)
    return np.asarray(turn)


def size(plant: Plant, omega: Array) -> Array:
    """Size of the plant at frequencies in rad/s."""
    num, den = plant.polynomials()
    return np.asarray(np.abs(np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega)))


def limits(loop: ControlLoop) -> tuple[float, float]:
    """Largest stable proportional gain around the plant, and where half of it crosses over.

    Infinite and NaN where no gain is largest.
    """
    around = loop.plant.transfer_function()
    gain = loop.parameters.get("gain", 1.0)
    sign = -1.0 if gain is not None and gain < 0.0 else 1.0
    late = sign * around * delay(loop.delay or 0.0)
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


class Felt:
    """What a loop feels of the plant of an estimate: part of `DelayEstimate`."""

    if TYPE_CHECKING:
        loop: ControlLoop
        free: tuple[str, ...]
        cov: Array
        uncalibrated: str

        def quantile(self, level: float) -> float: ...

    @cached_property
    def _limits(self) -> tuple[float, float]:
        if not self.loop.plant.is_linear:
            return math.nan, math.nan
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

    @property
    def gain_at_crossover(self) -> float:
        """Size of G at `crossover`."""
        return self._at_crossover["gain_at_crossover"]

    @property
    def phase_at_crossover(self) -> float:
        """Angle of G at `crossover`, rad."""
        return self._at_crossover["phase_at_crossover"]

    @property
    def delay_at_crossover(self) -> float:
        """Equivalent delay at `crossover`, s."""
        return self._at_crossover["delay_at_crossover"]

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
        given = one_dimensional("omega", np.atleast_1d(np.asarray(omega, dtype=float)))
        bad = given[~(given > 0.0)]
        if bad.size:
            raise ValueError(f"omega={bad[0]:g} rad/s: give frequencies above zero")
        if not self.loop.plant.is_linear:
            raise ValueError(
                "the plant limits the rate of its command, so the plant is not linear and has "
                "no gain or phase"
            )
        turned = _integrators(self.loop.plant) * 0.5 * np.pi

        def seen(loop: ControlLoop) -> Array:
            phase = angle(loop.plant, loop.delay or 0.0, given)
            return np.array([np.log(size(loop.plant, given)), phase])

        middle = seen(self.loop)
        low, high = self._ends(seen, level)
        ends = np.array([low, high])
        to_delay = -1.0 / given
        return LoopView(
            given,
            np.exp(middle[0]),
            middle[1],
            to_delay * (middle[1] + turned),
            np.exp(ends[:, 0]),
            ends[:, 1],
            (to_delay * (ends[:, 1] + turned))[::-1],
        )

    @cached_property
    def _at_crossover(self) -> dict[str, float]:
        omega = self.crossover
        if not math.isfinite(omega):
            return dict.fromkeys(FELT[2:], math.nan)
        place = np.array([omega])
        phase = float(angle(self.loop.plant, self.loop.delay or 0.0, place)[0])
        turned = phase + _integrators(self.loop.plant) * 0.5 * math.pi
        gain = float(size(self.loop.plant, place)[0])
        return dict(zip(FELT[2:], (gain, phase, -turned / omega), strict=True))

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
        values, vectors = np.linalg.eigh(self.cov)
        axes = self.quantile(level) * vectors * np.sqrt(np.maximum(values, 0.0))
        below, above = np.zeros_like(middle), np.zeros_like(middle)
        for axis in axes.T:
            steps = (dict(zip(self.free, step.tolist(), strict=True)) for step in (axis, -axis))
            moved = np.array([of(_moved(self.loop, step)) for step in steps])
            # Where no gain is largest beside one that is, the interval is open.
            changes = np.where(np.isnan(moved), math.inf, moved - middle)
            below += np.minimum(changes.min(axis=0), 0.0) ** 2
            above += np.maximum(changes.max(axis=0), 0.0) ** 2
        return middle - np.sqrt(below), middle + np.sqrt(above)


def _integrators(plant: Plant) -> int:
    """How often the plant integrates."""
    _, den = plant.polynomials()
    return int(np.count_nonzero(np.roots(den) == 0.0))


def _moved(loop: ControlLoop, steps: Mapping[str, float]) -> ControlLoop:
    """The loop with its numbers moved; times stay at zero or above, and the gain keeps its sign."""
    found = {}
    for name, step in steps.items():
        if name not in loop.parameters:
            continue
        value = loop.parameters[name]
        new = value + step
        if name == "gain":
            new = value * math.exp(step / value)
        elif name.startswith(("delay", "lag")):
            new = max(new, 0.0)
        elif name == "time_constant" or name.startswith("pole_"):
            new = max(new, LEAST * value)
        found[name] = new
    return loop.replace(**found)
