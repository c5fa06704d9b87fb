"""Output of a plant under held commands: over time, with its derivatives, and as H(z).

A command u_k that holds from t_k to t_{k+1} goes into gain/(s (lag s + 1)). For a gain of one,

    v' = (u - v)/lag,  F' = v,  F(t) = I(t) - lag v(t),  I = the integral of u,

(v = u without a lag), from rest before the first command. Both are exact: between commands I is a
line and v - u_k decays as e^(-(t - t_k)/lag). dF/dt = v, and with p = dv/dlag, whose own
recursion is the derivative of that of v, dF/dlag = -v - lag p.

A path is F(t; lag or time constant) for a gain of one and no delay. An integrator has a closed
form (`HeldResponse`); any other plant is simulated, and its derivatives are central difference
quotients with an error of about 1e-9 of the path.

The unit step response of the plant gain/(s (lag s + 1)) is S(t) = t - lag (1 - e^(-t/lag)). A
command held for one sample time h is a step up and a step down, so with a delay of (d + f) h,
0 <= f < 1, g = 1 - f and q = 1/z (modified z-transform, Jury 1964),

    H(z) = q^(d+1) [ h q/(1 - q) + g h - lag + lag e^(-g h/lag) (1 - q)/(1 - e^(-h/lag) q) ],

exact for every delay, whole number of samples or not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias, overload

import numpy as np

from deadtime._base.arrays import Array, Complex, Indices, Mask
from deadtime.loops import FactoredPlant, Integrator, Plant, RateLimited, open_response

#: Largest relative range of the time between commands that counts as rounding of even times.
EVEN = 1e-11


#: Relative step of difference quotients: of a parameter, or of the time between two commands.
STEP = 1e-5

#: Names of the limits of the rate of a command, and the relative step of quotients by them.
RATE_LIMITS, LIMIT_STEP = ("rate", "rate_of_rate"), 1e-4


class Response(NamedTuple):
    """F, dF/dt and dF/dlag at some times."""

    value: Array
    rate: Array
    by_lag: Array


class Places(NamedTuple):
    """Times among commands: the last command before each, and what it says."""

    row: Indices
    before: Mask
    since: Array
    command: Array
    integral: Array


class HeldResponse:
    """The response of an integrator to one record of commands.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time from which each command holds, s, increasing; the last one holds for ever.
    command : ndarray, shape (n,)
        The commands.
    """

    def __init__(self, time: Array, command: Array) -> None:
        self.time, self.command = time, command
        self._steps = np.diff(time)
        self._kept: tuple[float, Array, Array] | None = None
        self._is_even = bool(np.ptp(self._steps) <= EVEN * self._steps.mean())
        # Shorter lags have no effect and would overflow below.
        self._shortest = 1e-7 * float(self._steps.min(initial=np.inf))
        self._integral = np.concatenate([[0.0], np.cumsum(command[:-1] * self._steps)])

    def at(self, times: Array, lag: float = 0.0) -> Response:
        """F and its derivatives at `times` for a lag in s."""
        return self.at_places(self.places(times), lag)

    def places(self, times: Array) -> Places:
        """Where `times`, of any shape, lie among the commands."""
        row = np.searchsorted(self.time, times, side="right") - 1
        before = row < 0
        row = np.maximum(row, 0)
        since = np.where(before, 0.0, times - self.time[row])
        command = np.where(before, 0.0, self.command[row])
        return Places(row, before, since, command, self._integral[row] + command * since)

    def at_places(self, places: Places, lag: float) -> Response:
        """F and its derivatives at `places` for a lag in s."""
        row, before, since, command, integral = places
        if lag <= self._shortest:
            # To first order a lag is a delay: dF/dlag = -v at no lag.
            return Response(integral - lag * command, command, -command)
        velocity, by_lag = self._velocities(lag)
        decay = np.exp(-since / lag)
        gap = np.where(before, 0.0, velocity[row] - command)
        v = command + gap * decay
        p = np.where(before, 0.0, by_lag[row]) * decay + gap * decay * since / lag**2
        return Response(integral - lag * v, v, -v - lag * p)

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, as the path of an integrator."""
        return self.at(times, values["lag"]).value

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of that path."""
        found = self.at(times, values["lag"])
        return PathSlopes(found.rate, {"lag": found.by_lag} if "lag" in names else {})

    def _velocities(self, lag: float) -> tuple[Array, Array]:
        """The velocity v and dv/dlag at the start of each command; kept for the last lag."""
        if self._kept is None or self._kept[0] != lag:
            decays, rates = np.exp(-self._steps / lag), self._steps / lag**2
            recursion = _even if self._is_even else _uneven
            self._kept = (lag, *recursion(self.command, decays, rates))
        return self._kept[1], self._kept[2]


def _even(command: Array, decays: Array, rates: Array) -> tuple[Array, Array]:
    """The recursion of v and dv/dlag for evenly spaced commands, as two filters."""
    from scipy.signal import lfilter

    d = float(decays[0])
    v = lfilter([0.0, 1.0 - d], [1.0, -d], command)
    p = lfilter([0.0, d * float(rates[0])], [1.0, -d], v - command)
    return np.asarray(v), np.asarray(p)


def _uneven(command: Array, decays: Array, rates: Array) -> tuple[Array, Array]:
    """The recursion of v and dv/dlag, for steps of any length."""
    before = command[:-1]
    v = _recursion(decays, (1.0 - decays) * before)
    p = _recursion(decays, decays * rates * (v[:-1] - before))
    return v, p


def _recursion(factors: Array, added: Array) -> Array:
    """x[k + 1] = factors[k] x[k] + added[k] from zero, in ever longer steps (Blelloch 1990)."""
    factors, found = factors.copy(), np.concatenate([[0.0], added])
    own, step = found[1:], 1
    while step < own.size:
        own[step:] += factors[step:] * own[:-step]
        factors[step:] *= factors[:-step]
        step *= 2
    return found


@overload
def held_transfer(z: complex, delay: float, lag: float, sample_time: float) -> complex: ...
@overload
def held_transfer(z: Complex, delay: float, lag: float, sample_time: float) -> Complex: ...
def held_transfer(
    z: complex | Complex, delay: float, lag: float, sample_time: float
) -> complex | Complex:
    """H(z) for a gain of one; delay, lag and sample time in s."""
    q = 1.0 / z
    whole = math.floor(delay / sample_time)
    rest = 1.0 - (delay / sample_time - whole)
    ramp = sample_time * q / (1.0 - q) + rest * sample_time
    if lag > 0.0:
        late = math.exp(-rest * sample_time / lag) * (1.0 - q)
        ramp = ramp - lag + lag * late / (1.0 - math.exp(-sample_time / lag) * q)
    return ramp * q ** (whole + 1)


class PathSlopes(NamedTuple):
    """dF/dt, and the derivatives of F by the parameters of the plant."""

    rate: Array
    by: dict[str, Array]


class FactoredPath:
    """The output of a factored plant with one lag behind an integrator, in closed form."""

    def __init__(self, plant: FactoredPlant, time: Array, command: Array) -> None:
        self._held, self._stepped = HeldResponse(time, command), SteppedPath(plant, time, command)

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, of any shape, for these parameters of the plant."""
        if values.get("zero"):
            return self._stepped.value(times, values)
        return self._held.at(times, values["lag_1"]).value

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of F at `times`, by those of `names` that the plant has."""
        if values.get("zero") or "zero" in names:
            return self._stepped.slopes(times, values, names)
        found = self._held.at(times, values["lag_1"])
        return PathSlopes(found.rate, {"lag_1": found.by_lag} if "lag_1" in names else {})


class SteppedPath:
    """The simulated output of any other plant."""

    def __init__(self, plant: Plant, time: Array, command: Array) -> None:
        self._plant, self._time, self._command = plant, time, command
        self._change = STEP * float(np.median(np.diff(time)))

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, of any shape, for these parameters of the plant."""
        distinct, place = np.unique(times, return_inverse=True)
        numbers = {**self._plant.parameters, **values, "gain": 1.0}
        path = open_response(self._plant, numbers, distinct, self._time, self._command)
        return path[place].reshape(times.shape)

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of F at `times`, by those of `names` that the plant has."""
        change = self._change
        rate = (self.value(times + change, values) - self.value(times - change, values)) / (
            2.0 * change
        )
        by = {}
        for name in names:
            if name in self._plant.parameters and name != "gain":
                step = STEP * abs(values[name])
                higher, lower = (
                    self.value(times, {**values, name: values[name] + sign * step})
                    for sign in (1.0, -1.0)
                )
                by[name] = (higher - lower) / (2.0 * step)
        return PathSlopes(rate, by)


class LimitedPath:
    """The output of a plant that limits the rate of its command."""

    def __init__(self, plant: RateLimited, time: Array, command: Array) -> None:
        self._plant, self._time, self._command = plant, time, command
        self._kept: tuple[dict[str, float], Path] | None = None

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, of any shape, for these parameters of the plant."""
        return self._at(values).value(times, values)

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of F at `times`, by those of `names` that the plant has."""
        found = self._at(values).slopes(times, values, names)
        for name in RATE_LIMITS:
            if name in names:
                step = LIMIT_STEP * values[name]
                higher, lower = (
                    self.value(times, {**values, name: values[name] + sign * step})
                    for sign in (1.0, -1.0)
                )
                found.by[name] = (higher - lower) / (2.0 * step)
        return found

    def _at(self, values: Mapping[str, float]) -> Path:
        """The path under the command within these limits; kept for the last ones."""
        limits = {name: values[name] for name in RATE_LIMITS if name in values}
        if self._kept is None or self._kept[0] != limits:
            held = self._plant._replace(limits).limited(self._time, self._command)
            self._kept = (limits, path_of(self._plant.plant, *held))
        return self._kept[1]


#: Output of a plant of unit gain under one record of commands.
Path: TypeAlias = HeldResponse | FactoredPath | SteppedPath | LimitedPath


def path_of(plant: Plant, time: Array, command: Array) -> Path:
    """The path of `plant` under `command`, each value held from its time on."""
    if isinstance(plant, RateLimited):
        return LimitedPath(plant, time, command)
    if isinstance(plant, Integrator):
        return HeldResponse(time, command)
    if isinstance(plant, FactoredPlant) and _is_one_lag(plant):
        return FactoredPath(plant, time, command)
    return SteppedPath(plant, time, command)


def _is_one_lag(plant: FactoredPlant) -> bool:
    """Whether the plant is an integrator with one lag that decays."""
    alone = plant.integrator and plant.zero == 0.0 and plant.pole_frequency is None
    return alone and len(plant.lags) == 1 and plant.lags[0] > 0.0
