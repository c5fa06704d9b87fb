"""Vehicles of an experiment: how each is connected to, its name, and what runs its flights."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from deadtime.flights._fly import Connect
from deadtime.flights._moving_delay import MovingDelay
from deadtime.flights._plan import FlightPlan
from deadtime.links.ardrone2 import ARDrone2
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions
from deadtime.links.ardrone2.emulator.motion import PlantName
from deadtime.links.landing import run_landing
from deadtime.links.mavlink import LinkTime, MAVLinkVehicle
from deadtime.links.safety import Limits
from deadtime.links.vehicle import Vehicle
from deadtime.links.virtual_time import run as run_virtual

#: Difference between the noise seeds of successive links. It is large, so that runs with different
#: seeds share none.
SEED_STEP = 1_000_003


@dataclass(frozen=True)
class FlownVehicle:
    """A vehicle that experiments are flown with.

    Attributes
    ----------
    connect : callable
        Returns an asynchronous context manager whose value is a connected vehicle, and that lands
        it on exit.
    name : str
        The vehicle in words.
    run : callable
        Runs a coroutine to its end: `deadtime.links.run_landing`, which lands on a signal, or
        `deadtime.links.run` in virtual time.
    moving : MovingDelay or None
        The delay of its commands, where that moves in flights with gains that follow it.
    link_times : list of LinkTime
        What TIMESYNC measured on each link over MAVLink, added when the link is closed.

    Examples
    --------
    >>> from deadtime.flights import FlownVehicle
    >>> FlownVehicle.emulated("paper").name
    'an emulated AR.Drone 2.0 (paper)'
    """

    connect: Connect
    name: str = "the vehicle"
    run: Callable[..., Any] = run_landing
    moving: MovingDelay | None = None
    link_times: list[LinkTime] = field(default_factory=list)

    def round_trip(self) -> float | None:
        """Median round trip of the links while they were open, s; None where it is not measured."""
        return median(time.median for time in self.link_times) if self.link_times else None

    @classmethod
    def emulated(
        cls,
        plant: PlantName = EmulatorOptions.plant,
        seed: int = EmulatorOptions.seed,
        limits: Limits | None = None,
        moving: MovingDelay | None = None,
    ) -> FlownVehicle:
        """An emulated AR.Drone 2.0 in the event loop of its client, in virtual time.

        Parameters
        ----------
        plant : {"kit", "paper", "real", "thrust"}
            How height answers the commanded climb.
        seed : int
            Of the noise, which is another one on each link.
        limits : Limits, optional
            By default those of a `FlightPlan`.
        moving : MovingDelay, optional
            The delay of motion commands; by default that of the plant.
        """
        flown = FlightPlan().limits if limits is None else limits
        seeds = itertools.count(seed, SEED_STEP)

        @asynccontextmanager
        async def connect() -> AsyncIterator[Vehicle]:
            options = EmulatorOptions(
                plant=plant, seed=next(seeds), navdata_port=0, command_port=0, control_port=0
            )
            async with Emulator(options) as emulator:
                names = ("navdata_port", "command_port", "control_port")
                ports = {name: getattr(emulator, name) for name in names}
                moves = [moving.drive(emulator.drone.set_delay)] if moving is not None else []
                tasks = [asyncio.create_task(move) for move in moves]
                try:
                    async with ARDrone2(emulator.host, flown, **ports) as drone:
                        yield drone
                finally:
                    for task in tasks:
                        task.cancel()

        return cls(connect, f"an emulated AR.Drone 2.0 ({plant})", run_virtual, moving)

    @classmethod
    def ardrone2(cls, host: str, limits: Limits, **ports: Any) -> FlownVehicle:
        """An AR.Drone 2.0 at an address.

        Parameters
        ----------
        host : str
            Its address.
        limits : Limits
            Also set in the drone.
        **ports : int
            ``navdata_port``, ``command_port`` and ``control_port``, where they are others.
        """
        return cls(lambda: ARDrone2(host, limits, **ports), host, run_landing)

    @classmethod
    def over_mavlink(
        cls,
        link: str,
        limits: Limits,
        take_off_height: float = 1.0,
        simulated: bool = False,
        key: bytes | None = None,
        folder: Path | None = None,
    ) -> FlownVehicle:
        """A vehicle with ArduPilot or PX4.

        Parameters
        ----------
        link : str
            Its address, such as ``udp:127.0.0.1:14550``, or several with commas between them.
        limits : Limits
            Also set in the vehicle, where it has such settings.
        take_off_height : float
            Height that it takes off to, m.
        simulated : bool
            Whether anything but a simulator is refused.
        key : bytes, optional
            Signing key, 32 bytes.
        folder : Path, optional
            Where the old values of parameters are kept while they are changed.
        """
        times: list[LinkTime] = []

        @asynccontextmanager
        async def connect() -> AsyncIterator[Vehicle]:
            async with MAVLinkVehicle(
                link,
                limits,
                take_off_height=take_off_height,
                simulated=simulated,
                key=key,
                folder=folder,
            ) as vehicle:
                yield vehicle
                if vehicle.link_time is not None:
                    times.append(vehicle.link_time)

        return cls(connect, f"the vehicle at {link}", run_landing, link_times=times)
