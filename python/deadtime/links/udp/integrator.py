"""The plant of the loop: an integrator with optional lag, exact between changes of the command.

    lag v' + v = gain w,    y' = v.

With w held over a time h, and e = exp(-h/lag), both have a closed form, so a run has no error of
integration for any times of the commands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from deadtime._base.validation import finite, non_negative


@dataclass
class HeldIntegrator:
    """State of an integrator whose command is held.

    Parameters
    ----------
    gain : float
        Output per second and unit of command.
    lag : float
        Time constant of its velocity, s; 0 for none.

    Examples
    --------
    >>> from deadtime.links.udp import HeldIntegrator
    >>> plant = HeldIntegrator()
    >>> plant.advance(2.0, command=0.5)
    >>> plant.output
    1.0
    """

    gain: float = 1.0
    lag: float = 0.0
    output: float = 0.0
    velocity: float = 0.0

    def __post_init__(self) -> None:
        finite("gain", self.gain)
        non_negative("lag", self.lag)

    def advance(self, time: float, command: float) -> None:
        """Advance by a time, s, under this command."""
        requested = self.gain * command
        if self.lag == 0.0:
            self.velocity = requested
            self.output += requested * time
            return
        missing = self.velocity - requested
        decayed = -math.expm1(-time / self.lag)
        self.output += requested * time + missing * self.lag * decayed
        self.velocity = requested + missing * (1.0 - decayed)
