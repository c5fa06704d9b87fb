"""Random transfer functions, loops with margins, and bounds on the rounding of their values."""

import deadtime as dtm
import numpy as np
from deadtime import TransferFunction, delay, s
from hypothesis import assume, strategies as st

numbers = st.floats(-5, 5, allow_subnormal=False).map(lambda x: round(x, 3))
times = st.floats(0, 2, allow_subnormal=False).map(lambda x: round(x, 3))
# Not so close to 0 that powers underflow; 0 itself is included.
points = st.complex_numbers(max_magnitude=3, allow_subnormal=False).filter(
    lambda z: z == 0 or abs(z) > 1e-50
)


@st.composite
def quasi_polynomials(draw, rows=3, degree=2):
    m, d = draw(st.integers(1, rows)), draw(st.integers(0, degree))
    row = st.lists(numbers, min_size=d + 1, max_size=d + 1)
    return dtm.QuasiPolynomial(
        draw(st.lists(row, min_size=m, max_size=m)), draw(st.lists(times, min_size=m, max_size=m))
    )


@st.composite
def transfer_functions(draw):
    den = draw(quasi_polynomials())
    assume(den.coefficients.any())
    return TransferFunction(draw(quasi_polynomials()), den)


def terms(h, z):
    """Sum of the moduli of the terms of h, the scale of its rounding error."""
    powers = abs(z) ** np.arange(h.degree + 1)
    return float(np.exp(-z.real * h.delays) @ (np.abs(h.coefficients) @ powers))


def error(G, z):
    """Bound on the rounding error of G(z), for few terms and low powers."""
    n, d = abs(G.num(z)), abs(G.den(z))
    return 1e-13 * (terms(G.num, z) + n / d * terms(G.den, z)) / d


def close(value, wanted, *systems, z):
    return abs(value - wanted) <= sum(error(G, z) for G in systems)


LOOPS = [
    2.0 / s * delay(0.36),
    3.0 / (s + 0.7) * delay(0.4),
    (2 + 0.3 * s) * delay(0.36) / s,
    (2 * delay(0.3) + delay(1.1)) / (s + 0.5 * s * delay(0.7)) * 0.2,
    1.5 * (s + 1) / (s * (s**2 + 0.5 * s + 9)) * delay(0.05),
    4 * (s**2 + 0.02 * s + 1) / (s * (s + 1) * (s + 2)) * (1 + 0.5 * delay(2.0)) * 0.4,
    (1 + 0.4 * s) * delay(0.2) / (s * (s + 1 + 0.3 * delay(1.5))),
    0.9 * (s + 0.2) / (s + 2) * delay(0.5),
    5.0 / (s + 1) ** 3,
    # Three crossings; the last has the least delay.
    2.0 / s + 0.5 * s / (s**2 + 0.05 * s + 25),
]
