"""The plant of the loop: an integrator, with a lag where wanted, exact between changes of command.

    lag v' + v = gain w,    y' = v.

With w held over a time h, and e = exp(-h/lag), both are known in closed form; a run has no error
of integration, however unevenly the commands arrive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from deadtime._base.validation import finite, non_negative

__all__ = ["HeldIntegrator"]


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
        """Let so much time pass, s, under this command."""
        wanted = self.gain * command
        if self.lag == 0.0:
            self.velocity = wanted
            self.output += wanted * time
            return
        missing = self.velocity - wanted
        decayed = -math.expm1(-time / self.lag)
        self.output += wanted * time + missing * self.lag * decayed
        self.velocity = wanted + missing * (1.0 - decayed)
