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

from deadtime._base.plain import plain_fields
from deadtime.estimation import PlantEstimate
from deadtime.loops import P
from deadtime.recordings import Recording

#: The sensitivity peak of a well damped loop (Åström and Hägglund 2006).
PEAK = 1.7

#: Frequencies, in rad over the sum of delay and lag, and their number.
LOWEST, HIGHEST, FREQUENCIES = 0.02, 60.0, 1500

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
        Their 95 % intervals.
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


def cost_of(fit: PlantEstimate, recording: Recording) -> GainCost | None:
    """The gains for the plant of an estimate; None where no gain is known to make it unstable.

    The interval of the well damped gain is, as a share, that of the largest.
    """
    largest = fit.largest_gain
    known = fit.verdict != "none" and "largest_gain" in fit.intervals
    if not (known and math.isfinite(largest)):
        return None
    low, high = fit.ci(0.95, "largest_gain")
    share = _well_damped(fit, largest)
    flown = flown_gain(recording)
    margin = None
    if flown is not None:
        margin = float(fit.loop(P(flown)).margin().delay_margin)
    ends = (share * low, share * high)
    return GainCost(largest, (low, high), share * largest, ends, flown, margin)


def _well_damped(fit: PlantEstimate, largest: float) -> float:
    """The gain of the sensitivity peak as a share of the largest stable one."""
    plant = fit.plant
    assert plant is not None
    time = max(fit.best.delay + fit.best.lag_sum, 1e-9)
    omega = np.geomspace(LOWEST, HIGHEST, FREQUENCIES) / time
    G = np.ravel(plant.transfer_function().frequency_response(omega))
    G = largest * G * np.exp(-1j * omega * fit.delay)
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        peak = float(np.max(1.0 / np.maximum(np.abs(1.0 + middle * G), 1e-12)))
        low, high = (middle, high) if peak < PEAK else (low, middle)
    return low


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
