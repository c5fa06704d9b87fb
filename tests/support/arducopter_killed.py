"""Flights of the firmware whose station is killed, or whose link is cut, at a random moment.

The flying one is a process of its own, behind a relay that can be cut. Afterwards the next run
connects, or `restore` is called; another station reads the parameters before and after. Prints one
line of JSON. Arguments: how many, and a seed.
"""

import asyncio
import json
import random
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from contextlib import suppress
from pathlib import Path

from arducopter import firmware
from arducopter_session import OURS, THEIRS, Station
from deadtime import LinkError
from deadtime.links import Limits
from deadtime.links.mavlink import MAVLinkVehicle

#: Where the flying process is, behind the relay.
BEHIND = OURS + 1

#: The two ports of the firmware.
PORTS = f"udpclient:127.0.0.1:{OURS}", f"udpclient:127.0.0.1:{THEIRS}"

#: What a link sets in the vehicle.
NAMES = (
    "GUID_TIMEOUT",
    "FS_GCS_TIMEOUT",
    "FS_GCS_ENABLE",
    "FENCE_ALT_MAX",
    "FENCE_TYPE",
    "FENCE_ACTION",
    "FENCE_ENABLE",
    "ANGLE_MAX",
)

#: The moments are drawn up to so many seconds after it begins: connection, take-off, flight.
MOMENTS = 18.0

LIMITS = Limits(max_climb=1.0)


async def pilot(folder):
    print("begins", flush=True)
    async with MAVLinkVehicle(f"udp:127.0.0.1:{BEHIND}", LIMITS, folder=folder) as link:
        await link.take_off()
        while True:
            link.command(0.1 if int(time.monotonic()) % 2 else -0.1)
            await link.state()
            await asyncio.sleep(0.065)


async def after(folder, how):
    """The next run, which does not fly, or `restore`; what it says."""
    said = []
    link = MAVLinkVehicle(f"udp:127.0.0.1:{BEHIND}", LIMITS, folder=folder)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        if how == "restore":
            said = await link.restore()
        else:
            async with link:
                await asyncio.sleep(0.2)
    print(json.dumps([*said, *(str(one.message) for one in warned)]))


class Relay(threading.Thread):
    """Passes datagrams on between the vehicle and the flying process, unless it is cut."""

    def __init__(self):
        super().__init__(daemon=True)
        self.cut = False
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.near.bind(("127.0.0.1", OURS))
        self.far.bind(("127.0.0.1", 0))

    def run(self):
        vehicle = None
        while True:
            for ready in select.select([self.near, self.far], [], [])[0]:
                with suppress(OSError):  # nobody is there
                    data, sender = ready.recvfrom(4096)
                    vehicle = sender if ready is self.near else vehicle
                    if not self.cut and ready is self.near:
                        self.far.sendto(data, ("127.0.0.1", BEHIND))
                    elif not self.cut and vehicle is not None:
                        self.near.sendto(data, vehicle)


def wait_on_ground(station):
    """Until the vehicle has been disarmed for 3 s; how long that took."""
    begin = calm = time.monotonic()
    while time.monotonic() < begin + 60.0:
        heard = [value for _, _, what, value in list(station.notes) if what == "armed"]
        if not heard or heard[-1]:
            calm = time.monotonic()
        if time.monotonic() > calm + 3.0:
            return calm - begin
        time.sleep(0.1)
    raise TimeoutError("it has not disarmed within 60 s")


def interrupted(station, relay, folder, moment, how, then):
    """One flight that is ended at a moment, and what follows."""
    station.ask()  # it may have been starting when it was asked before
    del station.notes[:]
    process = subprocess.Popen(
        [sys.executable, __file__, "pilot", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.readline()
    time.sleep(moment)
    if how == "kill":
        process.kill()
    relay.cut = how == "cut"
    _, error = process.communicate()
    flew = any(value for _, _, what, value in list(station.notes) if what == "armed")
    down = wait_on_ground(station)
    relay.cut = False
    changed = {name: station.parameter(name) for name in NAMES}
    done = subprocess.run(
        [sys.executable, __file__, then, str(folder)], capture_output=True, text=True, timeout=120
    )
    return {
        "moment": moment,
        "how": how,
        "then": then,
        "flew": flew,
        "down": down,
        "changed": changed,
        "error": error[-1500:],
        "said": json.loads(done.stdout) if done.returncode == 0 else done.stderr[-1500:],
        "after": {name: station.parameter(name) for name in NAMES},
    }


def ready(station):
    """Until the firmware can be armed, by a first flight that nobody disturbs."""
    with tempfile.TemporaryDirectory() as folder, suppress(LinkError):

        async def flight():
            link = MAVLinkVehicle(f"udp:127.0.0.1:{BEHIND}", LIMITS, folder=Path(folder, "first"))
            async with link:
                await link.take_off()

        asyncio.run(flight())
    wait_on_ground(station)


def main(count, seed):
    draw = random.Random(seed)
    with (
        firmware(*PORTS, longest=400 + 90 * count),
        tempfile.TemporaryDirectory() as folder,
    ):
        station, relay = Station(), Relay()
        relay.start()
        while station.peer is None:
            time.sleep(0.1)
        station.ask()
        before = {name: station.parameter(name) for name in NAMES}
        ready(station)
        flights = [
            interrupted(
                station,
                relay,
                Path(folder, str(number)),
                draw.uniform(2.0, MOMENTS),
                ("kill", "cut")[number % 2],
                ("next", "restore")[number // 2 % 2],
            )
            for number in range(count)
        ]
    print(json.dumps({"before": before, "flights": flights}))


if __name__ == "__main__":
    if sys.argv[1] == "pilot":
        asyncio.run(pilot(Path(sys.argv[2])))
    elif sys.argv[1] in ("next", "restore"):
        asyncio.run(after(Path(sys.argv[2]), sys.argv[1]))
    else:
        main(int(sys.argv[1]), int(sys.argv[2]))
