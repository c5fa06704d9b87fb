"""A client and an emulator of the AR.Drone 2.0 in one event loop."""

from contextlib import asynccontextmanager

import pytest
from deadtime.links import Limits
from deadtime.links.ardrone2 import ARDrone2
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions

LIMITS = Limits(max_climb=1.0)


def skip_if_too_busy(said):
    """Skip if a flight in real time was ended because this machine was too slow."""
    said = str(said)
    if any(word in said for word in ("messages in a row", "s old, but at most", "no command for")):
        pytest.skip(f"this machine was too busy for real time: {said}")


def emulator(**options):
    """An emulator on free ports."""
    return Emulator(
        EmulatorOptions(**{"navdata_port": 0, "command_port": 0, "control_port": 0} | options)
    )


def client_of(emulated, limits=LIMITS, **options):
    """A client that is not connected yet."""
    return ARDrone2(
        emulated.host,
        limits,
        navdata_port=emulated.navdata_port,
        command_port=emulated.command_port,
        control_port=emulated.control_port,
        **options,
    )


@asynccontextmanager
async def connected(limits=LIMITS, full=True, **options):
    """The emulator and a client that is connected to it."""
    async with emulator(**options) as emulated, client_of(emulated, limits, full=full) as drone:
        yield emulated, drone


def connecting(limits=LIMITS, full=True, **options):
    """The argument of the experiment: a context manager that gives a connected vehicle."""

    @asynccontextmanager
    async def connect():
        async with connected(limits, full, **options) as (_, drone):
            yield drone

    return connect
