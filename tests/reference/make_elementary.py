"""Write elementary.txt: values of exp, sin, cos, log and atan2 for the tests of the Rust core.

Each line holds a name, the arguments, and the value as the sum of two doubles, all as bits in
hexadecimal. Computed with mpmath at 1500 bits. Hard cases of sine and cosine: for every 24th
binary exponent the doubles that come closest to a multiple of pi/2, found by the continued
fraction of the ratio.
"""

import random
import struct
from pathlib import Path

import mpmath as mp

mp.mp.prec = 1500


def bits(x):
    return struct.pack(">d", x).hex()


def pair(value):
    high = float(value)
    return bits(high), bits(float(value - mp.mpf(high)))


def close_to_quarter_turns():
    for exponent in range(-40, 972, 24):
        ratio = mp.mpf(2) ** exponent * 2 / mp.pi
        rest, before, now = ratio, 0, 1
        best = []
        for _ in range(200):
            part = rest - mp.floor(rest)
            if part == 0:
                break
            rest = 1 / part
            before, now = now, int(mp.floor(rest)) * now + before
            if now >= 2**53:
                break
            best.append(now)
        for m in best[-2:]:
            yield float(mp.mpf(m) * mp.mpf(2) ** exponent)


def lines():
    rng = random.Random(20261121)
    circular = list(close_to_quarter_turns())
    circular += [rng.uniform(-r, r) for r in (0.05, 1, 7, 1e3, 1e6, 2e6, 1e10) for _ in range(30)]
    circular += [rng.uniform(1, 2) * 2.0 ** rng.randrange(-60, 1023) for _ in range(150)]
    circular += [float(mp.pi / 64 * k) for k in range(-70, 71, 3)]
    for x in circular:
        yield "sin", (x,), mp.sin(mp.mpf(x))
        yield "cos", (x,), mp.cos(mp.mpf(x))
    exponents = [rng.uniform(-r, r) for r in (1e-3, 0.05, 1, 30, 705) for _ in range(60)]
    exponents += [float(mp.log(2) / 64 * k) for k in range(-67, 67, 2)]
    exponents += [709.78, 709.7827128933839, -708.4, -720.123, -744.9, -745.13, 1e-300, -1e-17]
    for x in exponents:
        yield "exp", (x,), mp.exp(mp.mpf(x))
    positive = [2.0 ** rng.uniform(-1074, 1023) for _ in range(60)]
    positive += [rng.uniform(0.6, 1.6) for _ in range(60)] + [1 + 2.0**-52, 1 - 2.0**-53, 5e-324]
    for x in positive:
        yield "log", (x,), mp.log(mp.mpf(x))
    for _ in range(150):
        y, x = (rng.choice((-1, 1)) * 2.0 ** rng.uniform(-12, 12) for _ in range(2))
        yield "angle", (y, x), mp.atan2(mp.mpf(y), mp.mpf(x))


if __name__ == "__main__":
    text = "".join(
        " ".join((name, *map(bits, arguments), *pair(value))) + "\n"
        for name, arguments, value in lines()
    )
    (Path(__file__).parent / "elementary.txt").write_text(text, encoding="ascii")
