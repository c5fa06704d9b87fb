"""Arguments of Lambert W, and functions that compare its results bit by bit."""

import math

import deadtime as dtm
import mpmath
import numpy as np

EPS = 2.0**-52
# The double next to -1/e; it lies below -1/e by 1.2e-17.
BRANCH_POINT = -0.36787944117144233
# Long enough for the thread pool at any speed of the kernel, and short enough for a test.
LARGE = 60_001


def points(n, seed=0):
    generator = np.random.default_rng(seed)
    return 10 ** generator.uniform(-5, 5, n) * np.exp(2j * np.pi * generator.random(n))


def same_bits(left, right):
    left, right = np.ascontiguousarray(left), np.ascontiguousarray(right)
    return (
        left.dtype == right.dtype
        and left.shape == right.shape
        and left.tobytes() == right.tobytes()
    )


def bits(w):
    return np.ascontiguousarray(w, complex).view(np.uint64)


def log_of(z, prec_zero_side):
    """Principal logarithm at mpmath's precision; the sign of a zero Im decides the side."""
    value = mpmath.log(mpmath.mpc(z))
    if mpmath.im(z) == 0 and mpmath.re(z) < 0:
        return mpmath.mpc(value.real, mpmath.pi * math.copysign(1, prec_zero_side))
    return value


def one_by_one(z, k=0):
    z, k = np.broadcast_arrays(z, k)
    flat = [complex(dtm.lambertw(complex(a), int(b))) for a, b in zip(z.flat, k.flat, strict=True)]
    return np.array(flat, complex).reshape(z.shape)
