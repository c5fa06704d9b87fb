"""Matrix systems with repeated and nearly repeated roots, which are known exactly.

M(s) = T (s I − J_0 − J_1 e^(−sτ)) T⁻¹ with triangular J and an integer T of determinant 1: all
entries are exact, and the roots are those of s = a_i + c_i e^(−sτ), from Lambert's W in mpmath.
"""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from deadtime import ContourError, CountMismatchError, DelaySystem

KINDS = ("diagonal", "chain of states", "chain of delayed states", "nearly repeated")
FORMS = ("triangular", "permuted", "dense")


def root(a, c, tau, k=0):
    """The root of branch k, 50 digits."""
    with mpmath.workdps(50):
        a, c, tau = (mpmath.mpf(float(x)) for x in (a, c, tau))
        return a + mpmath.lambertw(c * tau * mpmath.exp(-a * tau), k) / tau


def dyadic(x, bits=20):
    return round(x * 2.0**bits) / 2.0**bits


def placed(c, tau, target):
    """The number a for which the real part of the root of branch 0 is next to `target`."""
    low, high = -20.0, 20.0
    while (a := 0.5 * (low + high)) not in (low, high):
        low, high = (a, high) if root(a, c, tau).real < target else (low, a)
    return low


def unimodular(rng, n):
    """An integer matrix and its inverse, both with small entries."""
    T, inverse = np.eye(n), np.eye(n)
    for _ in range(n):
        i, j = rng.choice(n, 2, replace=False)
        factor = float(rng.choice([-1, 1]))
        T[:, j] += factor * T[:, i]
        inverse[i] -= factor * inverse[j]
    assert np.array_equal(T @ inverse, np.eye(n))
    return T, inverse


def drawn(seed, largest=20):
    """A system, its coefficients on the diagonal, its delay, its form and the condition of T."""
    rng = np.random.default_rng(seed)
    n, kind, form = int(rng.integers(2, largest + 1)), rng.choice(KINDS), rng.choice(FORMS)
    c, tau = dyadic(rng.uniform(-2, 2)), dyadic(rng.uniform(0.1, 1.0))
    # The rightmost root is placed next to the axis, on either side.
    a = dyadic(placed(c, tau, rng.choice([-1, 1]) * 10.0 ** rng.uniform(-13, -0.3)), 44)
    own = np.full(n, a)
    if kind == "nearly repeated":
        own += rng.integers(-3, 4, size=n) * 2.0 ** -float(rng.integers(20, 41))
    J0, J1 = np.diag(own), c * np.eye(n)
    if kind in ("chain of states", "nearly repeated"):
        J0 += np.diag(np.ones(n - 1), 1)
    elif kind == "chain of delayed states":
        J1 += np.diag(np.ones(n - 1), 1)
    condition = 1.0
    if form == "permuted":
        order = rng.permutation(n)
        J0, J1 = J0[np.ix_(order, order)], J1[np.ix_(order, order)]
    elif form == "dense":
        T, inverse = unimodular(rng, n)
        exact = [T.astype(object) @ J.astype(object) @ inverse.astype(object) for J in (J0, J1)]
        J0, J1 = (J.astype(float) for J in exact)
        condition = np.linalg.norm(T, 2) * np.linalg.norm(inverse, 2)
    return DelaySystem({0.0: J0, tau: J1}), own, c, tau, str(form), float(condition)


def judge(seed, largest=20):
    """Check all answers; give whether the stability was decided, and whether it had to be."""
    system, own, c, tau, form, condition = drawn(seed, largest)
    real = [root(a, c, tau).real for a in own]
    stable, least = max(real) < 0, min(abs(float(x)) for x in real)
    n = len(own)
    try:
        answer: bool | None = system.is_stable()
    except (ValueError, CountMismatchError):
        answer = None
    assert stable or not answer, seed
    must = form != "dense" or least > 3.0 * (1e-12 * condition**2) ** (1.0 / n)
    try:
        found = system.rightmost()
    except (ValueError, CountMismatchError, ContourError):
        assert form == "dense", seed
        return answer == stable, must
    truth = [s for a in own for s in (root(a, c, tau), root(a, c, tau, -1))]
    right = [s for s in truth if s.real > found.region[0][0]]
    for center, radius, number in zip(found.roots, found.radii, found.multiplicities, strict=True):
        inside = sum(abs(s - complex(center)) <= radius for s in right)
        assert inside == number, (seed, center, inside, number)
    return answer == stable, must


def check(seeds, largest):
    for seed in seeds:
        decided, must = judge(seed, largest)
        assert decided or not must, seed


def test_repeated_roots_are_never_wrong_and_decided_where_the_matrices_decide():
    check(range(6), largest=4)


@pytest.mark.survey
@pytest.mark.parametrize("count", [20, pytest.param(300, marks=pytest.mark.long)])
def test_many_systems_with_repeated_roots_are_never_wrong(count):
    check(range(24, 24 + count), largest=20)


def test_decoupled_equal_states_have_one_double_root():
    """Two simple roots were "proved", 2e-8 away from the double one."""
    found = DelaySystem({0.36: -2.1 * np.eye(2)}).poles(re=(-5, 0), im=(0, 10))
    assert found.multiplicities.tolist() == [2]
    assert bool(found.resolved.all())
    truth = complex(root(0.0, -2.1, 0.36))
    assert abs(found.roots[0] - truth) <= found.radii[0] + 1e-15 < 1e-13


@pytest.mark.parametrize("n", [2, 3, 5])
def test_stable_copies_of_a_state_are_stable(n):
    """Of 120 such systems, 34 stable ones were called unstable."""
    for exponent in range(-14, -1):
        c, tau = dyadic(-0.8), 0.5
        a = placed(c, tau, -(10.0**exponent))
        assert root(a, c, tau).real < 0
        system = DelaySystem({0.0: a * np.eye(n), tau: c * np.eye(n)})
        assert system.is_stable()
        assert system.spectral_abscissa() == pytest.approx(float(root(a, c, tau).real), abs=1e-15)


@pytest.mark.parametrize("n", [4, 12, 40])
def test_a_platoon_of_identical_lags_is_decided(n):
    """These were refused from four states on, or never ended."""
    late = -1.3 * np.eye(n) + np.diag(np.ones(n - 1), -1)
    system = DelaySystem({0.0: -0.5 * np.eye(n), 0.7: late})
    truth = root(-0.5, -1.3, 0.7)
    assert system.is_stable()
    assert system.rightmost().multiplicities.tolist() == [n, n]
    assert system.spectral_abscissa() == pytest.approx(float(truth.real), abs=1e-14)
    assert system.count(re=(-2, 0), im=(0, 5)) == n


def test_blocks_with_a_common_root_share_a_disc():
    """Different blocks with the same root: one disc, which holds both."""
    block = np.array([[0.0, 1.0], [-4.0, -0.4]])
    # The same oscillator in other coordinates, coupled one way.
    other = np.array([[-0.4, 4.0], [-1.0, 0.0]])
    A = np.block([[block, np.ones((2, 2))], [np.zeros((2, 2)), other]])
    found = DelaySystem({0.0: A, 0.3: np.zeros((4, 4))}).rightmost()
    assert found.multiplicities.tolist() == [2, 2]
    truth = complex(-0.2, np.sqrt(3.96))
    assert abs(found.roots[0] - truth) <= found.radii[0] < 1e-10


def test_close_roots_of_coupled_states_have_one_small_disc():
    """A defective double root of coupled states, which rounding moves by 1e-8."""
    T = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    inverse = np.array([[0.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 0.0, 1.0]])
    A = T @ np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]]) @ inverse
    found = DelaySystem({0.0: A, 0.5: -0.25 * np.eye(3)}).rightmost()
    truth = root(-1.0, -0.25, 0.5)
    assert found.multiplicities[0] == 3
    assert not found.resolved[0]
    assert abs(found.roots[0] - complex(truth)) <= found.radii[0] < 1e-3
