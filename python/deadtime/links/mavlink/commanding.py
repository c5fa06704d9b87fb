"""What a vehicle over MAVLink is commanded in the air: velocities, positions, attitudes, rates."""

from __future__ import annotations

from typing import get_args

from deadtime._base.errors import FlightAbortedError, LinkError
from deadtime.links.clock import now
from deadtime.links.mavlink.authority import Authority
from deadtime.links.mavlink.autopilots import Autopilot
from deadtime.links.mavlink.connection import Connection
from deadtime.links.mavlink.parameters import Parameters
from deadtime.links.mavlink.points import (
    Attitude,
    BodyRates,
    Kind,
    Place,
    Point,
    attitude_within,
    place_within,
    rates_within,
)
from deadtime.links.mavlink.set_points import SetPoints, within
from deadtime.links.mavlink.states import StateReader
from deadtime.links.mavlink.take_off import SHOWN
from deadtime.links.vehicle import Motion, VehicleState
from deadtime.links.vehicle_link import VehicleLink

#: Silence after which the link counts as lost in flight, s.
LOST = 1.0


class Commanding(VehicleLink):
    """The commands of a vehicle in the air; `MAVLinkVehicle` connects, takes off and lands."""

    address: str
    _link: Connection
    _reader: StateReader
    _set_points: SetPoints
    _authority: Authority
    _autopilot: Autopilot | None
    _parameters: Parameters | None
    _allowed: set[Kind]
    _origin: VehicleState

    @property
    def _known(self) -> Autopilot:
        if self._autopilot is None:
            raise LinkError(f"{self.address} is not connected")
        return self._autopilot

    @property
    def _held(self) -> Parameters:
        if self._parameters is None:
            raise LinkError(f"{self.address} is not connected")
        return self._parameters

    def _send(self) -> None:
        """Send the set point, where set points are followed."""
        if self._set_points.guarded:
            message = self._set_points.message(self._link.target, now(), self._reader.ground)
            self._link.send(message)

    def _check_vehicle(self) -> None:
        if self._link.silent > LOST + SHOWN or (self._set_points.guarded and self._silent):
            raise LinkError(self._unheard)
        if self._set_points.guarded and self._reader.has_lost_position:
            raise FlightAbortedError(f"{self.address}: the vehicle {self._lost_position}")

    @property
    def _lost_position(self) -> str:
        said = self._link.said(self._authority.armed_at)
        return f"has lost its position estimate ({self._known.estimator}){said}"

    @property
    def _silent(self) -> bool:
        return self._link.silent > LOST

    @property
    def _unheard(self) -> str:
        return f"nothing has been received from {self.address} for {self._link.silent:.1f} s"

    def _age(self) -> None:
        super()._age()
        if self._set_points.guarded and self._silent:
            self._set_points.give_up(self._unheard)

    def command(self, climb: float) -> float:
        """Command a vertical speed; it is sent at once and repeated until it is too old.

        Parameters
        ----------
        climb : float
            m/s, up positive. Clipped to ``limits.max_climb``.

        Returns
        -------
        float
            The speed that was sent, m/s.

        Raises
        ------
        ValueError
            If `climb` is not finite.
        LinkError
            If the vehicle has not taken off, or if the flight has ended without `land`: without
            commands, without messages of the vehicle, or because its mode was changed by itself or
            by another ground station.
        """
        return self.command_velocity(up=climb).up

    def command_velocity(
        self, north: float = 0.0, east: float = 0.0, up: float = 0.0, turn: float | None = None
    ) -> Motion:
        """Command a velocity, as `command` does a vertical one.

        Parameters
        ----------
        north, east, up : float
            m/s. The horizontal speed is limited to ``limits.max_speed``, in its direction.
        turn : float, optional
            Rate of turn, rad/s, clockwise positive, clipped to ``limits.max_yaw_rate``; the heading
            is held without it.

        Returns
        -------
        Motion
            What was sent.

        Raises
        ------
        ValueError
            If a number is not finite.
        LinkError
            As `command`.
        """
        motion = within(Motion(north, east, up, turn), self.limits)
        self._follow(motion)
        return motion

    async def allow(self, kind: Kind) -> None:
        """Prepare the vehicle for set points of a further kind, beside velocities.

        Towards a position it flies no faster than `limits`; a thrust is a thrust to it, not a rate
        of climb. What is set for this is put back when the link is closed.

        Parameters
        ----------
        kind : {"position", "attitude", "rates"}
            For `command_position`, `command_attitude` or `command_rates`.

        Raises
        ------
        LinkError
            If it is not connected, or does not keep a setting.
        ValueError
            If there is no such kind.
        """
        if kind not in get_args(Kind):
            raise ValueError(
                f"{kind!r} is not a kind of set point: give one of {', '.join(get_args(Kind))}"
            )
        await self._known.allow(self._held, self.limits, kind)
        await self._held.apply()
        self._allowed.add(kind)

    def command_position(
        self, north: float, east: float, height: float, heading: float | None = None
    ) -> Place:
        """Command a position, which is valid as long as a velocity is; `allow` it first.

        Parameters
        ----------
        north, east : float
            m, in the frame of `VehicleState`; no further than ``limits.max_distance`` from where
            it took off.
        height : float
            m, within ``limits.min_height`` and ``limits.max_height``.
        heading : float, optional
            rad; the present one if not given.

        Returns
        -------
        Place
            What was sent.

        Raises
        ------
        ValueError
            If a number is not finite.
        LinkError
            As `command`, if it was not allowed, and if no heading is known.
        """
        heading = self._heading(self._ready("position"), heading)
        place = place_within(Place(north, east, height, heading), self._origin, self.limits)
        self._follow(place)
        return place

    def command_attitude(
        self, roll: float, pitch: float, thrust: float, heading: float | None = None
    ) -> Attitude:
        """Command an attitude and a thrust, which nothing but this end keeps at a height.

        Parameters
        ----------
        roll, pitch : float
            To the right and nose up, rad; together no more than ``limits.max_angle``.
        thrust : float
            Share of the largest one, within ``limits.min_thrust`` and ``limits.max_thrust``.
        heading : float, optional
            rad; the present one if not given.

        Returns
        -------
        Attitude
            What was sent.

        Raises
        ------
        ValueError
            If a number is not finite.
        LinkError
            As `command`, if it was not allowed, and if no heading is known.
        """
        heading = self._heading(self._ready("attitude"), heading)
        attitude = attitude_within(Attitude(roll, pitch, heading, thrust), self.limits)
        self._follow(attitude)
        return attitude

    def command_rates(self, roll: float, pitch: float, turn: float, thrust: float) -> BodyRates:
        """Command rates around the axes of the vehicle, and a thrust.

        Parameters
        ----------
        roll, pitch, turn : float
            rad/s: to the right, nose up, clockwise. They are limited so that the tilt stays within
            ``limits.max_angle`` while the command is valid.
        thrust : float
            As of `command_attitude`.

        Returns
        -------
        BodyRates
            What was sent.

        Raises
        ------
        ValueError
            If a number is not finite.
        LinkError
            As `command`, and if it was not allowed.
        """
        state = self._ready("rates")
        rates = rates_within(BodyRates(roll, pitch, turn, thrust), state, self.limits)
        self._follow(rates)
        return rates

    def _ready(self, kind: Kind) -> VehicleState:
        """The newest state, where set points of a kind may be commanded."""
        if kind not in self._allowed:
            raise LinkError(
                f"{self.address}: set points of kind {kind!r} are not allowed yet. First use "
                f"`await allow({kind!r})`"
            )
        self._check_in_air()
        if self._reader.newest is None:
            raise LinkError(f"{self.address}: the vehicle has not reported its state yet")
        return self._reader.newest

    def _heading(self, state: VehicleState, given: float | None) -> float:
        """The heading that was given, or else the present one."""
        heading = state.yaw if given is None else given
        if heading is None:
            raise LinkError(f"{self.address}: the vehicle reports no heading: give a heading")
        return heading

    def _follow(self, point: Point) -> None:
        """Send a set point at once, and repeat it until it is too old."""
        self._check_in_air()
        self._set_points.command(point, now())
        self._send()
