"""Crossings of a delay that enters as T, 2T, ..., and of systems of matrices."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime import delay, s
from hypothesis import assume, given, settings, strategies as st

(T, K) = dtm.parameters("T K")


def test_two_multiples_in_closed_form():
    # z + z^2 = -j omega on the circle: cos a + cos 2a = 0, omega = sin a + sin 2a, z = e^(-j a).
    found = dtm.crossings(s + delay(T) + delay(2 * T), {"T": (0, 5)})
    first = math.pi / (3.0 * math.sqrt(3.0))
    period = 2.0 * math.pi / math.sqrt(3.0)
    np.testing.assert_allclose(found.values, [first, first + period], rtol=1e-13)
    np.testing.assert_allclose(found.omega, math.sqrt(3.0), rtol=1e-13)
    assert found.direction.tolist() == [2, 2]
    assert found.counts.tolist() == [0, 2, 4]
    margin = dtm.delay_margin(s + delay(T) + delay(2 * T), at={"T": 0.1})
    assert margin == pytest.approx(first - 0.1, rel=1e-12)


def test_halves_and_a_constant_delay():
    h = s**2 + 0.4 * s + 3.0 + delay(0.2) * (delay(0.5 * T) - 0.5 * delay(1.5 * T))
    found = dtm.crossings(h, {"T": (0.0, 9.0)})
    assert len(found) > 2
    assert (np.diff(found.counts) == found.direction).all()


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-1.5, 1.5).map(lambda x: round(x, 3)), min_size=8, max_size=8),
    st.floats(0.0, 1.5),
)
def test_counts_of_the_matrix_change_as_the_crossings_say(entries, damping):
    """A delayed matrix of rank two gives terms in T and 2T; such crossings were refused once."""
    now, late = np.reshape(entries, (2, 2, 2))
    now = now - damping * np.eye(2)
    assume(np.linalg.det(now + late) != 0.0)  # a root at 0 for every delay is refused by name
    found = dtm.crossings(dtm.DelaySystem({0.0: now, 1.0: late}), {"delay": (0.02, 4.0)})
    for (low, high), expected in zip(found.intervals, found.counts.tolist(), strict=True):
        if expected < 0 or high - low < 1e-6:
            continue
        # The determinant from its matrices, by an eigenvalue problem on Chebyshev points.
        for point in (low + 0.01 * (high - low), high - 0.01 * (high - low)):
            assert unstable_by_collocation(now, late, point) in (expected, None)


def unstable_by_collocation(now, late, tau, n=40):
    """Unstable eigenvalues of the generator on Chebyshev points (Breda, Maset, Vermiglio 2005)."""
    k = np.arange(n + 1)
    x = np.cos(np.pi * k / n)
    c = np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
    gaps = x[:, None] - x[None, :] + np.eye(n + 1)
    D = np.outer(c, 1.0 / c) / gaps
    D -= np.diag(D.sum(axis=1))
    generator = np.kron(D * 2.0 / tau, np.eye(len(now)))
    size = len(now)
    generator[:size] = 0.0
    generator[:size, :size], generator[:size, -size:] = now, late
    real = np.linalg.eigvals(generator).real
    return None if np.abs(real).min() < 1e-6 else int((real > 0.0).sum())


def test_the_delay_margin_of_a_system():
    now, late = np.array([[-1.0, 0.5], [-0.4, -0.7]]), np.array([[-1.5, 0.2], [0.3, -1.8]])
    system = dtm.DelaySystem({0.0: now, 0.2: late})
    lost = 0.2 + dtm.delay_margin(system)
    assert unstable_by_collocation(now, late, 0.999 * lost) == 0
    assert unstable_by_collocation(now, late, 1.001 * lost) == 2
    with pytest.raises(ValueError, match="the states of this system have no delay"):
        dtm.delay_margin(dtm.DelaySystem(now))


def test_a_system_with_two_delays_keeps_their_ratio():
    system = dtm.DelaySystem({0.0: -0.1, 0.2: -1.0, 0.4: -0.5})
    found = dtm.crossings(system, {"delay": (0.1, 3.0)})
    assert len(found)
    assert (np.diff(found.counts) == found.direction).all()
    high = found.stable_ranges[0][1]
    assert 0.2 + dtm.delay_margin(system) == pytest.approx(high, rel=1e-12)
    with pytest.raises(ValueError, match="several delays"):
        dtm.crossings(dtm.DelaySystem({0.2: -1.0, 0.2 * math.pi: -0.5}), {"delay": (0.1, 1.0)})


def test_a_gain_is_listed_outside_of_where_chains_reach_the_axis():
    """The whole range was refused once because chains are unstable in a part of it."""
    # s (1 + K e^(-0.3 s)) + 3 e^(-0.5 s): chains reach the axis from |K| = 1 on.
    found = dtm.crossings(s * (1.0 + K * delay(0.3)) + 3.0 * delay(0.5), {"K": (-2, 2)})
    (first, second) = found.unlisted
    assert first == (-2.0, pytest.approx(-1.0, abs=0.01))
    assert second == (pytest.approx(1.0, abs=0.01), 2.0)
    listed = [count for count in found.counts.tolist() if count != -1]
    assert found.counts[0] == found.counts[-1] == -1
    assert (np.diff(listed) == found.direction).all()
    # On the axis K = -(j w + 3 e^(-0.5 j w)) e^(0.3 j w)/(j w) is real: by brute force.
    omega = np.linspace(1e-3, 60.0, 2_000_001)
    k = -(1j * omega + 3.0 * np.exp(-0.5j * omega)) * np.exp(0.3j * omega) / (1j * omega)
    change = np.flatnonzero(k.imag[:-1] * k.imag[1:] < 0.0)
    brute = np.sort(k.real[change][np.abs(k.real[change]) < 0.95])
    inner = found.values[np.abs(found.values) < 0.95]
    np.testing.assert_allclose(inner, brute, atol=1e-3)
    assert "crossings from -2 to" in repr(found)


def test_a_leading_coefficient_that_vanishes_within_the_range():
    found = dtm.crossings(K * s + 1.0, {"K": (-1, 1)})
    assert found.counts.tolist() == [1, -1, 0]
    with pytest.raises(ValueError, match="chains"):
        dtm.crossings(s + K * s * delay(0.3) + 1.0, {"K": (2, 3)})
