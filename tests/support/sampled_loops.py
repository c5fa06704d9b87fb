"""Logs of loops with known truth, with rows and clocks as logs have them.

A P controller reads the response at its own rate and holds each command until the next. The command
arrives after the delay and passes gain/(s (lag s + 1)), and air moves the output through the same
lag; it is calm, so that what is wrong comes from the rows. The noiseless response has a closed form
at any time (`Flight.response`), so rows may lie anywhere. Rows are those of PX4, whose topics each
have times of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from deadtime.logs._autopilots import names_of
from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._log import Log, log_of
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kind:
    """A kind of loop: names of its topics and columns, and its sizes in SI units.

    `air` is the deviation of what air adds to the gain times the command.
    """

    loop: str
    setpoint: tuple[str, str]
    response: tuple[str, str]
    actuator: tuple[str, str]
    sign: float
    period: float
    seconds: float
    delay: tuple[float, float]
    lag: tuple[float, float]
    gain: tuple[float, float]
    noise: float
    air: float
    air_time: float
    size: float
    pause: float
    parameters: Mapping[str, float]


RATE = Kind(
    loop="roll rate",
    setpoint=("vehicle_rates_setpoint", "roll"),
    response=("vehicle_angular_velocity", "xyz[0]"),
    actuator=("vehicle_torque_setpoint", "xyz[0]"),
    sign=1.0,
    period=0.0025,
    seconds=5.0,
    delay=(0.003, 0.015),
    lag=(0.015, 0.040),
    gain=(60.0, 150.0),
    noise=0.02,
    air=0.01,
    air_time=0.3,
    size=1.0,
    pause=0.3,
    parameters={"IMU_GYRO_RATEMAX": 400.0},
)

HEIGHT = Kind(
    loop="altitude",
    setpoint=("trajectory_setpoint", "position[2]"),
    response=("vehicle_local_position", "z"),
    actuator=("vehicle_local_position_setpoint", "vz"),
    sign=-1.0,
    period=0.02,
    seconds=24.0,
    delay=(0.05, 0.25),
    lag=(0.1, 0.3),
    gain=(0.8, 1.2),
    noise=0.005,
    air=0.0001,
    air_time=1.0,
    size=1.0,
    pause=4.0,
    parameters={},
)


@dataclass(frozen=True)
class Flight:
    """One flight: its truth, and what its controller read and sent at `time`."""

    kind: Kind
    delay: float
    lag: float
    gain: float
    time: Array
    setpoint: Array
    read: Array
    sent: Array
    moved: Array

    @property
    def delay_plus_lag(self) -> float:
        """Delay and lag together, s."""
        return self.delay + self.lag

    def delay_at(self, omega: Array) -> Array:
        """Equivalent delay of the vehicle without its integrator, s."""
        return np.asarray(self.delay + np.arctan(self.lag * omega) / omega)

    def response(self, times: Array) -> Array:
        """Response without noise of the sensor, at any times within the flight."""
        step = self.kind.period
        decay = math.exp(-step / self.lag)
        velocity, place = np.zeros((2, self.sent.size + 1))
        for k, sent in enumerate(self.gain * self.sent):
            gap = velocity[k] - sent
            velocity[k + 1] = sent + gap * decay
            place[k + 1] = place[k] + sent * step + gap * self.lag * (1.0 - decay)
        since = times - self.delay - self.time[0]
        row = np.maximum(np.floor(since / step + 1e-9).astype(int), -1)
        late = np.where(row < 0, 0.0, since - row * step)
        row = np.clip(row, 0, self.sent.size - 1)
        sent = np.where(since < 0.0, 0.0, self.gain * self.sent[row])
        gap = velocity[row] - sent
        found = place[row] + sent * late + gap * self.lag * -np.expm1(-late / self.lag)
        return np.asarray(found + np.interp(times, self.time, self.moved))


def fly(kind: Kind, random: np.random.Generator) -> Flight:
    """A loop drawn at random, well damped, that follows doublets of random length."""
    delay, lag, gain = (float(random.uniform(*ends)) for ends in (kind.delay, kind.lag, kind.gain))
    Kp = float(random.uniform(0.35, 0.5)) / (delay + lag) / gain
    step = kind.period
    rows = round(kind.seconds / step)
    time = step * np.arange(rows)
    setpoint = np.zeros(rows)
    at, way = 0.5 * kind.pause, 1.0
    while at < kind.seconds:
        length = kind.pause * random.uniform(0.6, 1.4)
        setpoint[(time >= at) & (time < at + length)] = way * kind.size * random.uniform(0.5, 1.0)
        at, way = at + length, -way
    kept = math.exp(-step / kind.air_time)
    fresh = random.standard_normal(rows)
    air = np.empty(rows)
    now, drift = kind.air * fresh[0], 0.0
    for k in range(rows):
        air[k] = drift
        drift = now + (drift - now) * math.exp(-step / lag)
        now = kept * now + kind.air * math.sqrt(1.0 - kept**2) * fresh[k]
    moved = np.concatenate([[0.0], np.cumsum(0.5 * step * (air[1:] + air[:-1]))])
    noise = kind.noise * random.standard_normal(rows)
    read, sent = np.empty(rows), np.empty(rows)
    decay = math.exp(-step / lag)
    velocity = place = 0.0
    arrived = -1  # the last command whose effect up to the next arrival is in the state
    since_first = delay / step
    for k in range(rows):
        last = math.floor(k - since_first + 1e-9)  # the command that acts at this time
        while arrived < last - 1:
            arrived += 1
            told = gain * sent[arrived]
            gap = velocity - told
            place += told * step + gap * lag * (1.0 - decay)
            velocity = told + gap * decay
        now = place
        if last >= 0:
            part = (k - since_first - last) * step
            told = gain * sent[last]
            now += told * part - (velocity - told) * lag * math.expm1(-part / lag)
        read[k] = now + moved[k] + noise[k]
        sent[k] = Kp * (setpoint[k] - read[k])
    return Flight(kind, delay, lag, gain, time, setpoint, read, sent, moved)


@dataclass(frozen=True)
class Rows:
    """Rows of one signal: stamps and values."""

    time: Array
    values: Array

    def every(self, number: int, first: int = 0) -> Rows:
        """Every so-many-th row."""
        return Rows(self.time[first::number], self.values[first::number])

    def without(self, lost: NDArray[np.bool_]) -> Rows:
        """The rows that are not lost."""
        return Rows(self.time[~lost], self.values[~lost])

    def rounded(self, step: float) -> Rows:
        """Values in whole steps."""
        return Rows(self.time, step * np.round(self.values / step))

    def stamped(self, late: Array) -> Rows:
        """Rows whose stamps are that much later than their samples."""
        return Rows(self.time + late, self.values)


def log_with(flight: Flight, setpoint: Rows, response: Rows, actuator: Rows) -> Log:
    """The log of a PX4 with these rows, each signal in a topic of its own."""
    kind = flight.kind
    topics: dict[str, Topic] = {}
    for (name, column), rows, sign in (
        (kind.setpoint, setpoint, kind.sign),
        (kind.response, response, kind.sign),
        (kind.actuator, actuator, kind.sign),
    ):
        topics[name] = Topic(rows.time, {column: sign * rows.values})
    contents = LogContents("ULog", "PX4", "Quadrotor", "", topics, kind.parameters)
    return log_of(contents, names_of(contents), "made.ulg")


#: What a logger makes of a flight: rows of setpoint, response and actuator.
Logger = Callable[[Flight, np.random.Generator], tuple[Rows, Rows, Rows]]


def _logged(change: Callable[[Rows, np.random.Generator, Flight], Rows], *names: str) -> Logger:
    """Every row of the controller, with a change of these signals."""

    def rows(flight: Flight, random: np.random.Generator) -> tuple[Rows, Rows, Rows]:
        found = {
            "setpoint": Rows(flight.time, flight.setpoint),
            "response": Rows(flight.time, flight.read),
            "actuator": Rows(flight.time, flight.sent),
        }
        for name in names:
            found[name] = change(found[name], random, flight)
        return found["setpoint"], found["response"], found["actuator"]

    return rows


def _read_at(times: Callable[[np.random.Generator, Flight], Array], noise: float = 1.0) -> Logger:
    """The response read at times of its own."""

    def change(_: Rows, random: np.random.Generator, flight: Flight) -> Rows:
        at = times(random, flight)
        fresh = noise * flight.kind.noise * random.standard_normal(at.size)
        return Rows(at, flight.response(at) + fresh)

    return _logged(change, "response")


def at_rate(hertz: float) -> Logger:
    """Rows of the response at another rate, in any phase."""

    def times(random: np.random.Generator, flight: Flight) -> Array:
        return np.arange(random.uniform() / hertz, flight.time[-1] - 1e-6, 1.0 / hertz)

    return _read_at(times)


def uneven(random: np.random.Generator, flight: Flight) -> Array:
    """Times that scatter over nine tenths of a period."""
    late = 0.9 * flight.kind.period * random.uniform(size=flight.time.size - 1)
    return np.asarray(flight.time[:-1] + late)


def own_oscillator(apart: float) -> Logger:
    """The response read by a task whose period is longer by this share, and stamped rightly."""

    def times(random: np.random.Generator, flight: Flight) -> Array:
        period = (1.0 + apart) * flight.kind.period
        return np.arange(random.uniform() * period, flight.time[-1] - 1e-6, period)

    return _read_at(times)


def drifting(apart: float, scatter: float = 0.0) -> Logger:
    """Stamps of the response by a clock that is faster by this share since the log began.

    They scatter by a share of a period, too.
    """

    def change(rows: Rows, random: np.random.Generator, flight: Flight) -> Rows:
        way = random.uniform(-1.0, 1.0, rows.time.size)
        return rows.stamped(apart * rows.time + scatter * flight.kind.period * way)

    return _logged(change, "response")


def every(number: int, name: str) -> Logger:
    """Only every so-many-th row of a signal."""
    return _logged(lambda rows, random, _: rows.every(number, int(random.integers(number))), name)


def lost(share: float, name: str) -> Logger:
    """Rows lost at random."""
    return _logged(
        lambda rows, random, _: rows.without(random.uniform(size=rows.time.size) < share), name
    )


def dropouts(number: int, shortest: int, longest: int) -> Logger:
    """Pauses of the whole logger, of so many rows each."""

    def rows(flight: Flight, random: np.random.Generator) -> tuple[Rows, Rows, Rows]:
        gone = np.zeros(flight.time.size, dtype=bool)
        for start in random.integers(10, flight.time.size - longest, number).tolist():
            gone[start : start + int(random.integers(shortest, longest + 1))] = True
        change = _logged(lambda rows, *_: rows.without(gone), "setpoint", "response", "actuator")
        return change(flight, random)

    return rows


def repeated(share: float) -> Logger:
    """Rows of the response that hold the value of the row before."""

    def change(rows: Rows, random: np.random.Generator, _: Flight) -> Rows:
        again = random.uniform(size=rows.time.size) < share
        source = np.maximum.accumulate(np.where(again, 0, np.arange(rows.time.size)))
        return Rows(rows.time, rows.values[source])

    return _logged(change, "response")


def rounded(step: float, noise: float) -> Logger:
    """The response in whole steps, with so much of the usual noise."""

    def rows(flight: Flight, random: np.random.Generator) -> tuple[Rows, Rows, Rows]:
        read = _read_at(lambda _, flown: flown.time, noise)
        setpoint, response, actuator = read(flight, random)
        return setpoint, response.rounded(step), actuator

    return rows


def scattered(share: float) -> Logger:
    """Stamps of the response that scatter around its samples, by this share of a period."""

    def change(rows: Rows, random: np.random.Generator, flight: Flight) -> Rows:
        way = random.uniform(-1.0, 1.0, rows.time.size)
        return rows.stamped(share * flight.kind.period * way)

    return _logged(change, "response")


COMMON: dict[str, Logger] = {
    "every row": _logged(lambda rows, *_: rows),
    "setpoint: every eighth row": every(8, "setpoint"),
    "commands: every second row": every(2, "actuator"),
    "commands: every fifth row": every(5, "actuator"),
    "10 % of the response lost": lost(0.1, "response"),
    "5 % of the commands lost": lost(0.05, "actuator"),
    "logger lost 12 to 80 rows, 3 times": dropouts(3, 12, 80),
    "logger lost 2 to 4 rows, 6 times": dropouts(6, 2, 4),
    "30 % of the response repeated": repeated(0.3),
    "uneven rows": _read_at(uneven),
    "scattered stamps": scattered(0.4),
    "clocks drift by 100 ppm": drifting(1e-4),
}
LOGGERS: dict[str, tuple[Kind, dict[str, Logger]]] = {
    "rate": (
        RATE,
        COMMON
        | {
            "response at 1000 Hz": at_rate(1000.0),
            "response at 250 Hz": at_rate(250.0),
            "steps of 1 deg/s": rounded(math.radians(1.0), 1.0),
            "steps of 1 deg/s, little noise": rounded(math.radians(1.0), 0.1),
        },
    ),
    "height": (
        HEIGHT,
        COMMON
        | {
            "response at 30 Hz": at_rate(30.0),
            "response at 10 Hz": at_rate(10.0),
            "steps of 1 cm": rounded(0.01, 1.0),
            "steps of 1 cm, little noise": rounded(0.01, 0.2),
            "steps of 0.1 hPa": rounded(0.84, 1.0),
        },
    ),
    "long height": (
        replace(HEIGHT, seconds=120.0),
        {
            "every row": COMMON["every row"],
            "an oscillator of its own": own_oscillator(1e-4),
            "clocks drift by 100 ppm, scattered stamps": drifting(1e-4, 0.1),
        },
    ),
}


def made(kind: str, logger: str, seed: int, part: float = 1.0) -> tuple[Flight, Log]:
    """A flight and its log, drawn from this seed; or a shorter one, of a part of the time."""
    random = np.random.default_rng([seed, 7])
    sizes, loggers = LOGGERS[kind]
    flight = fly(replace(sizes, seconds=part * sizes.seconds), random)
    return flight, log_with(flight, *loggers[logger](flight, random))
