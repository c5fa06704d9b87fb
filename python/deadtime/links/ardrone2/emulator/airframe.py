"""The body of the emulated drone: height, attitude, heading and horizontal speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deadtime.links.ardrone2.emulator.clock import Micros
from deadtime.links.ardrone2.emulator.motion import (
    GRAVITY,
    LINEAR_PLANTS,
    FreeFall,
    LinearMotion,
    Motion,
    PlantName,
)
from deadtime.links.ardrone2.emulator.thrust import Thruster, ThrustMotion
from deadtime.loops import FirstOrder, Integrator, RationalPlant

#: Time constants of roll, pitch and turning speed, s.
ATTITUDE_LAG = 0.15

#: Rate at which air drag reduces horizontal speed, 1/s.
DRAG = 1.0


@dataclass(frozen=True)
class Pose:
    """Position and motion of the drone; SI units, angles in rad.

    Attributes
    ----------
    height, climb : float
        m and m/s, up positive.
    setpoint : float
        Commanded climb, m/s.
    roll, pitch, heading : float
        Right, backwards (nose up) and clockwise positive.
    forward, right : float
        Horizontal speeds, m/s.
    """

    height: float
    climb: float
    setpoint: float
    roll: float
    pitch: float
    heading: float
    forward: float
    right: float


class Airframe:
    """Motion of the drone under given setpoints, without link, phases and limits.

    Parameters
    ----------
    plant : str
        Name of the vertical plant.
    """

    def __init__(self, plant: PlantName) -> None:
        self._hover: Motion = (
            ThrustMotion(Thruster()) if plant == "thrust" else LinearMotion(LINEAR_PLANTS[plant])
        )
        self._fall = FreeFall()
        self._vertical: Motion = self._hover
        self.setpoint = 0.0
        self._roll, self._pitch = (LinearMotion(FirstOrder(1.0, ATTITUDE_LAG)) for _ in "rp")
        self._heading = LinearMotion(Integrator(1.0, ATTITUDE_LAG))
        sideways = RationalPlant((GRAVITY,), np.polymul((ATTITUDE_LAG, 1.0), (1.0, DRAG)).tolist())
        self._forward, self._right = LinearMotion(sideways), LinearMotion(sideways)
        self._angles = (0.0, 0.0, 0.0)
        self._moved = False
        self.stand(0)

    def stand(self, time: Micros) -> None:
        """Put the drone on the ground: level, at rest, motors off; the heading stays."""
        self._vertical = self._hover
        self._hover.settle(time, 0.0)
        self.setpoint = 0.0
        for motion in (self._roll, self._pitch, self._forward, self._right):
            motion.settle(time, 0.0)
        self._heading.settle(time, self._heading.at(time)[0])
        self._angles, self._moved = (0.0, 0.0, 0.0), False

    def climb_at(self, time: Micros, climb: float) -> None:
        """Set the commanded climb from this time on, m/s."""
        if climb != self.setpoint:
            self.setpoint = climb
            self._vertical.follow(time, climb)

    def lean(self, time: Micros, roll: float, pitch: float, turning: float) -> None:
        """Set the commanded angles (rad) and turning speed (rad/s) from this time on."""
        if (roll, pitch, turning) == self._angles:
            return
        self._angles, self._moved = (roll, pitch, turning), True
        self._roll.follow(time, roll)
        self._right.follow(time, roll)
        self._pitch.follow(time, pitch)
        self._forward.follow(time, -pitch)
        self._heading.follow(time, turning)

    def settle_tilt(self, time: Micros) -> None:
        """Apply the tilt to the thrust, for which the controller on board does not compensate."""
        if isinstance(self._vertical, ThrustMotion) and self._moved:
            roll, pitch = self._roll.at(time)[0], self._pitch.at(time)[0]
            self._vertical.tilt(time, math.cos(roll) * math.cos(pitch))

    def cut(self, time: Micros) -> None:
        """Stop the motors, so that the drone falls."""
        height, climb = self._vertical.at(time)
        self._fall.drop(time, height, climb)
        self._vertical, self.setpoint = self._fall, 0.0

    def vertical_at(self, time: Micros) -> tuple[float, float]:
        """Height and climb, m and m/s."""
        return self._vertical.at(time)

    def at(self, time: Micros) -> Pose:
        """The pose at a time not before the last setpoint."""
        height, climb = self._vertical.at(time)
        if not self._moved:
            heading = self._heading.at(time)[0]
            return Pose(height, climb, self.setpoint, 0.0, 0.0, heading, 0.0, 0.0)
        return Pose(
            height,
            climb,
            self.setpoint,
            self._roll.at(time)[0],
            self._pitch.at(time)[0],
            self._heading.at(time)[0],
            self._forward.at(time)[0],
            self._right.at(time)[0],
        )
