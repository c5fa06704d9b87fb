"""Flights of the firmware over links with the package's relay in between, and over one without.

The vehicle has a port for each; the relay adds `ONE_WAY` in each direction, or for the argument
``rough`` that with jitter and losses. Prints one line of JSON: for each link the estimate from the
flight, the echo of the set point, and the round trip by TIMESYNC.
"""

import asyncio
import json
import sys
from contextlib import asynccontextmanager
from pathlib import Path

import deadtime as dtm
from arducopter import firmware
from deadtime.flights import FlightPlan
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

NEAR, FAR, RELAY = 14550, 14560, 14570

PLAN = FlightPlan(
    gains=(0.7,),
    step=1.0,
    base=3.0,
    settle=8.0,
    hold=8.0,
    limits=Limits(max_climb=1.0, max_height=6.0, max_error=1.5, max_state_age=0.5),
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


async def flights(folder, path):
    """Over the near link, then over the far one."""
    options = RelayOptions(("127.0.0.1", FAR), path, path, listen=("127.0.0.1", RELAY))
    async with Relay(options):
        return [await flown(port, folder) for port in (NEAR, FAR)]


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
    echo = split_delay([read_telemetry(flight)]).transport
    return {
        "total": fit.delay_plus_lag,
        "interval": fit.ci(0.95, "delay+lag"),
        "gain": fit.gain,
        "echo": echo.delay,
        "median": link_time.median,
        "least": link_time.least,
        "mean": link_time.mean,
        "age": flight.age,
        "irregular": flight.irregular,
        "rows": [len(flight.recording), len(flight.measured)],
        "misfit": flight.clock.misfit,
    }


if __name__ == "__main__":
    folder, kind = Path(sys.argv[1]), sys.argv[2:]
    path = Network(delay=ONE_WAY)
    if kind == ["rough"]:
        path = Network(delay=Normal(ONE_WAY, JITTER), loss=LOSS)
    with firmware(f"udpclient:127.0.0.1:{NEAR}", f"udpclient:127.0.0.1:{RELAY}"):
        flights_and_times = asyncio.run(flights(folder, path))
    print(json.dumps([told(*one) for one in flights_and_times]))
