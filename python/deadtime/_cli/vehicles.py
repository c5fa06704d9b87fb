"""The vehicles that ``deadtime fly`` flies, in real or virtual time."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from statistics import median

from deadtime._cli.landing import run_landing, terminated_like_interrupted
from deadtime._cli.own_emulator import own_emulator
from deadtime.flights import Connect, Flown, MovingDelay
from deadtime.links import Limits, Vehicle, run as run_virtual
from deadtime.links.ardrone2 import ARDrone2
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions
from deadtime.links.ardrone2.emulator.motion import PlantName
from deadtime.links.mavlink import LinkTime, MAVLinkVehicle

#: UDP ports of navdata and commands, TCP port of the control connection.
Ports = tuple[int, int, int]

#: Difference between the noise seeds of successive links. It is large, so that runs with different
#: values of --seed share none.
SEED_STEP = 1_000_003


@dataclass(frozen=True)
class FlownVehicle:
    """A vehicle: how to connect to it, its name, what runs it, and what its link has measured."""

    connect: Connect
    name: str
    run: Callable[..., Flown]
    link_times: list[LinkTime] = field(default_factory=list)

    def round_trip(self) -> float | None:
        """Median round trip of the link while it was open, s, where the vehicle tells."""
        return median(one.median for one in self.link_times) if self.link_times else None


@contextmanager
def flown_vehicle(
    host: str | None,
    link: str | None,
    plant: PlantName,
    seed: int,
    virtual_time: bool,
    height: float,
    limits: Limits,
    ports: Ports,
    consent: bool = False,
    moving: MovingDelay | None = None,
) -> Iterator[FlownVehicle]:
    name = f"an emulated AR.Drone 2.0 ({plant})"
    if virtual_time:
        yield FlownVehicle(emulated_drone(plant, seed, limits, moving), name, run_virtual)
    elif link is not None:
        with terminated_like_interrupted():
            times: list[LinkTime] = []
            connect = over_mavlink(link, height, limits, times, simulated=not consent)
            yield FlownVehicle(connect, f"the vehicle at {link}", run_landing, times)
    elif host is not None:
        with terminated_like_interrupted():
            yield FlownVehicle(lambda: _client(host, limits, ports), host, run_landing)
    else:
        with terminated_like_interrupted(), own_emulator(plant, seed) as own:
            here = EmulatorOptions().host
            yield FlownVehicle(lambda: _client(here, limits, own), name, run_landing)


def over_mavlink(
    link: str, height: float, limits: Limits, times: list[LinkTime], simulated: bool = False
) -> Connect:
    """Connect to a vehicle, or to a `simulated` one only.

    What TIMESYNC says at the end of each connection goes to `times`.
    """

    @asynccontextmanager
    async def connect() -> AsyncIterator[Vehicle]:
        async with MAVLinkVehicle(
            link, limits, take_off_height=height, simulated=simulated
        ) as vehicle:
            yield vehicle
            if vehicle.link_time is not None:
                times.append(vehicle.link_time)

    return connect


def _client(host: str, limits: Limits, ports: Ports) -> ARDrone2:
    navdata, command, control = ports
    return ARDrone2(host, limits, navdata_port=navdata, command_port=command, control_port=control)


def emulated_drone(
    plant: PlantName, seed: int, limits: Limits, moving: MovingDelay | None = None
) -> Connect:
    """Connect to an emulator in the same event loop; each link has a different noise seed.

    Its transport delay is that of the plant, or one that moves.
    """
    seeds = itertools.count(seed, SEED_STEP)

    @asynccontextmanager
    async def connect() -> AsyncIterator[Vehicle]:
        options = EmulatorOptions(
            plant=plant, seed=next(seeds), navdata_port=0, command_port=0, control_port=0
        )
        async with Emulator(options) as emulator:
            ports = (emulator.navdata_port, emulator.command_port, emulator.control_port)
            moves = (
                None
                if moving is None
                else asyncio.create_task(moving.drive(emulator.drone.set_delay))
            )
            try:
                async with _client(emulator.host, limits, ports) as drone:
                    yield drone
            finally:
                if moves is not None:
                    moves.cancel()

    return connect
