"""Delays, coefficients and regions of extreme size: correct results, or a refusal with its reason.

Truth is an exact scaling (s → c s, h → c h with powers of two), Lambert W, or ball arithmetic.
"""

import contextlib
import math

import deadtime as dtm
import mpmath as mp
import numpy as np
import pytest
from ball_count import BallCounter
from deadtime import QuasiPolynomial, delay, s
from deadtime._base.errors import ContourError

EIGHT_REAL = np.poly(np.arange(-1.0, -9.0, -1.0))[::-1]

FUNCTIONS = {
    "loop": s + 2.0 * delay(0.36),
    "neutral": s + (2.0 + 0.3 * s) * delay(0.36),
    "second order": s**2 + 0.3 * s + 1.0 + (2.0 + 0.7 * s) * delay(1.0) + 0.1 * delay(0.3),
    "degree 8": QuasiPolynomial([EIGHT_REAL, [1e-3] + [0.0] * 8], [0.0, 1.0]),
    "four delays": s + 1.5 * delay(1.0) + delay(math.sqrt(2)) + 0.3 * delay(math.pi) + 0.2,
}


def in_other_time(h, c):
    """The function whose roots are those of h over c; exact for a power of two."""
    return QuasiPolynomial(h.coefficients * c ** np.arange(h.degree + 1), h.delays * c)


# Exact scalings


@pytest.mark.parametrize("power", [-37, -30, -12, 5, 13, 20])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_delays_from_picoseconds_to_weeks(name, power):
    h = FUNCTIONS[name]
    c = 2.0**power
    scaled = in_other_time(h, c)
    re, im = (-9.5, 2.0), (-60.0, 60.0)
    there = {"re": (re[0] / c, re[1] / c), "im": (im[0] / c, im[1] / c)}
    wanted = h.roots(re=re, im=im)
    found = scaled.roots(**there)
    assert scaled.count(**there) == h.count(re=re, im=im) == found.counted == wanted.counted
    assert (np.abs(found.roots * c - wanted.roots) <= found.radii * c + wanted.radii).all()
    first, second = h.rightmost(), scaled.rightmost()
    assert np.abs(second[0] * c - first[0]) <= second.radii[0] * c + first.radii[0]
    assert scaled.count(re=(-0.1 / c, None)) == h.count(re=(-0.1, None))
    assert scaled.is_stable() == h.is_stable()


@pytest.mark.parametrize("factor", [1e-300, 1e-200, -1e-100, 1e100, -1e200, 1e300])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_constant_factor_changes_nothing(name, factor):
    h = FUNCTIONS[name]
    # The largest coefficient must stay a double.
    scaled = h * (factor / max(1.0, float(np.abs(h.coefficients).max())))
    assert scaled.count(re=(-9.5, 2), im=(0, 60)) == h.count(re=(-9.5, 2), im=(0, 60))
    assert scaled.count(re=(-0.1, None)) == h.count(re=(-0.1, None))
    first, second = h.rightmost(), scaled.rightmost()
    # Coefficients are rounded once more.
    assert np.allclose(second, first, rtol=1e-9, atol=0)
    assert scaled.is_stable() == h.is_stable()


# Closed forms

SIZES = (1e-200, 1e-100, 1.0, 1e100, 1e200)


# Further apart than that is refused, below.
FAR_APART = 1e150


@pytest.mark.parametrize(("a", "b"), [(a, b) for a in SIZES for b in SIZES if b / a < FAR_APART])
def test_coefficients_that_differ_by_hundreds_of_decades(a, b):
    """a s + b e^(−s) around its rightmost root W₀(−b/a)."""
    h = QuasiPolynomial([[0.0, a], [b, 0.0]], [0.0, 1.0])
    with mp.workdps(30):
        root = mp.lambertw(-mp.mpf(b) / mp.mpf(a))
        place = complex(root)
        height = 3.0 + 2.0 * abs(place.imag)
        found = h.roots(re=(place.real - 2, place.real + 3), im=(-height, height))
        # One that is no double, −1e−400, is 0 here.
        assert min(abs(mp.mpc(z) - root) - r for z, r in zip(found, found.radii, strict=True)) <= 0
    counter = BallCounter(h.coefficients, h.delays)
    assert found.counted == counter.rectangle((place.real - 2, place.real + 3), (-height, height))


@pytest.mark.parametrize("omega", [1e2, 1e4, 1e6])
def test_high_on_the_chain(omega):
    """Roots of s + e^(−s) around Im s = omega are branches of Lambert W."""
    h = s + delay(1.0)
    found = h.roots(re=(-20, 2), im=(omega, omega + 50))
    middle = round(omega / (2 * math.pi))
    with mp.workdps(30):
        branches = [mp.lambertw(-1, k) for k in range(middle - 3, middle + 14)]
        wanted = [w for w in branches if omega < w.imag < omega + 50]
        assert len(found) == len(wanted) == found.counted
        for z, r in zip(found, found.radii, strict=True):
            assert min(abs(mp.mpc(z) - w) for w in wanted) <= r


def test_all_of_a_chain_up_to_a_million():
    last = 159154
    with mp.workdps(30):
        assert mp.lambertw(-1, last).imag < 10**6 < mp.lambertw(-1, last + 1).imag
    # Branch k ≥ 0 is in the upper half plane.
    assert (s + delay(1.0)).count(re=(-20, 2), im=(0, 1e6)) == last + 1


@pytest.mark.parametrize("omega", [1e3, 1e6, 1e8])
def test_high_on_a_neutral_chain(omega):
    """Against ball arithmetic, and the closed form of the chain to which the roots tend."""
    h = s + (1.0 + 0.5 * s) * delay(1.0)
    found = h.roots(re=(-2, 2), im=(omega, omega + 60))
    counter = BallCounter(h.coefficients, h.delays)
    assert found.counted == counter.rectangle((-2.0, 2.0), (omega, omega + 60))
    assert np.abs(found.roots.real - math.log(0.5)).max() < 2 / omega
    for z, r in zip(found, found.radii.tolist(), strict=True):
        assert counter.disc(z, r) == 1


# Delays of very different size


@pytest.mark.parametrize(
    ("rows", "delays", "re", "im"),
    [
        pytest.param(
            *([[0, 1], [1, 0], [1, 0]], [0, 1e-9, 1e4], (-1e-3, 5.0), (-0.1, 0.1)),
            marks=pytest.mark.survey,
        ),
        ([[0, 1], [1, 0], [1e-3, 0]], [0, 1e-3, 1e3], (-0.01, 3.0), (-0.3, 0.3)),
        ([[0, 1], [1e3, 0], [1.0, 0]], [0, 1e-3, 1.0], (-8.0, 1e3), (-100.0, 100.0)),
        ([[0, 1], [1, 0], [1, 0.1]], [0, 1e-6, 10.0], (-0.3, 5.0), (-20.0, 20.0)),
    ],
)
def test_delays_of_very_different_size(rows, delays, re, im):
    h = QuasiPolynomial(rows, delays)
    counter = BallCounter(rows, delays)
    found = h.roots(re=re, im=im)
    assert h.count(re=re, im=im) == found.counted == counter.rectangle(re, im)
    for k in range(0, len(found), 1 + len(found) // 20):
        assert counter.disc(found[k], found.radii[k].item()) == found.multiplicities[k]
    assert h.count(re=(0, None)) == counter.right_of(0.0)
    first = h.rightmost()
    assert counter.right_of(math.nextafter(first[0].real + 2 * first.radii[0], math.inf)) == 0


# Regions


@pytest.mark.parametrize("left", [-1e3, -1e4, -1e9, -1e20])
def test_far_to_the_left(left):
    h = s + delay(1.0)
    assert h.count(re=(left, 2), im=(-30, 30)) == 10
    assert len(h.roots(re=(left, 2), im=(-30, 30))) == 10
    assert h.count(re=(left, left / 2), im=(-30, 30)) == 0
    neutral = s + (1 + 0.5 * s) * delay(1.0)
    assert neutral.count(re=(left, 2), im=(-30, 30)) == neutral.count(re=(-9, 2), im=(-30, 30))
    assert neutral.count(re=(left, -9)) == 0


@pytest.mark.parametrize("right", [1e3, 1e6])
def test_far_to_the_right(right):
    h = s + delay(1.0)
    assert h.count(re=(-1, right), im=(-30, 30)) == 2
    assert h.count(re=(right / 2, right), im=(-30, 30)) == 0


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-9, 1e-12])
def test_tiny_regions(size):
    h = s + delay(1.0)
    z = h.rightmost()[0]
    box = {"re": (z.real - size, z.real + size), "im": (z.imag - size, z.imag + size)}
    assert h.count(**box) == 1
    assert abs(h.roots(**box)[0] - z) < 1e-14
    beside = {"re": (z.real + size, z.real + 2 * size), "im": box["im"]}
    assert h.count(**beside) == 0


def test_a_region_smaller_than_rounding_resolves():
    """A square of 1e-17 about a root: the error names the root and a distance that helps."""
    h = s + delay(1.0)
    z = h.rightmost()[0]

    def around(x, y):
        return {"re": (z.real - x, z.real + x), "im": (z.imag - y, z.imag + y)}

    with pytest.raises(ContourError) as error:
        h.count(**around(5.6e-17, 2.3e-16))
    assert abs(error.value.place - z) < 1e-14
    assert 0 < error.value.distance < 1e-12
    away = 2 * error.value.distance
    assert h.count(**around(away, away)) == 1


# What is refused


ONE_DELAY = s + delay(1.0)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: QuasiPolynomial([[0.0, math.nan]], [0.0]), "coefficient is NaN.*finite"),
        (lambda: QuasiPolynomial([[-math.inf, 1.0]], [0.0]), "coefficient is -inf.*finite"),
        (lambda: QuasiPolynomial([[1.0]], [math.inf]), "delay is inf.*finite"),
        (lambda: QuasiPolynomial([[1.0]], [-1e-300]), "delay is -.*not negative"),
        (lambda: QuasiPolynomial([], []), "shape.*not empty"),
        (lambda: QuasiPolynomial([[]], [0.0]), "shape.*not empty"),
        (lambda: QuasiPolynomial([[1.0], [1.0, 2.0]], [0.0, 1.0]), "different lengths.*zeros"),
        (lambda: QuasiPolynomial([[1.0, 2.0]], [0.0, 1.0]), "1 rows.*2 delays.*each row"),
        (lambda: QuasiPolynomial([[1.0, 2.0]], 0.0), "delays has shape"),
        (lambda: QuasiPolynomial([[1j]], [0.0]), "complex128.*real"),
        (lambda: QuasiPolynomial([["1"]], [0.0]), "real numbers"),
        (lambda: QuasiPolynomial(None, None), "real numbers"),
        (lambda: ONE_DELAY.roots(re=(0, math.nan)), r"re=\(0, NaN\).*below"),
        (lambda: ONE_DELAY.roots(re=(-1, 1), im=(2, 2)), r"im=\(2, 2\).*below"),
        (lambda: ONE_DELAY.roots(re=(-1, 1), im=(3, -3)), r"im=\(3, -3\).*below"),
        (lambda: ONE_DELAY.roots(), "infinitely many.*both ends of im"),
        (lambda: (s - s).roots(re=(-1, 1), im=(-1, 1)), "zero everywhere"),
        (lambda: (s - s).is_stable(), "zero everywhere"),
        (lambda: (1 + s * delay(1.0)).roots(), "advanced.*both ends of im"),
        (lambda: (1 + s * delay(1.0)).rightmost(), "advanced.*longer delay"),
    ],
)
def test_bad_input_is_refused_by_value(ask, words):
    with pytest.raises((TypeError, ValueError), match=words):
        ask()


def test_an_advanced_equation_has_roots_in_a_box():
    """1 + s e^(−s): its roots −W_k(1) have arbitrarily large real parts."""
    h = 1 + s * delay(1.0)
    found = h.roots(re=(-3, 3), im=(-20, 20))
    with mp.workdps(30):
        wanted = [-mp.lambertw(1, k) for k in range(-9, 10)]
        inside = [w for w in wanted if -3 < w.real < 3 and abs(w.imag) < 20]
        assert len(found) == found.counted == len(inside)
        for z, r in zip(found, found.radii, strict=True):
            assert min(abs(mp.mpc(z) - w) for w in inside) <= r


@pytest.mark.parametrize("root", [1.0, 2.0**-27, 2.0**27])
@pytest.mark.parametrize("edge", ["left", "right", "top"])
def test_a_refusal_names_the_root_on_the_edge(root, edge):
    """The place is the root, and the count succeeds when the edge is moved by the distance."""
    h = s**2 + root**2
    if edge == "top":
        box = {"re": (-root, root), "im": (-2 * root, root)}
        assert ask_where(h, box, "im", 1) == pytest.approx(1j * root, rel=1e-6)
        return
    h = (s - root) * (s + 3 * root)
    box = {"re": (root, 2 * root) if edge == "left" else (-root, root), "im": (-root, root)}
    index = 0 if edge == "left" else 1
    assert ask_where(h, box, "re", index) == pytest.approx(root, rel=1e-6)


def ask_where(h, box, side, index):
    """The place of a refused count; counts with the edge moved to either side differ by one."""
    with pytest.raises(ContourError, match="Move the edge") as error:
        h.count(**box)
    counts = []
    for sign in (2, -2):
        ends = list(box[side])
        ends[index] += sign * error.value.distance
        counts.append(h.count(**{**box, side: tuple(ends)}))
    assert abs(counts[0] - counts[1]) == 1
    return error.value.place


@pytest.mark.parametrize(
    ("a", "b"), [(1.0, 1e100), (1e-100, 1e100), (1e-200, 1e200), (1e100, 1e-200)]
)
def test_results_beyond_the_range_of_doubles_are_refused(a, b):
    """The rightmost root or the reason for a refusal, without a warning."""
    h = QuasiPolynomial([[0.0, a], [b, 0.0]], [0.0, 1.0])
    words = "exceeds double precision|infinitely many|evaluations|rightmost root was not found"
    roots = []
    with contextlib.suppress(ValueError):
        roots = list(h.rightmost())
    if not roots:
        with pytest.raises(ValueError, match=words):
            h.rightmost()
    with mp.workdps(30):
        wanted = complex(mp.lambertw(-mp.mpf(b) / mp.mpf(a)))
    assert all(min(abs(root - wanted), abs(root - wanted.conjugate())) < 1e-10 for root in roots)


def test_loops_of_extreme_gain_agree_with_lambert_w():
    """Integrators with one delay, as control loops."""
    for gain, tau in ((1e-9, 1e4), (1e9, 1e-9), (1e5, 1e4), (1e-200, 1.0)):
        root = dtm.ControlLoop(dtm.Integrator(), dtm.P(gain), delay=tau).rightmost()[0]
        with mp.workdps(30):
            wanted = complex(mp.lambertw(-mp.mpf(gain) * mp.mpf(tau)) / mp.mpf(tau))
        assert abs(root - wanted) <= 1e-13 * abs(wanted)


@pytest.mark.parametrize(
    ("h", "re", "im", "number"),
    [
        (ONE_DELAY, (-1.0, 1e20), (-30.0, 30.0), 2),
        (ONE_DELAY, (-1e30, 1.0), (-30.0, 30.0), 10),
        (s**2 - 1e40 + delay(1.0), (1.0, None), None, 1),
    ],
)
def test_regions_that_reach_beyond_all_roots(h, re, im, number):
    assert h.count(re=re, im=im) == number


def test_the_second_root_of_a_loop_of_almost_no_gain():
    h = QuasiPolynomial([[0.0, 1.0], [1e-200, 0.0]], [0.0, 1.0])
    assert BallCounter(h.coefficients, h.delays).rectangle((-1e3, 1.0), (-10.0, 10.0)) == 4
    assert h.count(re=(-1e3, 1), im=(-10, 10)) == 4
    # A gain of 1e-400 is none of double precision's numbers: refused, and where.
    with pytest.raises(ContourError, match="double precision can resolve"):
        QuasiPolynomial([[0.0, 1e200], [1e-200, 0.0]], [0.0, 1.0]).count(re=(-1e3, 1), im=(-10, 10))


def test_degree_8_in_a_unit_of_time_of_1e24():
    h = FUNCTIONS["degree 8"]
    c = 2.0**80
    root = in_other_time(h, c).rightmost()[0] * c
    assert abs(root - h.rightmost()[0]) < 1e-11


def test_a_lag_of_a_microsecond_beside_a_delay_of_a_minute():
    """A retarded equation has a rightmost root, but the set was empty.

    W₀ of −4e4 · 65 e^(65 · 6e5) by w + log w = log of that: real part −0.0417.
    """
    h = s + 6e5 + 4e4 * delay(65.0)
    with mp.workdps(30):
        log = mp.log(mp.mpf(4e4) * 65) + 65 * mp.mpf(6e5) + mp.pi * 1j
        w = mp.findroot(lambda w: w + mp.log(w) - log, log - mp.log(log))
        root = complex(w / 65 - mp.mpf(6e5))
    assert root == pytest.approx(-0.04166 + 0.04833j, abs=1e-5)
    found = h.rightmost()
    assert len(found) == 2
    assert abs(found[0] - root) < 1e-9
