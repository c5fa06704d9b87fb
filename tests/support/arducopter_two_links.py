"""A flight of the firmware over two links, the first of which is cut in flight.

Prints one line of JSON.
"""

import asyncio
import json
import warnings
from contextlib import AsyncExitStack

from arducopter import firmware
from deadtime.links import Limits, now
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.udp import Network, RelayOptions
from deadtime.links.udp.relay import Relay

FIRST, SECOND, RELAY = 14550, 14560, 14551

LIMITS = Limits(max_climb=1.0, max_state_age=0.5, max_missing=100)


async def climbed(link, speed, seconds):
    """Command one speed; the states and the greatest time between two of them, s."""
    states, longest = [await link.state()], 0.0
    until = now() + seconds
    while now() < until:
        link.command(speed)
        await asyncio.sleep(0.05)
        states.append(await link.state())
        longest = max(longest, now() - states[-1].time)
    return {
        "climb": states[-1].climb,
        "echo": states[-1].climb_setpoint,
        "height": states[-1].height,
        "oldest": longest,
        "missing": states[-1].missing,
    }


async def flight():
    path = Network(delay=0.02)
    near = RelayOptions(("127.0.0.1", FIRST), path, path, listen=("127.0.0.1", RELAY))
    both = f"udp:127.0.0.1:{FIRST},udp:127.0.0.1:{SECOND}"
    relayed = AsyncExitStack()
    await relayed.enter_async_context(Relay(near))
    async with relayed, MAVLinkVehicle(both, LIMITS) as link:
        await link.take_off()
        found = {"first": await climbed(link, 0.3, 2.0), "first_trip": link.link_time.median}
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            await relayed.aclose()
            found["second"] = await climbed(link, 0.3, 2.0)
        found["said"] = [str(one.message) for one in said]
        found["second_trip"] = link.link_time.median
        await climbed(link, -0.3, 1.0)
        await link.land()
        found["landed"] = (await link.state()).landed
    return found


if __name__ == "__main__":
    with firmware(f"udpclient:127.0.0.1:{RELAY}", f"udpclient:127.0.0.1:{SECOND}"):
        print(json.dumps(asyncio.run(flight())))
