"""Measurements of the emulated drone, and its navdata.

The noise of a time is a function of the seed and the time alone, so that it does not depend on
which navdata are sent, or when.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime.links.ardrone2.commands import Ref
from deadtime.links.ardrone2.emulator.airframe import DRAG, Pose
from deadtime.links.ardrone2.emulator.clock import SECOND, Micros, seconds
from deadtime.links.ardrone2.emulator.flight import LOW_BATTERY, TICK, Phase
from deadtime.links.ardrone2.emulator.motion import GRAVITY
from deadtime.links.ardrone2.emulator.options import EmulatorOptions
from deadtime.links.ardrone2.navdata import FULL_OPTIONS, TAGS, Navdata, State, build_navdata
from deadtime.links.ardrone2.navdata_options import (
    AltitudeOption,
    Demo,
    KalmanPressure,
    PhysicalMeasures,
    Pressure,
    Pwm,
    RawMeasures,
    VideoStream,
)

#: Period of the ultrasound, and its largest height, m.
ECHO_EVERY: Micros = SECOND // 25
HEARS_UP_TO = 6.0

#: Ratios of the noise of the climb (1/s), of the angles (rad/m) and of the accelerations (1/m, in
#: units of the standard gravity) to that of the height.
CLIMB_NOISE = 10.0
ANGLE_NOISE = 0.4
FORCE_NOISE = 1.0

#: The accelerometers have 12 bits with 512 counts per g; in recordings of the vehicle at rest the
#: one that points down has 2560 counts, which means -1 g.
ZERO_COUNT, COUNTS_PER_G, LARGEST_COUNT = 2048, 512, 4095

#: Number of ticks for which noise is drawn at once: more take more memory, fewer more calls.
BLOCK = 1024

#: Bits that are set in a working drone.
WORKING = (
    State.ALTITUDE_CONTROL
    | State.CAMERA_READY
    | State.PIC_VERSION_OK
    | State.COMMAND_THREAD
    | State.NAVDATA_THREAD
    | State.VIDEO_THREAD
    | State.ACQUISITION_THREAD
)

#: Control states: the upper half of the word in navdata.
DEFAULT, LANDED, FLYING, HOVERING, TAKING_OFF, GOING_UP, LANDING = 0, 2, 3, 4, 6, 7, 8

#: Reported motor speed while the motors turn, from 0 to 255; it is not modelled.
TURNING = 150

EMPTY_VOLTAGE, FULL_VOLTAGE = 10_500.0, 12_500.0
SEA_LEVEL, PER_METRE = 101_325.0, 12.0


@dataclass(frozen=True)
class Reading:
    """The drone at one time, for its navdata. Names as in `Flight` and the link."""

    time: Micros
    sequence: int
    pose: Pose
    phase: Phase
    lifted: bool
    hovering: bool
    emergency: bool
    charge: float
    ref: Ref
    ref_number: int
    to_acknowledge: bool
    link_late: bool
    link_lost: bool
    bootstrap: bool
    #: The options of short navdata, one bit a tag; None for the long ones.
    options: int | None
    no_echo: bool


class _Noise:
    """Standard normal numbers by time and channel."""

    def __init__(self, seed: int, channels: int) -> None:
        self._seed, self._channels = seed, channels
        self._number = -1
        self._block: NDArray[np.float64] = np.empty((0, channels))

    def at(self, count: int) -> tuple[float, ...]:
        number, row = divmod(count, BLOCK)
        if number != self._number:
            rng = np.random.default_rng((self._seed, self._channels, number))
            self._block, self._number = rng.standard_normal((BLOCK, self._channels)), number
        return tuple(self._block[row].tolist())


class Sensors:
    """Measures with noise, and makes navdata.

    Parameters
    ----------
    options : EmulatorOptions
        Options with noise and seed.
    """

    def __init__(self, options: EmulatorOptions) -> None:
        self._size = options.noise
        self._noise = _Noise(options.seed, channels=5)
        self._echo_noise = _Noise(options.seed, channels=1)
        self._force_noise = _Noise(options.seed, channels=3)
        self._echo = 0.0
        self._climb = self._acceleration = 0.0

    def tick(self, time: Micros, height: float, climb: float) -> None:
        """Measure the acceleration, and the height by ultrasound when an echo is due."""
        self._acceleration = (climb - self._climb) / seconds(TICK)
        self._climb = climb
        if time % ECHO_EVERY == 0 and height <= HEARS_UP_TO:
            self._echo = height

    def packet(self, reading: Reading) -> bytes:
        """The navdata of one time."""
        navdata = Navdata(self._state(reading), reading.sequence)
        if not reading.bootstrap:
            navdata = self._measured(reading, navdata)
        return build_navdata(navdata)

    def _forces(self, reading: Reading) -> tuple[float, float, float]:
        """Specific force forward, right and down, in units of the standard gravity.

        Thrust acts along the vertical axis of the drone, drag against its speed; on the ground, its
        reaction takes the place of thrust.
        """
        pose, noise = reading.pose, self._force_noise.at(reading.time // TICK)
        standing = reading.phase is Phase.LANDED
        lift = GRAVITY + (0.0 if standing else self._acceleration)
        forces = (
            -DRAG * pose.forward,
            -DRAG * pose.right,
            -lift / (math.cos(pose.roll) * math.cos(pose.pitch)),
        )
        largest = (LARGEST_COUNT - ZERO_COUNT) / COUNTS_PER_G
        measured = [
            force / GRAVITY + self._size * FORCE_NOISE * error
            for force, error in zip(forces, noise, strict=True)
        ]
        x, y, z = (min(max(value, -largest), largest) for value in measured)
        return x, y, z

    def _state(self, reading: Reading) -> int:
        state = WORKING
        for flag, holds in (
            (State.FLYING, reading.lifted),
            (State.USER_FEEDBACK, reading.ref.take_off),
            (State.COMMAND_ACKNOWLEDGED, reading.to_acknowledge),
            (State.DEMO, reading.bootstrap or reading.options is not None),
            (State.BOOTSTRAP, reading.bootstrap),
            (State.COMMUNICATION_LOST, reading.link_lost),
            (State.BATTERY_LOW, reading.charge < LOW_BATTERY),
            (State.ULTRASOUND_DEAF, reading.no_echo or reading.pose.height > HEARS_UP_TO),
            (State.COM_WATCHDOG, reading.link_late),
            (State.EMERGENCY, reading.emergency),
        ):
            if holds:
                state |= flag
        return int(state)

    def _measured(self, reading: Reading, head: Navdata) -> Navdata:
        noise = self._noise.at(reading.time // TICK)
        (echo_noise,) = self._echo_noise.at(reading.time // ECHO_EVERY)
        size, angle = self._size, self._size * ANGLE_NOISE
        pose = reading.pose
        height = pose.height + size * noise[0]
        climb = pose.climb + size * CLIMB_NOISE * noise[1]
        echo = self._echo + size * echo_noise
        turning = TURNING if reading.phase not in (Phase.LANDED, Phase.FALLING) else 0
        x, y, z = self._forces(reading)
        volts = EMPTY_VOLTAGE + (FULL_VOLTAGE - EMPTY_VOLTAGE) * reading.charge / 100.0
        parts: dict[str, Any] = {
            "demo": Demo(
                major=_control_state(reading),
                battery=round(reading.charge),
                pitch=pose.pitch + angle * noise[2],
                roll=pose.roll + angle * noise[3],
                yaw=math.remainder(pose.heading + angle * noise[4], math.tau),
                height=height,
                vx=pose.forward,
                vy=pose.right,
                vz=0.0,  # as on the vehicle
            ),
            "clock": seconds(reading.time),
            "raw_measures": RawMeasures(
                acceleration_x=round(ZERO_COUNT + COUNTS_PER_G * x),
                acceleration_y=round(ZERO_COUNT - COUNTS_PER_G * y),
                acceleration_z=round(ZERO_COUNT - COUNTS_PER_G * z),
                battery_voltage=round(volts),
                height=echo,
            ),
            "physical_measures": PhysicalMeasures(
                acceleration_x=x, acceleration_y=y, acceleration_z=z
            ),
            "pwm": Pwm(turning, turning, turning, turning, vz_ref=pose.setpoint),
            "altitude": AltitudeOption(
                altitude_vision=height, altitude_vz=-climb, altitude_raw=echo
            ),
            "video_stream": VideoStream(atcmd_ref_seq=reading.ref_number),
            "pressure": Pressure(pressure=round(SEA_LEVEL - PER_METRE * height)),
            "kalman_pressure": KalmanPressure(est_z=height, est_zdot=climb),
        }
        bits = reading.options
        if bits is not None:
            parts = {name: part for name, part in parts.items() if bits >> TAGS[name] & 1}
        options = FULL_OPTIONS if bits is None else _chosen(bits)
        return replace(head, options=options, **parts)


@lru_cache(maxsize=8)
def _chosen(bits: int) -> tuple[tuple[int, bytes], ...]:
    """The empty options whose bits are set in a mask."""
    return tuple(option for option in FULL_OPTIONS if bits >> option[0] & 1)


def _control_state(reading: Reading) -> int:
    return {
        Phase.LANDED: LANDED,
        Phase.TAKING_OFF: GOING_UP if reading.lifted else TAKING_OFF,
        Phase.FLYING: HOVERING if reading.hovering else FLYING,
        Phase.LANDING: LANDING,
        Phase.FALLING: DEFAULT,
    }[reading.phase]
