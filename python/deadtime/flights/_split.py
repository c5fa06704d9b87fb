"""Divide the delay between link and vehicle, from the reports of the vehicle.

The log of a ground station does not determine where in the loop the delay is. The reports of a
vehicle that echoes its setpoint and its vertical speed do:

    command --(transport)--> setpoint, as reported --(the vehicle's own loop)--> climb, as reported.

The setpoint is a delayed copy of the command. Its integral is that of the delayed command,
so it is fitted as the output of an integrator behind a delay, and the delay is found between the
samples. The climb follows the setpoint as a first-order lag, with a delay of its own where it needs
one. Both reports take the same way back, whose delay counts to the transport.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime.estimation import DelayEstimate, OutputError, estimate_delay
from deadtime.flights._runs import Telemetry
from deadtime.loops import ControlLoop, FirstOrder, Integrator, P
from deadtime.recordings import Recording

Array = NDArray[np.float64]

#: The plants of both parts are known: no other is looked for.
METHOD = OutputError(rivals=False)

#: Time between used messages, s, while the setpoint is constant: more of them hold no more
#: information on the delay.
SPARSE = 0.02

#: Initial value of the search for the lag of the vehicle, s.
GUESS = 0.2


@dataclass(frozen=True)
class DelaySplit:
    """The two parts of a delay.

    Attributes
    ----------
    transport : DelayEstimate
        From the command to the setpoint that the vehicle reports: its ``delay``, and a gain that is
        1 if vehicle and ground station agree on the unit of a command.
    vehicle : DelayEstimate
        From the setpoint to the climb: ``gain`` and ``time_constant``, and ``delay`` where there is
        one; then the sum ``delay+time_constant`` is the most accurate.
    """

    transport: DelayEstimate
    vehicle: DelayEstimate

    @property
    def late(self) -> str:
        """The name of what the vehicle takes, in its estimate."""
        return "delay+time_constant" if "delay" in self.vehicle.free else "time_constant"

    @property
    def vehicle_delay(self) -> float:
        """Delay and time constant of the vehicle together, s."""
        return self.vehicle.delay + self.vehicle.loop.parameters["time_constant"]

    def adds_up(self, whole: DelayEstimate, together: float) -> bool:
        """Whether both parts take what the loop does, within the 95 % intervals of all three.

        Parameters
        ----------
        whole : DelayEstimate
            That from command and output, with ``delay+lag``.
        together : float
            Delay and lags of the loop for small commands by it, s.
        """
        parts = self.transport.delay + self.vehicle_delay
        asked = ((self.transport, "delay"), (self.vehicle, self.late), (whole, "delay+lag"))
        widths = [0.5 * float(np.ptp(fit.ci(0.95, name))) for fit, name in asked]
        return abs(parts - together) <= float(np.linalg.norm(widths))


def split_delay(flights: Sequence[Telemetry]) -> DelaySplit:
    """Estimate both parts from the messages of one flight or several.

    Parameters
    ----------
    flights : sequence of Telemetry
        Of one vehicle.

    Returns
    -------
    DelaySplit

    Raises
    ------
    NotIdentifiableError
        If the setpoint does not respond to the command, or the climb to the setpoint.
    """
    # The controller is not part of this path; the sample time makes the commands held.
    link = ControlLoop(Integrator(), P(1.0), sample_time=_period(flights[0].command_time))
    transport = estimate_delay(
        [_followed(flight) for flight in flights], link, method=METHOD, free=("delay", "gain")
    )
    own = link.replace(plant=FirstOrder(1.0, GUESS))
    climbed = [_climbed(flight) for flight in flights]
    free = ("delay", "gain", "time_constant")
    vehicle = estimate_delay(climbed, own, method=METHOD, free=free)
    if vehicle.delay == 0.0:
        # At its bound the delay has no interval, and a lag alone explains the response.
        vehicle = estimate_delay(climbed, own.replace(delay=0.0), method=METHOD, free=free[1:])
    return DelaySplit(transport, vehicle)


def _period(times: Array) -> float:
    return float(np.median(np.diff(times)))


def _followed(flight: Telemetry) -> Recording:
    """Command and integral of the setpoint, at the times of commands and messages."""
    times = np.union1d(flight.command_time, flight.time[_kept(flight)])
    low = max(flight.command_time[0], flight.time[0])
    high = min(flight.command_time[-1], flight.time[-1])
    times = times[(times >= low) & (times <= high)]
    # The setpoint holds from message to message, so its integral is linear in between.
    steps = np.diff(flight.time) * flight.setpoint[:-1]
    integral = np.interp(times, flight.time, np.append(0.0, np.cumsum(steps)))
    rows = np.searchsorted(flight.command_time, times, side="right") - 1
    command = flight.command[rows]
    return Recording(times, command, integral - integral[0], command, source="transport")


def _climbed(flight: Telemetry) -> Recording:
    """Setpoint and rate at the used messages."""
    rows = _kept(flight)
    setpoint = flight.setpoint[rows]
    return Recording(flight.time[rows], setpoint, flight.rate[rows], setpoint, source="vehicle")


def _kept(flight: Telemetry) -> NDArray[np.bool_]:
    """The used messages: those with a new setpoint, and one every `SPARSE` seconds."""
    changed = np.append(True, np.diff(flight.setpoint) != 0.0)
    slots = np.floor(flight.time / SPARSE)
    spaced = np.append(True, np.diff(slots) > 0.0)
    kept: NDArray[np.bool_] = changed | spaced
    return kept
