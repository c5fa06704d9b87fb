"""Forges, delays, repeats and drops a few messages of each kind of a stand-in, by a seed."""

import asyncio
import math
import random

from pymavlink.dialects.v20 import ardupilotmega as d
from stand_in_autopilot import MODES

#: What a client decides by, and what it asks for.
FROM_VEHICLE = (
    "HEARTBEAT",
    "EXTENDED_SYS_STATE",
    "LOCAL_POSITION_NED",
    "ATTITUDE",
    "SYS_STATUS",
    "EKF_STATUS_REPORT",
    "ESTIMATOR_STATUS",
    "POSITION_TARGET_LOCAL_NED",
    "PARAM_VALUE",
    "COMMAND_ACK",
    "TIMESYNC",
    "STATUSTEXT",
    "AUTOPILOT_VERSION",
    "GLOBAL_POSITION_INT",
)
FROM_STATION = (
    "HEARTBEAT",
    "COMMAND_LONG",
    "PARAM_SET",
    "PARAM_REQUEST_READ",
    "SET_POSITION_TARGET_LOCAL_NED",
    "TIMESYNC",
)

#: Messages that come when they are asked for: which of them is meddled with, not when.
ANSWERS = {"PARAM_VALUE": 130, "COMMAND_ACK": 16, "AUTOPILOT_VERSION": 4, "STATUSTEXT": 1}

#: Time in which the others are meddled with, s, and of the way of a message.
FLIGHT, WAY = 18.0, 0.01


class Meddler:
    """Between a vehicle and its station.

    Parameters
    ----------
    seed : int
    clock : callable
        The time, s, and that of the vehicle.
    deliver : callable
        Called with a delay, s, and the bytes of a message of the vehicle.
    pack : callable
        The bytes of a message with the ids of the vehicle.
    """

    def __init__(self, seed, clock, deliver, pack, firmware="ardupilot", names=("FENCE_ENABLE",)):
        self.random, self.clock, self.deliver, self.pack = random.Random(seed), clock, deliver, pack
        self.firmware, self.names = firmware, list(names)
        self.begin, self.counts = clock(), {}
        self.plans = {kind: self._plan(kind) for kind in FROM_VEHICLE}
        self.lost = {kind: [self._start(kind), self._some()] for kind in FROM_STATION}
        self.done = []

    @classmethod
    def of(cls, vehicle, seed):
        """For a stand-in, inside of a running loop."""

        def pack(message):
            data = message.pack(vehicle._mav)
            vehicle._mav.seq = (vehicle._mav.seq + 1) % 256
            return data

        def deliver(delay, data):
            loop = asyncio.get_running_loop()
            loop.call_later(WAY + delay, vehicle._transport.sendto, data, vehicle.ground)

        meddler = cls(
            seed, lambda: vehicle.time, deliver, pack, vehicle.firmware, vehicle.parameters
        )
        vehicle.send = lambda message: meddler.sent(message.get_type(), pack(message))
        vehicle.drop = lambda message: (
            message.get_srcSystem() == 255 and meddler.drops(message.get_type())
        )
        return meddler

    def _some(self):
        return self.random.randint(1, 3)

    def _start(self, kind):
        return self.random.randrange(ANSWERS.get(kind, 1)), self.random.uniform(0.0, FLIGHT)

    def _plan(self, kind):
        action = self.random.choice(["forge", "late", "copy", "drop"])
        return [action, self._start(kind), self._some()]

    def drops(self, kind):
        """Whether a message of the station is lost."""
        plan = self.lost.get(kind)
        return plan is not None and self._is_due(kind, plan, 0)

    def _is_due(self, kind, plan, place):
        (index, start), left = plan[place], plan[place + 1]
        if left == 0:
            return False
        if place == 1 and kind in ANSWERS:
            self.counts[kind] = self.counts.get(kind, 0) + 1
            is_due = self.counts[kind] > index
        else:
            is_due = self.clock() - self.begin > start
        plan[place + 1] -= is_due
        return is_due

    def sent(self, kind, data):
        """Pass on a message of the vehicle, or what is made of it."""
        plan = self.plans.get(kind)
        if plan is None or not self._is_due(kind, plan, 1):
            self.deliver(0.0, data)
            return
        self.done.append((round(self.clock() - self.begin, 2), kind, plan[0]))
        if plan[0] == "forge":
            self.deliver(0.0, self.pack(self.forged(kind)))
        if plan[0] in ("forge", "copy"):
            self.deliver(0.0, data)
        if plan[0] == "late":
            self.deliver(self.random.uniform(0.9, 1.2), data)
        elif plan[0] == "copy":
            self.deliver(self.random.uniform(0.0, 1.2), data)

    def forged(self, kind):
        """A message that the vehicle has not sent, with its ids."""
        draw = self.random

        def number():
            return draw.choice([0.0, 1.0, -1.0, draw.gauss(0.0, 5.0), math.nan, math.inf])

        ms = max(0, round(1e3 * self.clock()) + draw.choice([0, 1, 5, -500, 3000, 10**7]))
        modes = [*MODES[self.firmware], 0, 17]
        make = {
            "HEARTBEAT": lambda: d.MAVLink_heartbeat_message(
                2,
                3 if self.firmware == "ardupilot" else 12,
                draw.choice([81, 209]),
                draw.choice(modes),
                draw.choice([3, 4, 4, 5, 6, 8]),
                3,
            ),
            "EXTENDED_SYS_STATE": lambda: d.MAVLink_extended_sys_state_message(
                0, draw.randint(0, 4)
            ),
            "LOCAL_POSITION_NED": lambda: d.MAVLink_local_position_ned_message(
                ms, *(number() for _ in range(6))
            ),
            "ATTITUDE": lambda: d.MAVLink_attitude_message(ms, *(number() for _ in range(6))),
            "SYS_STATUS": lambda: d.MAVLink_sys_status_message(
                0, 0, 0, 0, 12000, 0, draw.choice([-1, 0, 5, 90]), *[0] * 6
            ),
            "EKF_STATUS_REPORT": lambda: d.MAVLink_ekf_status_report_message(
                draw.choice([0, 128, 48]), *[0.0] * 5
            ),
            "ESTIMATOR_STATUS": lambda: d.MAVLink_estimator_status_message(
                0, draw.choice([0, 128, 48]), *[0.0] * 8
            ),
            "POSITION_TARGET_LOCAL_NED": lambda: d.MAVLink_position_target_local_ned_message(
                ms, 1, 0xDC7, *(number() for _ in range(11))
            ),
            "PARAM_VALUE": lambda: d.MAVLink_param_value_message(
                draw.choice(self.names).encode(),
                draw.choice([0.0, 1.0, 5.0, 100.0]),
                9,
                1,
                0,
            ),
            "COMMAND_ACK": lambda: d.MAVLink_command_ack_message(
                draw.choice([400, 22, 176, 511]), draw.choice([0, 1, 2, 4, 5])
            ),
            "TIMESYNC": lambda: d.MAVLink_timesync_message(
                draw.choice([0, 10**9, 10**15]), draw.choice([0, 10**9])
            ),
            "STATUSTEXT": lambda: d.MAVLink_statustext_message(2, b"\x1b[2J"),
            "AUTOPILOT_VERSION": lambda: d.MAVLink_autopilot_version_message(
                0, 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, draw.randint(0, 3)
            ),
            "GLOBAL_POSITION_INT": lambda: d.MAVLink_global_position_int_message(
                ms, 0, 0, draw.choice([0, 50_000, 10**6]), 0, 0, 0, 0, 0
            ),
        }
        return make[kind]()
