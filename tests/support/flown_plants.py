"""Plants of known truth, exact at any time, and the noise of a sensor with its covariance.

A plant is gain (zero s + 1)/(square s² + lag s + 1) behind a delay. Its equivalent delay as the
frequency goes to zero is delay + lag - zero. In partial fractions it is a sum of shares of
1/(1 - s/pole), each of which follows a held input exactly:

    z(t) = u + (z(0) - u) exp(pole t).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]

#: The numbers of a plant that an estimate has to find, by its kind.
FREE = {
    "lag": ("delay", "lag"),
    "lags": ("delay", "lag", "square"),
    "pair": ("delay", "lag", "square"),
    "pair and zero": ("delay", "lag", "square", "zero"),
}


@dataclass(frozen=True)
class Plant:
    """A plant that follows its input: seconds, and square seconds for `square`."""

    kind: str
    delay: float
    lag: float
    square: float = 0.0
    zero: float = 0.0
    gain: float = 1.0

    @property
    def time(self) -> float:
        """Delay and lags together, less the zero, s."""
        return self.delay + self.lag - self.zero

    def delay_at(self, omega: Array) -> Array:
        """Equivalent delay -arg G/omega, s; that as omega goes to zero at zero."""
        safe = np.where(omega > 0.0, omega, 1.0)
        lags = np.angle(1.0 - self.square * safe**2 + 1j * safe * self.lag)
        found = self.delay + (lags - np.arctan(safe * self.zero)) / safe
        return np.where(omega > 0.0, found, self.time)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """One pole, or two that differ."""
        return np.roots([self.square, self.lag, 1.0]).astype(complex)

    @property
    def shares(self) -> NDArray[np.complex128]:
        """The part of each pole in the response at rest; they add up to one."""
        poles = self.poles
        if poles.size == 1:
            return np.ones(1, dtype=complex)
        first, second = poles
        apart = np.array([first - second, second - first])
        return np.asarray(-(self.zero * poles + 1.0) / (self.square * apart * poles))

    def step(self, times: Array) -> Array:
        """Response to a unit step at time zero, without the gain."""
        since = np.maximum(times - self.delay, 0.0)
        parts = self.shares[:, None] * -np.expm1(self.poles[:, None] * np.ravel(since))
        return np.asarray(np.sum(parts, axis=0).real.reshape(times.shape))

    def response(self, times: Array, period: float, inputs: Array) -> Array:
        """Response at any times; input k holds from k periods on, the first one held before."""
        since = times - self.delay
        row = np.clip(np.floor(since / period + 1e-9).astype(int), 0, inputs.size - 1)
        late = np.maximum(since - row * period, 0.0)
        found = inputs[row].astype(complex)
        for pole, share in zip(self.poles, self.shares, strict=True):
            kept = np.exp(pole * period)
            start = kept * inputs[:1].astype(complex)
            later, _ = signal.lfilter([1.0 - kept], [1.0, -kept], inputs[:-1], zi=start)
            state = np.concatenate([inputs[:1].astype(complex), later])
            found += share * (state[row] - inputs[row]) * np.exp(pole * late)
        return np.asarray(self.gain * found.real)


def drawn_plant(
    kind: str,
    delay: tuple[float, float],
    lag: tuple[float, float],
    damping: tuple[float, float],
    random: np.random.Generator,
) -> Plant:
    """A plant of a kind with delay and lag from these ranges, s."""
    late, slow = (float(np.exp(random.uniform(*np.log(ends)))) for ends in (delay, lag))
    gain = float(random.uniform(0.85, 1.1))
    square = zero = 0.0
    if kind == "lags":
        share = random.uniform(0.2, 0.9)
        square = slow**2 * share / (1.0 + share) ** 2
    elif kind != "lag":
        square = (slow / (2.0 * random.uniform(*damping))) ** 2
    if kind == "pair and zero":
        zero = slow * random.uniform(0.2, 0.5)
    return Plant(kind, late, slow, float(square), float(zero), gain)


@dataclass(frozen=True)
class Noise:
    """What a sensor adds to a response, and what gusts add to the input of the plant.

    Deviations in units of the signal, times in s. Colour and gusts are first-order Gauss-Markov
    processes, so that with the white part a sensor has the noise of an ARMA model at its samples.
    """

    white: float
    colour: float = 0.0
    colour_time: float = 0.01
    gust: float = 0.0
    gust_time: float = 0.5
    vibration: float = 0.0
    frequency: float = 100.0
    rounding: float = 0.0

    def drawn(self, count: int, period: float, random: np.random.Generator) -> Array:
        """Noise of the sensor at so many samples, without rounding."""
        found = self.white * random.standard_normal(count)
        found += markov(count, period, self.colour, self.colour_time, random)
        turn = 2.0 * np.pi * (self.frequency * period * np.arange(count) + random.uniform())
        return np.asarray(found + self.vibration * np.sin(turn))

    def covariance(self, plant: Plant) -> Callable[[Array], Array]:
        """Covariance of the noise of two readings by the time between them, s."""
        poles = np.append(plant.poles, -1.0 / self.gust_time)
        strength = plant.gain * self.gust * np.sqrt(2.0 / self.gust_time)
        own = -plant.shares * plant.poles
        at_gust = np.sum(own / (poles[-1] - plant.poles))
        parts = strength * np.append(own / (plant.poles - poles[-1]), at_gust)
        sizes = parts * np.sum(parts / -(poles[:, None] + poles), axis=1)

        def found(times: Array) -> Array:
            gusts = sum(
                (size * np.exp(pole * times)).real for size, pole in zip(sizes, poles, strict=True)
            )
            colour = self.colour**2 * np.exp(-times / self.colour_time)
            turn = 2.0 * np.pi * self.frequency * times
            white = (self.white**2 + self.rounding**2 / 12.0) * (times == 0.0)
            return np.asarray(gusts + colour + white + 0.5 * self.vibration**2 * np.cos(turn))

        return found


def markov(
    count: int, period: float, deviation: float, time: float, random: np.random.Generator
) -> Array:
    """Samples of a first-order Gauss-Markov process of this deviation and correlation time."""
    kept = np.exp(-period / time)
    fresh = random.standard_normal(count)
    fresh[1:] *= np.sqrt(1.0 - kept**2)
    return np.asarray(deviation * signal.lfilter([1.0], [1.0, -kept], fresh))
