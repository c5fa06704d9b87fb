"""A flight of the firmware by positions, by attitudes and thrust, and by rates and thrust.

Prints one line of JSON.
"""

import asyncio
import json
import math

from arducopter import firmware
from deadtime.links import Limits
from deadtime.links.mavlink import MAVLinkVehicle

PORT = 14550

#: Parameters that are set for these set points.
NAMES = ("GUID_OPTIONS", "WPNAV_SPEED")

LIMITS = Limits(
    max_climb=1.0,
    max_speed=1.0,
    max_height=8.0,
    max_angle=math.radians(12.0),
    max_missing=100,
    max_state_age=0.5,
)


async def held(link, command, seconds):
    """Command something 20 times a second; the states."""
    states = []
    for _ in range(round(20 * seconds)):
        state = await link.state()
        command(state)
        states.append(state)
        await asyncio.sleep(0.05)
    return states


def facts(states):
    return {
        "north": states[-1].north - states[0].north,
        "east": states[-1].east - states[0].east,
        "height": states[-1].height,
        "heights": [min(s.height for s in states), max(s.height for s in states)],
        "heading": states[-1].yaw,
        "speed": max(math.hypot(s.north_speed, s.east_speed) for s in states),
        "climb": max(abs(s.climb) for s in states),
        "tilt": max(math.hypot(s.roll, s.pitch) for s in states),
        "pitch": [min(s.pitch for s in states), max(s.pitch for s in states)],
    }


async def flight():
    found = {}
    async with MAVLinkVehicle(f"udp:127.0.0.1:{PORT}", LIMITS, take_off_height=3.0) as link:
        for kind in ("position", "attitude", "rates"):
            await link.allow(kind)
        hover = await link.parameter("MOT_THST_HOVER")
        await link.take_off()
        origin = await link.state()

        def thrust(state):
            return hover + 0.08 * (4.0 - state.height) - 0.12 * state.climb

        def to_place(state):
            link.command_position(origin.north + 2.0, origin.east - 1.0, 4.0, heading=1.0)

        found["position"] = facts([origin, *await held(link, to_place, 10.0)])

        def level(state):
            link.command_attitude(0.0, 0.0, thrust(state), heading=1.0)

        found["level"] = facts(await held(link, level, 3.0))
        lean = 0.08

        def nose_down(state):
            link.command_attitude(0.0, -lean, thrust(state), heading=0.0)

        found["nose_down"] = facts(await held(link, nose_down, 2.0))
        await held(link, lambda state: link.command_velocity(), 3.0)

        def rolling(state):
            # A roll of 0.1 rad, by rates.
            link.command_rates(3.0 * (0.1 - state.roll), -3.0 * state.pitch, 0.0, thrust(state))

        found["rates"] = facts(await held(link, rolling, 2.0))
        found["rates"]["roll"] = (await link.state()).roll
        await held(link, lambda state: link.command_velocity(), 3.0)
        await link.land()
        found["held"] = [await link.parameter(x) for x in NAMES]
    await asyncio.sleep(0.5)  # until the port is free
    async with MAVLinkVehicle(f"udp:127.0.0.1:{PORT}", LIMITS) as link:
        found["put_back"] = [await link.parameter(x) for x in NAMES]
    return found


if __name__ == "__main__":
    with firmware(f"udpclient:127.0.0.1:{PORT}"):
        print(json.dumps(asyncio.run(flight())))
