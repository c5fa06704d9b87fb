"""The plants, their controllers and what is commanded, with numbers drawn for each run."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, lfilter

from strangers.linear import Array, Linear

#: A number with the share by which it is drawn around it.
Around = tuple[float, float]

#: Share of the record in which nothing is commanded yet.
REST = 0.05

#: Time in which a stick moves, s.
STICK = 0.03


@dataclass(frozen=True)
class Kind:
    """A kind of plant with its experiment; times in s.

    Attributes
    ----------
    parts : int
        Steps of the simulation in a row.
    numbers : mapping
        ``gain``, ``delay``, ``lag_1``, ``zero_1``, ``pole_1``, ``damping_1`` and so on.
    controller : {"P", "PI", "open"}
    share : (float, float)
        Ends of Kp as a share of the largest stable gain.
    hold, move : (float, float)
        Ends of the times between steps, and of their size, in units of the set point or command.
    at : (float, float)
        Command and output at the start.
    limit : float
        Largest change of the command from the start.
    family : bool
        Whether the estimator knows such plants.
    filtered : bool
        Whether the last pair of poles is a known filter of the sensor, which the noise passes.
    """

    name: str
    numbers: Mapping[str, Around]
    dt: Around
    noise: Around
    rows: int
    parts: int
    controller: str
    hold: tuple[float, float]
    move: tuple[float, float]
    share: tuple[float, float] = (0.3, 0.5)
    at: tuple[float, float] = (0.0, 0.0)
    limit: float = 1.0
    integrators: int = 0
    family: bool = True
    filtered: bool = False

    @property
    def swing(self) -> float:
        """The size of usual commands, which that of some faults is a share of."""
        return self.move[1] if self.controller != "P" and not self.filtered else self.limit


KINDS = {
    kind.name: kind
    for kind in (
        Kind(
            "height lag",
            {"gain": (0.85, 0.3), "delay": (0.3, 0.4), "lag_1": (0.2, 0.5)},
            *((0.0585, 0.14), (0.005, 0.5), 320, 8, "P", (2.0, 4.5), (0.5, 1.5)),
            integrators=1,
        ),
        Kind(
            "height servo",
            {
                "gain": (0.69, 0.3),
                "delay": (0.13, 0.5),
                "zero_1": (1.3, 0.3),
                "pole_1": (1.67, 0.3),
                "damping_1": (1.0, 0.3),
            },
            *((0.0585, 0.14), (0.004, 0.5), 400, 8, "P", (2.0, 5.0), (0.5, 1.5)),
            integrators=1,
        ),
        Kind(
            "height limits",
            {
                "gain": (1.0, 0.3),
                "delay": (0.25, 0.4),
                "lag_1": (0.2, 0.3),
                "acceleration": (2.0, 0.4),
            },
            *((0.0585, 0.14), (0.005, 0.5), 320, 5, "P", (2.0, 4.5), (0.5, 1.5)),
            integrators=1,
        ),
        Kind(
            "rate loop",
            {
                "gain": (50.0, 0.4),
                "delay": (0.005, 0.4),
                "lag_1": (0.03, 0.4),
                "pole_1": (2.0 * np.pi * 80.0, 0.3),
                "damping_1": (np.sqrt(0.5), 0.0),
            },
            *((0.001, 0.0), (0.02, 0.5), 1500, 2, "PI", (0.08, 0.25), (0.5, 2.0)),
            integrators=1,
            filtered=True,
        ),
        Kind(
            "process PI",
            {"gain": (1.8, 0.4), "delay": (12.0, 0.4), "lag_1": (40.0, 0.4)},
            *((1.0, 0.0), (0.1, 0.5), 500, 3, "PI", (70.0, 150.0), (4.0, 9.0)),
            at=(40.0, 60.0),
            share=(0.2, 0.4),
            limit=40.0,
        ),
        Kind(
            "open steps",
            {"gain": (1.8, 0.4), "delay": (10.0, 0.4), "lag_1": (40.0, 0.3), "lag_2": (12.0, 0.4)},
            *((1.0, 0.0), (0.1, 0.5), 500, 3, "open", (50.0, 140.0), (3.0, 6.0)),
            at=(40.0, 60.0),
        ),
        Kind(
            "lightly damped",
            {
                "gain": (1.0, 0.4),
                "delay": (0.3, 0.4),
                "pole_1": (3.0, 0.3),
                "damping_1": (0.2, 0.4),
            },
            *((0.08, 0.3), (0.02, 0.5), 360, 8, "open", (1.5, 5.0), (0.6, 1.2)),
        ),
        Kind(
            "internet loop",
            {"gain": (1.0, 0.3), "delay": (0.7, 0.4)},
            *((0.15, 0.3), (0.005, 0.5), 300, 4, "P", (5.0, 9.0), (0.5, 1.5)),
            integrators=1,
            limit=2.0,
        ),
        Kind(
            "third order",
            {
                "gain": (2.0, 0.4),
                "delay": (5.0, 0.4),
                "lag_1": (22.0, 0.3),
                "lag_2": (15.0, 0.3),
                "lag_3": (10.0, 0.3),
            },
            *((1.0, 0.0), (0.05, 0.5), 500, 3, "open", (50.0, 140.0), (3.0, 6.0)),
            at=(40.0, 60.0),
            family=False,
        ),
        Kind(
            "two zeros",
            {
                "gain": (1.5, 0.4),
                "delay": (4.0, 0.4),
                "lag_1": (25.0, 0.3),
                "lag_2": (15.0, 0.3),
                "lag_3": (8.0, 0.3),
                "zero_1": (-8.0, 0.4),
                "zero_2": (-5.0, 0.4),
            },
            *((1.0, 0.0), (0.05, 0.5), 500, 3, "open", (50.0, 140.0), (3.0, 6.0)),
            at=(40.0, 60.0),
            family=False,
        ),
    )
}


@dataclass(frozen=True)
class Runs:
    """What is drawn for runs of one kind, apart from faults.

    Attributes
    ----------
    dt, deviation, Kp, Ki : ndarray, shape (runs,)
        Ki in 1/s, the integral part of the command.
    reference, noise : ndarray, shape (runs, rows)
        Set points, or commands where nothing controls.
    names : list of str
        From which the numbers of each run are drawn.
    """

    kind: Kind
    linear: Linear
    dt: Array
    deviation: Array
    Kp: Array
    Ki: Array
    reference: Array
    noise: Array
    names: list[str]

    def __len__(self) -> int:
        return len(self.linear)

    @property
    def quiet(self) -> Runs:
        """The same without noise."""
        return replace(self, noise=np.zeros_like(self.noise))

    def commanded_again(self, time: int) -> Runs:
        """The same plants and controllers, without noise, with other commands of the same kind."""
        reference = [
            commands(self.kind, self.dt[i], self._random(i, time)) for i in range(len(self))
        ]
        return replace(self.quiet, reference=np.array(reference))

    def _random(self, run: int, time: int) -> np.random.Generator:
        return random_of(self.names[run], "commands", str(time))


def random_of(*names: str) -> np.random.Generator:
    """Random numbers that depend on these names alone."""
    return np.random.default_rng([zlib.crc32(name.encode()) for name in names])


def drawn(kind: Kind, names: list[str]) -> Runs:
    """Runs with these names, each of which draws its own numbers."""
    each = [_numbers(kind, random_of(name, "numbers")) for name in names]
    columns = {name: np.array([one[name] for one in each]) for name in each[0]}
    linear = _linear(kind, columns)
    dt = columns["dt"]
    held = replace(linear.without_limit, delay=linear.delay + 0.5 * dt)
    Kp = columns["share"] * np.exp(held.turns()[1])
    slowest = linear.lags.max(axis=1, initial=0.0) * (10.0 if kind.filtered else 1.0)
    Ki = Kp / (slowest * columns["integral"]) if kind.controller == "PI" else 0.0 * Kp
    reference = [
        commands(kind, step, random_of(name, "commands", "0"))
        for name, step in zip(names, dt, strict=True)
    ]
    noise = np.array([random_of(name, "noise").standard_normal(kind.rows) for name in names])
    if kind.filtered:
        for i, row in enumerate(noise):
            b, a = butter(2, linear.pairs[i, 0] / (2.0 * np.pi), fs=1.0 / dt[i])
            noise[i] = lfilter(b, a, row)
    noise = noise * columns["noise"][:, None]
    return Runs(kind, linear, dt, columns["noise"], Kp, Ki, np.array(reference), noise, names)


def _numbers(kind: Kind, random: np.random.Generator) -> dict[str, float]:
    """Numbers of one run."""
    around = {**kind.numbers, "dt": kind.dt, "noise": kind.noise}
    found = {
        name: middle * random.uniform(1.0 - share, 1.0 + share)
        for name, (middle, share) in around.items()
    }
    return found | {"share": random.uniform(*kind.share), "integral": random.uniform(0.8, 1.3)}


def _linear(kind: Kind, columns: Mapping[str, Array]) -> Linear:
    runs = columns["gain"].size

    def block(*names: str) -> Array:
        places = [str(i) for i in range(1, 4) if f"{names[0]}_{i}" in columns]
        found = [columns[f"{name}_{place}"] for place in places for name in names]
        return np.stack(found, axis=1) if found else np.zeros((runs, 0))

    return Linear(
        columns["gain"],
        columns["delay"],
        block("lag"),
        block("zero"),
        block("pole", "damping"),
        kind.integrators,
        columns.get("acceleration", np.full(runs, np.inf)),
    )


def commands(kind: Kind, dt: float, random: np.random.Generator) -> Array:
    """Steps at uneven times, up and down around the start."""
    rows = kind.rows
    out = np.zeros(rows)
    row, level = round(REST * rows * random.uniform(0.6, 1.6)), 0.0
    while row < rows:
        jump = random.uniform(*kind.move)
        away = level != 0.0 and random.random() < 0.8
        level += -np.sign(level) * jump if away else random.choice([-1.0, 1.0]) * jump
        level = float(np.clip(level, -1.2 * kind.move[1], 1.2 * kind.move[1]))
        out[row:] = level
        row += max(2, round(random.uniform(*kind.hold) / dt))
    if kind.filtered:
        keep = np.exp(-dt / STICK)
        out = np.asarray(lfilter([1.0 - keep], [1.0, -keep], out))
    return out + kind.at[0 if kind.controller == "open" else 1]
