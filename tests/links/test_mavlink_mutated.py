"""Damaged frames among those of an autopilot that answers, from its own address.

Nothing that a checksum or a signature refutes is believed or answered, on the ground or in the air.
"""

import asyncio
import random
from collections import deque

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime.links import Limits, now, run
from deadtime.links.mavlink import MAVLinkVehicle
from mavlink_frames import crc, damaged
from pymavlink.dialects.v20 import ardupilotmega as d
from stand_in_autopilot import StandIn

ADDRESS, LIMITS = "udp:127.0.0.1:14550", Limits(max_climb=1.0)
KEY = bytes(range(32))

#: Set points of the flight, m/s, and what the vehicle sends in a second, about.
CLIMB, FRAMES = 0.125, 175


def checksum_is_right(data):
    """Whether a frame stands at the beginning and its checksum is right, bit by bit."""
    begin = {0xFD: 10, 0xFE: 6}.get(data[0] if data else None)
    if begin is None or len(data) < begin + 2 or len(data) < (end := begin + data[1]) + 2:
        return False
    number = int.from_bytes(data[7:10], "little") if begin == 10 else data[5]
    known = d.mavlink_map.get(number)
    right = known is not None and crc(data[1:end], known.crc_extra)
    return right == int.from_bytes(data[end : end + 2], "little")


class Damaging:
    """The socket of the vehicle, which sends `copies` damaged frames after each of its own.

    Those whose checksum is right by chance are not sent, unless frames are signed. Then replays
    are sent, too.
    """

    def __init__(self, transport, signed):
        self.close, self._send, self._signed = transport.close, transport.sendto, signed
        self._numbers, self._recent = random.Random(1), deque(maxlen=100)
        self._read = d.MAVLink(None)
        self.copies = self.sent = 0
        self.positions, self.modes = set(), set()

    def sendto(self, data, ground):
        self._send(data, ground)
        (message,) = self._read.parse_buffer(data)
        if message.get_type() == "LOCAL_POSITION_NED":
            self.positions.add((1e-3 * message.time_boot_ms, message.x, -message.vz))
        elif message.get_type() == "HEARTBEAT":
            self.modes.add((message.custom_mode, bool(message.base_mode & 128)))
        self._recent.append(bytes(data))
        for _ in range(self.copies):
            frame = self._numbers.choice(self._recent)
            replayed = self._signed and self._numbers.random() < 0.1
            data = frame if replayed else damaged(frame, self._numbers)
            if self._signed or not checksum_is_right(data):
                self._send(data, ground)
                self.sent += 1


async def attacked(count, firmware, key):
    """A flight among `count` damaged frames, half of them before the take-off."""
    async with StandIn(firmware, key=key) as vehicle:
        before = dict(vehicle.parameters)
        vehicle._transport = damaging = Damaging(vehicle._transport, key is not None)
        believed = []

        def take(state):
            believed.append((state.vehicle_time, state.north, state.climb))
            assert (link._reader.mode, link._reader.armed) in damaging.modes

        async with MAVLinkVehicle(ADDRESS, LIMITS, key=key) as link:
            link.listen(take)
            commands, kinds = len(vehicle.commands), len(vehicle.came)
            seconds = 3.0
            damaging.copies = round(0.5 * count / seconds / FRAMES) + 1
            await asyncio.sleep(seconds)
            assert len(vehicle.commands) == commands
            sent = {kind for _, kind in vehicle.came[kinds:]}
            assert sent == {"HEARTBEAT", "TIMESYNC"}
            assert not vehicle.armed
            damaging.copies = 0
            await link.take_off()
            commands = len(vehicle.commands)
            vehicle.set_points.clear()
            damaging.copies = round(0.5 * count / seconds / FRAMES) + 1
            for _ in range(round(seconds / 0.065)):
                assert (await link.state()).flying
                link.command(CLIMB)
                await asyncio.sleep(0.065)
            damaging.copies = 0
            assert {climb for _, climb in vehicle.set_points} <= {0.0, CLIMB}
            assert len(vehicle.commands) == commands
            assert link.link_time.offset == pytest.approx(vehicle.time - now(), abs=1e-6)
            link.listen(None)
            await link.land()
            refused = link._link.carriers.current.codec.refused
        assert vehicle.parameters == before
        assert len(believed) > 200
        assert set(believed) <= damaging.positions
        assert damaging.sent >= count
        assert refused > 0.8 * damaging.sent


def test_damaged_frames_are_neither_believed_nor_answered():
    run(attacked(2_000, "ardupilot", None))


@pytest.mark.survey
@pytest.mark.long
@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
@pytest.mark.parametrize("key", [None, KEY], ids=["unsigned", "signed"])
def test_100_000_damaged_frames_are_neither_believed_nor_answered(firmware, key):
    run(attacked(100_000, firmware, key))
