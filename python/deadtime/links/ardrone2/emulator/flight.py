"""The flight of the emulated drone: its phases and the actions of its autopilot in each.

The phases are: on the ground; taking off; flying, where it follows the setpoints of the link and
hovers without them; landing; falling with the motors off. The autopilot acts at ticks of 200 Hz,
and immediately on requests of the link.
"""

from __future__ import annotations

from enum import Enum

from deadtime.links.ardrone2.emulator.airframe import Airframe
from deadtime.links.ardrone2.emulator.clock import SECOND, Micros, seconds
from deadtime.links.ardrone2.emulator.options import EmulatorOptions
from deadtime.links.ardrone2.emulator.settings import Settings

#: Time between two steps of the autopilot.
TICK: Micros = SECOND // 200

#: Durations of a take-off as on the vehicle: motor start, smooth rise, and all of it.
SPIN_UP: Micros = SECOND
RISE: Micros = SECOND * 5 // 2
TAKE_OFF: Micros = SECOND * 9 // 2
TAKE_OFF_HEIGHT = 0.75

#: Gain of the height control of the autopilot: climb per height error, 1/s.
HEIGHT_GAIN = 3.0

#: Climb of a landing, m/s.
SINKING = -0.3

#: Flight time of a full battery, s; discharge on the ground relative to that in flight; charges in
#: percent: below the low one the drone reports it and does not take off, at the empty one it lands.
BATTERY_LASTS = 720.0
IDLE_SHARE = 0.1
LOW_BATTERY = 20.0
EMPTY_BATTERY = 3.0


class Phase(Enum):
    """Phases of a flight."""

    LANDED = "landed"
    TAKING_OFF = "taking off"
    FLYING = "flying"
    LANDING = "landing"
    FALLING = "falling"


#: Climb in m/s, roll and pitch in rad, turning speed in rad/s.
Setpoints = tuple[float, float, float, float]
HOVER: Setpoints = (0.0, 0.0, 0.0, 0.0)


class Flight:
    """Phases and autopilot.

    Parameters
    ----------
    options : EmulatorOptions
    settings : Settings
        The settings with the limits; they may change in flight.
    """

    def __init__(self, options: EmulatorOptions, settings: Settings) -> None:
        self.airframe = Airframe(options.plant)
        self.phase = Phase.LANDED
        self.emergency = False
        self._settings = settings
        self._requested = HOVER
        self._since: Micros = 0
        self._charge = options.battery
        self._charged_at: Micros = 0

    @property
    def airborne(self) -> bool:
        """Whether the drone is in any phase but on the ground."""
        return self.phase is not Phase.LANDED

    @property
    def hovering(self) -> bool:
        """Whether the drone flies without a setpoint."""
        return self.phase is Phase.FLYING and self._requested == HOVER

    def lifted(self, time: Micros) -> bool:
        """Whether the drone is off the ground."""
        if self.phase is Phase.TAKING_OFF:
            return time - self._since >= SPIN_UP
        return self.airborne

    def charge(self, time: Micros) -> float:
        """Charge left, percent."""
        share = 1.0 if self.airborne else IDLE_SHARE
        spent = 100.0 * share * seconds(time - self._charged_at) / BATTERY_LASTS
        return max(0.0, self._charge - spent)

    def _enter(self, phase: Phase, time: Micros) -> None:
        self._charge, self._charged_at = self.charge(time), time
        self.phase, self._since, self._requested = phase, time, HOVER

    def take_off(self, time: Micros) -> None:
        """Take off, if the drone is on the ground, without emergency and charged."""
        if self.phase is Phase.LANDED and not self.emergency and self.charge(time) >= LOW_BATTERY:
            self._enter(Phase.TAKING_OFF, time)
            self.airframe.stand(time)

    def land(self, time: Micros) -> None:
        """Land, if the drone takes off or flies."""
        if self.phase in (Phase.TAKING_OFF, Phase.FLYING):
            self._enter(Phase.LANDING, time)
            self._follow(time)

    def toggle_emergency(self, time: Micros) -> None:
        """Stop the motors, or end the emergency; a falling drone keeps falling."""
        self.emergency = not self.emergency
        if self.emergency and self.airborne and self.phase is not Phase.FALLING:
            self.airframe.cut(time)
            self._enter(Phase.FALLING, time)

    def follow(self, time: Micros, setpoint: Setpoints) -> None:
        """Set the setpoint of the link, which applies only while flying."""
        if self.phase is Phase.FLYING and setpoint != self._requested:
            self._requested = setpoint
            self._follow(time)

    def tick(self, time: Micros) -> None:
        """Make one step of the autopilot, every 5 ms."""
        if self.phase is Phase.LANDED:
            return
        down = self.phase in (Phase.LANDING, Phase.FALLING)
        if down and self.airframe.vertical_at(time)[0] <= 0.0:
            self._enter(Phase.LANDED, time)
            self.airframe.stand(time)
            return
        if self.phase is Phase.TAKING_OFF and time - self._since >= TAKE_OFF:
            self._enter(Phase.FLYING, time)
        elif self.phase is Phase.FLYING and self.charge(time) <= EMPTY_BATTERY:
            self.land(time)
        self._follow(time)

    def _follow(self, time: Micros) -> None:
        """Set the setpoints of the airframe by the phase, the link and the limits."""
        airframe = self.airframe
        if self.phase is Phase.TAKING_OFF:
            height, climb = _rising(time - self._since)
            if time - self._since >= SPIN_UP:
                error = height - airframe.vertical_at(time)[0]
                airframe.climb_at(time, climb + HEIGHT_GAIN * error)
        elif self.phase is Phase.LANDING:
            airframe.lean(time, 0.0, 0.0, 0.0)
            airframe.climb_at(time, SINKING)
        elif self.phase is Phase.FLYING:
            climb, *lean = self._requested
            airframe.lean(time, *lean)
            airframe.climb_at(time, self._within_heights(time, climb))
        airframe.settle_tilt(time)

    def _within_heights(self, time: Micros, climb: float) -> float:
        """The climb, limited so that the height stays in its range and slows towards its ends."""
        lowest, highest = self._settings.heights
        fastest = self._settings.climb_limit
        height = self.airframe.vertical_at(time)[0]
        climb = min(climb, HEIGHT_GAIN * (highest - height))
        climb = max(climb, HEIGHT_GAIN * (min(lowest, highest) - height))
        return min(max(climb, -fastest), fastest)


def _rising(since: Micros) -> tuple[float, float]:
    """Height and climb during a take-off, m and m/s."""
    share = min(max((since - SPIN_UP) / RISE, 0.0), 1.0)
    height = TAKE_OFF_HEIGHT * share * share * (3.0 - 2.0 * share)
    climb = TAKE_OFF_HEIGHT * 6.0 * share * (1.0 - share) / seconds(RISE)
    return height, climb
