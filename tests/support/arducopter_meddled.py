"""Flights of the firmware with a few forged, late, repeated and missing messages of each kind.

They come and go by a relay in the process that flies. Another station notes what the vehicle
reports to it, undisturbed. Prints one line of JSON. Arguments: how many, and a seed.
"""

import asyncio
import json
import struct
import sys
import tempfile
import time
import warnings
from pathlib import Path

from arducopter import firmware
from arducopter_killed import BEHIND, LIMITS, NAMES, PORTS, ready, wait_on_ground
from arducopter_session import OURS, Station
from deadtime import LinkError
from deadtime.links.mavlink import MAVLinkVehicle
from meddling import Meddler
from pymavlink.dialects.v20 import ardupilotmega as d

#: Numbers and kinds of messages.
KINDS = {number: message.msgname for number, message in d.mavlink_map.items()}

#: Time in the air by commands, s.
FLIGHT = 5.0


def frames(data):
    """The MAVLink 2 frames of a datagram, with their kinds."""
    while len(data) >= 12 and data[0] == 0xFD:
        length = data[1] + 12 + 13 * (data[2] & 1)
        number = struct.unpack("<I", data[7:10] + b"\0")[0]
        yield KINDS.get(number, ""), data[:length], data[4]
        data = data[length:]


class Relay(asyncio.DatagramProtocol):
    """Between the vehicle and the link; `meddler` decides what passes."""

    def __init__(self):
        self.meddler = self.vehicle = self.near = self.far = None
        self.number = 0

    async def open(self):
        loop = asyncio.get_running_loop()
        self.far, _ = await loop.create_datagram_endpoint(
            lambda: _End(self.up), remote_addr=("127.0.0.1", BEHIND)
        )
        self.near, _ = await loop.create_datagram_endpoint(
            lambda: _End(self.down), local_addr=("127.0.0.1", OURS)
        )

    def down(self, data, sender):
        self.vehicle = sender
        for kind, frame, number in frames(data):
            self.number = number
            if self.meddler is None:
                self.far.sendto(frame)
            else:
                self.meddler.sent(kind, frame)

    def up(self, data, sender):
        for kind, frame, _ in frames(data):
            if self.vehicle and not (self.meddler and self.meddler.drops(kind)):
                self.near.sendto(frame, self.vehicle)

    def deliver(self, delay, data):
        asyncio.get_running_loop().call_later(delay, self.far.sendto, data)

    def pack(self, message):
        mav = d.MAVLink(None, 1, 1)
        mav.seq = (self.number + 1) % 256
        return message.pack(mav)

    def close(self):
        self.near.close()
        self.far.close()


class _End(asyncio.DatagramProtocol):
    def __init__(self, take):
        self._take = take

    def datagram_received(self, data, addr):
        self._take(data, addr)


async def flight(folder, seed):
    """One flight; what ended it, and what was done to its messages."""
    relay, ended, begin = Relay(), None, time.monotonic()
    await relay.open()
    relay.meddler = Meddler(seed, lambda: time.monotonic() - begin, relay.deliver, relay.pack)
    relay.meddler.names = list(NAMES)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            async with MAVLinkVehicle(f"udp:127.0.0.1:{BEHIND}", LIMITS, folder=folder) as link:
                await link.take_off()
                end = time.monotonic() + FLIGHT
                while time.monotonic() < end:
                    await link.state()
                    link.command(0.1 if int(time.monotonic()) % 2 else -0.1)
                    await asyncio.sleep(0.065)
        except LinkError as error:
            ended = " ".join([str(error), *getattr(error, "__notes__", [])])
    done, relay.meddler = relay.meddler.done, None
    relay.close()
    return ended, [str(one.message) for one in warned], done


async def restored(folder):
    relay = Relay()
    await relay.open()
    try:
        return await MAVLinkVehicle(f"udp:127.0.0.1:{BEHIND}", LIMITS, folder=folder).restore()
    finally:
        relay.close()


def without_failsafes(notes):
    """Times at which the vehicle flew while its failsafes were off, after they had been on."""
    armed, height, on, found = False, 0.0, False, []
    for now, _, what, value in notes:
        armed = value if what == "armed" else armed
        height = value if what == "height" else height
        if what == "parameter" and value[0] == "FS_GCS_ENABLE":
            on = value[1] == 5.0
        if armed and height > 0.3 and not on:
            found.append(now)
    return found


def meddled(station, folder, seed):
    station.ask()  # it may have been starting when it was asked before
    del station.notes[:]
    ended, warned, done = asyncio.run(flight(folder, seed))
    down = wait_on_ground(station)
    notes = list(station.notes)
    left = {name: station.parameter(name) for name in NAMES}
    said = asyncio.run(restored(folder))
    return {
        "seed": seed,
        "ended": ended,
        "warned": warned,
        "done": done,
        "down": down,
        "without_failsafes": len(without_failsafes(notes)),
        "highest": max((v for _, _, what, v in notes if what == "height"), default=0.0),
        "left": left,
        "said": said,
        "after": {name: station.parameter(name) for name in NAMES},
    }


def main(count, seed):
    with (
        firmware(*PORTS, longest=400 + 90 * count),
        tempfile.TemporaryDirectory() as folder,
    ):
        station = Station()
        while station.peer is None:
            time.sleep(0.1)
        station.ask()
        before = {name: station.parameter(name) for name in NAMES}

        async def behind():
            relay = Relay()
            await relay.open()
            try:
                await asyncio.to_thread(ready, station)
            finally:
                relay.close()

        asyncio.run(behind())
        flights = [
            meddled(station, Path(folder, str(number)), seed + number) for number in range(count)
        ]
    print(json.dumps({"before": before, "flights": flights}))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
