"""What a delay and a lag cost: the gains that a proportional controller may have.

The loop is K G(s), G the estimated plant with its delay. Its largest stable gain is 1/|G| where
the phase of G passes -180 degrees; its sensitivity peak is Ms = max 1/|1 + K G(i omega)| (Åström
and Hägglund 2006, section 4.6).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.plain import plain_fields
from deadtime.estimation import DelayEstimate
from deadtime.loops import ControlLoop, FactoredPlant, P
from deadtime.recordings import Recording

#: The sensitivity peak of a well damped loop (Åström and Hägglund 2006).
PEAK = 1.7

#: Frequencies, in rad over the sum of delay and lag, and their number.
LOWEST, HIGHEST, FREQUENCIES = 0.02, 60.0, 1500

#: Draws of the estimate for the intervals of the gains, and their seed.
DRAWS, SEED = 200, 1

#: Halvings of the range of the gain.
HALVINGS = 40

#: Share of the variance of the actuator that the error explains under proportional control.
PROPORTIONAL = 0.8


@dataclass(frozen=True)
class GainCost:
    """Gains of a proportional controller for an estimated plant.

    Attributes
    ----------
    largest : float
        Largest stable gain, in units of the actuator by that of the response.
    well_damped : float
        Gain at which the sensitivity peak is 1.7.
    largest_ci, well_damped_ci : (float, float)
        95 % intervals, from the covariance of the estimate.
    flown : float or None
        Slope of the actuator on the error of the loop, where the error explains four fifths of
        the actuator; None for other controllers.
    delay_margin : float or None
        Further delay that the loop with the flown gain can take, s; NaN if it is not stable.
    """

    largest: float
    largest_ci: tuple[float, float]
    well_damped: float
    well_damped_ci: tuple[float, float]
    flown: float | None
    delay_margin: float | None

    def to_dict(self) -> dict[str, Any]:
        """The gains as plain values for JSON."""
        return plain_fields(vars(self))


def cost_of(fit: DelayEstimate, recording: Recording) -> GainCost | None:
    """The gains for the plant of an estimate; None where no positive gain makes it unstable."""
    plant = fit.loop.plant
    assert isinstance(plant, FactoredPlant)
    numbers = np.array([fit._value(name) for name in fit.free])
    time = max(fit.delay_plus_lag, 1e-9)
    omega = np.geomspace(LOWEST, HIGHEST, FREQUENCIES) / time
    best = _gains(plant, fit.free, numbers, omega)
    if best is None or plant.gain == 0.0:
        return None
    random = np.random.default_rng(SEED)
    drawn = random.multivariate_normal(numbers, np.nan_to_num(fit.cov), DRAWS, method="eigh")
    found = [_gains(plant, fit.free, one, omega) for one in drawn]
    known = np.array([one for one in found if one is not None] or [best])
    ends = np.quantile(known, [0.025, 0.975], axis=0)
    flown = flown_gain(recording)
    margin = None
    if flown is not None:
        loop = ControlLoop(plant, P(flown), delay=fit.delay)
        margin = float(loop.margin().delay_margin)
    (low, high), (low_damped, high_damped) = ends.T.tolist()
    return GainCost(
        best[0], (low, high), best[1], (low_damped, high_damped), flown, margin
    )  # fmt: skip


def _gains(
    plant: FactoredPlant, names: tuple[str, ...], numbers: Array, omega: Array
) -> tuple[float, float] | None:
    """Largest stable gain and that of the sensitivity peak, with the sign of the plant's gain."""
    values = dict(zip(names, numbers.tolist(), strict=True))
    delay = max(values.pop("delay", 0.0), 0.0)
    values = {
        name: max(value, 0.0) if name.startswith("lag") else value for name, value in values.items()
    }
    moved = plant._replace({**plant.parameters, **values})
    response = moved.transfer_function().frequency_response(omega)
    G = np.ravel(response) * np.exp(-1j * omega * delay)
    sign = math.copysign(1.0, values.get("gain", plant.gain))
    G = G * sign
    phase = np.unwrap(np.angle(G))
    phase += 2.0 * np.pi * np.round(-phase[0] / (2.0 * np.pi))
    beyond = np.flatnonzero(phase <= -np.pi)
    if not beyond.size or beyond[0] == 0:
        return None
    k = int(beyond[0])
    share = (phase[k - 1] + np.pi) / (phase[k - 1] - phase[k])
    size = np.exp((1.0 - share) * np.log(abs(G[k - 1])) + share * np.log(abs(G[k])))
    largest = 1.0 / float(size)
    low, high = 0.0, largest
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        peak = float(np.max(1.0 / np.maximum(np.abs(1.0 + middle * G), 1e-12)))
        low, high = (middle, high) if peak < PEAK else (low, middle)
    return sign * largest, sign * low


def flown_gain(recording: Recording) -> float | None:
    """Slope of the command on the error, if it is that of a proportional controller."""
    if recording.command is None:
        return None
    error = recording.reference - recording.output
    error, command = error - error.mean(), recording.command - recording.command.mean()
    power, both = float(error @ error), float(error @ command)
    if power == 0.0 or not float(command @ command) > 0.0:
        return None
    explained = both**2 / (power * float(command @ command))
    return both / power if explained > PROPORTIONAL else None
