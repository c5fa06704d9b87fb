"""Records of processes and vehicles, simulated in small steps, with what a loop feels of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

# Small steps a row, and in the delay.
STEPS = 8
SHARES = 4


@dataclass(frozen=True)
class Made:
    """A record, the numbers of its plant, and whether a controller made its command."""

    time: np.ndarray
    command: np.ndarray
    output: np.ndarray
    num: tuple
    den: tuple
    delay: float
    in_loop: bool

    @property
    def integrates(self):
        return self.den[-1] == 0.0

    def response(self, omega):
        s = 1j * np.asarray(omega)
        return np.polyval(self.num, s) / np.polyval(self.den, s) * np.exp(-s * self.delay)

    def phase(self, omega):
        """The phase without jumps, of a positive gain."""
        grid = np.geomspace(1e-4, 1.0, 40_000) * 40.0 / self.delay
        turns = np.unwrap(np.angle(self.response(grid) * np.sign(self.num[-1])))
        start = -np.pi / 2 if self.integrates else 0.0
        turns -= 2 * np.pi * np.round((turns[0] - start) / (2 * np.pi))
        return np.interp(omega, grid, turns), grid, turns

    @property
    def largest_gain(self):
        _, grid, turns = self.phase(1.0)
        turn = np.interp(np.pi, -turns, grid)
        return np.sign(self.num[-1]) / abs(self.response(turn))


def simulated(num, den, delay, time_step, rows, command, noise, in_loop):
    """A record of a plant from rest; `command(row, outputs)` gives the command of a row."""
    steps = max(STEPS, int(np.ceil(SHARES * time_step / delay)))
    step = time_step / steps
    late = round(delay / step)
    a, b, c, _ = signal.tf2ss(num, den)
    ahead, into, *_ = signal.cont2discrete((a, b, c, [[0.0]]), step)
    state = np.zeros((len(a), 1))
    arriving = np.zeros(rows * steps + late + 1)
    u, y = np.zeros(rows), np.zeros(rows)
    for row in range(rows):
        y[row] = (c @ state).item() + noise[row]
        u[row] = command(row, y)
        arriving[late + row * steps : late + (row + 1) * steps] = u[row]
        for small in range(row * steps, (row + 1) * steps):
            state = ahead @ state + into * arriving[small]
    time = np.arange(rows) * time_step
    return Made(time, u, y, tuple(num), tuple(den), late * step, in_loop)


def coloured(random, rows, deviation, correlation):
    """White noise, or in two of five records one with a correlation."""
    own = random.normal(0.0, deviation, rows)
    if random.random() >= 0.4:
        return own
    white = random.normal(0.0, deviation, rows + 200)
    return own + signal.lfilter([1.0 - correlation], [1.0, -correlation], white)[200:]


def process(random):
    lag = np.exp(random.uniform(np.log(5.0), np.log(60.0)))
    delay = lag * random.uniform(0.15, 0.8)
    gain = random.uniform(0.5, 3.0)
    second = lag * random.uniform(0.1, 0.5) if random.random() < 0.5 else 0.0
    den = np.polymul([lag, 1.0], [second, 1.0]) if second else [lag, 1.0]
    return gain, den, delay, lag


def bump_test(seed):
    """Two steps of a process that comes to rest, from rest."""
    random = np.random.default_rng([seed, 1])
    gain, den, delay, lag = process(random)
    gain *= random.choice([-1.0, 1.0])
    rows = 400
    first, second = int(random.uniform(32, 60)), int(random.uniform(200, 240))
    noise = coloured(random, rows, abs(gain) * random.uniform(0.05, 0.15), 0.8)

    def command(row, _):
        return 0.0 if row < first else 5.0 if row < second else 2.0

    return simulated([gain], den, delay, (lag + delay) / 50, rows, command, noise, False)


def process_loop(seed):
    """A process under PI control, with three changes of the set point."""
    random = np.random.default_rng([seed, 2])
    gain, den, delay, lag = process(random)
    largest = Made(*[np.zeros(1)] * 3, (gain,), tuple(den), delay, True).largest_gain
    kp, reset = largest * random.uniform(0.25, 0.45), (lag + delay) * random.uniform(0.8, 1.5)
    rows, step = 600, (lag + delay) / 40
    setpoint = np.zeros(rows)
    for place, row in enumerate(np.sort(random.integers(30, rows - 100, 3))):
        setpoint[row:] = random.choice([-1, 1]) * random.uniform(5, 10) * (0.3 if place == 1 else 1)
    noise = coloured(random, rows, random.uniform(0.05, 0.3), 0.9)
    integral = 0.0

    def command(row, y):
        nonlocal integral
        error = setpoint[row] - y[row]
        integral += kp / reset * error * step
        return kp * error + integral

    return simulated([gain], den, delay, step, rows, command, noise, True)


def height_steps(seed):
    """A vehicle that integrates its command, some with a servo that follows, under P control."""
    random = np.random.default_rng([seed, 3])
    gain, delay = random.uniform(0.6, 1.2), random.uniform(0.1, 0.4)
    num, den = [gain], [random.uniform(0.1, 0.6), 1.0, 0.0]
    if random.random() < 0.6:
        omega, damping = random.uniform(1.5, 5.0), random.uniform(0.6, 1.2)
        zero = random.uniform(0.3, 1.3) * 2 * damping / omega
        num, den = [gain * zero, gain], [1 / omega**2, 2 * damping / omega, 1.0, 0.0]
    largest = Made(*[np.zeros(1)] * 3, tuple(num), tuple(den), delay, True).largest_gain
    kp, rows = largest * random.uniform(0.2, 0.45), 300
    reference = np.zeros(rows)
    for size, row in zip([1.0, 0.2, 1.5], [17, 115, 205], strict=True):
        reference[row + random.integers(-12, 12) :] = size * random.uniform(0.7, 1.2)
    noise = coloured(random, rows, random.uniform(0.002, 0.008), 0.97)

    def command(row, y):
        return float(np.clip(kp * (reference[row] - y[row]), -1.0, 1.0))

    return simulated(num, den, delay, 0.065, rows, command, noise, True)


def cut(made, first):
    """The rows of a record from one on."""
    rows = {name: getattr(made, name)[first:] for name in ("time", "command", "output")}
    return replace(made, **rows)


def slow_run(seed):
    """A binary sequence of 40 s through e^(−0.3 s)/(5 s + 1)."""
    random = np.random.default_rng(seed)
    signs = np.repeat((-1.0) ** np.arange(100), random.integers(10, 60, 100))
    noise = random.normal(0.0, 0.003, 801)
    return simulated([1.0], [5.0, 1.0], 0.3, 0.05, 801, lambda row, _: signs[row], noise, False)


def slow_window(seed):
    """The last ten seconds of it, cut out, not at rest."""
    return cut(slow_run(seed), 600)


def lone_sine(seed):
    """One sine that ran long before the first row, through a delay and a lag."""
    random = np.random.default_rng(seed)
    omega, lag, rows = random.uniform(0.5, 6.0), random.uniform(0.3, 5.0), 600
    phase, noise = random.uniform(0, 6), random.normal(0.0, 0.003, rows)

    def command(row, _):
        return np.sin(omega * 0.05 * row + phase)

    made = simulated([1.0], [lag, 1.0], 0.3, 0.05, rows, command, noise, False)
    return cut(made, 300)
