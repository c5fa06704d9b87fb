"""A drone with the worst possible behaviour of a real one, to test a client.

It takes off whenever the take-off bit is set, during a landing and on the ground, and follows the
last motion command until its own watchdog lands it. Rising and landing are quick, so that a flight
takes little time.
"""

import asyncio
from collections import deque
from contextlib import asynccontextmanager

from deadtime.links import Limits
from deadtime.links.ardrone2 import ARDrone2, Navdata, build_navdata, write_configuration
from deadtime.links.ardrone2.commands import Config, Control, Move, Ref, decode
from deadtime.links.ardrone2.navdata import State
from deadtime.links.ardrone2.navdata_options import Demo, VideoStream

WATCHDOG, WARNING_TIME = 2.0, 0.05
RISE_TIME, LANDING_TIME = 0.3, 0.4
MAJOR = {"landed": 2, "rising": 7, "flying": 3, "landing": 8}

#: Number of packets that a socket buffers for a process that does not read; later ones are lost.
SOCKET_BUFFER = 40


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, receive):
        self.datagram_received = receive

    datagram_received = None


class _Connections(asyncio.Protocol):
    def __init__(self, readers):
        self.connection_made = readers.append

    connection_made = None


class WorstCaseDrone:
    """`uplink` and `late` are the delays of commands and navdata, s.

    `received` lists every datagram with the time at which it was sent, its commands, and the time
    at which the drone had last begun to land.
    """

    def __init__(self, uplink=0.0, late=0.0, tick=0.02, options=()):
        self.uplink, self.late, self.tick, self.options = uplink, late, tick, options
        self.phase, self.since, self.came_down = "landed", 0.0, -1.0
        self.emergency, self.acknowledged, self.fault = False, False, 0
        self.toggles, self.received, self.clients = [], [], {}
        self.settings = {
            "general:navdata_demo": "TRUE",
            "control:control_vz_max": "700",
            "control:altitude_max": "3000",
        }
        self.last, self.ref, self.gaz, self.heard = 0, Ref(), 0.0, None
        self.sequence, self.peer = 0, None
        self.coming, self.leaving, self.backlog = deque(), deque(), deque()
        self.held, self.readers = False, []

    # Sockets.

    async def __aenter__(self):
        loop = asyncio.get_running_loop()
        self.time = self.began = loop.time()
        ports = []
        for name, receive in (
            ("navdata", self._receive_wake_up),
            ("commands", self.receive_commands),
        ):
            protocol = _Datagrams(receive)
            transport, _ = await loop.create_datagram_endpoint(
                lambda protocol=protocol: protocol, local_addr=("127.0.0.1", 0)
            )
            setattr(self, name, transport)
            ports.append(transport.get_extra_info("sockname")[1])
        server = await loop.create_server(self._control_connection, "127.0.0.1", 0)
        self.server = server
        ports.append(server.sockets[0].getsockname()[1])
        self.ports = dict(zip(("navdata_port", "command_port", "control_port"), ports, strict=True))
        self.timer = loop.call_later(self.tick, self._advance_regularly)
        return self

    async def __aexit__(self, *reason):
        self.timer.cancel()
        self.server.close()
        for transport in (self.navdata, self.commands):
            transport.close()

    def _advance_regularly(self):
        loop = asyncio.get_running_loop()
        self.advance(loop.time())
        self.timer = loop.call_later(self.tick, self._advance_regularly)

    def _control_connection(self):
        return _Connections(self.readers)

    def _receive_wake_up(self, data, address):
        self.peer = address

    def receive_commands(self, data, address):
        now = asyncio.get_running_loop().time()
        self.advance(now)
        self.received.append((now, [command for _, command in decode(data)], self.came_down))
        self.coming.append((now + self.uplink, data))
        self.advance(now)

    def _deliver(self, packet):
        """Send to the socket of the client, which may not read it at the moment."""
        if not self.held and not self.backlog:
            self.navdata.sendto(packet, self.peer)
        elif len(self.backlog) < SOCKET_BUFFER:
            self.backlog.append(packet)

    def pause_client(self, duration):
        """Pause the client's program for this virtual time; the drone continues."""
        loop = asyncio.get_running_loop()
        end, self.held = loop.time() + duration, True
        while loop.time() < end:
            loop._jump.time = min(loop.time() + self.tick, end)
            self.advance(loop.time())
        self.held = False

        def read():  # one buffered datagram in each iteration of the client's event loop
            if self.backlog:
                self.navdata.sendto(self.backlog.popleft(), self.peer)
                loop.call_soon(read)

        loop.call_soon(read)

    # The drone.

    def _enter(self, phase, time):
        if phase == "landing":
            self.came_down = time
        self.phase, self.since = phase, time

    def advance(self, now):
        """Process all events up to now, each at its time."""
        while True:
            tick = self.time + self.tick
            arrival = self.coming[0][0] if self.coming else now + 1.0
            if min(tick, arrival) > now + 1e-9:
                break
            if arrival <= tick:
                self._receive(*self.coming.popleft())
            else:
                self.time = tick
                self._step(tick)
        while self.leaving and self.leaving[0][0] <= now + 1e-9:
            self._deliver(self.leaving.popleft()[1])

    def _step(self, time):
        if self.heard is not None and time - self.heard > WATCHDOG:
            self.heard, self.last, self.gaz = None, 0, 0.0
            if self.phase in ("rising", "flying"):
                self._enter("landing", time)
        lasts = {"rising": RISE_TIME, "landing": LANDING_TIME}.get(self.phase)
        if lasts is not None and time - self.since >= lasts:
            self._enter("flying" if self.phase == "rising" else "landed", time)
        if self.peer is not None:
            self.sequence += 1
            self.leaving.append((time + self.late, build_navdata(self._state_message(time))))

    def _state_message(self, time):
        state = self.fault | (State.FLYING if self.phase != "landed" else 0)
        late = self.heard is None or time - self.heard > WARNING_TIME
        for flag, holds in (
            (State.COMMAND_ACKNOWLEDGED, self.acknowledged),
            (State.COMMUNICATION_LOST, self.heard is None and self.last == 0 and self.sequence > 9),
            (State.COM_WATCHDOG, late),
            (State.EMERGENCY, self.emergency),
        ):
            state |= flag if holds else 0
        demo = Demo(
            major=MAJOR[self.phase], battery=80, height=0.0 if self.phase == "landed" else 1.0
        )
        full = {"clock": time - self.began, "video_stream": VideoStream(atcmd_ref_seq=self.number)}
        return Navdata(state, self.sequence, demo=demo, **({} if "short" in self.options else full))

    number = 0

    def _receive(self, time, datagram):
        for number, command in decode(datagram):
            if number != 1 and number <= self.last:
                continue
            self.last, self.heard = number, time
            if isinstance(command, Ref):
                self.number = number
                self._apply_ref(command, time)
            elif isinstance(command, Move):
                self.gaz = float(command.gaz) if command.flag else 0.0
            elif isinstance(command, Config):
                self.settings[command.key], self.acknowledged = command.value, True
            elif isinstance(command, Control) and command.mode == 5:
                self.acknowledged = False
            elif isinstance(command, Control):
                for reader in self.readers:
                    reader.write(write_configuration(self.settings))

    def _apply_ref(self, ref, time):
        before, self.ref = self.ref, ref
        if ref.emergency and not before.emergency:
            self.emergency = not self.emergency
            self.toggles.append((time, self.emergency))
            if self.emergency:
                self._enter("landed", time)
        if ref.take_off and not self.emergency and self.phase in ("landed", "landing"):
            self._enter("rising", time)
        elif not ref.take_off and self.phase in ("rising", "flying"):
            self._enter("landing", time)


@asynccontextmanager
async def connected_drone(limits=Limits(max_climb=1.0), **how):  # noqa: B008
    """The drone and a client that is connected to it."""
    async with (
        WorstCaseDrone(**how) as drone,
        ARDrone2("127.0.0.1", limits, **drone.ports) as client,
    ):
        # Datagrams reach the drone when they are sent, even if the program pauses afterwards.
        client._link._commands.sendto = lambda data: drone.receive_commands(data, None)
        yield drone, client
