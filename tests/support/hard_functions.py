"""Random quasi-polynomials and regions that are hard to count, reproducible from seed and number.

Each case is one of the KINDS below and a rectangle of about 0 to 60 roots. A fifth of the
rectangles have an edge whose distance from a given root is 1e-13 to 0.1 of its modulus. The
resulting floats define the function: expanding a product rounds its coefficients, which separates
multiple roots slightly, and the roots so separated are part of the test.
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class HardFunction:
    """A function, a region whose roots are hard to count, and a line to the right of its chains."""

    number: int
    kind: str
    coefficients: tuple[tuple[float, ...], ...]
    delays: tuple[float, ...]
    re: tuple[float, float]
    im: tuple[float, float]
    line: float | None


def times(first, second):
    """Product of two functions, as maps from delays to ascending coefficients."""
    product = {}
    for t, p in first.items():
        for u, q in second.items():
            row = np.convolve(p, q)
            old = product.get(t + u, np.zeros(1))
            size = max(len(old), len(row))
            product[t + u] = np.pad(old, (0, size - len(old))) + np.pad(row, (0, size - len(row)))
    return product


def plus(first, second):
    both = dict(first)
    for t, q in second.items():
        p = both.get(t, np.zeros(1))
        size = max(len(p), len(q))
        both[t] = np.pad(p, (0, size - len(p))) + np.pad(q, (0, size - len(q)))
    return both


def value(h, z):
    return sum(np.polynomial.polynomial.polyval(z, p) * np.exp(-z * t) for t, p in h.items())


def planted(h, z):
    """`h` less the line through its values at `z` and its conjugate: roots there, nearly."""
    w = value(h, z)
    if z.imag == 0.0:
        line = np.array([w.real])
    else:
        slope = w.imag / z.imag
        line = np.array([w.real - slope * z.real, slope])
    return plus(h, {0.0: -line})


def delays_of(rng, m):
    """0 and m − 1 others: multiples of one, arbitrary, or far apart."""
    how = rng.integers(3)
    unit = 10.0 ** rng.uniform(-1, 1)
    if how == 0:
        taus = unit * rng.choice(np.arange(1, 2 * m + 1), m - 1, replace=False)
    elif how == 1:
        taus = unit * rng.uniform(0.05, 3, m - 1)
    else:
        taus = unit * 10.0 ** rng.uniform(-2, 0.5, m - 1)
    return [0.0, *sorted(float(t) for t in taus)]


def rows_of(rng, m, degree, decades):
    rows = rng.normal(size=(m, degree + 1)) * 10.0 ** rng.uniform(
        -decades / 2, decades / 2, size=(m, degree + 1)
    )
    rows[rng.random(size=rows.shape) < 0.3] = 0.0
    rows[0, -1] = rng.choice([1.0, -1.0]) * 10.0 ** rng.uniform(-1, 1)
    return rows


def neutral_top(rng, rows, most):
    """Leading coefficients of the delayed rows whose moduli add up to at most `most` of row 0's."""
    share = rng.normal(size=len(rows) - 1)
    share *= most * rng.uniform(0.05, 1) / max(np.abs(share).sum(), 1e-9)
    rows[1:, -1] = share * rows[0, -1]


def retarded(rng):
    m, degree = int(rng.integers(1, 7)), int(rng.integers(1, 9))
    rows = rows_of(rng, m, degree, rng.choice([1.0, 3.0]))
    rows[1:, -1] = 0.0
    return dict(zip(delays_of(rng, m), rows, strict=True)), None


def twelve_decades(rng):
    m, degree = int(rng.integers(1, 7)), int(rng.integers(1, 9))
    rows = rows_of(rng, m, degree, 12.0)
    if rng.random() < 0.7:
        rows[1:, -1] = 0.0
    else:
        neutral_top(rng, rows, 0.9)
    return dict(zip(delays_of(rng, m), rows, strict=True)), None


def neutral(rng):
    m, degree = int(rng.integers(2, 7)), int(rng.integers(1, 9))
    rows = rows_of(rng, m, degree, 2.0)
    neutral_top(rng, rows, rng.choice([0.5, 0.99, 1.5]))
    return dict(zip(delays_of(rng, m), rows, strict=True)), None


def difference(rng):
    m = int(rng.integers(2, 7))
    rows = rng.normal(size=(m, 1)) * 10.0 ** rng.uniform(-2, 2, size=(m, 1))
    return dict(zip(delays_of(rng, m), rows, strict=True)), None


def near_multiple(rng):
    """(s−a)(s−a−ε)… times a loop, or plus a small multiple of it."""
    a, h = round(float(rng.normal()), int(rng.integers(0, 4))), {0.0: np.ones(1)}
    for k in range(int(rng.integers(2, 5))):
        eps = float(k and rng.choice([0.0, 1.0]) * 10.0 ** rng.uniform(-10, -1))
        h = times(h, {0.0: np.array([-(a + eps), 1.0])})
    loop = {0.0: np.array([0.0, 1.0]), float(10 ** rng.uniform(-1, 1)): rng.normal(size=1)}
    if rng.random() < 0.5:
        return times(h, loop), complex(a)
    tau, size = float(10 ** rng.uniform(-1, 1)), float(10.0 ** rng.uniform(-12, 0))
    return plus(h, {tau: np.array([size * float(rng.normal())])}), complex(a)


def near_multiple_pair(rng):
    """A pair of complex roots of multiplicity nearly two or three."""
    a, w, h = float(rng.normal()), float(rng.uniform(0.1, 10)), {0.0: np.ones(1)}
    for k in range(int(rng.integers(2, 4))):
        eps = float(k and rng.choice([0.0, 1.0]) * 10.0 ** rng.uniform(-10, -1))
        h = times(h, {0.0: np.array([a * a + (w + eps) ** 2, -2 * a, 1.0])})
    loop = {0.0: np.array([0.5, 1.0]), float(10 ** rng.uniform(-1, 1)): rng.normal(size=1)}
    return times(h, loop), complex(a, w)


def loops_squared(rng):
    """(s + k e^(−sT))² or its cube with a small perturbation, also with k T around 1/e."""
    T = float(10 ** rng.uniform(-1, 1))
    k = float(rng.normal()) if rng.random() < 0.5 else math.exp(-1) / T * (1 + tiny(rng))
    loop = {0.0: np.array([0.0, 1.0]), T: np.array([k])}
    h = loop
    for _ in range(int(rng.integers(0, 3))):
        h = times(h, plus(loop, {0.0: np.array([tiny(rng)])}))
    return h, complex(-1 / T)


def tiny(rng):
    return float(rng.choice([0.0, 1.0, -1.0]) * 10.0 ** rng.uniform(-14, -2))


def on_the_axes(rng):
    """A root at a given point of the real or imaginary axis or the plane, sometimes double."""
    h = [retarded, neutral][rng.integers(2)](rng)[0]
    size = float(10 ** rng.uniform(-1, 1))
    z = [complex(size), complex(-size), complex(0, size), complex(0.3 * size, size)][
        rng.integers(4)
    ]
    if rng.random() < 0.3:
        loop = {0.0: np.array([-z.real, 1.0])}
        if z.imag:
            loop = {0.0: np.array([abs(z) ** 2, -2 * z.real, 1.0])}
        return times(planted(h, z), loop), z
    return planted(h, z), z


def at_zero(rng):
    """Roots at 0, from common powers of s or from terms that cancel."""
    h = [retarded, neutral][rng.integers(2)](rng)[0]
    if rng.random() < 0.5:
        return times(h, {0.0: np.array([0.0] * int(rng.integers(1, 4)) + [1.0])}), 0j
    return planted(h, 0j), 0j


KINDS = {
    kind.__name__: kind
    for kind in (
        retarded,
        twelve_decades,
        neutral,
        difference,
        near_multiple,
        near_multiple_pair,
        loops_squared,
        on_the_axes,
        at_zero,
    )
}


def size_of(h, place):
    """A modulus typical of the roots."""
    taus = [t for t in h if t > 0]
    top = np.trim_zeros(h[min(h)], "b")
    moduli = [abs(z) for z in np.polynomial.polynomial.polyroots(top) if z] if len(top) > 1 else []
    sizes = [1 / t for t in taus] + moduli + ([abs(place)] if place else [])
    return float(np.exp(np.mean(np.log(sizes)))) if sizes else 1.0


def hard_function(seed, number):
    """Case `number` of a seed."""
    rng = np.random.default_rng([seed, number])
    kind = list(KINDS)[rng.integers(len(KINDS))]
    h = {}
    # Adding a root may leave the zero function.
    while not h:
        h, place = KINDS[kind](rng)
        h = {t: p for t, p in h.items() if np.any(p)}
    span = max(h) - min(h)
    size = size_of(h, place)
    width = size * 10.0 ** rng.uniform(-1, 1)
    # Some 60 roots lie along the chains of the longest delay, in a strip 60 · 2π/span high.
    height = min(size * 10.0 ** rng.uniform(-1, 1.5), 190.0 / span if span else math.inf)
    middle = place.real if place is not None and rng.random() < 0.7 else size * rng.normal() / 2
    a = middle - width * rng.uniform(0.05, 1)
    b = middle + width * rng.uniform(0.05, 1)
    if span:
        # Limited to the left, because further left the values at roots are only rounding errors.
        a = max(a, -30.0 / span)
        b = max(b, a + 0.1 * width)
    d = height * rng.uniform(0.3, 1)
    c = [-d, 0.0, -height * rng.uniform(0.01, 1), d * rng.uniform(0.01, 0.9)][rng.integers(4)]
    if place is not None and rng.random() < 0.35:
        away = 10.0 ** rng.uniform(-13, -1) * (abs(place) or size) * rng.choice([-1.0, 1.0])
        if place.imag and rng.random() < 0.5:
            d, c = place.imag + away, (-place.imag - away if c == -d else min(c, 0.5 * place.imag))
        elif rng.random() < 0.5:
            a, b = place.real + away, max(b, place.real + away + 0.1 * width)
        else:
            a, b = min(a, place.real + away - 0.1 * width), place.real + away
    line = None
    if kind != "difference":
        line = (place.real if place is not None else 0.0) + size * rng.normal() / 2
        line = max(line, -2.0 / span) if span else line
    delays = sorted(h)
    longest = max(len(p) for p in h.values())
    rows = tuple(tuple(map(float, np.pad(h[t], (0, longest - len(h[t]))))) for t in delays)
    ranges = (float(a), float(b)), (float(c), float(d))
    return HardFunction(
        number, kind, rows, tuple(delays), *ranges, None if line is None else float(line)
    )
