"""Flights of the firmware over three links, two of them with the package's relay in between.

The vehicle has a port for each. The relay of the second adds `ONE_WAY` in each direction, that of
the third the same with jitter and losses. Prints one line of JSON: for each link the estimate from
the flight, the echo of the set point, and the round trip by TIMESYNC.
"""

import asyncio
import json
import sys
from contextlib import asynccontextmanager
from pathlib import Path

import deadtime as dtm
from arducopter import firmware
from deadtime.flights import FlightPlan
from deadtime.flights._arrivals import error_of_mean
from deadtime.flights._fly import PlannedFlight, fly_all
from deadtime.flights._runs import read_telemetry
from deadtime.flights._split import split_delay
from deadtime.links import Limits
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.udp import Network, RelayOptions
from deadtime.links.udp.delays import Normal
from deadtime.links.udp.relay import Relay

ONE_WAY = 0.13

#: Standard deviation of the delays of the rough link in each direction, s, and its losses.
JITTER, LOSS = 0.02, 0.05

#: Ports of the ground station, and of the relays.
NEAR, FAR, ROUGH = 14550, 14560, 14570
FAR_RELAY, ROUGH_RELAY = 14561, 14571

PLAN = FlightPlan(
    gains=(0.7,),
    step=1.0,
    base=3.0,
    settle=8.0,
    hold=8.0,
    limits=Limits(max_climb=1.0, max_height=6.0, max_error=1.5, max_state_age=0.5, max_missing=100),
)


async def flown(port, folder):
    """One flight over the link at a port, its TIMESYNC, and the limits of the vehicle."""
    trips = []

    @asynccontextmanager
    async def connect():
        address = f"udp:127.0.0.1:{port}"
        async with MAVLinkVehicle(address, PLAN.limits, take_off_height=PLAN.base) as link:
            yield link
            trips.append(link.link_time)

    planned = PlannedFlight(PLAN, dtm.P(0.7), PLAN.hold)
    (flight,), shaping = await fly_all(connect, [planned], folder / str(port))
    return flight, trips[0], shaping["z"]


def relay(port, listening, delay, loss=0.0):
    """A relay in front of the ground station at a port."""
    path = Network(delay=delay, loss=loss)
    return Relay(RelayOptions(("127.0.0.1", port), path, path, listen=("127.0.0.1", listening)))


async def flights(folder):
    """Over the near link, then over the others."""
    async with (
        relay(FAR, FAR_RELAY, ONE_WAY),
        relay(ROUGH, ROUGH_RELAY, Normal(ONE_WAY, JITTER), LOSS),
    ):
        return [await flown(port, folder) for port in (NEAR, FAR, ROUGH)]


def told(flight, link_time, shaping):
    """What a flight tells of the delay, by a plant with the limits of the vehicle."""
    plant = dtm.RateLimited(dtm.Integrator(1.0, lag=0.1), *shaping)
    loop = dtm.ControlLoop(plant, flight.controller, sample_time=0.065, limit=1.0)
    fit = dtm.estimate_delay(
        flight.measured,
        loop,
        method="output_error",
        free=("delay", "gain", "lag"),
        window=(0.5 * flight.settle, None),
    )
    fit = fit.with_error_beside(error_of_mean([flight.effects]))
    try:
        echo = split_delay([read_telemetry(flight)]).transport.delay
    except dtm.NotIdentifiableError:  # echoes that come as irregularly as messages
        echo = None
    return {
        "total": fit.delay_plus_lag,
        "interval": fit.ci(0.95, "delay+lag"),
        "gain": fit.gain,
        "echo": echo,
        "median": link_time.median,
        "least": link_time.least,
        "mean": link_time.mean,
        "age": flight.age,
        "error_of_times": flight.effects.error,
        "irregular": flight.irregular,
        "rows": [len(flight.recording), len(flight.measured)],
        "misfit": flight.clock.misfit,
    }


if __name__ == "__main__":
    ports = [f"udpclient:127.0.0.1:{port}" for port in (NEAR, FAR_RELAY, ROUGH_RELAY)]
    with firmware(*ports):
        flights_and_times = asyncio.run(flights(Path(sys.argv[1])))
    print(json.dumps([told(*one) for one in flights_and_times]))
