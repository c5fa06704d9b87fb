r"""Vertical motion of a quadrotor from the speed of its rotors.

Armah and Yi (2017), equations (7) and (8): four rotors give a thrust that grows with the square of
their speed, T = 4 k Omega^2 with equal speeds Omega, and

    m z'' = T cos(roll) cos(pitch) - m g.

Every vehicle also has two parts that are not in these equations: the speed of a rotor follows its
setpoint with a lag, Omega' = (Omega_set - Omega) / lag, within a range; and a controller on board
sets the speed that gives the thrust m (g + c (climb_set - z')). Linearised at hover, the climb is
c / (lag s^2 + s + c) times its setpoint. With c = 1 / (4 lag) this has two equal lags of 2 lag,
whose sum is 1 / c.

The equations are integrated by the classical Runge-Kutta method in steps that end at whole
milliseconds of the drone's clock and where the setpoint changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from deadtime._base.validation import positive
from deadtime.links.ardrone2.emulator.clock import SECOND, Micros
from deadtime.links.ardrone2.emulator.motion import GRAVITY, Motion

#: Largest step of the integration: a shorter one is more accurate and slower.
STEP: Micros = 1000

#: Motor speeds in revolutions per minute, and the gear ratio between motor and rotor.
HOVERING_RPM, SLOWEST_RPM, FASTEST_RPM = 28_500.0, 10_350.0, 41_400.0
GEAR = 8.75

#: Height, climb, rotor speed.
State: TypeAlias = tuple[float, float, float]


def _rotor(motor_rpm: float) -> float:
    return motor_rpm / GEAR * 2.0 * math.pi / 60.0


@dataclass(frozen=True)
class Thruster:
    """Parameters of the thrust model, by default of an AR.Drone 2.0 with its indoor hull.

    Parameters
    ----------
    mass : float
        In kg.
    hover_speed, slowest, fastest : float
        Speeds of a rotor, rad/s: at hover, and the ends of its range.
    motor_lag : float
        Time constant of the speed of a rotor, s.
    speed_gain : float
        Gain of the controller on board, 1/s: commanded acceleration per error of the climb.

    Raises
    ------
    ValueError
        If a number is not above zero, or hovering is outside the range of the rotors.

    Examples
    --------
    >>> thruster = Thruster()
    >>> round(thruster.hover_speed, 1), round(thruster.thrust_factor * 1e6, 2)
    (341.1, 8.85)
    """

    mass: float = 0.420
    hover_speed: float = _rotor(HOVERING_RPM)
    slowest: float = _rotor(SLOWEST_RPM)
    fastest: float = _rotor(FASTEST_RPM)
    motor_lag: float = 0.040
    speed_gain: float = 6.25

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            object.__setattr__(self, name, positive(name, value))
        if not self.slowest < self.hover_speed < self.fastest:
            raise ValueError(
                f"hover_speed={self.hover_speed} is not between slowest={self.slowest} and "
                f"fastest={self.fastest}, so such a vehicle cannot hover"
            )

    @property
    def thrust_factor(self) -> float:
        """Thrust of one rotor per square of its speed, N s^2."""
        return self.mass * GRAVITY / (4.0 * self.hover_speed**2)

    @property
    def accelerations(self) -> tuple[float, float]:
        """Largest accelerations down and up, m/s^2."""
        return (
            GRAVITY * ((self.slowest / self.hover_speed) ** 2 - 1.0),
            GRAVITY * ((self.fastest / self.hover_speed) ** 2 - 1.0),
        )


class ThrustMotion(Motion):
    """Height from the commanded climb by thrust.

    Parameters
    ----------
    thruster : Thruster

    Examples
    --------
    >>> height = ThrustMotion(Thruster())
    >>> height.settle(0, 1.0)
    >>> height.follow(0, 0.5)
    >>> above, climb = height.at(2_000_000)
    >>> round(above, 3), round(climb, 3)             # 0.16 s of lag in all
    (1.919, 0.5)
    """

    def __init__(self, thruster: Thruster) -> None:
        self.thruster = thruster
        self._time: Micros = 0
        self._state: State = (0.0, 0.0, thruster.hover_speed)
        self._setpoint = 0.0
        self._upright = 1.0

    def settle(self, time: Micros, value: float) -> None:
        """Set the state to hover at a height."""
        self._time, self._state = time, (value, 0.0, self.thruster.hover_speed)
        self._setpoint = 0.0

    def follow(self, time: Micros, value: float) -> None:
        """Change the commanded climb, m/s."""
        self._go_to(time)
        self._setpoint = value

    def tilt(self, time: Micros, upright: float) -> None:
        """Change cos(roll) cos(pitch)."""
        if upright != self._upright:
            self._go_to(time)
            self._upright = upright

    def at(self, time: Micros) -> tuple[float, float]:
        """Height and climb."""
        # The state is stored only at whole steps, so that it does not depend on the times of
        # evaluation.
        whole = time - time % STEP
        if whole > self._time:
            self._go_to(whole)
        height, climb, _ = self._step(self._state, time - self._time)
        return height, climb

    def _go_to(self, time: Micros) -> None:
        while self._time < time:
            until = min(time, self._time - self._time % STEP + STEP)
            self._state = self._step(self._state, until - self._time)
            self._time = until

    def _step(self, state: State, length: Micros) -> State:
        h = length / SECOND
        if h == 0.0:
            return state
        k1 = self._rates(state)
        k2 = self._rates(_moved(state, k1, 0.5 * h))
        k3 = self._rates(_moved(state, k2, 0.5 * h))
        k4 = self._rates(_moved(state, k3, h))
        z, v, w = state
        sixth = h / 6.0
        return (
            z + sixth * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]),
            v + sixth * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]),
            w + sixth * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]),
        )

    def _rates(self, state: State) -> State:
        _, climb, speed = state
        model = self.thruster
        hover = model.hover_speed
        # Thrusts as accelerations, so that the mass cancels: T / m = g (Omega / Omega_hover)^2.
        lift = max(0.0, GRAVITY + model.speed_gain * (self._setpoint - climb))
        requested = hover * math.sqrt(lift / GRAVITY)
        requested = min(max(requested, model.slowest), model.fastest)
        thrust = GRAVITY * (speed / hover) ** 2
        return climb, thrust * self._upright - GRAVITY, (requested - speed) / model.motor_lag


def _moved(state: State, rates: State, by: float) -> State:
    return (state[0] + by * rates[0], state[1] + by * rates[1], state[2] + by * rates[2])
