"""Roots along chains: tall regions against the search without chains, mpmath and Lambert W."""

import math
import os
import subprocess
import sys

import deadtime as dtm
import mpmath
import numpy as np
import pytest
from deadtime import QuasiPolynomial, delay, s
from deadtime._base.errors import ContourError
from hypothesis import assume, given, settings, strategies as st

# Fewer roots than this are found without the laws of chains.
FEW = 60

SYSTEMS = {
    "scalar": s + 2.0 * delay(0.36),
    "scalar, large delay": s + 2e-4 * delay(3.6e3),
    "scalar, small delay": s + 2e6 * delay(3.6e-7),
    "double integrator": s**2 + (3.0 * s + 1.0) * delay(0.8),
    "second order": (s + 1.0) * (s + 3.0) + (0.5 * s - 7.0) * delay(1.3),
    "neutral": s + (2.0 + 0.3 * s) * delay(0.36),
    "neutral, unstable chain": s + (2.0 + 1.3 * s) * delay(0.36) + 1.0,
    "neutral of second order": s**2 + 1.0 + (0.4 * s**2 - 2.0 * s) * delay(1.0),
    "late": (s + 1.0) * delay(0.3) + 2.0 * delay(1.0),
    "advanced": 1.0 + s**2 * delay(0.5),
    "three delays": s**2 + 0.5 * s * delay(0.7) + 2.0 * delay(1.1) - delay(0.4),
    "two bends": s**3 + s**2 * delay(1.0) + 5.0 * delay(1.7),
    "edge of slope": s**2 + 0.5 * s * delay(1.0) + 3.0 * delay(2.0),
    "two neutral chains": s**2 * (1.0 - 0.75 * delay(1.0) + 0.5 * delay(2.0)) + s + 1.0,
    "no common base": s * (1.0 + 0.4 * delay(1.0) + 0.3 * delay(math.sqrt(2))) + 1.0,
    "a chain of double roots": (s + delay(1.0)) ** 2,
    # The laws lead to some of its roots only.
    "slow convergence": QuasiPolynomial(
        [
            [1.888, -1.407, -1.844, -0.795],
            [-2.904, -0.370, -2.716, -0.4596],
            [-1.695, -1.023, -2.248, 0.0],
            [1.127, -0.966, 2.563, 0.0],
        ],
        [0.0, 0.16475619, 0.95274465, 2.31616552],
    ),
}


def box(h):
    """Ranges of real and imaginary parts with some hundreds of roots."""
    span = float(h.delays[-1] - h.delays[0])
    re = (-20.0 / span, 6.0 / span) if h.kind != "advanced" else (-4.0 / span, 25.0 / span)
    return re, 700.0 / span


def by_height(found):
    return np.lexsort((found.roots.real, found.roots.imag))


def in_slices(h, re, high):
    """Roots and radii of the upper half plane up to `high`, from regions with few roots each."""
    roots, radii = [], []
    low, height = 0.0, min(high, 100.0 / float(h.delays[-1] - h.delays[0]))
    edge = low
    while edge < high:
        top = min(high, edge + height)
        for share in (1.0, 0.97, 0.94, 0.91, 0.88, 0.83):
            upper = top if top == high else edge + share * height
            try:
                found = h.roots(re=re, im=(edge, upper))
            except ContourError:
                continue
            break
        assert found.counted < FEW
        order = by_height(found)
        roots.append(np.repeat(found.roots[order], found.multiplicities[order]))
        radii.append(np.repeat(found.radii[order], found.multiplicities[order]))
        edge = upper
    return np.concatenate(roots), np.concatenate(radii)


def compare(h, re, high):
    """The number of roots in the whole region, which are those of its slices."""
    whole = h.roots(re=re, im=(0.0, high))
    order = by_height(whole)
    number = whole.multiplicities[order]
    roots, radii = in_slices(h, re, high)
    assert whole.multiplicities.sum() == whole.counted == len(roots)
    found, around = np.repeat(whole.roots[order], number), np.repeat(whole.radii[order], number)
    apart = np.abs(found[:, None] - roots[None, :])
    allowed = around[:, None] + radii[None, :]
    # Each root of one list is one of the other.
    met = apart <= allowed
    assert met.any(axis=0).all()
    assert met.any(axis=1).all()
    return whole


def check_discs(found):
    """Disjoint discs."""
    order = np.argsort(found.roots.imag)
    z, r = found.roots[order], found.radii[order]
    for ahead in range(1, min(6, len(z))):
        assert (np.abs(z[ahead:] - z[:-ahead]) > r[ahead:] + r[:-ahead]).all()


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_tall_region_holds_the_roots_of_its_slices(name):
    h = SYSTEMS[name]
    found = compare(h, *box(h))
    assert found.counted > 64
    check_discs(found)
    re, high = box(h)
    inside = (found.roots.real > re[0]) & (found.roots.real < re[1])
    assert (inside & (found.roots.imag >= 0) & (found.roots.imag < high)).all()


def polished(h, z):
    """The root next to z at 50 digits."""
    terms = [
        ([mpmath.mpf(float(c)) for c in row], mpmath.mpf(float(tau)))
        for row, tau in zip(h.coefficients, h.delays, strict=True)
    ]

    def value(x):
        return sum(
            sum(c * x**k for k, c in enumerate(row)) * mpmath.exp(-tau * x) for row, tau in terms
        )

    with mpmath.workdps(50):
        return mpmath.findroot(value, mpmath.mpc(z), tol=1e-70, maxsteps=40, verify=False)


@pytest.mark.parametrize("name", sorted(set(SYSTEMS) - {"a chain of double roots"}))
def test_the_discs_hold_the_roots_that_mpmath_finds(name):
    h = SYSTEMS[name]
    re, high = box(h)
    found = h.roots(re=re, im=(0.0, high))
    for index in range(0, len(found), max(1, len(found) // 12)):
        z, radius = found[index], float(found.radii[index])
        assert found.multiplicities[index] == 1
        with mpmath.workdps(50):
            assert abs(polished(h, z) - mpmath.mpc(z)) <= radius
        assert radius <= 1e-12 * abs(z)


def test_a_hundred_thousand_roots_are_the_branches_of_lambert_w():
    number = 100_000
    high = 2 * math.pi * number
    found = (s + delay(1.0)).roots(re=(-20, 2), im=(0, high))
    branches = np.arange(number + 2)
    exact = dtm.lambertw(-np.ones(len(branches)), branches)
    exact = exact[(exact.imag >= 0) & (exact.imag < high)]
    assert len(found) == found.counted == len(exact)
    order = np.argsort(found.roots.imag)
    error = np.abs(found.roots[order] - exact[np.argsort(exact.imag)])
    # The error of each part of W is half an ulp.
    assert (error <= found.radii[order] + 2.0**-52 * np.abs(found.roots[order])).all()
    assert (np.diff(found.roots.real) <= 0).all()
    assert found.radii.max() < 1e-14 * high


def test_both_halves_of_a_region_have_the_same_roots():
    h = SYSTEMS["second order"]
    re, high = box(h)
    both, upper = h.roots(re=re, im=(-high, high)), h.roots(re=re, im=(0, high))
    lower = h.roots(re=re, im=(-high, 0))
    assert set(both) == set(upper) | set(lower)
    assert set(lower) == {z.conjugate() for z in upper}
    part = h.roots(re=re, im=(0.3 * high, high))
    assert set(part) == {z for z in upper if z.imag > 0.3 * high}


def test_a_chain_that_leaves_the_region_is_followed_as_far():
    h = s + 2.0 * delay(0.36)
    short = h.roots(re=(-20, 2), im=(0, 50_000))
    tall = h.roots(re=(-30, 2), im=(0, 50_000))
    assert short.counted == np.count_nonzero(tall.roots.real > -20)
    far = short.roots[short.roots.imag > 150]
    assert len(far) > 100
    assert set(far) <= set(tall)


@st.composite
def systems(draw):
    """Two to four rows, of any kind, over twelve decades of time."""
    thousandths = st.integers(-3000, 3000).map(lambda n: n / 1000)
    degree = draw(st.integers(1, 3))
    rows = draw(st.integers(2, 4))
    coefficients = np.array([[draw(thousandths) for _ in range(degree + 1)] for _ in range(rows)])
    kind = draw(st.sampled_from(["retarded", "neutral", "advanced", "any"]))
    if kind == "retarded":
        coefficients[1:, -1] = 0.0
    elif kind == "neutral":
        coefficients[1:, -1] *= 0.3
    elif kind == "advanced":
        coefficients[0, -1] = 0.0
    assume(np.all(coefficients[:, 0] != 0) and np.any(coefficients[0, 1:]))
    if draw(st.booleans()):
        delays = np.arange(rows) * draw(st.floats(0.1, 2.0))
    else:
        delays = np.cumsum([0.0] + [draw(st.floats(0.05, 2.0)) for _ in range(rows - 1)])
    unit = 10.0 ** draw(st.integers(-6, 6))
    return QuasiPolynomial(coefficients * unit ** np.arange(degree + 1), delays * unit)


@settings(deadline=None, max_examples=40)
@given(systems())
def test_random_tall_regions(h):
    span = float(h.delays[-1])
    re, high = (-6.0 / span, 3.0 / span), 400.0 / span
    try:
        h.roots(re=re, im=(0.0, high))
        check_discs(compare(h, re, high))
    except (ContourError, UnboundLocalError, dtm.CountMismatchError):
        assume(False)


SCRIPT = """
import hashlib
from deadtime import delay, s
systems = [s + delay(1.0), s + (2.0 + 0.3 * s) * delay(0.36),
           s**2 + 0.5 * s * delay(0.7) + 2.0 * delay(1.1) - delay(0.4)]
digest = hashlib.sha256()
for h in systems:
    found = h.roots(re=(-9, 4), im=(-900, 900))
    digest.update(found.roots.tobytes() + found.radii.tobytes())
print(digest.hexdigest())
"""


def test_instruction_sets_agree_to_the_bit():
    def run(name):
        return subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env=os.environ | {"DEADTIME_INSTRUCTIONS": name},
            capture_output=True,
            check=True,
        ).stdout

    assert run("plain") == run("avx2") == run("avx512") != b""
