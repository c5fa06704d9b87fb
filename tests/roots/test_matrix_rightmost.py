"""Rightmost roots of matrix systems from guesses and one line, against independent results."""

import math

import numpy as np
import pytest
from deadtime import DelaySystem
from deadtime.roots._matrix_roots import MatrixDeterminant
from hypothesis import given, settings, strategies as st


def matrix_of(system):
    return MatrixDeterminant(system.E, system.N, system.A)


def collocated(system, degree):
    """Eigenvalues of the generator on Chebyshev points of the interval of the longest delay."""
    n, k, longest = system.n_states, np.arange(degree + 1), max(system.A)
    x = np.cos(np.pi * k / degree)
    weights = np.r_[2.0, np.ones(degree - 1), 2.0] * (-1.0) ** k
    gaps = x[:, None] - x + np.eye(degree + 1)
    D = weights[:, None] / weights / gaps
    D -= np.diag(D.sum(axis=1))
    whole = np.kron(2 / longest * D, np.eye(n))
    whole[:n] = 0.0
    for tau, matrix in system.A.items():
        away = 1.0 - 2.0 * tau / longest - x
        near = abs(away) < 1e-14
        barycentric = (-1.0) ** k * np.r_[0.5, np.ones(degree - 1), 0.5]
        values = near.astype(float) if near.any() else barycentric / away
        values = values / values.sum()
        whole[:n] += np.kron(values, np.linalg.solve(system.E, matrix))
    return np.linalg.eigvals(whole)


def random_system(seed, n, delays, size=1.0):
    rng = np.random.default_rng(seed)
    A = {0.0: rng.normal(size=(n, n)) / math.sqrt(n) - rng.uniform(0, 3) * np.eye(n)}
    for _ in range(delays):
        A[float(rng.uniform(0.05, 1.5))] = size * rng.normal(size=(n, n)) / math.sqrt(n)
    return DelaySystem(A)


def assert_rightmost(system, found, degree=24):
    values = collocated(system, degree)
    values = values[values.real.argsort()[::-1]]
    top = found.roots[0]
    # The collocation is accurate to more than this where |s| times the delay is moderate.
    assert abs(values[0].real - top.real) < 1e-6 * (1 + abs(top)), (values[:4], top)
    s = top
    M = s * system.E - sum(A * np.exp(-s * tau) for tau, A in system.A.items())
    smallest = np.linalg.svd(M, compute_uv=False)
    assert smallest[-1] < 1e-9 * smallest[0]


# Independent results


@pytest.mark.parametrize("delays", [1, 2, 3])
@pytest.mark.parametrize("n", [2, 3, 5, 8, 13, 20])
def test_guesses_lead_to_the_rightmost_root(n, delays):
    for seed in range(3 if n < 10 else 1):
        system = random_system(100 * n + seed, n, delays)
        answer = system.rightmost()
        assert_rightmost(system, answer)
        assert answer.counted == answer.multiplicities.sum()
        assert system.spectral_abscissa() == answer.roots[0].real


@pytest.mark.parametrize("n", [40, pytest.param(80, marks=pytest.mark.survey)])
def test_many_states_agree_with_collocation(n):
    rng = np.random.default_rng(1)
    system = DelaySystem(
        {0.0: rng.normal(size=(n, n)) - 2 * np.eye(n), 0.3: rng.normal(size=(n, n))}
    )
    assert_rightmost(system, system.rightmost(), degree=9)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_small_systems_have_the_roots_of_their_expansion(n):
    for seed in range(5):
        system = random_system(seed, n, 2)
        h = system.characteristic()
        for wanted in (1, 3):
            expected, found = h.rightmost(wanted), system.rightmost(wanted)
            assert len(found.roots) == len(expected.roots)
            assert found.roots == pytest.approx(expected.roots, abs=1e-8)
            # The half plane holds what is listed and nothing else, in the other form as well.
            assert h.count(re=(found.region[0][0], None)) == found.counted


@pytest.mark.survey
@pytest.mark.parametrize("count", [40, pytest.param(250, marks=pytest.mark.long)])
def test_many_random_systems_are_never_wrong(count):
    for seed in range(count):
        rng = np.random.default_rng(seed)
        n, delays = int(rng.integers(2, 7)), int(rng.integers(1, 4))
        system = random_system(seed, n, delays, size=float(rng.uniform(0.1, 4)))
        top = system.rightmost().roots[0]
        values = collocated(system, 30)
        assert abs(values.real.max() - top.real) < 1e-6 * (1 + abs(top)), seed


# Structure


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.integers(2, 8), st.integers(1, 2))
def test_scaled_states_have_the_same_roots(seed, n, delays):
    system = random_system(seed, n, delays)
    scale = 2.0 ** np.random.default_rng(seed).integers(-30, 31, size=n)
    turned = DelaySystem({tau: A * scale[:, None] / scale for tau, A in system.A.items()})
    assert turned.spectral_abscissa() == pytest.approx(system.spectral_abscissa(), abs=1e-8)


def test_defective_and_multiple_roots():
    one = random_system(3, 3, 1)
    twice = DelaySystem({tau: np.kron(np.eye(2), A) for tau, A in one.A.items()})
    found = twice.rightmost()
    assert found.multiplicities[0] == 2
    assert found.roots[0].real == pytest.approx(one.spectral_abscissa(), abs=1e-6)
    jordan = DelaySystem({0.0: [[-1.0, 1.0], [0.0, -1.0]], 0.4: np.zeros((2, 2))})
    assert jordan.spectral_abscissa() == pytest.approx(-1.0, abs=1e-6)


def test_a_root_at_zero_is_exactly_there():
    system = DelaySystem({0.0: [[0.0, 1.0], [0.0, -1.0]], 0.5: [[0.0, 0.0], [0.0, -0.5]]})
    assert system.spectral_abscissa() == 0.0


@pytest.mark.parametrize("delay", [1e-3, 0.1, 3.0, 30.0])
def test_short_and_long_delays(delay):
    system = DelaySystem({0.0: [[0.0, 1.0], [-4.0, -1.0]], delay: [[0.0, 0.0], [1.5, 0.2]]})
    expected = system.characteristic().rightmost()
    assert system.rightmost().roots[0] == pytest.approx(expected.roots[0], abs=1e-9)


def test_a_descriptor_and_units_of_time():
    system = random_system(11, 6, 2)
    E = np.diag(np.arange(1.0, 7.0))
    scaled = DelaySystem({tau: E @ A for tau, A in system.A.items()}, E=E)
    assert scaled.spectral_abscissa() == pytest.approx(system.spectral_abscissa(), abs=1e-10)
    fast = DelaySystem({tau / 1e6: 1e6 * A for tau, A in system.A.items()})
    assert fast.spectral_abscissa() == pytest.approx(1e6 * system.spectral_abscissa(), rel=1e-9)


@pytest.mark.parametrize("n", [0, -1])
def test_a_number_below_one_is_refused(n):
    with pytest.raises(ValueError, match="at least 1"):
        random_system(1, 4, 1).rightmost(n)
