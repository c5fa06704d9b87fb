"""Characteristic roots: closed forms, the paper's loops, regions, chains, sets."""

import math

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from deadtime import QuasiPolynomial, delay, s
from deadtime._base.errors import ContourError
from deadtime.roots import RootSet
from hypothesis import assume, given, settings, strategies as st
from root_cases import CASES, ULP, make

# Closed forms


@settings(deadline=None, max_examples=60)
@given(st.floats(-8, 8), st.floats(0.05, 4))
def test_scalar_equation_by_lambert_w(a, T):
    assume(abs(a) > 1e-3)
    assume(abs(a * T - math.exp(-1)) > 1e-6)
    h = s + a * delay(T)
    with mp.workdps(30):
        branches = [mp.lambertw(-mp.mpf(a) * mp.mpf(T), k) / mp.mpf(T) for k in range(-8, 9)]
    try:
        found = h.roots(re=(-6 / T, 9), im=(-30 / T, 30 / T))
    except ContourError:
        assume(False)
    inside = [w for w in branches if -6 / T < w.real < 9 and abs(w.imag) < 30 / T]
    assert len(found) == len(inside) == found.counted
    for root, radius in zip(found, found.radii, strict=True):
        assert min(abs(mp.mpc(root) - w) for w in inside) <= radius + ULP * abs(root)
    first = h.rightmost()
    assert abs(first[0].real - max(w.real for w in branches)) <= first.radii[0] + 1e-15


def test_critical_damping_rounded_to_a_double_is_a_pair():
    """With a = fl(1/e) the double root at -1 splits by 2 sqrt(2 (a e - 1)), some 1e-8."""
    a = math.exp(-1)
    found = (s + a * delay(1.0)).rightmost()
    with mp.workdps(40):
        w = mp.lambertw(-mp.mpf(a))
        assert abs(w.imag) > 1e-9
        for root, exact in zip(found, (w, mp.conj(w)), strict=True):
            assert abs(mp.mpc(root) - exact) <= 2 * ULP
    assert found.multiplicities.tolist() == [1, 1]
    assert found.resolved.all()


def test_a_double_root_that_rounding_cannot_split():
    # (s + e^-s)^2 has exact coefficients, and all its roots twice.
    found = ((s + delay(1.0)) ** 2).roots(re=(-4, 1), im=(-30, 30))
    assert (found.multiplicities == 2).all()
    assert found.resolved.all()
    simple = (s + delay(1.0)).roots(re=(-4, 1), im=(-30, 30))
    assert (np.abs(found.roots - simple.roots) <= found.radii + simple.radii).all()


@pytest.mark.parametrize("m", [3, 4, 6, 9])
def test_many_roots_in_one_point(m):
    """One disc for all: double-double arithmetic resolves an m-fold root to (2^-95)^(1/m)."""
    h = (s + 1) ** m * (s + 2.0 * delay(0.5))
    found = h.roots(re=(-2, 1), im=(-3, 3))
    many = int(np.argmax(found.multiplicities))
    assert found.multiplicities[many] == m
    assert abs(found[many] + 1) <= found.radii[many] < 20 * (2.0**-95) ** (1 / m)
    assert found.resolved[many] == (found.radii[many] < 1e-12)


def test_a_polynomial_has_all_its_roots():
    h = (s - 1) * (s + 2) * (s**2 + 4 * s + 13) * delay(0.7)
    everywhere = h.roots()
    assert np.allclose(everywhere, [1, -2, -2 + 3j, -2 - 3j], rtol=0, atol=1e-13)
    assert h.count() == 4
    assert np.allclose(h.rightmost(), [1], rtol=0, atol=1e-14)
    assert len(h.rightmost(9)) == 4
    # Equal real parts cannot be told apart: all of them, or none.
    assert len(h.rightmost(2)) == 4


def test_common_powers_of_s_are_exact_roots():
    """Roots at 0 that follow from zero coefficients are exact."""
    h = s**3 * (s + delay(1.0))
    found = h.roots(re=(-1, 1), im=(-5, 5))
    assert found.multiplicities.tolist() == [3, 1, 1]
    assert found[0] == 0
    assert found.radii[0] == 0
    assert found.resolved[0]
    assert h.count(re=(-1, 1), im=(0, 5)) == 4
    assert h.count(re=(1e-300, None)) == 0
    assert h.rightmost().multiplicities.tolist() == [3]
    assert not h.is_stable()
    with pytest.raises(ContourError):
        h.count(re=(0, 1), im=(-5, 5))
    assert (s**4).count() == 4
    # One more comes from the delay: a disc that reaches 0 holds both.
    both = (s * (1 - delay(1.0))).roots(re=(-1, 1), im=(-1, 1))
    assert both.multiplicities.tolist() == [2]
    assert (both[0], both.radii[0], both.resolved[0]) == (0, 0, True)
    assert np.allclose((s * (1 - 0.5 * delay(1.0))).rightmost(), [0])


def test_rightmost_roots_close_to_the_chains():
    """Newton's iteration once stopped too early, and the disc of its root crossed the line."""
    rows = [
        [-0.073, 4.34, -6.29, 0.0, 0.036, -0.344],
        [-0.035, 0.03, 28.65, -0.34, 0.49, -0.537],
        [-0.88, 0.23, 0.0, 0.0, 0.0, -0.018],
    ]
    h = QuasiPolynomial(rows, [0.0, 1.074, 2.649])
    found = h.rightmost(3)
    assert len(found) == found.counted == h.count(re=(found.region[0][0], None)) == 3
    assert 0 < found.region[0][0] - h.chain_abscissa() < 1e-3


# The paper's loops: s + (Kp + Kv s) e^(−s Td)


def test_a_pair_almost_double_beside_roots_on_the_chain():
    # The next pair is 1.5e-8 right of the chain; no line lies between the two.
    h = s + (1.503849446591373 + 0.1353576030581129 * s) * delay(0.36)
    mp.mp.dps = 30
    kp, kv, wait = (mp.mpf(x) for x in (1.503849446591373, 0.1353576030581129, 0.36))
    first = mp.findroot(lambda z: z + (kp + kv * z) * mp.exp(-z * wait), mp.mpc(-5.55, 0.09))
    found = h.rightmost()
    np.testing.assert_allclose(found.roots, [complex(first), complex(first).conjugate()], rtol=1e-9)
    assert h.spectral_abscissa() == found.roots[0].real
    assert h.count(re=(float(first.real) - 1e-3, None)) == 2


def test_pv_loop_of_the_paper():
    def loop(Kv):
        return s + (2.0 + Kv * s) * delay(0.36)

    first = loop(0.3).rightmost()
    assert abs(first[0] + 3.3168) < 5e-5
    assert len(first) == 1
    assert abs(loop(0.3).chain_abscissa() - math.log(0.3) / 0.36) < 1e-14
    pair = loop(0.7).rightmost()
    assert np.allclose(pair, [-0.926 + 7.713j, -0.926 - 7.713j], rtol=0, atol=5e-4)
    # With Kv = cos(ω Td) and Kp = ω sin(ω Td) a pair sits at ±iω.
    with mp.workdps(20):
        omega = mp.findroot(lambda w: w * mp.sin(w * mp.mpf("0.36")) - 2, 8)
        limit = float(-mp.cos(omega * mp.mpf("0.36")))
    assert abs(limit - 0.9685) < 5e-5
    assert loop(limit - 1e-6).is_stable()
    assert not loop(limit + 1e-6).is_stable()
    assert not loop(1.1).is_stable()


def test_p_loop_of_the_paper():
    limit = math.pi / (2 * 0.36)
    assert abs(limit - 4.363) < 5e-4
    assert (s + (limit - 1e-9) * delay(0.36)).is_stable()
    assert not (s + limit * delay(0.36)).is_stable()
    assert not (s + (limit + 1e-9) * delay(0.36)).is_stable()
    assert (s + (limit + 1e-9) * delay(0.36)).count(re=(0, None)) == 2


# Regions


def test_open_ends():
    h = s + delay(1.0)
    assert h.count(re=(-0.5, None)) == 2
    assert h.count(im=(0, 30)) == 5
    assert h.count(re=(0, None), im=(0, None)) == 0
    assert (1 + s**2 * delay(1.0)).count(im=(-20, 20)) > 0
    assert h.roots(re=(-0.5, None)).region == ((-0.5, math.inf), (-math.inf, math.inf))
    neutral = s + (1 + 0.5 * s) * delay(1.0)
    # Left of its chain the delayed term leads: finitely many roots there, too.
    assert neutral.count(re=(None, -3.0)) == 0
    assert neutral.count(re=(-0.6, None)) == len(neutral.roots(re=(-0.6, None)))


@pytest.mark.parametrize(
    ("h", "where", "message"),
    [
        (s + delay(1.0), {}, "infinitely many"),
        (s + delay(1.0), {"re": (None, 0)}, "infinitely many"),
        (s + (1 + 0.5 * s) * delay(1.0), {"re": (-1, None)}, "chain"),
        (1 + s * delay(1.0), {"re": (0, None)}, "advanced"),
        (s - s, {"re": (0, 1), "im": (0, 1)}, "zero everywhere"),
        (s, {"re": (1, 0)}, "below its upper end"),
        (s, {"re": (1, 1)}, "below its upper end"),
        (s, {"im": (math.nan, 1)}, "below its upper end"),
        (s, {"re": (math.inf, None)}, "below its upper end"),
    ],
)
def test_regions_that_cannot_be(h, where, message):
    for method in (h.count, h.roots):
        with pytest.raises(ValueError, match=message):
            method(**where)


@pytest.mark.parametrize("bad", [1.0, (1.0,), ("a", 1.0), (1, 2, 3), "ab"])
def test_ranges_are_pairs(bad):
    with pytest.raises(TypeError, match="give a range"):
        s.count(re=bad)


def test_an_edge_through_a_root_is_never_moved():
    h = s * (s + 1 + delay(1.0))
    with pytest.raises(ContourError) as error:
        h.count(re=(0, 5))
    away = 2 * error.value.distance
    assert h.count(re=(-away, 5)) == 1
    assert h.count(re=(away, 5)) == 0


def test_far_to_the_left_nothing_overflows():
    h = s + delay(1.0)
    assert h.count(re=(-1e4, 2), im=(-30, 30)) == 10
    assert len(h.roots(re=(-1e4, 2), im=(-30, 30))) == 10


def test_tiny_and_huge_scales():
    tiny = s + 1e8 * delay(1e-8)
    assert tiny.count(re=(-1e9, 2e8), im=(0, 3e9)) == 5
    assert len(tiny.roots(re=(-1e9, 2e8), im=(0, 3e9))) == 5
    slow = QuasiPolynomial([[0, 1e290], [1e286, 0]], [0.0, 1e4])
    reference = (s + delay(1.0)).rightmost()
    assert np.allclose(slow.rightmost() * np.array(1e4), reference, rtol=1e-12)


# Chains


def test_chain_abscissa_in_closed_form():
    assert (s + delay(1.0)).chain_abscissa() == -math.inf
    assert (1 + s * delay(1.0)).chain_abscissa() == math.inf
    assert (s**2).chain_abscissa() == -math.inf
    golden = s * (1 - delay(1.0) - delay(2.0)) + 1
    assert abs(golden.chain_abscissa() - math.log((1 + math.sqrt(5)) / 2)) < 1e-15


def test_a_neutral_loop_right_of_its_chain():
    h = s + (1 + 1.2 * s) * delay(1.0)
    assert not h.is_stable()
    assert abs(h.chain_abscissa() - math.log(1.2)) < 1e-15
    assert h.spectral_abscissa() > h.chain_abscissa()


def test_exact_delays_can_be_stable_where_perturbed_ones_are_not():
    """Example 2.6 of the TDS-CONTROL manual: stable for delays 1 and 2 only as long as exact."""
    h = make(CASES["tdscontrol_2.6_tau2=2"])
    assert h.is_stable(strong=False)
    assert not h.is_stable()
    moved = make(CASES["tdscontrol_2.6_tau2=2.05"])
    assert not moved.is_stable(strong=False)
    assert not moved.is_stable()


def test_invalid_arguments_are_refused():
    for bad in (0, -1):
        with pytest.raises(ValueError, match="n="):
            s.rightmost(bad)
    with pytest.raises(TypeError):
        s.rightmost(1.5)
    with pytest.raises(ValueError, match="advanced"):
        (1 + s * delay(1.0)).rightmost()
    assert (1 + s * delay(1.0)).spectral_abscissa() == math.inf
    assert not (1 + s * delay(1.0)).is_stable()
    with pytest.raises(ValueError, match="zero everywhere"):
        (s - s).rightmost()
    with pytest.raises(ValueError, match="no roots"):
        (s - s + 3).spectral_abscissa()
    assert len((s - s + 3).rightmost()) == 0
    assert not s.is_stable()
    assert (s + 1).is_stable()


# The set


def test_root_set_is_like_an_array():
    found = (s + delay(1.0)).roots(re=(-3, 2), im=(-20, 20))
    assert isinstance(found, RootSet)
    assert len(found) == 6 == found.counted
    assert [type(z) for z in found] == [complex] * 6
    assert np.array_equal(np.asarray(found), found.roots)
    assert np.asarray(found, dtype=np.complex64).dtype == np.complex64
    assert np.array_equal(found[:2], found.roots[:2])
    assert np.array_equal(found[found.resolved], found.roots)
    assert found[0] in found
    assert np.all(np.diff(found.roots.real) <= 0)
    assert found[0].imag > 0 > found[1].imag
    assert "6 roots" in repr(found)
    with pytest.raises(ValueError, match="read-only"):
        found.roots[0] = 0


def test_bounds_that_overflow_prove_nothing():
    # Far to the right exponentials underflow and the bound on what they grow to was not a number,
    # which was taken for "no limit": the walk stepped over the root.
    h = s + 2.0 * delay(0.36)
    for far in (10.0, 2050.0, 2070.0, 6000.0, 1e5):
        assert h.count(re=(-20.0, far), im=(2300.0, 2308.4)) == 1


def test_two_thousand_rightmost_roots():
    # A cell thousands of units wide hid a root from its count.
    found = (s + 2.0 * delay(0.36)).rightmost(2000)
    assert found.multiplicities.sum() == found.counted >= 2000
    (line, _), _ = found.region
    # All of them: Lambert W's branches right of the line.
    k = np.arange(-3000, 3000)
    exact = dtm.lambertw(-0.72, k) / 0.36
    assert (exact.real > line).sum() == len(found)


@pytest.mark.parametrize("omega", [1e6, 1e7, 1e9, 1e12])
def test_the_rightmost_root_of_a_loop_with_a_fast_filter(omega):
    # Chains that bend away only beyond omega cost more than a line was given: it came empty.
    loop = dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(2.0, 0.3, filter=dtm.DerivativeFilter(omega)), delay=0.36
    )
    ideal = (s + (2.0 + 0.3 * s) * delay(0.36)).rightmost()[0]
    root = loop.characteristic().rightmost()[0]
    # The filter is late by 2/omega, and the root moves by 14 times as much.
    assert abs(root - ideal) < 40 / omega


@pytest.mark.parametrize(
    ("kv", "tau"), [(0.3, 0.36), (-0.3, 0.36), (0.9, 0.36), (0.999, 1.0), (0.5, 2.0)]
)
def test_lines_close_to_the_chains_count_every_root(kv, tau):
    """The bound along the chains against a count in a box much taller than the bound."""
    h = s**2 + 0.3 * s + 1.0 + (2.0 + 0.7 * s + kv * s**2) * delay(tau)
    chain = h.chain_abscissa()
    for distance in (1.0, 0.1, 0.01, 0.001):
        sigma = chain + distance
        assert h.count(re=(sigma, None)) == h.count(re=(sigma, None), im=(-3e3, 3e3))


def test_lines_where_one_row_dominates_count_every_root():
    """Counts with long steps down a line against a count in a box, which does not use them."""
    rng = np.random.default_rng(7)
    for _ in range(60):
        m, d = rng.integers(2, 5), rng.integers(1, 5)
        rows = rng.normal(size=(m, d + 1)) * 10.0 ** rng.uniform(-1, 1, size=(m, d + 1))
        rows[1:, -1] = 0.0
        # Roots with Re s > -0.8 stay well below 3e4: |s| < e^(0.8 * 9) times the moduli / 30.
        rows[0, -1] = 30.0
        h = QuasiPolynomial(rows, [0.0, *np.cumsum(rng.uniform(0.1, 3.0, size=m - 1))])
        sigma = rng.uniform(-0.8, 0.3)
        assert h.count(re=(sigma, None)) == h.count(re=(sigma, None), im=(-3e4, 3e4))


def test_exact_delays_have_chains_of_their_own():
    """Michiels and Niculescu: stable for delays of exactly 1 and 2, not close to these."""
    h = s - 0.25 + (1 / 3 - 0.75 * s) * delay(1.0) + 0.5 * s * delay(2.0)
    assert h.base_delay == 1.0
    # z^2 / 2 - 3 z / 4 + 1 has |z| = sqrt 2; 3 x / 4 + x^2 / 2 = 1 for free delays.
    assert abs(h.chain_abscissa(strong=False) + math.log(2) / 2) < 1e-12
    free = (-0.75 + math.sqrt(0.75**2 + 2)) / 1.0
    assert abs(h.chain_abscissa() + math.log(free)) < 1e-14
    assert h.spectral_abscissa() == h.chain_abscissa() > 0
    exact = h.spectral_abscissa(strong=False)
    # Every root of a tall box right of the chains of the exact delays, in long walks around it.
    box = h.roots(re=(-0.3, 3), im=(-2000, 2000))
    assert abs(exact - box[0].real) < 1e-14
    moved = s - 0.25 + (1 / 3 - 0.75 * s) * delay(1.0) + 0.5 * s * delay(math.sqrt(4.1))
    assert moved.base_delay is None
    assert moved.spectral_abscissa(strong=False) == moved.chain_abscissa() > 0
    golden = 1 - delay(1.0) - delay(2.0)
    assert abs(golden.chain_abscissa(strong=False) - golden.chain_abscissa()) < 1e-12
    three = 1 - 0.3 * delay(0.1) + 0.4 * delay(0.2) - 0.2 * delay(0.3)
    slowest = max(-np.log(np.abs(np.roots([-0.2, 0.4, -0.3, 1]))) / 0.1)
    assert abs(three.chain_abscissa(strong=False) - slowest) < 1e-11


@pytest.mark.parametrize("omega", [0.21666740597802447, 1.0, 2.7298599562231607])
def test_the_rightmost_root_may_lie_within_rounding_of_the_axis(omega):
    """A line at 0 is counted in double-double arithmetic, but discs about the pair cross it."""
    h = (s**2 + omega**2) * (s + 0.3 + (0.2 + 0.1 * s) * delay(1.0))
    first = h.rightmost()
    assert np.allclose(first, [1j * omega, -1j * omega], rtol=0, atol=1e-14)
    assert not h.is_stable()
    # Beside it by less than its disc: on one side, or on the edge and named.
    for gap in (1e-17, 1e-16, -1e-17, -1e-16):
        for method, number in ((h.count, int), (h.roots, len)):
            assert asked(method, number, gap) in (0, 2, "on the edge")


def asked(method, number, left):
    try:
        return number(method(re=(left, 1), im=(-5, 5)))
    except ContourError as error:
        return "on the edge" if len(error.on_edge) == 2 and error.inside == 0 else error
