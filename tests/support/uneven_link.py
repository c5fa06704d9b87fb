"""Simulated flights over a link whose delays scatter, saved as flights are.

A vehicle follows vertical speeds with a lag. Commands, positions and echoes of the setpoint each
take a delay of their own; some are lost. Nothing of the links under test is used.
"""

import csv
import math
from dataclasses import dataclass, field

import numpy as np
from deadtime import P
from deadtime.flights._runs import FlownSteps
from deadtime.recordings import read_recording

#: Steps of the simulation, times between samples and between reports, s, and lag of the vehicle, s.
STEP, SAMPLE, SPACING, LAG = 0.0025, 0.065, 0.02, 0.2

#: What is left of a difference of speeds after a step.
KEPT = math.exp(-STEP / LAG)

SETTLE, HOLD, AMPLITUDE, NOISE = 8.0, 8.0, 1.0, 0.003


@dataclass
class Link:
    """Delays of one way, s; of what is sent, a share is lost."""

    random: np.random.Generator
    mean: float
    deviation: float
    loss: float
    coming: list = field(default_factory=list)

    def send(self, now, what):
        if self.random.random() >= self.loss:
            wait = max(0.0, self.random.normal(self.mean, self.deviation))
            self.coming.append((now + wait, what))

    def arrived(self, now):
        here = sorted((one for one in self.coming if one[0] <= now), key=lambda one: one[0])
        self.coming = [one for one in self.coming if one[0] > now]
        return here


def flight(folder, seed, mean=0.13, deviation=0.02, loss=0.05, Kp=0.7, echoes=True):
    """A flight of two steps under P control, and the mean age of its rows in truth, s."""
    random = np.random.default_rng(seed)
    up, down = (Link(random, mean, deviation, loss) for _ in range(2))
    height, speed, told, slow = 1.0, 0.0, 0.0, 30.0 * random.random()
    newest, rows, messages, ages = None, [], [], []
    phase, lead = random.random() * SPACING, 3.0
    reports = samples = 0
    for k in range(round((lead + SETTLE + 2 * HOLD) / STEP)):
        now = k * STEP
        for _, value in up.arrived(now):
            told = value
        if now >= phase + reports * SPACING:
            reports += 1
            stamp = round(now + slow, 3)
            down.send(now, ("position", stamp, height + NOISE * random.standard_normal(), now))
            if echoes:
                down.send(now, ("echo", stamp, told, now))
        for at, (kind, stamp, value, true) in down.arrived(now):
            if kind == "echo":
                messages.append((at - lead, "", stamp, value, "", ""))
            elif newest is None or stamp > newest[0]:
                newest = stamp, value, true
                messages.append((at - lead, stamp, "", "", value, ""))
        time = now - lead
        if time >= samples * SAMPLE and newest is not None:
            samples += 1
            stepped = SETTLE <= time < SETTLE + HOLD
            reference = 1.0 + AMPLITUDE * stepped
            command = float(np.float32(Kp * (reference - newest[1])))
            rows.append((time, reference, newest[1], command, newest[0]))
            ages.append(now - newest[2])
            up.send(now, command)
        height += STEP * told + LAG * (1.0 - KEPT) * (speed - told)
        speed = told + KEPT * (speed - told)
    path, told_in = folder / f"{seed}.csv", folder / f"{seed}.messages.csv"
    _write(path, "time_s reference_m height_m command_m_s vehicle_time_s", rows)
    columns = "time_s vehicle_time_s setpoint_time_s climb_setpoint_m_s height_m climb_m_s"
    _write(told_in, columns, messages)
    recording = read_recording(
        path, time="time_s", reference="reference_m", output="height_m", command="command_m_s"
    )
    return FlownSteps(P(Kp), recording, path, told_in, SAMPLE, SETTLE), float(np.mean(ages))


def _write(path, columns, rows):
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerows([columns.split(), *rows])
