"""The quasi-polynomial: what it accepts, its algebra, its values."""

import cmath
import copy
import math
import pickle

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from deadtime import QuasiPolynomial, delay, s
from hypothesis import given, settings, strategies as st

numbers = st.floats(-10, 10, allow_subnormal=False)
times = st.floats(0, 3, allow_subnormal=False)
points = st.complex_numbers(max_magnitude=5, allow_subnormal=False)


@st.composite
def quasi_polynomials(draw):
    m = draw(st.integers(1, 4))
    d = draw(st.integers(0, 3))
    rows = draw(st.lists(st.lists(numbers, min_size=d + 1, max_size=d + 1), min_size=m, max_size=m))
    return QuasiPolynomial(rows, draw(st.lists(times, min_size=m, max_size=m)))


def exact(h, z):
    """Value of h and the sum of the moduli of its terms, in 40 digits."""
    with mp.workdps(40):
        z = mp.mpc(z)
        total, size = mp.mpc(0), mp.mpf(0)
        for row, tau in zip(h.coefficients, h.delays, strict=True):
            e = mp.exp(-z * mp.mpf(float(tau)))
            for k, c in enumerate(row):
                total += mp.mpf(float(c)) * z**k * e
                size += abs(mp.mpf(float(c)) * z**k * e)
        return total, size


def close(value, wanted, size, factor=200):
    """Within `factor` units of rounding of the terms, whose number is below 100 here."""
    return abs(mp.mpc(value) - wanted) <= factor * 2.3e-16 * (size + mp.mpf(10) ** -300)


def test_normalised_once():
    h = QuasiPolynomial([[1, 0, 0], [2, -1, 0], [0, 0, 0], [0, 1, 0]], [2.0, 0.5, 0.1, 0.5])
    assert h.delays.tolist() == [0.5, 2.0]
    assert h.coefficients.tolist() == [[2.0], [1.0]]
    assert h.degree == 0
    zero = s - s
    assert zero.coefficients.tolist() == [[0.0]]
    assert zero.delays.tolist() == [0.0]
    assert zero.degree == 0


@pytest.mark.parametrize(
    ("h", "kind"),
    [
        (s**2 + 1, "polynomial"),
        (s * delay(2.0), "polynomial"),
        (s + delay(1.0), "retarded"),
        (s * delay(1.0) + delay(1.5), "retarded"),
        (s + s * delay(1.0), "neutral"),
        (1 - 0.5 * delay(1.0), "difference"),
        (1 + s * delay(1.0), "advanced"),
    ],
)
def test_kind(h, kind):
    assert h.kind == kind


@pytest.mark.parametrize(
    ("coefficients", "delays", "error"),
    [
        ([[1.0]], [-1.0], ValueError),
        ([[1.0]], [math.nan], ValueError),
        ([[math.inf]], [0.0], ValueError),
        ([[1.0], [2.0]], [0.0], ValueError),
        ([[1.0], [2.0, 3.0]], [0.0, 1.0], ValueError),
        ([], [], ValueError),
        ([1.0], [0.0], ValueError),
        ([[1j]], [0.0], TypeError),
        ([["a"]], [0.0], TypeError),
    ],
)
def test_bad_arguments_are_refused(coefficients, delays, error):
    with pytest.raises(error):
        QuasiPolynomial(coefficients, delays)


@pytest.mark.parametrize("bad", [-0.1, math.inf, math.nan])
def test_a_delay_is_not_negative_and_finite(bad):
    with pytest.raises(ValueError, match="delay"):
        delay(bad)


@pytest.mark.parametrize("bad", ["1", None, 1j, [1.0]])
def test_a_delay_is_a_number(bad):
    with pytest.raises(TypeError):
        delay(bad)


def test_does_not_change():
    h = s + delay(1.0)
    with pytest.raises(AttributeError):
        h.degree = 3
    with pytest.raises(AttributeError):
        h.other = 3
    for array in (h.coefficients, h.delays):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_pickle_copy_equality_and_hash():
    h = s**2 + (1 - 2.5 * s) * delay(0.25)
    for other in (pickle.loads(pickle.dumps(h)), copy.copy(h), copy.deepcopy(h)):
        assert other == h
        assert hash(other) == hash(h)
    assert h != s
    assert h != 3
    assert hash(s * 1.0 + 0.0 * delay(1.0)) == hash(s)


def test_negative_zeros_are_zeros():
    a = QuasiPolynomial([[-0.0, 1.0]], [-0.0])
    assert a == s
    assert hash(a) == hash(s)


@pytest.mark.parametrize(
    ("h", "text"),
    [
        (s - s, "0"),
        (s, "s"),
        (-s, "-s"),
        (s**2 - 3, "-3 + s^2"),
        (delay(0.5), "exp(-0.5 s)"),
        (s - delay(0.5), "s - exp(-0.5 s)"),
        (s + (2 - 0.3 * s) * delay(0.36), "s + (2 - 0.3 s) exp(-0.36 s)"),
        (1e-7 * s - 2e20 * delay(1.0), "1e-07 s - 2e+20 exp(-1 s)"),
    ],
)
def test_repr_is_algebra(h, text):
    assert repr(h) == text


def test_numbers_on_either_side():
    h = delay(1.0)
    for number in (2, 2.0, np.float64(2.0), np.int64(2), np.array(2.0), True + 1):
        assert number * h == h * number == QuasiPolynomial([[2.0]], [1.0])
        assert number + h == h + number
        assert number - h == -(h - number)
        assert h / number == h * 0.5


@pytest.mark.parametrize(
    "quotient", [lambda: 1 / s, lambda: s / s, lambda: s / delay(1.0), lambda: s**-1]
)
def test_quotients_are_transfer_functions(quotient):
    assert isinstance(quotient(), dtm.TransferFunction)


def test_operators_of_foreign_types_are_tried():
    class Parameter:
        def __radd__(self, other):
            return "added"

        __rsub__ = __rmul__ = __rtruediv__ = __rpow__ = __add__ = __mul__ = __radd__

    p = Parameter()
    assert s + p == s - p == s * p == s / p == p * s == p + s == s**p == "added"
    for bad in ("x", None, [1.0], np.arange(2.0), 1j):
        with pytest.raises(TypeError):
            s + bad
        with pytest.raises(TypeError):
            s * bad


def test_overflow_and_size_are_refused():
    with pytest.raises(ValueError, match="too large"):
        (1e200 * s) * (1e200 * s)
    with pytest.raises(ValueError, match="coefficients"):
        (s + delay(1.0)) ** 100_000
    with pytest.raises(ZeroDivisionError):
        s / 0


@settings(deadline=None)
@given(quasi_polynomials(), quasi_polynomials(), points, numbers)
def test_algebra_is_pointwise(a, b, z, c):
    (x, m), (y, n) = exact(a, z), exact(b, z)
    assert close((a + b)(z), x + y, m + n)
    assert close((a - b)(z), x - y, m + n)
    # Delays of a product are rounded, which counts as |s| τ times the size.
    assert close((a * b)(z), x * y, m * n)
    assert close((c * a)(z), mp.mpf(c) * x, abs(c) * m)
    assert close((a**2)(z), x * x, m * m)


@settings(deadline=None)
@given(quasi_polynomials(), points)
def test_derivative(h, z):
    first, second = h.derivative(), h.derivative(2)
    # By the rule for each term, in 40 digits.
    total, size, total2, size2 = mp.mpc(0), mp.mpf(0), mp.mpc(0), mp.mpf(0)
    with mp.workdps(40):
        w = mp.mpc(z)
        for row, tau in zip(h.coefficients, h.delays, strict=True):
            t = mp.mpf(float(tau))
            for k, c in enumerate(row):
                f = mp.mpf(float(c)) * mp.exp(-w * t)
                p = [w**k, k * w ** (k - 1) if k else mp.mpf(0)]
                p.append(k * (k - 1) * w ** (k - 2) if k > 1 else mp.mpf(0))
                total += f * (p[1] - t * p[0])
                size += abs(f) * (abs(p[1]) + t * abs(p[0]))
                total2 += f * (p[2] - 2 * t * p[1] + t * t * p[0])
                size2 += abs(f) * (abs(p[2]) + 2 * t * abs(p[1]) + t * t * abs(p[0]))
    assert close(first(z), total, size)
    assert close(second(z), total2, size2)
    assert h.derivative(0) == h


@settings(deadline=None)
@given(quasi_polynomials(), points)
def test_values_of_conjugates_are_conjugates(h, z):
    assert h(z.conjugate()) == h(z).conjugate()


@settings(deadline=None)
@given(quasi_polynomials(), st.floats(-300, 300), st.floats(-1e3, 1e3))
def test_values_far_out(h, x, y):
    z = complex(x, y)
    wanted, size = exact(h, z)
    value = h(z)
    if size < 1e307:
        # Angles up to 1e3 · 3 rad are reduced with their rounding error.
        assert close(value, wanted, size, 200 + 10 * abs(z))
    elif abs(wanted) > 2e308:
        assert not np.isfinite(value)


def test_values_of_arrays():
    h = s + 2 * delay(0.5)
    z = np.linspace(-1, 1, 24).reshape(2, 3, 4) + 2j
    for array in (z, z[::2, ::-1], z.T, z.astype(np.complex64), np.zeros((0, 3)), np.arange(3)):
        values = h(array)
        assert values.shape == array.shape
        assert values.dtype == np.complex128
        expected = [h(complex(x)) for x in np.asarray(array).ravel()]
        assert values.ravel().tolist() == expected
    assert type(h(1.0)) is complex
    assert h([0.0, 1.0]).shape == (2,)
    big = np.linspace(0, 1, 10_001) * 1j
    assert np.array_equal(h(big), [h(complex(x)) for x in big])
    with pytest.raises(TypeError):
        h("1")


def test_not_a_number_stays_so():
    assert cmath.isnan((s + delay(1.0))(math.nan))


def test_orders_of_derivatives():
    for bad in (-1, 2**40):
        with pytest.raises(ValueError, match=f"n={bad}"):
            s.derivative(bad)
    with pytest.raises(TypeError):
        s.derivative(0.5)
    assert (s**3).derivative(1_000_000) == s - s


def test_public_names():
    assert {"QuasiPolynomial", "delay", "s"} <= set(dtm.__all__)


@pytest.mark.parametrize("h", [s + 2.0 * delay(0.36), s + (2.0 + 0.3 * s) * delay(0.36)])
def test_far_to_the_left_values_are_infinite_and_numbers(h):
    # The modulus of 1e300 squares to infinity, so no term was seen to dominate: the value was nan.
    value = h(-1e300)
    assert math.isinf(value.real)
    assert value.real > 0 if h.kind == "retarded" else value.real < 0
    assert value.imag == 0


def test_powers_that_overflow_leave_no_nan():
    h = s**3 + s * delay(0.5)
    assert h(1e200).real == math.inf
    assert h(-1e200).real == -math.inf
    assert h(1e200j).imag == -math.inf
    # The power overflows, but not what it is multiplied by.
    assert (s**2 * delay(1.0))(1e200) == 0
    small = (s**3 * delay(1.0) * 1e-200)(1e103)
    assert small == 0
    assert (1e-300 * s**4)(1e110) == pytest.approx(1e140, rel=1e-12)
