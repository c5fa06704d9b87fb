"""Limits in the drone: set and read back before a flight, and restored after it."""

from __future__ import annotations

import asyncio
import math
from contextlib import suppress

from deadtime._base.errors import LinkError
from deadtime.links.ardrone2.connection import LOST, Connection
from deadtime.links.ardrone2.handshake import Handshake, check_configuration
from deadtime.links.ardrone2.reader import on_ground
from deadtime.links.safety import Limits

#: Ranges of the drone for its largest vertical speed, mm/s, and its largest height, mm.
VZ_MAX, ALTITUDE_MAX = (200, 2000), (500, 5000)

#: Longest time for restoring the settings, s.
PUTTING_BACK = 3.0


class LimitSettings:
    """Largest climb and height of one drone.

    Parameters
    ----------
    host : str
        The drone, for messages.

    Attributes
    ----------
    vz_max : float or None
        Vertical speed for a command of 1, as read back, m/s.
    """

    def __init__(self, host: str) -> None:
        self._host = host
        self._before: dict[str, str] = {}
        self.vz_max: float | None = None

    async def set(self, link: Connection, control_port: int, limits: Limits, full: bool) -> None:
        """Set the limits and the kind of navdata, and read them back.

        Raises
        ------
        LinkError
            If the drone does not keep a setting.
        """
        host = self._host
        handshake = Handshake(host, link.send, link.until)
        demo = {"general:navdata_demo": "FALSE" if full else "TRUE"}
        await handshake.set(*next(iter(demo.items())))
        before = await handshake.read_back(host, control_port)
        climb = math.ceil(1e3 * limits.max_climb - 1e-6)
        height = round(1e3 * limits.max_height)
        requested = {
            "control:control_vz_max": str(min(max(climb, VZ_MAX[0]), VZ_MAX[1])),
            "control:altitude_max": str(min(max(height, ALTITUDE_MAX[0]), ALTITUDE_MAX[1])),
        }
        for key, value in requested.items():
            if before.get(key, value) != value:
                self._before[key] = before[key]
            await handshake.set(key, value)
        held = await handshake.read_back(host, control_port)
        check_configuration(host, held, demo | requested)
        self.vz_max = 1e-3 * float(held["control:control_vz_max"])

    async def put_back(self, link: Connection) -> str | None:
        """Restore the changed settings if the drone is down; warn of those that could not be."""
        before, self._before = self._before, {}
        navdata = link.reader.navdata
        handshake = Handshake(self._host, link.send, link.until)
        with suppress(LinkError, TimeoutError):
            async with asyncio.timeout(PUTTING_BACK):
                while before and link.silent < LOST and navdata is not None and on_ground(navdata):
                    key = next(iter(before))
                    await handshake.set(key, before[key])
                    del before[key]
        if not before:
            return None
        kept = ", ".join(f"{key} = {value}" for key, value in before.items())
        return f"these settings could not be restored in {self._host}: {kept}"
