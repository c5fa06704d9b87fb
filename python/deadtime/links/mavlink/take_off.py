"""The take-off of a vehicle, step by step, each confirmed by what the vehicle reports."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from contextlib import suppress

from deadtime._base.errors import LinkError
from deadtime.links.clock import now
from deadtime.links.mavlink.authority import Authority
from deadtime.links.mavlink.autopilots import Autopilot
from deadtime.links.mavlink.belief import AGREEING
from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.connection import Connection
from deadtime.links.mavlink.set_points import SetPoints
from deadtime.links.mavlink.states import StateReader, wanted_messages

#: Longest wait for a position estimate after power-up, and for the vehicle to agree to arm, s.
READY, ARMING = 120.0, 30.0

#: Time in which an accepted command shows in a heartbeat, s.
SHOWN = 1.0

#: Distance to the height of a take-off, m, and climb, m/s, at which it is complete.
NEAR, SLOW = 0.15, 0.1

#: Age of a streamed message beyond which it is asked for again, s.
MISSING = 1.5


async def ask_for_messages(link: Connection, pilot: Autopilot, anew: bool = False) -> None:
    """Ask for the messages that do not come, or `anew` for all.

    A vehicle forgets them while it starts.
    """
    number = dialect().MAV_CMD_SET_MESSAGE_INTERVAL
    address = link.carriers.current.address
    baud = address.port if address.kind == "serial" else None
    for name, (message, rate) in wanted_messages(pilot.estimator, baud).items():
        seen = link.latest.get(name)
        if anew or name == "HEARTBEAT" or seen is None or now() - seen[0] > MISSING:
            await link.command(number, float(message), 1e6 / rate)


async def ask_over_all(link: Connection, pilot: Autopilot) -> None:
    """Ask on every link on which the vehicle is heard: on each comes what was asked for there."""
    current = link.carriers.current
    for carrier in link.carriers:
        if carrier is not current and carrier.heard is not None:
            # Where it falls silent, it is named.
            with link.carriers.over(carrier), suppress(LinkError):
                await ask_for_messages(link, pilot, anew=True)
    await ask_for_messages(link, pilot)


class TakeOff:
    """The steps of a take-off.

    Parameters
    ----------
    link, pilot, reader, authority
        The parts of a link to a vehicle.
    check : callable
        Raises when the flight has ended or the link is lost.
    """

    def __init__(
        self,
        link: Connection,
        pilot: Autopilot,
        reader: StateReader,
        authority: Authority,
        check: Callable[[], None],
    ) -> None:
        self._link, self._pilot, self._reader = link, pilot, reader
        self._authority, self._check = authority, check
        self._begin = now()

    def _failed(self, what: str) -> LinkError:
        return LinkError(f"{self._link.address}: the vehicle {what}{self._link.said(self._begin)}")

    async def prepare(self, min_battery: float) -> None:
        """Wait for its position estimate, and refuse a vehicle that must not take off.

        Raises
        ------
        LinkError
            With the reason.
        """
        reader = self._reader
        while not reader.ready or reader.newest is None:
            if now() - self._begin > READY:
                raise self._failed(f"has no position estimate after {READY:g} s")
            await self._link.until(lambda: reader.ready, 5.0)
            self._check()
            await ask_for_messages(self._link, self._pilot)
            await self._link.until(lambda: reader.newest is not None, 0.5)
        # Whether it is armed now, not as of a second ago.
        for _ in range(AGREEING):
            await self._link.next(lambda message: message.get_type() == "HEARTBEAT", MISSING)
        if (reason := self._authority.disarmed or self._authority.lost) is not None:
            raise LinkError(reason)
        self._check()
        self._authority.refuse_armed(reader)
        state = reader.newest
        if state.emergency:
            raise self._failed("reports an emergency")
        if state.fault is not None:
            raise self._failed(f"reports that {state.fault}")
        if not state.landed:
            raise self._failed("is not on the ground")
        if state.battery is not None and state.battery < min_battery:
            raise self._failed(
                f"has {state.battery:g} % of battery, but {min_battery:g} % are needed"
            )

    async def fly(
        self,
        height: float,
        set_points: SetPoints,
        wait_up: Callable[[Callable[[], bool]], Awaitable[None]],
    ) -> None:
        """Arm and take off; `wait_up` waits until it holds its height.

        Raises
        ------
        LinkError
            If a step is refused or takes too long.
        """
        pilot, link, d = self._pilot, self._link, dialect()
        self._begin = now()
        await self._set_mode(pilot.arming)
        self._authority.fly(*pilot.rising)
        await self._arm()
        position = link.latest.get("GLOBAL_POSITION_INT", (0.0, None))[1]
        result = await link.command(d.MAV_CMD_NAV_TAKEOFF, *pilot.take_off(height, position))
        if result != d.MAV_RESULT_ACCEPTED:
            raise self._failed("refuses to take off")
        await wait_up(lambda: self._is_up(height))
        set_points.begin(now())
        if pilot.arming != pilot.guided:
            for _ in range(4):  # PX4 wants set points before it follows them
                await asyncio.sleep(0.25 * SHOWN)
                set_points.hover(now())
            self._check()
            self._authority.fly(*pilot.rising, pilot.guided)
            await self._set_mode(pilot.guided)
            set_points.hover(now())
        self._authority.fly(pilot.guided)

    async def _set_mode(self, custom: int) -> None:
        for _ in range(3):
            await self._link.command(dialect().MAV_CMD_DO_SET_MODE, *self._pilot.mode(custom))
            if await self._link.until(lambda: self._reader.mode == custom, SHOWN):
                return
        raise self._failed(f"does not change to the mode {self._pilot.mode_name(custom)}")

    async def _arm(self) -> None:
        """Arm, once the vehicle agrees: some of its checks pass only a while after power-up."""
        begin, d = now(), dialect()
        self._authority.arming = True
        try:
            while True:
                # Ours as well where the answer is lost: then it is commanded to land.
                self._authority.armed_at = now()
                result = await self._link.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
                if result != d.MAV_RESULT_ACCEPTED:
                    self._authority.armed_at = math.inf
                if await self._link.until(lambda: bool(self._reader.armed), SHOWN):
                    break
                if now() - begin > ARMING:
                    raise self._failed("does not arm its motors")
        finally:
            self._authority.arming = False
        if not self._authority.armed_here:
            # By this command, whose answer was wrong, or by somebody else at the same time. In the
            # air no vehicle obeys this.
            with suppress(LinkError):
                await self._link.command(d.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
        self._authority.refuse_armed(self._reader)

    def _is_up(self, height: float) -> bool:
        state = self._reader.newest
        return (
            state is not None
            and state.flying
            and abs(state.height - height) < NEAR
            and abs(state.climb or 0.0) < SLOW
        )
