"""Gains that follow the delay on the firmware, over the relay whose delay moves.

The relay delays the commands by `DELAYS`: by the first while the vehicle is learnt, then up to the
other and back. Prints one line of JSON: the mean absolute errors with the robust gains and with
those that follow, and what was known and used.
"""

import asyncio
import json
import sys
from contextlib import asynccontextmanager
from pathlib import Path

from arducopter import firmware
from deadtime.flights import AdaptivePlan, FlightPlan, MovingDelay, fly_adaptive, fly_experiment
from deadtime.links import Limits, now
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.udp import Network, RelayOptions
from deadtime.links.udp.relay import Relay

DELAYS = (0.1, 0.5)

#: Ports of the ground station and of the relay.
GROUND, RELAY = 14560, 14561

PLAN = FlightPlan(
    gains=(0.6,),
    step=0.75,
    base=3.0,
    settle=8.0,
    hold=8.0,
    sample_time=0.1,
    prior_delay=0.7,
    prior_gain=1.0,
    limits=Limits(max_climb=1.0, max_height=6.0, max_error=1.5, max_state_age=0.8),
)
ADAPT = AdaptivePlan(longest=1.0, duration=112.0, hold=8.0)


class Moved:
    """What the relay draws: the delay of now."""

    def __init__(self, moving):
        self._moving = moving

    @property
    def mean(self):
        return self._moving.delays[0]

    def draw(self, numbers):
        return self._moving.at(now())


def flown(folder):
    """The experiment, then the two flights."""
    moving = MovingDelay(DELAYS)

    @asynccontextmanager
    async def connect():
        late = Network(delay=Moved(moving))
        there = RelayOptions(("127.0.0.1", GROUND), Network(), late, listen=("127.0.0.1", RELAY))
        address = f"udp:127.0.0.1:{GROUND}"
        async with (
            Relay(there),
            MAVLinkVehicle(address, PLAN.limits, take_off_height=PLAN.base) as vehicle,
        ):
            yield vehicle

    def say(stage):
        print(stage, file=sys.stderr, flush=True)

    study = fly_experiment(connect, PLAN, folder, say)
    found = fly_adaptive(connect, study, ADAPT, folder, say, asyncio.run, moving)
    say("\n".join(found.lines()))
    return {
        **found.to_dict(),
        "delay": study.learned.fit.delay,
        "lag": study.learned.fit.lag,
        "covered": sum(one.covered for one in found.choices) / len(found.choices),
        "samples": len(found.choices),
    }


if __name__ == "__main__":
    with firmware(f"udpclient:127.0.0.1:{RELAY}"):
        print(json.dumps(flown(Path(sys.argv[1]))))
