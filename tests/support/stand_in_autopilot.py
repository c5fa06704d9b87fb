"""A stand-in for ArduPilot Copter and PX4: enough of both to fly the height, in virtual time.

It speaks through pymavlink's own encoder and parser. Its vehicle follows vertical speeds with a lag
and obeys its own failsafes; nothing of the link under test is used.
"""

import asyncio
import os
import random
import struct

from pymavlink.dialects.v20 import ardupilotmega as d

GROUND = ("127.0.0.1", 14550)

ARDUPILOT = {
    "SYSID_MYGCS": 255.0,
    "GUID_TIMEOUT": 3.0,
    "FS_GCS_TIMEOUT": 5.0,
    "FS_GCS_ENABLE": 0.0,
    "SIM_SPEEDUP": 1.0,
    "FENCE_MARGIN": 2.0,
    "FENCE_TYPE": 7.0,
    "FENCE_ENABLE": 0.0,
    "FENCE_ALT_MAX": 100.0,
    "FENCE_ACTION": 1.0,
    "ANGLE_MAX": 3000.0,
    "GUID_OPTIONS": 2.0,
    "WPNAV_SPEED": 1000.0,
    "WPNAV_SPEED_UP": 250.0,
    "WPNAV_SPEED_DN": 8.0,
}
PX4 = {
    "COM_OF_LOSS_T": 1.0,
    "COM_OBL_RC_ACT": 0,
    "COM_DL_LOSS_T": 10,
    "NAV_DLL_ACT": 0,
    "GF_MAX_VER_DIST": 0.0,
    "GF_ACTION": 2,
    "MPC_TILTMAX_AIR": 45.0,
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
}

#: Modes: guided, landing, another one that holds.
MODES = {"ardupilot": (4, 9, 5), "px4": (6 << 16, 4 << 16 | 6 << 24, 3 << 16)}

#: Step of the simulation, and lag of the vertical speed, s.
STEP, LAG = 0.01, 0.2


class StandIn:
    """One vehicle; ``async with StandIn() as vehicle``.

    `drop` decides on each message that comes in or goes out whether it is lost. It sends to all
    `grounds` but those that are `cut`, as a router does; `came` has the ground and the type of each
    message. With `serial`, it is at the other end of this pseudo-terminal.
    """

    def __init__(
        self,
        firmware="ardupilot",
        system=1,
        ground=GROUND,
        key=None,
        armed=False,
        noise=0.0,
        tcp=None,
        serial=None,
        grounds=(),
    ):
        self.firmware, self.tcp, self.serial = firmware, tcp, serial
        self.ground, self.grounds = ground, grounds or (ground,)
        self.cut, self.came = set(), []
        self.server, self.stream = None, None
        self.guided, self.landing, self.other = MODES[firmware]
        self.mode, self.armed = self.other, armed
        self.parameters = dict(ARDUPILOT if firmware == "ardupilot" else PX4)
        self.height, self.climb, self.told = 0.0, 0.0, 0.0
        self.target = None
        self.along, self.place = (0.0, 0.0), [0.0, 0.0]
        self.turn = self.yaw = 0.0
        self.ready = True
        self.drop = lambda message: False
        self.commands, self.set_points = [], []
        self.places, self.attitudes, self.goal = [], [], None
        self.battery, self.board = 90, 17
        self.origin = -3.0  # z of the ground
        self.status = None
        self._mav = d.MAVLink(None, system, 1)
        self._mav.robust_parsing = True
        if key is not None:
            self._mav.signing.secret_key, self._mav.signing.sign_outgoing = key, True
            self._mav.signing.timestamp = 1 << 46
        self._noise, self._random = noise, random.Random(1)
        self._intervals, self._due = {}, {}
        self._station = self._streamed = None

    async def __aenter__(self):
        self._loop = asyncio.get_running_loop()
        self._begin = self._loop.time() - 20.0
        if self.serial is not None:
            self._loop.add_reader(self.serial, lambda: self.receive(os.read(self.serial, 4096)))
        elif self.tcp is None:
            self._transport, _ = await self._loop.create_datagram_endpoint(
                lambda: _Receiver(self), local_addr=("127.0.0.1", 0)
            )
        else:
            self.server = await self._loop.create_server(lambda: _Stream(self), *self.tcp)
        self._task = self._loop.create_task(self._live())
        return self

    async def __aexit__(self, *_):
        self._task.cancel()
        if self.serial is not None:
            self._loop.remove_reader(self.serial)
        else:
            (self.server or self._transport).close()

    @property
    def time(self):
        return self._loop.time() - self._begin

    @property
    def landed(self):
        return self.height <= 0.0 and self.climb <= 0.0

    def send(self, message):
        if not self.drop(message):
            data = message.pack(self._mav)
            if self.serial is not None:
                os.write(self.serial, data)
            elif self.server is None:
                for ground in set(self.grounds) - self.cut:
                    self._transport.sendto(data, ground)
            elif self.stream is not None:
                self.stream.write(data[:9])  # streams have no borders of frames
                self.stream.write(data[9:])
        self._mav.seq = (self._mav.seq + 1) % 256

    def say(self, text):
        self.send(d.MAVLink_statustext_message(2, text.encode()))

    async def _live(self):
        due = self._loop.time()
        while True:
            self._move()
            for number, period in {0: 1.0, **self._intervals}.items():
                if self.time >= self._due.get(number, 0.0):
                    self._due[number] = self.time + period
                    self._report(number)
            due += STEP
            await asyncio.sleep(due - self._loop.time())

    def _move(self):
        if not self.armed:
            return
        self._fail_safe()
        wanted = 0.0
        if self.mode == self.landing:
            wanted = -0.5
        elif self.target is not None:
            wanted = max(-1.0, min(1.0, 2.0 * (self.target - self.height)))
            if abs(self.target - self.height) < 0.01:
                self.target = None
        elif self.mode == self.guided:
            wanted = self.told
        if self.goal is not None:
            self.along = tuple(g - x for g, x in zip(self.goal, self.place, strict=True))
        self.place = [x + STEP * v for x, v in zip(self.place, self.along, strict=True)]
        self.yaw += STEP * self.turn
        self.climb += STEP / LAG * (wanted - self.climb)
        self.height += STEP * self.climb
        if self.height <= 0.0:
            self.height = 0.0
            if self.mode == self.landing:
                self.climb, self.armed, self.target = 0.0, False, None
            self.climb = max(0.0, self.climb)

    def _fail_safe(self):
        silent = self.time - (self._streamed or 0.0)
        unheard = 0.0 if self._station is None else self.time - self._station
        ap = self.firmware == "ardupilot"
        if silent > self.parameters["GUID_TIMEOUT" if ap else "COM_OF_LOSS_T"]:
            self.told, self.along, self.turn, self.goal = 0.0, (0.0, 0.0), 0.0, None
            if not ap and self.mode == self.guided:
                self.mode = 4 << 16 | 3 << 24  # hold
        if ap and self.parameters["FS_GCS_ENABLE"] and unheard > self.parameters["FS_GCS_TIMEOUT"]:
            self.change_mode(self.landing)
        if not ap and self.parameters["NAV_DLL_ACT"] and unheard > self.parameters["COM_DL_LOSS_T"]:
            self.change_mode(self.landing)

    def change_mode(self, mode):
        """As a pilot, another ground station or a failsafe does."""
        self.mode, self.told, self.target = mode, 0.0, None
        self.along, self.turn = (0.0, 0.0), 0.0

    def _report(self, number):
        ms = round(1e3 * self.time)
        z = self.origin - self.height + self._random.gauss(0.0, self._noise)
        nothing = [0.0] * 8
        if number == 0:
            flags = 1 | (128 if self.armed else 0)
            pilot = 3 if self.firmware == "ardupilot" else 12
            status = self.status or (4 if self.armed else 3)
            self.send(d.MAVLink_heartbeat_message(2, pilot, flags, self.mode, status, 3))
        elif number == 32:
            self.send(
                d.MAVLink_local_position_ned_message(ms, *self.place, z, *self.along, -self.climb)
            )
        elif number == 85:
            self.send(
                d.MAVLink_position_target_local_ned_message(
                    ms, 1, 0xDC7, *nothing[:3], *self.along, -self.told, *nothing[:5]
                )
            )
        elif number == 30:
            self.send(d.MAVLink_attitude_message(ms, 0.0, 0.0, self.yaw, 0.0, 0.0, self.turn))
        elif number == 245:
            landing = self.mode == self.landing
            state = 1 if self.landed else 4 if landing else 3 if self.target is not None else 2
            self.send(d.MAVLink_extended_sys_state_message(0, state))
        elif number == 1:
            self.send(d.MAVLink_sys_status_message(0, 0, 0, 0, 12000, 0, self.battery, *[0] * 6))
        elif number == 33:
            alt = round(1e3 * (50.0 + self.height))
            self.send(d.MAVLink_global_position_int_message(ms, 0, 0, alt, 0, 0, 0, 0, 0))
        elif number in (193, 230):
            flags = 16 | 32 if self.ready else 128
            if number == 193:
                self.send(d.MAVLink_ekf_status_report_message(flags, *nothing[:5]))
            else:
                self.send(d.MAVLink_estimator_status_message(0, flags, *nothing))

    def receive(self, data, ground=None):
        if ground in self.cut:
            return
        for message in self._mav.parse_buffer(data) or []:
            self.came.append((ground, message.get_type()))
            if message.get_type() == "BAD_DATA" or self.drop(message):
                continue
            handler = getattr(self, "_take_" + message.get_type().lower(), None)
            if handler is not None:
                handler(message)

    def _take_heartbeat(self, message):
        if message.get_srcSystem() == 255:
            self._station = self.time

    def _take_timesync(self, message):
        if message.tc1 == 0:
            self.send(d.MAVLink_timesync_message(round(1e9 * self.time), message.ts1))

    def _take_set_position_target_local_ned(self, message):
        self._streamed = self.time
        assert message.type_mask in (0xDC7, 0x5C7, 0x9F8)
        assert message.coordinate_frame == 1
        if message.type_mask == 0x9F8:
            self.places.append(message)
            if self.mode == self.guided:
                self.goal, self.told = (message.x, message.y), 0.0
                self.target, self.yaw = self.origin - message.z, message.yaw
            return
        self.set_points.append((self.time, -message.vz))
        if self.mode == self.guided:
            self.goal = None
            self.target = None  # a set point ends the take-off
            self.told = -message.vz
            self.along = (message.vx, message.vy)
            if message.type_mask == 0x5C7:
                self.turn = message.yaw_rate

    def _take_set_attitude_target(self, message):
        """Thrust above one half climbs."""
        self._streamed = self.time
        assert message.type_mask in (0x07, 0x80)
        self.attitudes.append(message)
        if self.mode == self.guided:
            self.target = self.goal = None
            self.told, self.along, self.turn = message.thrust - 0.5, (0.0, 0.0), 0.0

    def _integer(self, name):
        return self.firmware == "px4" and isinstance(self.parameters[name], int)

    def _send_parameter(self, name):
        value = self.parameters[name]
        kind = 6 if self._integer(name) else 9
        if self._integer(name):
            value = struct.unpack("<f", struct.pack("<i", value))[0]
        self.send(d.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))

    def _take_param_request_read(self, message):
        if message.param_id in self.parameters:
            self._send_parameter(message.param_id)

    def _take_param_set(self, message):
        name = message.param_id
        value = message.param_value
        if self._integer(name):
            value = struct.unpack("<i", struct.pack("<f", value))[0]
        self.parameters[name] = value
        self._send_parameter(name)

    def _take_command_long(self, message):
        values = [getattr(message, f"param{k}") for k in range(1, 8)]
        self.commands.append((message.command, values))
        result = 0
        if message.command == d.MAV_CMD_SET_MESSAGE_INTERVAL:
            self._intervals[int(values[0])] = 1e-6 * values[1]
        elif message.command == d.MAV_CMD_REQUEST_MESSAGE and values[0] == 148:
            version = [0, 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, self.board]
            self.send(d.MAVLink_autopilot_version_message(*version))
        elif message.command == d.MAV_CMD_DO_SET_MODE:
            px4 = self.firmware == "px4"
            mode = int(values[1]) << 16 | int(values[2]) << 24 if px4 else int(values[1])
            fresh = self._streamed is not None and self.time - self._streamed < 0.5
            if mode == self.guided and px4 and not fresh:
                result = 1  # no set points yet
            else:
                self.change_mode(mode)
        elif message.command == d.MAV_CMD_COMPONENT_ARM_DISARM:
            result = self._arm(values[0])
        elif message.command == d.MAV_CMD_NAV_TAKEOFF:
            result = 0 if self.armed else 4
            if self.armed:
                self.target = values[6] - (50.0 if self.firmware == "px4" else 0.0)
        self.send(d.MAVLink_command_ack_message(message.command, result))

    def _arm(self, value):
        if value and not self.ready:
            self.say("PreArm: no position")
            return 4
        if not value and not self.landed:
            return 4
        if value and self.firmware == "ardupilot":
            self.origin -= 0.4  # it moves the zero of its heights
        self.armed = bool(value)
        return 0


class _Receiver(asyncio.DatagramProtocol):
    def __init__(self, vehicle):
        self._vehicle = vehicle

    def datagram_received(self, data, addr):
        self._vehicle.receive(data, tuple(addr[:2]))


class _Stream(asyncio.Protocol):
    def __init__(self, vehicle):
        self._vehicle = vehicle

    def connection_made(self, transport):
        self._vehicle.stream = transport

    def data_received(self, data):
        self._vehicle.receive(data)


async def told(link, speed, seconds):
    """Command one speed as a controller does; the states that came."""
    states = []
    for _ in range(round(seconds / 0.065)):
        states.append(await link.state())
        link.command(speed)
        await asyncio.sleep(0.065)
    return states
