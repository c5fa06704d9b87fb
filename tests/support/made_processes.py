"""Records of processes with known numbers, by formulas of their own."""

import numpy as np

#: The process of most records: gain, time constant and dead time in s, noise of the sensor.
GAIN, SLOW, DEAD, NOISE = 1.8, 40.0, 12.0, 0.1


def first_order(time, command, gain=GAIN, slow=SLOW, dead=DEAD, start=0.0):
    """The output of a first-order process to a command that is held between rows, exactly.

    `start` is the output at the first row; the command was that of the first row before it.
    """
    changes = np.flatnonzero(np.diff(command)) + 1
    events = np.concatenate([time[changes] + dead, [np.inf]])
    levels = gain * np.concatenate([command[changes], [0.0]])
    output = np.empty(time.size)
    now, value, target, place = time[0], start, gain * command[0], 0
    for row, moment in enumerate(time):
        while events[place] <= moment:
            value = target + (value - target) * np.exp(-(events[place] - now) / slow)
            now, target, place = events[place], levels[place], place + 1
        value = target + (value - target) * np.exp(-(moment - now) / slow)
        now = moment
        output[row] = value
    return output


def moves(rows, hold, size, rng, start=0.0):
    """A command that moves up or down by `size` at random multiples of `hold` rows."""
    signs = rng.choice([-1.0, 1.0], rows // hold + 1)
    return start + size * np.repeat(signs, hold)[:rows]


def bump(seed=1, rows=300, noise=NOISE):
    """Time, command and output of a valve that moves up, down and up again."""
    rng = np.random.default_rng(seed)
    time = np.arange(float(rows))
    command = np.select([time < 40, time < 120, time < 210], [40.0, 45.0, 38.0], 43.0)
    output = first_order(time, command, start=GAIN * 40.0)
    return time, command, output + rng.normal(0.0, noise, rows)


def loop_with_load(seed=1, rows=500, load=8.0, after=330):
    """Time, reference, output and command of a PI loop whose load steps at a row."""
    rng = np.random.default_rng(seed)
    time = np.arange(float(rows))
    reference = np.select([time < 20, time < 170], [55.0, 63.0], 57.0)
    keep, late = np.exp(-1.0 / SLOW), int(DEAD)
    output, command = np.empty(rows), np.empty(rows)
    level, integral = 55.0, 55.0 / GAIN
    for row in range(rows):
        output[row] = level + rng.normal(0.0, NOISE)
        error = reference[row] - output[row]
        integral += 0.02 * error
        command[row] = error + integral
        acting = command[row - late] if row >= late else 55.0 / GAIN
        acting += load if row >= after else 0.0
        level = keep * level + (1.0 - keep) * GAIN * acting
    return time, reference, output, command


def sine(rows=200, seed=1):
    """One sine that ran before the first row, through a delay of 0.3 s and a lag of 0.5 s."""
    time = 0.05 * np.arange(rows)
    wave = np.exp(1j * 3.0 * time) * np.exp(-0.9j) / (1.0 + 1.5j)
    noise = np.random.default_rng(seed).normal(0.0, 0.003, rows)
    return time, np.cos(3.0 * time), wave.real + noise


def write(path, columns):
    """Write columns by name as CSV; NaN is an empty cell."""
    rows = zip(*columns.values(), strict=True)
    cells = (",".join("" if one != one else str(one) for one in row) for row in rows)
    path.write_text("\n".join([",".join(columns), *cells]) + "\n", encoding="utf-8")
    return path
