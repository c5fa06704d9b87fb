"""Which part of the delay is the link, and which the vehicle, from what the vehicle tells.

A ground station's log cannot divide its loop's delay. A vehicle that echoes the demand it is
following, and reports its vertical speed, divides it:

    command --(transport)--> demand, as reported --(the vehicle's own loop)--> climb, as reported.

The demand is a late copy of the command. Its integral over time is that of the late command, so
that it is fitted as the output of an integrator behind a delay, in which the delay is found between
the samples. The climb answers the demand as a first-order lag, with a delay of its own if need be.
Both reports travel alike, so the way back counts to the transport.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime.estimation import DelayEstimate, estimate_delay
from deadtime.flights._runs import Telemetry
from deadtime.loops import ControlLoop, FirstOrder, Integrator, P
from deadtime.recordings import Recording

__all__ = ["DelaySplit", "split_delay"]

Array = NDArray[np.float64]

#: Messages are taken at this distance, s, if nothing happens: more of them know no more of a delay.
SPARSE = 0.02

#: Where the search for the vehicle's lag begins, s.
GUESS = 0.2


@dataclass(frozen=True)
class DelaySplit:
    """The two parts of a delay.

    Attributes
    ----------
    transport : DelayEstimate
        From the command to the demand that the vehicle reports: its ``delay``, and a gain that is
        1 if vehicle and ground station mean the same by a command.
    vehicle : DelayEstimate
        From the demand to the climb: ``gain`` and ``time_constant``, and ``delay`` where there is
        one; then the sum ``delay+time_constant`` is known best.
    """

    transport: DelayEstimate
    vehicle: DelayEstimate

    @property
    def vehicle_lateness(self) -> float:
        """Delay and time constant of the vehicle together, s."""
        return self.vehicle.delay + self.vehicle.loop.parameters["time_constant"]


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
        If demand or climb do not answer what comes before them.
    """
    # An open path: the controller is not in it, and a sample time says that commands are held.
    link = ControlLoop(Integrator(), P(1.0), sample_time=_period(flights[0].command_time))
    transport = estimate_delay(
        [_followed(one) for one in flights], link, method="output_error", free=("delay", "gain")
    )
    own = link.replace(plant=FirstOrder(1.0, GUESS))
    climbed = [_climbed(one) for one in flights]
    free = ("delay", "gain", "time_constant")
    vehicle = estimate_delay(climbed, own, method="output_error", free=free)
    if vehicle.delay == 0.0:
        # At its bound it is no number with an interval: a lag alone explains the answer.
        vehicle = estimate_delay(
            climbed, own.replace(delay=0.0), method="output_error", free=free[1:]
        )
    return DelaySplit(transport, vehicle)


def _period(times: Array) -> float:
    return float(np.median(np.diff(times)))


def _followed(flight: Telemetry) -> Recording:
    """Command, and the integral of the demand, whenever one of them may change."""
    times = np.union1d(flight.command_time, flight.time[_kept(flight)])
    low = max(flight.command_time[0], flight.time[0])
    high = min(flight.command_time[-1], flight.time[-1])
    times = times[(times >= low) & (times <= high)]
    # The demand holds from message to message: its integral is straight between them.
    steps = np.diff(flight.time) * flight.demand[:-1]
    integral = np.interp(times, flight.time, np.append(0.0, np.cumsum(steps)))
    rows = np.searchsorted(flight.command_time, times, side="right") - 1
    command = flight.command[rows]
    return Recording(times, command, integral - integral[0], command, source="transport")


def _climbed(flight: Telemetry) -> Recording:
    """Demand and climb at every message at which the demand changes, and some between."""
    rows = _kept(flight)
    demand = flight.demand[rows]
    return Recording(flight.time[rows], demand, flight.climb[rows], demand, source="vehicle")


def _kept(flight: Telemetry) -> NDArray[np.bool_]:
    """Messages that bring a new demand, and of the others one every so often."""
    changed = np.append(True, np.diff(flight.demand) != 0.0)
    slots = np.floor(flight.time / SPARSE)
    spaced = np.append(True, np.diff(slots) > 0.0)
    kept: NDArray[np.bool_] = changed | spaced
    return kept
