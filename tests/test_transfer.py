"""Transfer functions: algebra, values, loops, margins, and what other packages say."""

import cmath
import copy
import importlib
import importlib.util
import math
import pickle

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from deadtime import TransferFunction, delay, feedback, s
from hypothesis import assume, given, settings
from hypothesis import strategies as st

numbers = st.floats(-5, 5, allow_subnormal=False).map(lambda x: round(x, 3))
times = st.floats(0, 2, allow_subnormal=False).map(lambda x: round(x, 3))
points = st.complex_numbers(max_magnitude=3, allow_subnormal=False)


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
    """Sum of the moduli of the terms of h: what its rounding error is measured against."""
    powers = abs(z) ** np.arange(h.degree + 1)
    return float(np.exp(-z.real * h.delays) @ (np.abs(h.coefficients) @ powers))


def error(G, z):
    """Bound on the rounding error of G(z): the terms are few and the powers low."""
    n, d = abs(G.num(z)), abs(G.den(z))
    return 1e-13 * (terms(G.num, z) + n / d * terms(G.den, z)) / d


def close(value, wanted, *systems, z):
    return abs(value - wanted) <= sum(error(G, z) for G in systems)


# What it is


def test_the_line_of_the_readme():
    T = feedback(2.0 / s * delay(0.36))
    assert T.num == 2.0 * delay(0.36)
    assert T.den == s + 2.0 * delay(0.36)
    wanted = TransferFunction(2.0 * delay(0.36), s + 2.0 * delay(0.36))
    assert wanted == T
    W = dtm.lambertw(-2.0 * 0.36) / 0.36
    assert abs(T.rightmost()[0] - W) < 1e-13


def test_coefficients_descend():
    G = TransferFunction([1, 2], [3, 4, 5])
    assert G.num == s + 2
    assert G.den == 3 * s**2 + 4 * s + 5
    assert TransferFunction(2).den == dtm.QuasiPolynomial([[1.0]], [0.0])
    assert G(2.0) == pytest.approx(4 / 25)


def test_common_delays_cancel_where_that_is_exact():
    G = (2 * delay(1.5)) / (delay(0.5) * s + delay(0.75))
    assert G.num == 2 * delay(1.0)
    assert G.den == s + delay(0.25)
    # 0.9 - 0.1 is no double, and a delay is not to be rounded behind one's back.
    tau = float(np.nextafter(0.9, 1.0))
    assert math.fsum([tau, -0.1, -(tau - 0.1)]) != 0.0
    assert TransferFunction(delay(tau), delay(0.1) * s).den == delay(0.1) * s


def test_common_roots_stay_and_are_told():
    G = s / (s * (s + 1))
    assert G.den == s**2 + s
    assert G.minreal() == 1 / (s + 1)
    assert (s * delay(0.5) / s**3).minreal() == delay(0.5) / s**2
    hidden = G.hidden_modes()
    assert hidden.tolist() == [0j]
    loop = feedback((s - 1) / (s + 3) * (2 / ((s - 1) * (s + 5))) * delay(0.2))
    assert not loop.is_stable()
    assert abs(loop.hidden_modes(re=(-2, 2), im=(0, 5)) - 1.0).max() < 1e-8
    assert (1 / (s + 1)).hidden_modes().size == 0


@pytest.mark.parametrize(
    ("G", "proper", "causal"),
    [
        (1 / s * delay(1.0), True, True),
        (s**2 / (s + 1), False, True),
        (1 / (s * delay(0.5)), True, False),
        (1 / (1 + s * delay(0.5)), True, False),
        (TransferFunction(0.0, s * delay(0.5)), True, True),
    ],
)
def test_properness_and_causality_are_told(G, proper, causal):
    assert (G.is_proper, G.is_causal) == (proper, causal)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: TransferFunction(1, 0), ZeroDivisionError, "den is zero"),
        (lambda: s / (s - s), ZeroDivisionError, "den is zero"),
        (lambda: 1 / TransferFunction(0.0), ZeroDivisionError, "zero transfer function"),
        (lambda: TransferFunction([], 1), ValueError, "num of shape"),
        (lambda: TransferFunction([[1, 2]], 1), ValueError, "num of shape"),
        (lambda: TransferFunction("1", 1), (TypeError, ValueError), "num"),
        (lambda: TransferFunction(1, [1j]), TypeError, "den of dtype"),
        (lambda: TransferFunction([math.nan]), ValueError, "finite"),
        (lambda: 1 / s + "x", TypeError, "unsupported"),
        (lambda: (1 / s) ** 0.5, TypeError, "unsupported"),
        (lambda: feedback("G"), TypeError, "G='G'"),
        (lambda: feedback(1 / s, None), TypeError, "H=None"),
        (lambda: feedback(1 / s, sign=2), ValueError, "sign=2"),
        (lambda: feedback(1.0, -1.0), ValueError, "no solution"),
        (lambda: (1 / s)("x"), TypeError, "dtype"),
        (lambda: (1 / s).frequency_response([math.inf]), ValueError, "finite"),
        (lambda: TransferFunction(0.0).phase(1.0), ValueError, "no phase"),
        (lambda: (1 / s).bode([1.0]), ValueError, "omega"),
        (lambda: (1 / s).nyquist([2.0, 1.0]), ValueError, "omega"),
    ],
)
def test_what_makes_no_sense_is_refused(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_it_does_not_change_and_survives_copying():
    G = (1 + 0.5 * delay(0.3)) / (s + 2)
    with pytest.raises(AttributeError):
        G.num = s
    with pytest.raises(AttributeError):
        del G._den
    for other in (pickle.loads(pickle.dumps(G)), copy.copy(G), copy.deepcopy(G)):
        assert other == G
        assert hash(other) == hash(G)
    assert TransferFunction(1.0, s) != G
    assert G != 3


@pytest.mark.parametrize(
    ("G", "text"),
    [
        (2 / s, "2 / s"),
        (2 / s * delay(0.36), "2 exp(-0.36 s) / s"),
        ((s + 1) / (2 * s), "(1 + s) / (2 s)"),
        (TransferFunction(s + 1), "1 + s"),
        (1 / (s + (2 + s) * delay(1.0)), "1 / (s + (2 + s) exp(-1 s))"),
        ((2 + s) * delay(0.5) / s, "(2 + s) exp(-0.5 s) / s"),
    ],
)
def test_repr_is_algebra(G, text):
    assert repr(G) == text


# Algebra


@settings(max_examples=60)
@given(transfer_functions(), transfer_functions(), points)
def test_algebra_is_that_of_the_values(G, H, z):
    for one in (G, H):
        assume(abs(one.den(z)) > 1e-2 * terms(one.den, z))
    g, h = G(z), H(z)
    total, product = G + H, G * H
    assume(abs(product.den(z)) > 1e-6 * terms(product.den, z))
    assert close(total(z), g + h, total, G, H, z=z)
    assert close((G - H)(z), g - h, total, G, H, z=z)
    slack = error(G, z) * abs(h) + error(H, z) * abs(g)
    assert abs(product(z) - g * h) <= error(product, z) + slack
    assert abs((2.0 - G)(z) - (2.0 - g)) <= error(2.0 - G, z) + error(G, z)
    assert (G + H)(z) == pytest.approx((H + G)(z), rel=1e-9, abs=1e-9)
    assert (G**2)(z) == pytest.approx(g * g, rel=1e-8, abs=1e-9)
    if abs(h) > 0.1:
        quotient = G / H
        assume(abs(quotient.den(z)) > 1e-6 * terms(quotient.den, z))
        assert quotient(z) == pytest.approx(g / h, rel=1e-6, abs=1e-6)


@settings(max_examples=60)
@given(transfer_functions(), transfer_functions(), points, st.sampled_from([-1, 1]))
def test_feedback_is_what_it_says(G, H, z, sign):
    assume((G.den * H.den - sign * (G.num * H.num)).coefficients.any())
    T = feedback(G, H, sign)
    for one in (G, H, T):
        assume(abs(one.den(z)) > 1e-3 * terms(one.den, z))
    wanted = G(z) / (1 - sign * G(z) * H(z))
    assert T(z) == pytest.approx(wanted, rel=1e-7, abs=1e-7)


@settings(max_examples=60)
@given(transfer_functions(), points)
def test_values_are_conjugate_symmetric(G, z):
    assume(G.den(z) != 0.0)
    assert G(z.conjugate()) == pytest.approx(G(z).conjugate(), rel=1e-12, abs=1e-300)


@settings(max_examples=25)
@given(transfer_functions(), transfer_functions())
def test_poles_are_roots_of_the_denominator(G, H):
    den = (G * H).den
    assume(den.coefficients.any())
    try:
        found = (G * H).poles(re=(-1.9, 2.3), im=(0.0, 7.1))
    except dtm.DeadtimeError:  # a root on the edge, or a cluster: said, not miscounted
        assume(False)
    for root, radius in zip(found.roots, found.radii, strict=True):
        slope = abs(den.derivative()(root)) + 1.0
        assert abs(den(root)) <= 1e-9 * terms(den, root) + 10.0 * radius * slope


def test_shared_denominators_are_not_squared():
    d = s**2 + 2 * s + 5
    assert (1 / d + 3 / d).den == d
    assert (1 / s + 1 / s**2) == (s + 1) / s**2
    T = feedback((s + 2) / d, 3 / (s + 7))
    assert T.num == (s + 2) * (s + 7)
    assert T.den == d * (s + 7) + 3 * (s + 2)


def test_numbers_and_quasi_polynomials_on_either_side():
    G = 1 / (s + 1)
    for value, wanted in (
        (2 * G, 1.0),
        (G * np.float64(2), 1.0),
        (np.array(2.0) * G, 1.0),
        (1 - G, 0.5),
        (s + G, 1.5),
        (G - s, -0.5),
        (s * G, 0.5),
        (G / s, 0.5),
        (s / G, 2.0),
        (2 / G, 4.0),
        (G**-2, 4.0),
        (+G, 0.5),
        (-G, -0.5),
        (s**-2, 1.0),
    ):
        assert isinstance(value, TransferFunction)
        assert value(1.0) == pytest.approx(wanted)


# Values


@pytest.mark.parametrize(
    ("G", "z"),
    [
        (delay(1.0) / (1 + 2 * delay(1.0)), -5000.0 + 3j),
        ((s + 2) / (s + (1 + s) * delay(3.0)), -220.0 + 10j),
        (s**3 / (s + 1) ** 4, 1e120 + 1e119j),
        ((s**2 + delay(1.0)) / s**2, 1e-200 + 0j),
        ((1 - delay(2.0)) / (s * (1 + delay(700.0))), -0.9 + 0.3j),
    ],
)
def test_finite_ratios_do_not_overflow(G, z):
    value = G(z)
    with mp.workdps(60):
        top, bottom = (
            sum(
                mp.mpf(float(c)) * mp.mpc(z) ** k * mp.exp(-mp.mpc(z) * mp.mpf(float(t)))
                for row, t in zip(h.coefficients, h.delays, strict=True)
                for k, c in enumerate(row)
            )
            for h in (G.num, G.den)
        )
        wanted = top / bottom
        if abs(wanted) < mp.mpf(10) ** 300:
            # Exponents of several thousand are known to 1e-12.
            assert abs(mp.mpc(value) - wanted) <= 1e-11 * abs(wanted)
        else:
            assert abs(value) == math.inf


def test_poles_and_cancelled_poles_have_their_values():
    G = 1 / s
    assert G(0) == math.inf
    assert cmath.isnan((s / s)(0))
    assert G(np.zeros((2, 3))).shape == (2, 3)
    assert G([]).shape == (0,)
    assert isinstance(G(2), complex)
    assert TransferFunction(0.0)(3.0) == 0.0


@pytest.mark.parametrize(
    ("G", "wanted"),
    [
        (3 / (s + 2), 1.5),
        (s / (s + 2), 0.0),
        (2 / s, math.inf),
        (-2 / s, -math.inf),
        (s / (s * (s + 4)), 0.25),
        ((1 - delay(0.5)) / s, 0.5),
        ((1 - delay(0.5)) ** 2 / s**2, 0.25),
        (TransferFunction(0.0), 0.0),
    ],
)
def test_dcgain(G, wanted):
    assert G.dcgain() == pytest.approx(wanted, rel=1e-12)


def test_frequency_response():
    omega = np.array([[0.1, 1.0], [-3.0, 7.0]])
    G = 2.0 / (s + 1) * delay(0.5)
    wanted = 2.0 * np.exp(-0.5j * omega) / (1j * omega + 1)
    np.testing.assert_allclose(G.frequency_response(omega), wanted, rtol=1e-14)
    assert G.frequency_response(1.0).shape == ()


def test_the_phase_is_continuous_however_far_apart_the_frequencies():
    G = 5.0 * (s + 0.3) / (s * (s**2 + 0.1 * s + 4)) * delay(0.36)
    w = np.array([1e-3, 0.5, 1.9, 2.1, 50.0, 3e4])
    wanted = np.arctan(w / 0.3) - np.pi / 2 - np.arctan2(0.1 * w, 4 - w**2) - 0.36 * w
    np.testing.assert_allclose(G.phase(w), wanted, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(G.phase(-w), -wanted, rtol=1e-13, atol=1e-13)
    shuffled = G.phase(w[[3, 1, 1, 5]])
    np.testing.assert_allclose(shuffled, wanted[[3, 1, 1, 5]], rtol=1e-13, atol=1e-13)
    assert G.phase(0.5).shape == ()


@settings(max_examples=30)
@given(transfer_functions())
def test_the_phase_is_that_of_a_fine_grid(G):
    w = np.linspace(0.01, 8.0, 16001)
    values = G.frequency_response(w)
    assume(G.num.coefficients.any())
    usual = np.isfinite(values) & (values != 0.0)
    assume(usual.all())
    unwrapped = np.unwrap(np.angle(values))
    # Next to a zero or pole a grid proves nothing.
    assume(np.abs(np.diff(unwrapped)).max() < 0.5)
    phase = G.phase(w[[0, 1234, 16000]])
    np.testing.assert_allclose(
        np.diff(phase), np.diff(unwrapped[[0, 1234, 16000]]), rtol=1e-9, atol=1e-7
    )
    np.testing.assert_allclose(np.exp(1j * phase[0]), values[0] / abs(values[0]), atol=1e-8)


def test_the_phase_starts_and_jumps_as_agreed():
    first = 1e-6
    assert (1 / s**2).phase(first) == pytest.approx(-math.pi)
    assert (s / (s + 1)).phase(first) == pytest.approx(math.pi / 2, abs=1e-5)
    assert (-1 / (s + 1)).phase(first) == pytest.approx(math.pi, abs=1e-5)
    assert (1 / (s - 1)).phase(first) == pytest.approx(-math.pi, abs=1e-5)
    np.testing.assert_allclose((1 / (s**2 + 1)).phase([0.5, 2.0]), [0.0, -math.pi], atol=1e-12)
    for G in (1 / s**2, s / (s + 1), -1 / (s + 1), 1 / (s - 1), (1 - delay(1.0)) / (s + 1)):
        assert G.phase(0.0) == pytest.approx(G.phase(first), abs=1e-5)
    assert (1 / (s + 1)).phase([0.0, 1.0]).tolist() == [0.0, pytest.approx(-math.pi / 4)]


# Margins


@settings(max_examples=30)
@given(st.floats(0.1, 10), st.floats(0.01, 0.99))
def test_margins_of_an_integrator_in_closed_form(K, part):
    T = part * math.pi / (2 * K)
    found = (K / s * delay(T)).margin()
    assert found.stable
    assert found.gain_margin == pytest.approx(math.pi / (2 * K * T), rel=1e-12)
    assert found.gain_margin_omega == pytest.approx(math.pi / (2 * T), rel=1e-12)
    assert found.phase_margin == pytest.approx(90 - math.degrees(K * T), rel=1e-10)
    assert found.delay_margin == pytest.approx(math.pi / (2 * K) - T, rel=1e-10)
    assert found.delay_margin_omega == pytest.approx(K, rel=1e-14)
    assert found.gain_reduction == 0.0


def test_margins_of_a_first_order_lag_in_closed_form():
    K, a, T = 3.0, 0.7, 0.4
    found = (K / (s + a) * delay(T)).margin()
    omega = math.sqrt(K * K - a * a)
    assert found.gain_crossovers.tolist() == [pytest.approx(omega, rel=1e-14)]
    assert found.delay_margin == pytest.approx((math.pi - math.atan(omega / a)) / omega - T)


def test_an_unstable_plant_has_a_least_gain():
    found = (2.0 * delay(0.1) / (s - 1)).margin()
    assert found.stable
    assert found.gain_reduction == pytest.approx(0.5, rel=1e-14)
    assert found.gain_reduction_omega == 0.0
    for factor, stable in ((0.501, True), (0.499, False)):
        assert feedback(factor * 2.0 * delay(0.1) / (s - 1)).is_stable() is stable


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
    # Three crossings, the least delay at the last.
    2.0 / s + 0.5 * s / (s**2 + 0.05 * s + 25),
]


@pytest.mark.parametrize("G", LOOPS)
def test_margins_are_where_stability_is_lost(G):
    found = G.margin()
    if not found.stable:
        pytest.fail(f"{G} is no example")
    lost = found.delay_margin
    if math.isfinite(lost) and lost > 0.0:
        assert (G.den + G.num * delay(0.9999 * lost)).is_stable()
        assert not (G.den + G.num * delay(1.0001 * lost)).is_stable()
        for part in (0.2, 0.5, 0.8):
            assert (G.den + G.num * delay(part * lost)).is_stable()
    else:
        assert all((G.den + G.num * delay(T)).is_stable() for T in (0.01, 1.0, 20.0))
    for factor, inside, outside in (
        (found.gain_margin, 0.9999, 1.0001),
        (found.gain_reduction, 1.0001, 0.9999),
    ):
        if 0.0 < factor < math.inf:
            assert (G.den + factor * inside * G.num).is_stable()
            assert not (G.den + factor * outside * G.num).is_stable()


def test_the_delay_margin_is_not_always_at_the_last_or_first_crossing():
    G = LOOPS[-1]
    found = G.margin()
    assert len(found.gain_crossovers) == 3
    assert found.delay_margin == found.delay_margins.min()
    assert found.delay_margin_omega == found.gain_crossovers[np.argmin(found.delay_margins)]


@settings(max_examples=40)
@given(quasi_polynomials(), quasi_polynomials(degree=3))
def test_no_crossing_is_missed(n, d):
    assume(n.coefficients.any())
    # The highest power of the denominator without delay: no neutral or advanced loops here.
    d = d + (5 * s**4)
    G = TransferFunction(n, d)
    found = G.margin()
    assert found.searched[0] == math.inf
    w = np.linspace(1e-3, 20, 20001)
    values = G.frequency_response(w)
    size = np.log(np.abs(values))
    changes = np.flatnonzero(size[:-1] * size[1:] < 0)
    for low, high in zip(w[changes], w[changes + 1], strict=True):
        assert ((found.gain_crossovers >= low) & (found.gain_crossovers <= high)).sum() == 1
    real = (values.imag[:-1] * values.imag[1:] < 0) & (values.real[:-1] < 0)
    real &= (values.real[1:] < 0) & (w[1:] < found.searched[1])
    for at in np.flatnonzero(real):
        inside = (found.phase_crossovers >= w[at]) & (found.phase_crossovers <= w[at + 1])
        assert inside.sum() == 1
    for omega in found.gain_crossovers:
        assert abs(n(1j * omega)) == pytest.approx(abs(d(1j * omega)), rel=1e-6)
    below = found.gain_margins[found.gain_margins > 1.0]
    if found.stable and below.size and found.searched[1] < math.inf:
        far = np.geomspace(found.searched[1], 1e3 * found.searched[1], 2001)
        assert (np.abs(G.frequency_response(far)) < 1.0 / below.min()).all()


@settings(max_examples=30)
@given(quasi_polynomials(rows=2, degree=1), times)
def test_random_delay_margins_are_where_stability_is_lost(n, tau):
    assume(n.coefficients.any())
    G = n * delay(tau) / (s**2 + 3 * s + 2)
    found = G.margin()
    assume(found.stable)
    lost = found.delay_margin
    if lost == 0.0 or lost > 50.0:
        return
    assume(lost > 1e-3)
    assert (G.den + G.num * delay(0.999 * lost)).is_stable()
    assert not (G.den + G.num * delay(1.001 * lost)).is_stable()


def test_a_gain_that_only_touches_one_is_listed():
    # |s^2 + a s + b|^2 = (omega^2 - 1)^2 + 1, but for rounding.
    d = s**2 + math.sqrt(2 * math.sqrt(2) - 2) * s + math.sqrt(2)
    found = (1 / d).margin()
    assert found.gain_crossovers.size in (1, 2)
    np.testing.assert_allclose(found.gain_crossovers, 1.0, atol=1e-6)


@pytest.mark.parametrize(
    "G",
    [
        delay(1.0) / (5 * s**4 + delay(1.0)),
        0.5 * delay(0.3) * (1 + 0.3 * s + 0.045 * s**2 + 0.0045 * s**3) / (1 - s**4),
        1 / (s + 1),
        (1 + 0.3 * s) * delay(0.3) / (s**2 + 1),
    ],
)
def test_crossings_of_high_order_at_zero_frequency_hide_no_others(G):
    found = G.margin()
    w = np.geomspace(1e-6, 30.0, 60001)
    values = G.frequency_response(w)
    crossed = (values.imag[1:] * values.imag[:-1] < 0) & (values.real[1:] < 0)
    crossed &= (values.real[:-1] < 0) & (w[1:] < found.searched[1]) & (w[:-1] > 1e-2)
    assert crossed.sum() == ((found.phase_crossovers > 1e-2) & (found.phase_crossovers < 30)).sum()


def test_unstable_loops_have_no_margins_but_crossings():
    found = (9.0 / s * delay(0.36)).margin()
    assert not found.stable
    assert math.isnan(found.gain_margin)
    assert math.isnan(found.delay_margin)
    assert math.isnan(found.phase_margin_omega)
    assert found.gain_crossovers.tolist() == [pytest.approx(9.0)]
    assert "not stable" in repr(found)
    assert not found.gain_crossovers.flags.writeable
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)


def test_neutral_loops_lose_strong_stability():
    # A delay of any length splits what a lead without delay kept together.
    G = 1.5 * (s + 1) / (s + 2)
    found = G.margin()
    assert found.stable
    assert found.delay_margin == 0.0
    assert found.delay_margin_omega == math.inf
    assert not (G.den + G.num * delay(1e-4)).is_stable()
    # With a high-frequency gain of 0.3 a factor of 10/3 is one that no neutral loop stands.
    found = (0.3 * (s + 1) * delay(0.1) / (s + 2)).margin()
    assert found.gain_margin == pytest.approx(1 / 0.3, rel=1e-14)
    assert found.gain_margin_omega == math.inf
    assert found.delay_margin > 0.0
    # Two delays in the lead: their coefficients add up in the worst case.
    found = ((1 + 0.2 * s) * (delay(0.1) + delay(0.1732)) / (s * (1 + 0.3 * delay(0.2)))).margin()
    assert found.gain_margin <= 0.7 / 0.4 * (1 + 1e-14)


@pytest.mark.parametrize(
    ("G", "message"),
    [
        (TransferFunction(s * delay(0.1)), "grows with frequency"),
        (1 / (s * delay(0.5)), "before it comes"),
        (1 / (1 + s * delay(0.5)), "not causal"),
    ],
)
def test_loops_without_margins_are_refused(G, message):
    with pytest.raises(ValueError, match=message):
        G.margin()


def test_long_and_short_delays_are_no_trouble():
    found = (2 / s * delay(1e-6)).margin()
    assert found.gain_margin == pytest.approx(math.pi / 4e-6, rel=1e-9)
    found = (1e-4 / s * delay(1e4)).margin()
    assert found.gain_margin == pytest.approx(math.pi / 2, rel=1e-12)
    assert found.delay_margin == pytest.approx(1e4 * (math.pi / 2 - 1), rel=1e-9)


# Loops


@pytest.mark.parametrize(
    "controller",
    [
        dtm.P(2.0),
        dtm.PV(2.0, 0.3),
        dtm.PD(2.0, 0.3, filter=dtm.DerivativeFilter(38.0)),
        dtm.PI(2.0, 0.5),
        dtm.PID(2.0, 0.5, 0.1, filter=dtm.DerivativeFilter(20.0, 0.7)),
    ],
)
@pytest.mark.parametrize(
    "plant", [dtm.Integrator(0.9, 0.1), dtm.FirstOrder(1.2, 0.5), dtm.kit_plant()]
)
def test_the_loop_as_a_transfer_function(plant, controller):
    loop = dtm.ControlLoop(plant, controller, delay=0.1)
    L = loop.open_loop()
    z = np.array([0.3 + 1j, -0.5 + 4j, 2.0])
    parts = plant.transfer_function() * controller.transfer_function() * delay(0.1)
    np.testing.assert_allclose(L(z), parts(z), rtol=1e-13)
    np.testing.assert_allclose(feedback(L).den(z), loop.characteristic()(z), rtol=1e-13)
    assert repr(loop.margin()) == repr(L.margin())
    if loop.is_stable():
        more = loop.margin().delay_margin
        assert loop.stable_range("delay")[1] == pytest.approx(0.1 + more, rel=1e-8)


@pytest.mark.parametrize("path", ["command", "measurement"])
def test_the_closed_loop_is_the_transform_of_its_step_response(path):
    loop = dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(2.0, 0.2, filter=dtm.DerivativeFilter(30.0)), delay=0.25,
        delay_path=path,
    )  # fmt: skip
    t = np.linspace(0, 40, 40001)
    y = loop.step_response(t).outputs
    for z in (1.0, 0.4, 2.0):
        from scipy.integrate import simpson

        transform = z * (simpson(y * np.exp(-z * t), x=t) + math.exp(-40 * z) / z)
        assert loop.closed_loop()(z).real == pytest.approx(transform, rel=1e-7)
    assert loop.closed_loop().dcgain() == pytest.approx(1.0)


def test_sampled_loops_do_not_pretend():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
    for ask in (loop.margin, loop.open_loop, loop.closed_loop):
        with pytest.raises(ValueError, match=r"sample_time=0.065 .* continuous\(\)"):
            ask()
    assert loop.continuous().margin().delay_margin > loop.stable_range("delay")[1] - 0.36
    with pytest.raises(ValueError, match="delay of this loop is None"):
        loop.replace(delay=None).continuous().margin()


# Other packages

needs_control = pytest.mark.skipif(
    importlib.util.find_spec("control") is None, reason="python-control is not installed"
)
RATIONAL = [
    ([2.0], [1.0, 0.0]),
    ([1.5, 1.5], [1.0, 0.5, 9.0, 0.0]),
    ([1.0, -3.0, 2.0], [1.0, 4.0, 6.0, 4.0]),
    ([10.0], [1.0, 3.0, 3.0, 1.0]),
    ([6.0], [1.0, 3.0, 2.0, 0.0]),
    ([0.5, 1.0], [1.0, 2.0]),
    ([4.0], [1.0, -1.0]),
]


@needs_control
@pytest.mark.parametrize(("num", "den"), RATIONAL)
def test_python_control_agrees_without_delay(num, den):
    import control

    theirs = control.tf(num, den)
    ours = TransferFunction(num, den)
    assert TransferFunction.from_control(theirs) == ours
    omega = np.geomspace(0.01, 100, 50)
    np.testing.assert_allclose(ours.frequency_response(omega), theirs(1j * omega), rtol=1e-12)
    both = feedback(ours), control.feedback(theirs)
    for mine, other in ((both[0].poles(), both[1].poles()), (ours.zeros(), theirs.zeros())):
        np.testing.assert_allclose(np.sort_complex(mine), np.sort_complex(other), atol=1e-6)
    assert both[0].is_stable() == bool(np.all(both[1].poles().real < 0))
    found = ours.margin()
    gm, pm, _, wpc, wgc, _ = control.stability_margins(theirs, returnall=True)
    np.testing.assert_allclose(np.sort(found.gain_crossovers), np.sort(wgc), rtol=1e-7)
    inner = np.argsort(wpc)
    if found.stable:
        np.testing.assert_allclose(found.phase_crossovers, wpc[inner], rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(found.gain_margins, gm[inner], rtol=1e-6)
        if len(pm):
            assert found.phase_margin == pytest.approx(np.min(np.abs(pm)), rel=1e-6)
    _, phase, _ = control.frequency_response(theirs, omega)
    turns = (ours.phase(omega) - np.unwrap(phase)) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns[0]), atol=1e-9)


@needs_control
def test_python_control_both_ways():
    import control

    theirs = control.ss([[0.0, 1.0], [-4.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    G = TransferFunction.from_control(theirs, delay=0.36)
    z = 0.3 + 2j
    assert G(z) == pytest.approx(complex(theirs(z)) * cmath.exp(-0.36 * z), rel=1e-12)
    back = TransferFunction([1.0, 2.0], [3.0, 4.0]).to_control()
    assert isinstance(back, control.TransferFunction)
    assert complex(back(z)) == pytest.approx((z + 2) / (3 * z + 4))
    with pytest.raises(ValueError, match="pade=n"):
        G.to_control()
    rough = G.to_control(pade=4)
    assert complex(rough(1j)) == pytest.approx(G(1j), rel=1e-9)
    num, den = control.pade(0.36, 4)
    assert complex(rough(20j)) == pytest.approx(complex((theirs * control.tf(num, den))(20j)))
    T = feedback(2 / s * delay(0.36) + delay(0.7) / s)
    assert complex(T.to_control(pade=5)(1j)) == pytest.approx(T(1j), rel=1e-8)
    for bad, message in (
        (control.tf([1.0], [1.0, 1.0], 0.1), "dt=0.1"),
        (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "2 inputs"),
    ):
        with pytest.raises(ValueError, match=message):
            TransferFunction.from_control(bad)
    with pytest.raises(TypeError, match="int"):
        TransferFunction.from_control(3)
    with pytest.raises(ValueError, match="delay"):
        TransferFunction.from_control(theirs, delay=-1.0)


def test_scipy_both_ways():
    from scipy import signal

    for system in (
        signal.lti([2.0], [1.0, 3.0]),
        signal.ZerosPolesGain([], [-3.0], 2.0),
        signal.StateSpace([[-3.0]], [[1.0]], [[2.0]], [[0.0]]),
        ([2.0], [1.0, 3.0]),
    ):
        G = TransferFunction.from_scipy(system, delay=0.1)
        assert G(1.0) == pytest.approx(0.5 * math.exp(-0.1))
    back = TransferFunction([2.0], [1.0, 3.0]).to_scipy()
    assert isinstance(back, signal.TransferFunction)
    assert back.freqresp([1.0])[1][0] == pytest.approx(2 / (3 + 1j))
    rough = (2.0 / (s + 3) * delay(0.1)).to_scipy(pade=3)
    assert rough.freqresp([1.0])[1][0] == pytest.approx(2 / (3 + 1j) * cmath.exp(-0.1j), rel=1e-9)
    with pytest.raises(ValueError, match=r"dt=0\.1"):
        TransferFunction.from_scipy(signal.dlti([1.0], [1.0, 0.5], dt=0.1))
    with pytest.raises(ValueError, match="2 outputs"):
        TransferFunction.from_scipy(
            signal.StateSpace([[-1.0]], [[1.0]], [[1.0], [2.0]], [[0.0], [0.0]])
        )
    with pytest.raises(TypeError, match="float"):
        TransferFunction.from_scipy(3.0)
    for order in (0, 21):
        with pytest.raises(ValueError, match=f"pade={order}"):
            (1 / s * delay(0.1)).to_scipy(pade=order)


def test_without_python_control_it_says_what_to_install(monkeypatch):
    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", absent)
    with pytest.raises(ImportError, match="pip install control"):
        (1 / s).to_control()


# Pictures


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.mark.parametrize("G", [LOOPS[0], LOOPS[2], 9.0 / s * delay(0.36), TransferFunction(2.0)])
def test_pictures_are_labelled(pyplot, G):
    upper, lower = G.bode(margins=True)
    assert upper.get_ylabel() == "gain"
    assert lower.get_ylabel() == "phase / °"
    assert lower.get_xlabel() == "frequency / (rad/s)"
    ax = G.nyquist(margins=True)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Re G(jω)", "Im G(jω)")
    assert "-1" in [line.get_label() for line in ax.get_lines()]
    stable = G.margin().stable
    assert ("delay margin" in ax.get_title()) == stable
    assert ("not stable" in ax.get_title()) == (not stable)
    ax.figure.canvas.draw()
    upper.figure.canvas.draw()


def test_pictures_go_where_they_are_told(pyplot):
    _, axes = pyplot.subplots(2, 1)
    assert TransferFunction(s * delay(0.1)).bode([0.1, 1.0, 10.0], axes=axes) is axes
    _, ax = pyplot.subplots()
    assert (1 / (s + 1)).nyquist([0.1, 1.0], ax=ax) is ax
    with pytest.raises(ValueError, match="axes has 1"):
        (1 / s).bode(axes=[ax])
