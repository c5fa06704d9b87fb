"""Two flights of the firmware: another station lands it, and the ground station is killed.

The flying one is a process of its own (`pilot`). The other station, system 254, is written with
pymavlink alone and has its own link to the vehicle; it also notes what the vehicle reports. Prints
one line of JSON. Times are those of the system's monotonic clock, the same for all processes; after
the end of the ground station those of the vehicle, which a busy machine does not change.
"""

import asyncio
import json
import socket
import subprocess
import sys
import threading
import time

from arducopter import firmware
from deadtime import LinkError
from deadtime.links import Limits
from deadtime.links.mavlink import MAVLinkVehicle
from pymavlink.dialects.v20 import ardupilotmega as d

OURS, THEIRS = 14550, 14560

#: Climb that is commanded when the flight ends, m/s.
CLIMB = 0.4


def tell(**facts):
    print(json.dumps({**facts, "time": time.monotonic()}), flush=True)


async def pilot():
    """Take off and climb by small commands; what happens is printed."""
    async with MAVLinkVehicle(f"udp:127.0.0.1:{OURS}", Limits(max_climb=1.0)) as link:
        tell(event="connected")
        await link.take_off()
        tell(event="up", height=(await link.state()).height)
        begin, speed = time.monotonic(), 0.2
        try:
            while time.monotonic() < begin + 30.0:
                elapsed = time.monotonic() - begin
                speed = 0.2 * (-1) ** int(elapsed / 1.5) if elapsed < 6.0 else CLIMB
                link.command(speed)
                await asyncio.sleep(0.065)
        except LinkError as error:
            tell(event="ended", message=str(error), link_time=link.link_time.median)
    tell(event="closed")


class Station:
    """The other ground station."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", THEIRS))
        self.socket.settimeout(0.2)
        self.mav = d.MAVLink(None, 254, 190)
        self.mav.robust_parsing = True
        self.notes, self.peer, self.running = [], None, True
        self.parameters = {}
        self.boot = 0.0  # the vehicle's clock, s
        self.thread = threading.Thread(target=self._listen, daemon=True)
        self.thread.start()

    def send(self, message):
        self.socket.sendto(message.pack(self.mav), self.peer)
        self.mav.seq = (self.mav.seq + 1) % 256

    def command(self, number, *values):
        values = [*values, *[0.0] * (7 - len(values))]
        self.send(d.MAVLink_command_long_message(1, 1, number, 0, *values))

    def ask(self):
        for number, rate in ((32, 50.0), (85, 50.0), (245, 20.0), (0, 20.0)):
            self.command(511, number, 1e6 / rate)

    def parameter(self, name):
        self.parameters.pop(name, None)
        while name not in self.parameters:
            self.send(d.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
            time.sleep(0.2)
        return self.parameters[name]

    def _listen(self):
        told = 0.0
        while self.running:
            if self.peer is not None and time.monotonic() > told + 1.0:
                told = time.monotonic()
                self.send(d.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            try:
                data, self.peer = self.socket.recvfrom(4096)
            except TimeoutError:
                continue
            for message in self.mav.parse_buffer(data) or []:
                self._note(message, time.monotonic())

    def _note(self, message, now):
        kind = message.get_type()
        self.boot = 1e-3 * getattr(message, "time_boot_ms", 1e3 * self.boot)

        def note(what, value):
            self.notes.append((now, self.boot, what, value))

        if kind == "HEARTBEAT" and message.get_srcSystem() == 1:
            note("mode", message.custom_mode)
            note("armed", bool(message.base_mode & 128))
        elif kind == "POSITION_TARGET_LOCAL_NED":
            note("target", -message.vz)
        elif kind == "LOCAL_POSITION_NED":
            note("height", -message.z)
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value
            note("parameter", (message.param_id, message.param_value))

    def first(self, since, name, holds, within=60.0):
        """When something was first reported after a time: the time, and the vehicle's."""
        end = time.monotonic() + within
        while time.monotonic() < end:
            for now, boot, what, value in list(self.notes):
                if now >= since and what == name and holds(value):
                    return now, boot
            time.sleep(0.05)
        raise TimeoutError(f"no such {name}; it says {self.notes[-6:]}")


def events(process):
    """What the pilot tells, until its end."""
    for line in process.stdout:
        yield json.loads(line)


def start():
    return subprocess.Popen([sys.executable, __file__, "pilot"], stdout=subprocess.PIPE, text=True)


def landed_by_another(station):
    process, result = start(), {}
    for event in events(process):
        result[event["event"]] = event
        if event["event"] == "up":
            station.ask()
            time.sleep(2.0)
            result["asked"] = time.monotonic()
            station.command(d.MAV_CMD_NAV_LAND)
            result["landing"], _ = station.first(result["asked"], "mode", lambda mode: mode == 9)
    process.wait()
    return result


def killed(station):
    process = start()
    for event in events(process):
        if event["event"] == "up":
            station.ask()
            time.sleep(7.0)
            process.kill()
            break
    killed_at, boot = time.monotonic(), station.boot
    _, hovers = station.first(killed_at, "target", lambda speed: speed == 0.0)
    _, lands = station.first(killed_at, "mode", lambda mode: mode == 9)
    _, down = station.first(killed_at, "armed", lambda armed: not armed)
    heights = [v for now, _, what, v in station.notes if what == "height" and now >= killed_at]
    told = [v for now, _, what, v in station.notes if what == "target" and now < killed_at]
    return {
        "told": told[-1],
        "hovers": hovers - boot,
        "lands": lands - boot,
        "down": down - boot,
        "climbed": max(heights) - heights[0],
        "timeout": station.parameter("GUID_TIMEOUT"),
    }


def main():
    with firmware(f"udpclient:127.0.0.1:{OURS}", f"udpclient:127.0.0.1:{THEIRS}"):
        station = Station()
        result = {"another": landed_by_another(station)}
        result["put_back"] = {
            name: station.parameter(name) for name in ("GUID_TIMEOUT", "FENCE_ENABLE", "ANGLE_MAX")
        }
        result["killed"] = killed(station)
    print(json.dumps(result))


if __name__ == "__main__":
    asyncio.run(pilot()) if sys.argv[1:] == ["pilot"] else main()
