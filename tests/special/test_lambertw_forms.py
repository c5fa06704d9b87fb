"""Real branches, log form, Wright omega, offset form and derivative of W, against mpmath."""

import cmath
import math
import os
import subprocess
import sys

import deadtime as dtm
import flint
import mpmath
import numpy as np
import pytest
import scipy.special
from hypothesis import example, given, settings, strategies as st

EPS = 2.0**-52
SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 1e-9, -1e-9, 1024.0]
# The double next to -1/e; it lies below -1/e by 1.2e-17.
BRANCH_POINT = -0.36787944117144233


def refined(w, z):
    """The solution of w e^w = z next to `w`, to the working precision of mpmath."""
    for _ in range(12):
        power = mpmath.exp(w)
        step = (w * power - z) / (power * (1 + w))
        w -= step
        if abs(step) <= abs(w) * mpmath.mpf(10) ** (-mpmath.mp.dps * 2 // 3):
            return w
    raise AssertionError(f"no solution next to {w}")


def ulps(value, exact):
    return abs(mpmath.mpf(value) - exact) / mpmath.mpf(math.ulp(value))


# --- real branches ------------------------------------------------------------------------

inside = st.one_of(
    st.floats(-20, -0.001).map(lambda p: BRANCH_POINT * (1 - 10.0**p)),
    st.integers(0, 40).map(lambda n: BRANCH_POINT + n * 2.0**-54),
    st.floats(-323, -0.44).map(lambda p: -(10.0**p)),
)
everywhere = st.one_of(inside, st.floats(-323, 308.2).map(lambda p: 10.0**p))


@given(everywhere)
@settings(max_examples=150)
def test_the_principal_branch_is_within_an_ulp(x):
    w = dtm.lambertw0(x)
    if x == BRANCH_POINT:
        assert w == -1
        return
    with mpmath.workdps(60):
        offset = mpmath.mpf(x) + mpmath.exp(-1)
        start = mpmath.mpf(w)
        if abs(start + 1) < 1e-9:
            start = -1 + mpmath.sqrt(2 * mpmath.e * offset)
        # One ulp of a subnormal number is the best there is.
        assert ulps(w, refined(start, mpmath.mpf(x))) < 1


@given(inside)
@settings(max_examples=150)
def test_the_lower_branch_is_within_an_ulp(x):
    w = dtm.lambertwm1(x)
    if x == BRANCH_POINT:
        assert w == -1
        return
    with mpmath.workdps(60):
        offset = mpmath.mpf(x) + mpmath.exp(-1)
        start = mpmath.mpf(w)
        if abs(start + 1) < 1e-9:
            start = -1 - mpmath.sqrt(2 * mpmath.e * offset)
        assert ulps(w, refined(start, mpmath.mpf(x))) < 1


# Recorded largest error in ulps over 4000 arguments; correct rounding is at most 0.5. A ratchet.
DENSE = {
    "all doubles next to -1/e": (BRANCH_POINT + np.arange(1, 4001) * 2.0**-54, 0.87, 0.51),
    "decades of distance from -1/e": (
        BRANCH_POINT * (1 - np.geomspace(1e-15, 0.9, 4000)), 0.90, 0.86),
    "evenly below zero": (np.linspace(-0.3678, -1e-4, 4000), 0.80, 0.86),
    "decades below zero": (-np.geomspace(5e-324, 0.3678, 4000), 0.75, 0.56),
    "where W_-1 takes another start": (np.linspace(-1.02 / 256, -0.98 / 256, 4000), 0.75, 0.53),
    "where the exponential turns": (np.linspace(-0.349, -0.344, 4000), 0.75, 0.92),
    "evenly above zero": (np.linspace(1e-3, 8.0, 4000), 0.66, None),
    "decades above zero": (np.geomspace(5e-324, 1.7e308, 4000), 0.60, None),
    "where W_0 takes another start": (np.linspace(1000.0, 1048.0, 4000), 0.60, None),
}  # fmt: skip


@pytest.mark.parametrize("name", DENSE)
def test_dense_samples_of_the_real_branches(name):
    x, principal, lower = DENSE[name]
    ctx = flint.ctx
    before, ctx.prec = ctx.prec, 160
    try:
        for function, branch, allowed in (
            (dtm.lambertw0, 0, principal),
            (dtm.lambertwm1, -1, lower),
        ):
            if allowed is None:
                continue
            w = function(x)
            truth = [flint.arb(float(each)).lambertw(branch) for each in x]
            errors = [
                float(abs(flint.arb(float(value)) - exact).upper()) / math.ulp(float(value))
                for value, exact in zip(w, truth, strict=True)
            ]
            assert max(errors) <= allowed
    finally:
        ctx.prec = before


def test_ends_of_the_real_branches():
    after, before = np.nextafter(BRANCH_POINT, [0, -1])
    x = np.array([BRANCH_POINT, after, before, -1.0, -math.inf, math.inf, math.nan, 0.0, -0.0])
    principal, lower = dtm.lambertw0(x), dtm.lambertwm1(x)
    assert principal[0] == lower[0] == -1
    assert lower[1] < -1 < principal[1]
    assert np.isnan(lower[2:7]).all()
    np.testing.assert_array_equal(principal[2:], [math.nan] * 3 + [math.inf, math.nan, 0.0, 0.0])
    assert (np.signbit(principal[7:]) == [False, True]).all()
    assert (lower[7:] == -math.inf).all()
    assert np.isnan(dtm.lambertwm1([5e-324, 1.0])).all()


def test_neighbours_and_position_do_not_change_a_bit_of_the_real_branches():
    rng = np.random.default_rng(5)
    x = np.concatenate([-rng.random(500) * 0.3678, 10.0 ** rng.uniform(-320, 308, 500), SPECIAL])
    rng.shuffle(x)
    for function in (dtm.lambertw0, dtm.lambertwm1):
        whole = function(x)
        for start in range(17):
            np.testing.assert_array_equal(function(x[start:]), whole[start:])
        np.testing.assert_array_equal([function(float(each)) for each in x], whole)


def test_real_branches_agree_with_the_complex_one():
    x = np.concatenate(
        [-np.geomspace(1e-300, 0.36, 500), np.geomspace(1e-300, 1e300, 500), [0.0, -0.0]]
    )
    w = dtm.lambertw(x)
    assert np.abs(dtm.lambertw0(x) - w.real).max() <= np.spacing(np.abs(w.real)).max()
    assert (np.signbit(dtm.lambertw0(x)) == np.signbit(w.real)).all()
    below = dtm.lambertw(x[:500], -1)
    assert (np.abs(dtm.lambertwm1(x[:500]) - below.real) <= np.spacing(-below.real)).all()


# --- log form and Wright omega ------------------------------------------------------------

logs = st.one_of(
    st.builds(complex, st.floats(-50, 50), st.floats(-3.2, 3.2)),
    st.builds(complex, st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)),
    st.builds(complex, st.floats(-1e300, 1e300), st.floats(-100, 100)),
    # Around the branch point, on either side of the cut.
    st.builds(
        lambda p, a, side: complex(-1, side * math.pi) + cmath.rect(10.0**p, a),
        st.floats(-17, 0.3),
        st.floats(-math.pi, math.pi),
        st.sampled_from([-1, 1]),
    ),
)


def check_log_form(w, log_z, k):
    with mpmath.workdps(360):
        exact = mpmath.mpc(w)
        turned = mpmath.mpc(log_z) + 2 * mpmath.pi * mpmath.mpc(0, k)
        if abs(w) < 1e-290:
            # W_0(z) = z where that is next to nothing; its spacing is that of subnormal numbers.
            tiny = mpmath.exp(turned)
            assert abs(exact - tiny) <= EPS * abs(tiny) + 5e-324
            return
        rest = exact + mpmath.log(exact) - turned
        # The half plane of the cut of log w, which a w on it does not tell.
        if exact.imag == 0 and exact.real < 0:
            rest = min((rest, rest - 2j * mpmath.pi), key=abs)
        # An error of an eps of w leaves |1 + w| eps, and next to -1/e eps^2 more.
        assert abs(rest) <= 0.6 * EPS * abs(1 + exact) + 4 * EPS**2


@given(logs, st.integers(-3, 3))
@settings(max_examples=150)
def test_the_log_form_solves_its_equation(log_z, k):
    check_log_form(complex(dtm.special.lambertw_log(log_z, k)), log_z, k)


@given(logs)
@settings(max_examples=100)
def test_omega_is_the_log_form_of_branch_zero(z):
    w = dtm.wrightomega(z)
    alone = dtm.special.lambertw_log(z)
    assert np.array([w]).tobytes() == np.array([alone]).tobytes()


@given(st.floats(-700, 700), st.floats(-math.pi, math.pi), st.integers(-5, 5))
def test_log_form_and_plain_form_agree(modulus, angle, k):
    z = cmath.rect(math.exp(modulus), angle)
    if z.imag == 0 or abs(abs(angle) - math.pi) < 1e-3:
        return  # rounding of z may leave the side of the cut
    w, other = dtm.lambertw(z, k), dtm.special.lambertw_log(complex(modulus, angle), k)
    # z is rounded, and its logarithm may be large: the same as an error of log z.
    assert abs(w - other) <= 4 * EPS * (abs(modulus) + 10) * abs(w / (1 + w)) + EPS * abs(w)


# Turns that cancel against Im log z leave an angle whose second word counts.
cancelling = st.builds(
    lambda re, rest, k: (complex(re, rest - math.tau * k), k),
    st.floats(-50, 50),
    st.floats(-1e7, 1e7) | st.floats(-4, 4),
    st.integers(2**20, 2**45) | st.integers(-(2**45), -(2**20)),
)


@given(cancelling)
@settings(max_examples=100)
@example((37169030j, -5261527))
def test_multiples_of_two_pi_that_cancel_in_the_log_form(case):
    log_z, k = case
    check_log_form(complex(dtm.special.lambertw_log(log_z, k)), log_z, k)


@given(logs, st.integers(-(2**40), 2**40))
@settings(max_examples=100)
def test_far_branches_of_the_log_form(log_z, k):
    check_log_form(complex(dtm.special.lambertw_log(log_z, k)), log_z, k)


def test_omega_agrees_with_scipy_where_scipy_is_right():
    generator = np.random.default_rng(3)
    z = generator.uniform(-30, 30, 2000) + 1j * generator.uniform(-30, 30, 2000)
    theirs = scipy.special.wrightomega(z)
    assert (np.abs(dtm.wrightomega(z) - theirs) <= 1e-13 * np.abs(theirs)).all()
    x = generator.uniform(-700, 700, 2000)
    real = dtm.wrightomega(x)
    assert real.dtype == np.float64
    assert np.allclose(real, scipy.special.wrightomega(x), rtol=1e-14, atol=0)


def test_special_values_of_the_log_form():
    inf, nan = math.inf, math.nan
    assert dtm.wrightomega(inf) == inf
    assert dtm.wrightomega(-inf) == 0
    assert dtm.wrightomega(-1e6) == 0
    assert np.isnan(dtm.wrightomega(nan))
    assert dtm.special.lambertw_log(complex(-inf, 0.5), 0) == 0
    assert dtm.special.lambertw_log(-inf, 1) == complex(-inf, math.pi)
    assert dtm.special.lambertw_log(complex(inf, 0.5), 0) == complex(inf, 0.5)
    assert np.isnan(dtm.special.lambertw_log(complex(0, inf)))
    assert np.isnan(dtm.special.lambertw_log(complex(nan, 0), 3).imag)
    # The signs of zeros are those of the half plane.
    assert math.copysign(1, dtm.wrightomega(complex(2.0, -0.0)).imag) == -1


# --- offset form --------------------------------------------------------------------------

offsets = st.one_of(
    st.builds(
        lambda p, a: cmath.rect(10.0**p, a), st.floats(-300, 5), st.floats(-math.pi, math.pi)
    ),
    st.floats(-300, 5).map(lambda p: complex(10.0**p, 0.0)),
    st.floats(-300, 5).map(lambda p: complex(-(10.0**p), 0.0)),
    st.integers(-8, 8).map(lambda n: complex(-BRANCH_POINT + n * 2.0**-54, 0.0)),
)


@given(offsets, st.sampled_from([-2, -1, 0, 1, 2]))
@settings(max_examples=200)
def test_the_offset_form_gives_both_w_and_one_plus_w(delta, k):
    w, one_plus_w = (complex(part) for part in dtm.special.lambertw_offset(delta, k))
    digits = 60 + 2 * max(0, -int(math.log10(abs(delta))))
    with mpmath.workdps(min(digits, 700)):
        z = mpmath.mpc(delta) - mpmath.exp(-1)
        exact = refined(mpmath.mpc(one_plus_w) - 1, z)
        # Next to delta = 1/e, where w vanishes, 1/e in two words leaves 2^-108.
        assert abs(mpmath.mpc(w) - exact) <= 0.52 * EPS * abs(exact) + 2.0**-108
        # Half an ulp in each of some four operations of the series.
        assert abs(mpmath.mpc(one_plus_w) - (1 + exact)) <= 4 * EPS * abs(1 + exact)
        side = mpmath.log(exact) + exact - mpmath.log(z)
        if delta.imag != 0:
            assert abs(side - 2 * mpmath.pi * mpmath.mpc(0, k)) < 1e-9


def test_at_zero_offset_the_branches_meet():
    for k in (0, -1):
        w, one_plus_w = dtm.special.lambertw_offset(0.0, k)
        assert w == -1
        assert one_plus_w == 0
    assert abs(dtm.special.lambertw_offset(0.0, 1).w - dtm.lambertw(BRANCH_POINT, 1)) < 1e-14


# --- derivative ---------------------------------------------------------------------------


@given(
    st.one_of(
        offsets.map(lambda delta: delta + BRANCH_POINT),
        st.builds(cmath.rect, st.floats(-320, 308).map(lambda p: 10.0**p), st.floats(-3.14, 3.14)),
    ),
    st.sampled_from([-2, -1, 0, 1, 2, 1000]),
)
@settings(max_examples=150)
def test_the_derivative_is_exact_next_to_the_branch_point_too(z, k):
    if z == 0:
        return
    slope = complex(dtm.special.lambertw_derivative(z, k))
    with mpmath.workdps(700 if abs(z) < 1e-290 else 120):
        start = mpmath.mpc(complex(dtm.lambertw(z, k)))
        if abs(start + 1) < 1e-6:
            # W itself does not tell the two sheets apart any more.
            _, one_plus_w = dtm.special.lambertw_offset(
                complex(float(mpmath.mpf(z.real) + mpmath.exp(-1)), z.imag), k
            )
            start = mpmath.mpc(complex(one_plus_w)) - 1
        w = refined(start, mpmath.mpc(z))
        exact = w / (mpmath.mpc(z) * (1 + w))
        if abs(exact) > 1e308:
            return
        # Five roundings, and those of 1 + W.
        assert abs(mpmath.mpc(slope) - exact) <= 6 * EPS * abs(exact) + 5e-324


def test_derivatives_at_the_ends():
    assert dtm.special.lambertw_derivative(0.0) == 1
    assert dtm.special.lambertw_derivative(-0.0) == 1
    assert dtm.special.lambertw_derivative(0.0, 1).real == math.inf
    assert dtm.special.lambertw_derivative(math.inf) == 0
    assert np.isnan(dtm.special.lambertw_derivative(math.nan))
    assert abs(dtm.special.lambertw_derivative(1.0, 2**40) - 1) < 1e-12


# --- one set of bits for every instruction set --------------------------------------------

PROGRAM = """
import hashlib
import numpy as np
import deadtime as dtm

generator = np.random.default_rng(8)
n = 3000
z = 10 ** generator.uniform(-320, 308, n) * np.exp(2j * np.pi * generator.random(n))
near = 10 ** generator.uniform(-17, 3, n) * np.exp(6j * generator.random(n))
z[::3] = near[::3] - 0.36787944117144233
z.imag[::7] = 0.0
z.imag[1::7] = -0.0
k = generator.integers(-3, 4, n)
logs = generator.uniform(-40, 40, n) + 1j * generator.uniform(-9, 9, n)
real = generator.uniform(-20, 20, (2, n))
results = [
    dtm.lambertw(z, k),
    dtm.lambertw0(z.real),
    dtm.lambertwm1(-np.abs(z.real)),
    dtm.special.lambertw_log(logs, k),
    dtm.special.lambertw_derivative(z, k),
    *dtm.special.lambertw_offset(z, k),
    dtm.dde_roots(*real, np.abs(logs.real), k),
]
digest = hashlib.sha256()
for result in results:
    # One NaN is like another.
    result[np.isnan(result)] = 0
    digest.update(result.tobytes())
print(digest.hexdigest())
"""


def test_bits_do_not_depend_on_the_instruction_set():
    def digest(instructions):
        environment = dict(os.environ, DEADTIME_INSTRUCTIONS=instructions)
        run = [sys.executable, "-c", PROGRAM]
        return subprocess.run(
            run, env=environment, capture_output=True, text=True, check=True
        ).stdout

    plain = digest("plain")
    assert len(plain.strip()) == 64
    assert {digest("avx2"), digest("avx512"), digest("")} == {plain}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: dtm.special.lambertw_log("x"), "log_z has dtype"),
        (lambda: dtm.special.lambertw_log(1.0, 0.5), "k=0.5"),
        (lambda: dtm.wrightomega("x"), "z has dtype"),
        (lambda: dtm.special.lambertw_derivative(1.0, 1.5), "k=1.5"),
        (lambda: dtm.special.lambertw_offset(None), "delta has dtype"),
        (lambda: dtm.lambertw0(1j), "x has dtype complex128"),
    ],
)
def test_wrong_types_are_named(call, words):
    with pytest.raises(TypeError, match=words):
        call()


def test_the_rightmost_branches_are_in_order():
    generator = np.random.default_rng(4)
    for sign in (-1.0, 1.0):
        a0, delay = generator.uniform(-3, 3, (50, 1)), generator.uniform(0.05, 3, (50, 1))
        a1 = sign * generator.uniform(0.1, 5, (50, 1))
        s = dtm.dde_roots(a0, a1, delay, dtm.roots.rightmost_branches(sign, 8))
        assert (np.diff(s.real, axis=1) <= 1e-12 * np.abs(s[:, 1:])).all()
        # Nothing between them: the next branches out lie to the left.
        rest = np.setdiff1d(np.arange(-9, 10), dtm.roots.rightmost_branches(sign, 8))
        left = dtm.dde_roots(a0, a1, delay, rest).real
        assert (left <= s.real[:, -1:] + 1e-12 * np.abs(s[:, -1:])).all()
    for bad in ((0.0, 2), (math.nan, 2), (1.0, 0)):
        with pytest.raises(ValueError, match=r"a1=|n=0"):
            dtm.roots.rightmost_branches(*bad)
