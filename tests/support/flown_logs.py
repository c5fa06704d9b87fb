"""One flight of a case: its plant, what was asked of it, and the rows that a logger kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flown_cases import CASES, Case
from flown_files import WRITERS
from flown_plants import Noise, Plant, drawn_plant, markov
from flown_sticks import STICKS
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Share of the rows that a logger takes a sample or two late, and longest pause, s.
LATE, PAUSE = 0.1, 0.4

#: Share of the size of the setpoint up to which a response rests beside it.
OFFSET = 0.05

#: Correlation times of coloured noise and of gusts, s, and frequencies of vibration, Hz.
COLOUR_TIMES, GUST_TIMES, VIBRATIONS = (0.005, 0.05), (0.2, 1.0), (60.0, 200.0)

#: Step of a response in units of the log: centidegrees of ATT, whole deg/s of Blackbox.
ROUNDING = {("DataFlash", "roll"): 0.01, ("Blackbox", "roll rate"): 1.0}


@dataclass(frozen=True)
class Flown:
    """A log before it is written, in deg or deg/s and s from the start of the flight.

    Attributes
    ----------
    case : Case
        Where it was drawn from.
    plant, noise : Plant, Noise
        The truth.
    inputs : array
        Setpoint at each sample of the controller.
    asked, read : integer arrays
        Samples, of the controller and of the sensor, whose values are in the log.
    setpoint, response : arrays
        These values.
    """

    case: Case
    plant: Plant
    noise: Noise
    inputs: Array
    asked: NDArray[np.int64]
    read: NDArray[np.int64]
    setpoint: Array
    response: Array

    @property
    def asked_at(self) -> Array:
        """Times of the rows of the setpoint."""
        return self.asked / self.case.controller

    @property
    def read_at(self) -> Array:
        """Times of the rows of the response."""
        return self.read / self.case.sensor

    def data(self, random: np.random.Generator) -> bytes:
        """The log as a file of its format."""
        case = self.case
        return WRITERS[case.writer](
            case, self.asked_at, self.setpoint, self.read_at, self.response, random
        )


def kept(
    count: int, rate: float, rows: float, lost: float, random: np.random.Generator
) -> NDArray[np.int64]:
    """Samples that a logger keeps: the next after each row is due, some later, some lost."""
    every = rate / rows
    due = random.uniform() * every + np.arange(int(count / every)) * every
    if every > 1.5:
        due = due + (random.uniform(size=due.size) < LATE) * random.integers(0, 3, due.size)
    found = np.unique(np.ceil(due - 1e-9).astype(np.int64))
    found = found[found < count]
    gone = random.uniform(size=found.size) < 0.5 * lost
    seconds = count / rate
    for start in random.uniform(0.0, seconds, round(lost * seconds / PAUSE)):
        stop = start + random.uniform(0.0, PAUSE)
        gone |= (found > start * rate) & (found < stop * rate)
    return found[~gone]


def drawn_noise(case: Case, random: np.random.Generator) -> Noise:
    """The noise of one flight."""

    def some(largest: float) -> float:
        return case.size * largest * float(random.uniform(0.2, 1.0))

    def between(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    return Noise(
        white=case.size * between(*case.noise),
        colour=some(case.colour),
        colour_time=between(*COLOUR_TIMES),
        gust=some(case.gust),
        gust_time=between(*GUST_TIMES),
        vibration=some(case.vibration),
        frequency=float(random.uniform(*VIBRATIONS)),
        rounding=ROUNDING.get((case.writer, case.loop), 0.0),
    )


def fly(case: Case, seed: int) -> Flown:
    """The flight of a case that this seed draws."""
    random = np.random.default_rng([seed, CASES.index(case) if case in CASES else 99])
    plant = drawn_plant(case.plant, *case.vehicle, case.damping, random)
    noise = drawn_noise(case, random)
    count = round(case.seconds * case.controller)
    period = 1.0 / case.controller
    inputs = case.size * STICKS[case.sticks](
        period * np.arange(count), case.pace, case.rest, random
    )
    samples = round(case.seconds * case.sensor)
    times = np.arange(samples) / case.sensor
    response = plant.response(times, period, inputs)
    gusts = markov(count, period, noise.gust, noise.gust_time, random)
    response += plant.response(times, period, gusts)
    response += noise.drawn(samples, 1.0 / case.sensor, random)
    response += case.size * OFFSET * random.uniform(-1.0, 1.0)
    asked = kept(count, case.controller, case.rows[0], case.lost, random)
    read = asked if case.together else kept(samples, case.sensor, case.rows[1], case.lost, random)
    return Flown(case, plant, noise, inputs, asked, read, inputs[asked], response[read])
