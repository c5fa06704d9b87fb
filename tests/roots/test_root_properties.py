"""Properties of characteristic roots of random loops."""

import numpy as np
from deadtime import QuasiPolynomial, delay, s
from deadtime._base.errors import ContourError
from hypothesis import assume, given, settings, strategies as st

# Thousandths: what a loop has. Coefficients of 1e-300 are refused with the reason, not solved.
gains = st.integers(-3000, 3000).filter(bool).map(lambda n: n / 1000)


@st.composite
def loops(draw):
    """First or second order, retarded or neutral with its chain to the left of −0.05/τ."""
    tau = draw(st.floats(0.1, 3))
    b = draw(st.sampled_from([0.0, 0.3, -0.7]))
    h = s + draw(gains) + (draw(gains) + b * s) * delay(tau)
    if draw(st.booleans()):
        h = h * s + draw(gains) * delay(draw(st.floats(0.1, 3))) + draw(gains)
    assume(h.kind in ("retarded", "neutral"))
    return h


@settings(deadline=None, max_examples=50)
@given(loops(), st.floats(-2, 1), st.floats(-15, 15))
def test_the_count_of_a_region_is_the_sum_over_its_parts(h, x, y):
    # Real roots belong to either side of an edge on the real axis.
    assume(y != 0)
    try:
        whole = h.count(re=(-3, 4), im=(-21, 23))
        parts = [h.count(re=re, im=im) for re in ((-3, x), (x, 4)) for im in ((-21, y), (y, 23))]
    except ContourError:
        assume(False)
    assert whole == sum(parts)


@settings(deadline=None, max_examples=50)
@given(loops())
def test_roots_are_conjugate_and_add_up(h):
    try:
        number = h.count(re=(-3, 4), im=(-21, 21))
        found = h.roots(re=(-3, 4), im=(-21, 21))
        upper = h.roots(re=(-3, 4), im=(0, 21))
        lower = h.roots(re=(-3, 4), im=(-21, 0))
    except ContourError:
        assume(False)
    assert found.counted == number
    assert set(found) == {z.conjugate() for z in found}
    assert [z for z in found if z.imag >= 0] == list(upper)
    assert [z.conjugate() for z in upper] == list(lower)


@settings(deadline=None, max_examples=50)
@given(loops(), st.integers(-6, 6))
def test_scaling_of_time(h, power):
    """With s = c z and τ = t / c the roots are divided by c, exactly for a power of two."""
    c = 2.0**power
    scaled = QuasiPolynomial(h.coefficients * c ** np.arange(h.degree + 1), h.delays * c)
    first, second = h.rightmost(2), scaled.rightmost(2)
    assert len(first) == len(second)
    assert np.allclose(np.asarray(second) * c, first, rtol=1e-9, atol=1e-6)
    assert h.is_stable() == scaled.is_stable()


@settings(deadline=None, max_examples=50)
@given(loops())
def test_nothing_lies_right_of_the_rightmost(h):
    found = h.rightmost()
    assume(len(found))
    try:
        beyond = h.count(re=(found[0].real + 2 * found.radii[0] + 1e-6, None))
        all_of_them = h.count(re=(found.region[0][0], None))
    except ContourError:
        assume(False)
    assert beyond == 0
    assert all_of_them == found.counted


@settings(deadline=None, max_examples=40)
@given(st.lists(st.floats(-4, 2), min_size=1, max_size=4), st.floats(0, 2))
def test_given_real_roots_are_found(roots, tau):
    assume(min([abs(a - b) for i, a in enumerate(roots) for b in roots[:i]] or [1]) > 1e-2)
    h = delay(tau)
    for root in roots:
        h = h * (s - root)
    found = h.roots(re=(-5, 3), im=(0, 1))
    assert np.allclose(np.sort(found.roots.real), np.sort(roots), rtol=0, atol=1e-7)
    assert found.roots.imag.tolist() == [0.0] * len(roots)
