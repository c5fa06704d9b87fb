"""Values in double-double arithmetic and their bounds, against ball arithmetic."""

import numpy as np
import pytest
from deadtime import QuasiPolynomial, delay, s
from deadtime.roots import Expansion
from flint import acb, acb_series, arb, ctx, fmpq
from hypothesis import given, strategies as st

DIGITS = 400


def exact(x):
    numerator, denominator = float(x).as_integer_ratio()
    return arb(fmpq(numerator, denominator))


def reference(h, place, tau, order):
    """Taylor coefficients of h e^(s tau), by power series over balls."""
    ctx.prec, ctx.cap = DIGITS, order + 1
    point = acb_series([acb(exact(place.real), exact(place.imag)), 1])
    total = acb_series([0])
    for row, own in zip(h.coefficients.tolist(), h.delays.tolist(), strict=True):
        p = acb_series([0])
        for c in reversed(row):
            p = p * point + acb(exact(c))
        total += p * (point * acb(exact(tau) - exact(own))).exp()
    coefficients = [total[k] for k in range(order + 1)]
    ctx.cap = 10
    return coefficients


coefficient = st.floats(-10, 10).map(lambda c: c if abs(c) > 1e-6 else 0.0)
functions = st.builds(
    lambda rows, delays: QuasiPolynomial(rows[: len(delays)], delays[: len(rows)]),
    st.lists(st.lists(coefficient, min_size=4, max_size=4), min_size=4, max_size=4),
    st.lists(st.floats(0, 20), min_size=1, max_size=4),
)
places = st.builds(complex, st.floats(-15, 5), st.floats(-1e4, 1e4)) | st.builds(
    complex, st.floats(-3, 3), st.floats(-3, 3)
)


@given(functions, places, st.integers(0, 12))
def test_coefficients_are_within_their_bounds(h, place, order):
    near = h.expansion(place, order)
    assert near.coefficients.shape == near.errors.shape == (order + 1,)
    assert near.delay in h.delays
    for value, error, wanted in zip(
        near.coefficients.tolist(),
        near.errors.tolist(),
        reference(h, place, near.delay, order),
        strict=True,
    ):
        off = abs(acb(exact(value.real), exact(value.imag)) - wanted)
        assert float(off.mid()) <= error
        assert np.isfinite(error)


@given(functions, places)
def test_the_logarithmic_derivative(h, place):
    near = reference(h, place, 0.0, 1)
    if abs(near[0]) < 1e-60:
        return
    wanted = near[1] / near[0]
    size = float(abs(wanted).mid()) + h.delays.max() + 1e-3
    # Its condition is that of h and of h', but two words have digits to spare.
    found = h.logarithmic_derivative(place)
    off = abs(acb(exact(found.real), exact(found.imag)) - wanted)
    assert float(off.mid()) <= 1e-8 * size


def test_double_double_resolves_what_double_precision_does_not():
    h = (s + 1) ** 6
    near = h.expansion(-1 + 1e-4, 6)
    # Double precision loses (1e-4)^6 among terms of 64.
    assert abs(near.coefficients[0] - 1e-24) < 1e-30 + 1e-24 * 6e-12
    assert near.errors[0] < 1e-27
    assert np.allclose(near.coefficients[6], 1)
    far = (s + delay(3.0)).expansion(-1e5, 2)
    assert far.delay == 3.0
    assert far.coefficients.tolist() == [1, 0, 0]


def test_arrays_and_bad_places():
    h = s + 2.0 * delay(0.36)
    points = np.array([[1.0, 2j], [-3.0, 1e5]])
    found = h.logarithmic_derivative(points)
    assert found.shape == (2, 2)
    assert found[1, 1] == h.logarithmic_derivative(1e5)
    assert isinstance(h.logarithmic_derivative(1.0), complex)
    assert np.isnan(s.logarithmic_derivative(0.0).real)
    assert isinstance(h.expansion(1.0), Expansion)
    for bad, message in ((float("nan"), "finite"), (complex(0, np.inf), "finite"), (1e200, None)):
        if message:
            with pytest.raises(ValueError, match=message):
                h.expansion(bad)
    with pytest.raises(ValueError, match="order=61"):
        h.expansion(1.0, 61)
    with pytest.raises(ValueError, match="range of double precision"):
        (s**3 + 1).expansion(1e150, 1)
    with pytest.raises(TypeError):
        h.logarithmic_derivative("x")
