"""The emulated drone without sockets: datagrams and times as input, navdata as output.

All events have times of the clock of the drone and one order, so that the output depends only on
the datagrams, their times, the options and the seed, and not on when the drone is advanced.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deadtime._base.validation import non_negative
from deadtime.links.addresses import Address
from deadtime.links.ardrone2.commands import (
    Command,
    Config,
    ConfigIds,
    Control,
    Move,
    MoveFrom,
    Ref,
    decode,
)
from deadtime.links.ardrone2.configuration import write_configuration
from deadtime.links.ardrone2.emulator.clock import SECOND, Micros, micros, seconds
from deadtime.links.ardrone2.emulator.flight import HOVER, TICK, Flight, Phase, Setpoints
from deadtime.links.ardrone2.emulator.link import Listener, Order
from deadtime.links.ardrone2.emulator.options import EmulatorOptions
from deadtime.links.ardrone2.emulator.sensors import Reading, Sensors
from deadtime.links.ardrone2.emulator.settings import IDS, Settings

#: Time after the last motion command at which a drone hovers, except in the worst case.
HOVER_AFTER: Micros = SECOND // 4

#: Rate of short navdata, 1/s; full navdata are sent at every tick.
DEMO_RATE = 15

#: Upper limit on the motion commands in transit (bounds memory).
MOST_IN_TRANSIT = 1024

#: Upper limit on the navdata that wait to be sent (bounds memory).
MOST_WAITING = 4096

SEND_CONFIGURATION, ACKNOWLEDGE, SEND_IDS = 4, 5, 6

NEVER: Micros = 1 << 62


@dataclass(frozen=True)
class Truth:
    """The true state of the emulated drone, without noise.

    Attributes
    ----------
    time : float
        Clock of the drone, s.
    phase : Phase
    height : float
        m.
    climb : float
        m/s, up positive.
    setpoint : float
        Commanded climb, m/s.
    battery : float
        Percent.
    emergency, link_lost, connected : bool
        Whether the motors are stopped by the emergency switch, whether no command has been received
        for two seconds, and whether there is a receiver of navdata.
    """

    time: float
    phase: Phase
    height: float
    climb: float
    setpoint: float
    battery: float
    emergency: bool
    link_lost: bool
    connected: bool


class Drone:
    r"""An emulated AR.Drone 2.0.

    Parameters
    ----------
    options : EmulatorOptions
    start : float
        Time at which it is switched on, s, on the clock of all times passed to it.

    Attributes
    ----------
    settings : Settings
        Its configuration.
    no_echo : bool
        Set it to make the drone report that its ultrasound receives no echo.

    Examples
    --------
    >>> drone = Drone(EmulatorOptions(noise=0.0))
    >>> here = ("127.0.0.1", 5556)
    >>> for tick in range(250):                           # hold take-off for five seconds
    ...     drone.commanded(b"AT*REF=%d,512\r" % (tick + 1), here, now=0.02 * tick)
    >>> drone.truth(5.0).phase, round(drone.truth(5.0).height, 2)
    (<Phase.FLYING: 'flying'>, 0.75)
    >>> drone.truth(12.0).phase                           # seven seconds without commands
    <Phase.LANDED: 'landed'>
    """

    def __init__(self, options: EmulatorOptions, start: float = 0.0) -> None:
        self.options = options
        self.settings = Settings()
        self.no_echo = False
        self._start = start
        self._time: Micros = 0
        self._flight = Flight(options, self.settings)
        self._sensors = Sensors(options)
        self._order, self._listener = Order(), Listener()
        self._jitter = np.random.default_rng((options.seed, 1))
        self._in_transit: deque[tuple[Micros, Setpoints]] = deque()
        self._delay = options.transport_delay
        self._last_arrival: Micros = 0
        self._moved_at: Micros | None = None
        self._bootstrap, self._to_acknowledge = True, False
        self._sequence = 0
        self._ref, self._ref_number, self._take_off_requested = Ref(), 0, False
        self._ids: ConfigIds | None = None
        self._ticked: Micros = 0
        self._sent: Micros = 0
        self._packets: deque[tuple[Micros, bytes, Address]] = deque(maxlen=MOST_WAITING)
        self._dumps: list[tuple[str, bytes]] = []

    # Input.

    def commanded(self, datagram: bytes, source: Address, now: float) -> None:
        """Process a datagram of the command port."""
        time = self._advance_to(now)
        for number, command in decode(datagram):
            begins = self._order.begins(number)
            if not self._order.accept(number, time):
                continue
            if begins:  # discard the requests of an earlier client
                self._ref = Ref()
            if self._listener.commanded(source, time):
                self._sequence = 0
            self._execute(number, command, source, time)

    def woken(self, datagram: bytes, source: Address, now: float) -> None:
        """Process a datagram of the navdata port."""
        time = self._advance_to(now)
        if self._listener.wake(datagram, source, time):
            self._sequence, self._sent = 0, time
        if self._bootstrap and self._listener.may_answer(source, time):
            self._send(time)

    # Output.

    def advance(self, now: float) -> None:
        """Process all events until now."""
        self._advance_to(now)

    def due(self) -> float:
        """Time of the next event without further input, s; infinite if there is none."""
        event = min(self._next_event()[0], self._packets[0][0] if self._packets else NEVER)
        return math.inf if event == NEVER else self._start + seconds(event)

    def packets(self, now: float, oldest: float = math.inf) -> list[tuple[bytes, Address]]:
        """Take the navdata to be sent by now, with their receivers.

        Those due more than `oldest` seconds ago are dropped, except for the newest.
        """
        time, left = self._micros(now), []
        while self._packets and self._packets[0][0] <= time:
            leaves, packet, address = self._packets.popleft()
            newest = not self._packets or self._packets[0][0] > time
            if newest or seconds(time - leaves) <= oldest:
                left.append((packet, address))
        return left

    def dumps(self) -> list[tuple[str, bytes]]:
        """Take the requested configurations, with the hosts that requested them."""
        dumps, self._dumps = self._dumps, []
        return dumps

    def truth(self, now: float) -> Truth:
        """The true state of the drone now."""
        time = self._advance_to(now)
        pose = self._flight.airframe.at(time)
        return Truth(
            seconds(time),
            self._flight.phase,
            pose.height,
            pose.climb,
            pose.setpoint,
            self._flight.charge(time),
            self._flight.emergency,
            self._order.lost,
            self._listener.address is not None,
        )

    # Commands.

    def _execute(self, number: int, command: Command, source: Address, time: Micros) -> None:
        ids, self._ids = self._ids, None
        if isinstance(command, Ref):
            self._process_ref(number, command, time)
        elif isinstance(command, (Move, MoveFrom)):
            self._move(command, time)
        elif isinstance(command, ConfigIds):
            self._ids = command
        elif isinstance(command, Config):
            self._configure(command, ids)
        elif isinstance(command, Control):
            self._control(command.mode, source)

    def _process_ref(self, number: int, ref: Ref, time: Micros) -> None:
        """Process a REF command: take-off, landing and the emergency switch.

        In the worst case, a drone that has landed by itself takes off again if the earlier request
        is repeated. Otherwise it needs a new request.
        """
        before, self._ref, self._ref_number = self._ref, ref, number
        flight = self._flight
        if ref.emergency and not before.emergency:
            flight.toggle_emergency(time)
        if not ref.take_off:
            flight.land(time)
        if not ref.take_off or flight.phase in (Phase.TAKING_OFF, Phase.FLYING):
            self._take_off_requested = False
        elif self.options.worst_case or not before.take_off:
            self._take_off_requested = True
        if self._take_off_requested and not flight.airborne:
            flight.take_off(time)
            if flight.airborne:
                self._take_off_requested, self._ticked = False, time

    def set_delay(self, delay: float) -> None:
        """Change the transport delay of further motion commands, s; their order stays."""
        self._delay = non_negative("delay", delay)

    def _move(self, command: Move | MoveFrom, time: Micros) -> None:
        self._moved_at = time
        late = self._delay + self.options.jitter * self._jitter.random()
        self._last_arrival = max(self._last_arrival, time + micros(late))
        if len(self._in_transit) < MOST_IN_TRANSIT:
            self._in_transit.append((self._last_arrival, self._setpoints_of(command)))

    def _setpoints_of(self, command: Move | MoveFrom) -> Setpoints:
        """Setpoints of a motion command in SI units, scaled by the configured limits."""
        if not command.flag & 1:
            return HOVER
        limits = self.settings
        return (
            # Treat -0.0 as 0.0.
            0.0 + float(command.gaz) * limits.climb_limit,
            0.0 + float(command.roll) * limits.angle_limit,
            0.0 + float(command.pitch) * limits.angle_limit,
            0.0 + float(command.yaw) * limits.turn_limit,
        )

    def _configure(self, command: Config, ids: ConfigIds | None) -> None:
        """Process a CONFIG command, and acknowledge it in navdata."""
        settings = self.settings
        given = None if ids is None else (ids.session, ids.user, ids.application)
        entering = command.key.startswith("custom:")
        if settings.asks_for_ids and not entering and given != settings.ids:
            return
        if not settings.set(command.key, command.value):
            return
        self._to_acknowledge = True
        if command.key == "general:navdata_demo":
            self._bootstrap = False

    def _control(self, mode: int, source: Address) -> None:
        if mode == ACKNOWLEDGE:
            self._to_acknowledge = False
        elif mode in (SEND_CONFIGURATION, SEND_IDS):
            values = self.settings.values
            shown = values if mode == SEND_CONFIGURATION else {key: values[key] for key in IDS}
            # At most one answer to a host is pending, however many requests it sends.
            if all(host != source[0] for host, _ in self._dumps):
                self._dumps.append((source[0], write_configuration(shown)))

    # Events.

    def _micros(self, now: float) -> Micros:
        return micros(now - self._start)

    def _advance_to(self, now: float) -> Micros:
        """Process the due events in the order of their times; return the new time.

        The clock never goes back.
        """
        until = max(self._time, self._micros(now))
        while True:
            time, handle = self._next_event()
            if time > until:
                break
            self._time = max(self._time, time)
            handle(self._time)
        self._time = until
        return until

    def _next_event(self) -> tuple[Micros, Callable[[Micros], None]]:
        """Time and handler of the next event; of simultaneous ones, the first in this list."""
        events = (
            (self._in_transit[0][0] if self._in_transit else None, self._arrive),
            (self._hovers_at, self._hover),
            (self._order.loses_at, self._lose_link),
            (self._listener.leaves_at, self._listener_leaves),
            (_after(self._ticked) if self._flight.airborne else None, self._tick),
            (self._next_navdata(), self._stream),
        )
        return min(
            ((NEVER if time is None else time, handle) for time, handle in events),
            key=lambda event: event[0],
        )

    @property
    def _hovers_at(self) -> Micros | None:
        """Time at which the last motion command expires; None in the worst case."""
        flying = self._flight.phase is Phase.FLYING
        moving = bool(self._in_transit) or (flying and not self._flight.hovering)
        if self.options.worst_case or self._moved_at is None or not moving:
            return None
        return self._moved_at + HOVER_AFTER

    def _arrive(self, time: Micros) -> None:
        _, setpoint = self._in_transit.popleft()
        self._flight.follow(time, setpoint)

    def _hover(self, time: Micros) -> None:
        """Drop the expired motion command and those in transit."""
        self._in_transit.clear()
        self._flight.follow(time, HOVER)

    def _lose_link(self, time: Micros) -> None:
        self._order.lose()
        self._in_transit.clear()
        self._take_off_requested = self._to_acknowledge = False
        self._listener.commander_left()
        self._bootstrap = True
        self._flight.land(time)

    def _listener_leaves(self, time: Micros) -> None:
        self._listener.leave(time)
        self._bootstrap, self._sequence = True, 0

    def _tick(self, time: Micros) -> None:
        self._ticked = time
        self._flight.tick(time)
        self._sensors.tick(time, *self._flight.airframe.vertical_at(time))

    def _next_navdata(self) -> Micros | None:
        if self._bootstrap or self._listener.address is None:
            return None
        if not self.settings.demo:
            return _after(self._sent)
        count = self._sent * DEMO_RATE // SECOND + 1
        if count * SECOND // DEMO_RATE <= self._sent:
            count += 1
        return count * SECOND // DEMO_RATE

    def _stream(self, time: Micros) -> None:
        self._sent = time
        self._send(time)

    def _send(self, time: Micros) -> None:
        address = self._listener.address
        if address is None:
            return
        self._sequence += 1
        flight, settings = self._flight, self.settings
        reading = Reading(
            time=time,
            sequence=self._sequence,
            pose=flight.airframe.at(time),
            phase=flight.phase,
            lifted=flight.lifted(time),
            hovering=flight.hovering,
            emergency=flight.emergency,
            charge=flight.charge(time),
            ref=self._ref,
            ref_number=self._ref_number,
            to_acknowledge=self._to_acknowledge,
            link_late=self._order.late(time),
            link_lost=self._order.lost,
            bootstrap=self._bootstrap,
            options=settings.options if settings.demo else None,
            no_echo=self.no_echo,
        )
        leaves = time + micros(self.options.downlink)
        self._packets.append((leaves, self._sensors.packet(reading), address))


def _after(time: Micros) -> Micros:
    """The first tick after a time."""
    return (time // TICK + 1) * TICK
