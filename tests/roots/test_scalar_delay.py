"""Roots of the scalar delay equation, against mpmath and closed forms."""

import math

import deadtime as dtm
import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from lambertw_points import EPS, bits, log_of


def exact_root(a0, a1, delay, near):
    """The root next to `near`, by Newton's method at high precision."""
    a0, a1, delay, s = (mpmath.mpmathify(v) for v in (a0, a1, delay, near))
    for _ in range(50):
        feedback = a1 * mpmath.exp(-s * delay)
        slope = 1 + delay * feedback
        if slope == 0:
            break
        step = (s - a0 - feedback) / slope
        s -= step
        if abs(step) < mpmath.mpf(10) ** -45 * abs(s):
            break
    return s


def exact_branch(a0, a1, delay, s, k):
    """Number of the branch that a root belongs to."""
    w = (s - a0) * mpmath.mpf(delay)
    log_z = mpmath.log(abs(delay * mpmath.mpf(a1))) - mpmath.mpf(a0) * delay
    log_z = mpmath.mpc(log_z, mpmath.pi if a1 < 0 else 0)
    return (w + log_of(w, -1 if k < 0 else 1) - log_z) / mpmath.mpc(0, 2 * mpmath.pi)


def check_root(a0, a1, delay, k):
    # Next to a double root, 1 + e z = 0, an error of 2^-64 in z grows by 1/sqrt(2 |1 + e z|).
    distance = abs(1 + math.e * delay * a1 * math.exp(min(max(-a0 * delay, -700), 700)))
    tolerance = 4 + 1e-3 / max(distance, 1e-18) ** 0.5
    s = complex(dtm.dde_roots(a0, a1, delay, k))
    # Digits for s - a0, where a0 is huge, and for w = (s - a0) T, where it underflows.
    digits = 80 + int(2.2 * abs(a0 * delay))
    with mpmath.workdps(min(digits, 2500)):
        exact = exact_root(a0, a1, delay, s)
        if s.imag == 0:
            exact = exact.real
        assert abs(exact_branch(a0, a1, delay, exact, k) - k) < 1e-10
        assert abs(s - exact) <= tolerance * EPS * abs(exact)


coefficient = st.floats(-20, 20).filter(lambda a: abs(a) > 1e-3)


@given(coefficient, coefficient, st.floats(0.01, 3), st.integers(-20, 20))
@settings(max_examples=150)
def test_roots_solve_the_characteristic_equation(a0, a1, delay, k):
    check_root(a0, a1, delay, k)


@given(st.floats(-700, 700), coefficient, st.floats(0.5, 2), st.integers(-3, 3))
@settings(max_examples=30)
def test_large_exponents_neither_overflow_nor_cancel(a0, a1, delay, k):
    check_root(a0, a1, delay, k)


@given(st.floats(-3, 0.7), st.floats(-18, -3), st.booleans())
@settings(max_examples=60)
def test_the_root_at_the_stability_boundary_has_the_right_sign(a0, power, above):
    # a0 + a1 = 0 is the boundary; the root is (a0 + a1)/(1 + a1 T) + ...
    a1 = -a0 + (10.0**power if above else -(10.0**power))
    s = complex(dtm.dde_roots(a0, a1, 1.0))
    assert s.imag == 0
    # The sum of two doubles in doubles is exact here or has the right sign anyway.
    assert np.sign(s.real) == np.sign(a0 + a1)


@given(
    st.floats(1e-3, 1e3),
    st.sampled_from([-1, 1]),
    st.floats(1e-3, 1e2),
)
@example(0.21565670435126938, 1, 1.0)
@example(1.0000001, 1, 1.0)
def test_terms_that_balance_have_the_root_zero(magnitude, sign, delay):
    # s = a (1 - e^(-s T)): zero belongs to branch 0 while a T <= 1, to branch -1 from there on.
    a0 = sign * magnitude
    roots = dtm.dde_roots(a0, -a0, delay, [0, -1])
    product = mpmath.mpf(a0) * mpmath.mpf(delay)
    assert roots[0 if product <= 1 else 1] == 0
    if abs(product - 1) > 1e-6:
        assert roots[1 if product <= 1 else 0] != 0


def test_the_loop_of_the_paper_turns_unstable_where_theory_says():
    # Integrator with gain K and delay T: unstable from K T = pi/2 on.
    delay = 0.36
    gain = math.pi / 2 / delay
    s = dtm.dde_roots(0.0, -gain * np.array([0.999, 1.0, 1.001]), delay)
    assert s[0].real < 0 < s[2].real
    assert abs(s[1].real) < 1e-14
    assert s[1].imag == pytest.approx(gain, rel=1e-14)


def test_a_double_root_is_met():
    assert dtm.dde_roots(1.0, -1.0, 1.0, [0, -1]).tolist() == [0, 0]


def test_without_delay_one_root_is_left():
    s = dtm.dde_roots(-3.0, 1.0, 0.0, [0, 1, -1])
    assert s[0] == -2.0
    assert (s.real[1:] == -np.inf).all()
    assert dtm.dde_roots(-3.0, 0.0, 1.0) == -3.0


def test_roots_broadcast_and_keep_their_bits():
    generator = np.random.default_rng(1)
    gains = -generator.uniform(0.1, 5, (40, 1, 1))
    delays = generator.uniform(0.01, 1, (30, 1))
    k = np.arange(-6, 6)
    s = dtm.dde_roots(-0.5, gains, delays, k)
    assert s.shape == (40, 30, 12)
    assert (bits(s) == bits(dtm.dde_roots(-0.5, gains, delays, k, threads=2))).all()
    alone = dtm.dde_roots(-0.5, gains[3, 0, 0], delays[4, 0], int(k[5]))
    assert type(alone) is np.complex128
    assert (bits(alone) == bits(s[3, 4, 5])).all()


@pytest.mark.parametrize("a1", [2.0, -2.0])
def test_the_rightmost_branches_are_those_of_the_rightmost_roots(a1):
    branches = dtm.roots.rightmost_branches(a1, 9)
    found = dtm.dde_roots(-0.3, a1, 0.4, branches)
    every = dtm.dde_roots(-0.3, a1, 0.4, np.arange(-20, 21))
    assert len(set(branches.tolist())) == 9
    assert (np.diff(found.real) <= 1e-12).all()
    np.testing.assert_allclose(found.real, np.sort(every.real)[::-1][:9], rtol=1e-12)


def test_the_rightmost_root_is_number_zero():
    generator = np.random.default_rng(2)
    a0, a1 = generator.uniform(-4, 4, (2, 500, 1))
    s = dtm.dde_roots(a0, a1, generator.uniform(0.05, 3, (500, 1)), np.arange(-5, 6))
    assert (s.real <= s.real[:, 5:6] + 1e-13 * np.abs(s[:, 5:6])).all()


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ((math.inf, 1.0, 1.0), ValueError, "a0 must be finite, got inf"),
        ((1.0, math.nan, 1.0), ValueError, "a1 must be finite, got nan"),
        ((1.0, 1.0, -0.5), ValueError, "delay must not be negative, got -0.5"),
        ((1j, 1.0, 1.0), TypeError, "a0 has dtype complex128"),
        ((1.0, "1", 1.0), TypeError, "a1 has dtype"),
        ((1.0, 1.0, 1.0, 0.5), TypeError, "is not an integer"),
        (([1.0, 2.0], [1.0, 2.0, 3.0], 1.0), ValueError, r"a0 \(2,\), a1 \(3,\)"),
    ],
)
def test_bad_arguments_are_named(arguments, error, words):
    with pytest.raises(error, match=words):
        dtm.dde_roots(*arguments)
