"""Flights of the firmware over two links, one of them with the package's relay in between.

The vehicle has a port for each: one sends to the ground station, the other to the relay, which adds
`ONE_WAY` in each direction. Prints one line of JSON: for each link the estimate from the flight,
the echo of the set point, and the round trip by TIMESYNC.
"""

import asyncio
import json
import sys
from contextlib import asynccontextmanager
from pathlib import Path

import deadtime as dtm
import numpy as np
from arducopter import firmware
from deadtime.flights import FlightPlan
from deadtime.flights._fly import fly_all
from deadtime.flights._runs import read_telemetry
from deadtime.flights._split import split_delay
from deadtime.links import Limits
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.udp import Network, RelayOptions
from deadtime.links.udp.relay import Relay

ONE_WAY = 0.13

NEAR, FAR, RELAY = 14550, 14560, 14570

PLAN = FlightPlan(
    gains=(0.7,),
    step=1.0,
    base=3.0,
    settle=8.0,
    hold=8.0,
    limits=Limits(max_climb=1.0, max_height=6.0, max_error=1.5),
)


async def flown(port, folder):
    """One flight over the link at a port."""
    trips = []

    @asynccontextmanager
    async def connect():
        address = f"udp:127.0.0.1:{port}"
        async with MAVLinkVehicle(address, PLAN.limits, take_off_height=PLAN.base) as link:
            yield link
            trips.append(link.link_time)
            limits = [await link.parameter(name) for name in ("WPNAV_ACCEL_Z", "PSC_JERK_Z")]
            trips.extend((0.01 * limits[0], limits[1]))

    (flight,) = await fly_all(connect, [dtm.P(0.7)], PLAN, PLAN.hold, folder / str(port), 1)
    return flight, *trips


async def flights(folder):
    """Over the near link, then over the far one."""
    path = Network(delay=ONE_WAY)
    options = RelayOptions(("127.0.0.1", FAR), path, path, listen=("127.0.0.1", RELAY))
    async with Relay(options):
        return [await flown(port, folder) for port in (NEAR, FAR)]


def from_messages(flight):
    """The heights as the vehicle reported them, every third, and the commands when they were sent.

    A row of the recording holds the newest height, whatever its age.
    """
    rows, heights = flight.recording, read_telemetry(flight.telemetry, flight.recording)
    inside = (heights.time > rows.time[0]) & (heights.time <= rows.time[-1])
    time, height = heights.time[inside][::3], heights.height[inside][::3]
    reference = rows.reference[np.searchsorted(rows.time, time, side="right") - 1]
    return dtm.Recording(time, reference, height, sent=(rows.time, rows.command))


def told(flight, link_time, acceleration, jerk):
    """What a flight tells of the delay, by a plant with the limits of the vehicle."""
    plant = dtm.RateLimited(dtm.Integrator(1.0, lag=0.1), acceleration, jerk)
    loop = dtm.ControlLoop(plant, flight.controller, sample_time=0.065, limit=1.0)
    fit = dtm.estimate_delay(
        from_messages(flight),
        loop,
        method="output_error",
        free=("delay", "gain", "lag"),
        window=(0.5 * flight.settle, None),
    )
    echo = split_delay([read_telemetry(flight.telemetry, flight.recording)]).transport
    return {
        "total": fit.delay_plus_lag,
        "interval": fit.ci(0.95, "delay+lag"),
        "gain": fit.gain,
        "echo": echo.delay,
        "median": link_time.median,
        "least": link_time.least,
    }


if __name__ == "__main__":
    with firmware(f"udpclient:127.0.0.1:{NEAR}", f"udpclient:127.0.0.1:{RELAY}"):
        flights_and_times = asyncio.run(flights(Path(sys.argv[1])))
    print(json.dumps([told(*one) for one in flights_and_times]))
