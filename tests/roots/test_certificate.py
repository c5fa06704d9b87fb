"""Certificates are verified by two independent checkers; false ones are refused."""

import ast
import dataclasses
import json
import math
import pickle
from fractions import Fraction
from pathlib import Path

import deadtime
import mpmath as mp
import numpy as np
import pytest
from ball_certificate import ball_count
from deadtime import CertificateError, ContourError, QuasiPolynomial, delay, s
from deadtime.roots import Certificate
from deadtime.roots.certificate._check import _dominates_rightward
from deadtime.roots.certificate._enclosures import angle, cos_sin, dyadic, exponential, pi
from deadtime.roots.certificate._function import ExactFunction
from deadtime.roots.certificate._parts import Monotone, Segment
from hypothesis import assume, example, given, settings, strategies as st
from root_cases import CASES, ROOT_ON_AN_EDGE

REFERENCE = Path(__file__).resolve().parents[1] / "reference"

# A multiple root or a cluster lies on the real axis, which is an edge.
CLUSTER_ON_THE_AXIS = {"double_at_0", "near_double", "mazanti_mult6", "mid_mult4_exact0"}


def certify(name, symmetric=True):
    case = CASES[name]
    a, b, c, d = case["region"]
    im = (-d, d) if symmetric and c == 0 else (c, d)
    return QuasiPolynomial(case["coefs"], case["delays"]).certify(re=(a, b), im=im)


# What is true verifies


@pytest.mark.parametrize("name", sorted(set(CASES) - ROOT_ON_AN_EDGE))
def test_reference_cases_verify(name):
    proof = certify(name)
    assert proof.verify() == proof.count == CASES[name]["certified_winding_count"]


@pytest.mark.parametrize("name", sorted(set(CASES) - ROOT_ON_AN_EDGE - CLUSTER_ON_THE_AXIS))
def test_upper_halves_verify(name):
    proof = certify(name, symmetric=False)
    assert proof.verify() == proof.count == CASES[name]["count_region_upper_closed"]


def test_no_certificate_where_there_is_no_count():
    with pytest.raises(ContourError):
        certify("on_contour")
    with pytest.raises(ValueError, match="infinitely many"):
        (s + delay(1.0)).certify()


@pytest.mark.parametrize(
    ("h", "region", "count"),
    [
        (s + 5.0 * delay(0.36), {"re": (0, None)}, 2),
        (s + 4.0 * delay(0.36), {"re": (0, None)}, 0),
        (s + (2.0 + 0.3 * s) * delay(0.36), {"re": (-3.34, None)}, 1),
        (s + delay(1.0), {"re": (None, 2), "im": (0, 30)}, 5),
        (s + delay(1.0), {"re": (-3, None), "im": (-20, 30)}, 6),
        (s + delay(1.0), {"re": (-3, None), "im": (-30, 20)}, 6),
        (s + delay(1.0), {"re": (-3, None), "im": (None, -1)}, 3),
        (s + delay(1.0), {"im": (-9, 9)}, 4),
        (s**3 * (s + delay(1.0)), {"re": (-1, 1), "im": (0, 5)}, 4),
        (s**4, {}, 4),
        ((s - 1) * (s + 2) * (s**2 + 4 * s + 13) * delay(0.7), {}, 4),
        (s + 2.0 * delay(0.36), {"re": (10, None)}, 0),
        (1e-200 * s + 1e-200 * delay(1.0), {"re": (-1, None)}, 2),
        (s + 1e-5 * delay(1e4), {"re": (-1e-3, None), "im": (0, 0.01)}, 17),
    ],
)
def test_open_sides_zeros_and_mirrored_regions_verify(h, region, count):
    proof = h.certify(**region)
    assert h.count(**region) == proof.count == proof.verify()
    assert proof.count == count
    assert proof.coefficients == tuple(map(tuple, h.coefficients.tolist()))


gains = st.integers(-3000, 3000).filter(bool).map(lambda n: n / 1000)


@st.composite
def functions(draw):
    """First or second order, retarded or neutral, with one delay or two."""
    tau = draw(st.floats(0.01, 5))
    h = s + draw(gains) + (draw(gains) + draw(st.sampled_from([0.0, 0.3, -0.7])) * s) * delay(tau)
    if draw(st.booleans()):
        h = h * (s + draw(gains)) + draw(gains) * delay(draw(st.floats(0.01, 5)))
    return h


@settings(deadline=None, max_examples=40)
@given(functions(), st.floats(-4, 1), st.floats(0.1, 5), st.floats(-20, 19), st.floats(0.5, 30))
def test_certificates_of_random_functions_verify(h, a, width, c, height):
    region = {"re": (a, a + width), "im": (c, c + height)}
    try:
        proof = h.certify(**region)
    except ContourError:
        assume(False)
    assert proof.verify() == proof.count == h.count(**region)
    around = ball_count(proof)
    # With the real axis for an edge the contour goes around both halves.
    assert around == proof.count or (0 in region["im"] and around >= proof.count)


@settings(deadline=None, max_examples=30)
@given(functions(), st.floats(-0.2, 1))
def test_half_planes_of_random_functions_verify(h, sigma):
    try:
        proof = h.certify(re=(sigma, None))
    except (ContourError, ValueError):
        assume(False)
    assert proof.verify() == proof.count


# What is false does not


def assert_false(certificate, what):
    try:
        certificate.verify()
    except CertificateError:
        return
    pytest.fail(f"not noticed: {what}")


def mutations(proof):
    """Certificates with a false claim, each with a name."""
    contour = proof.contours[0]
    segments = contour.segments
    middle = len(segments) // 2
    chosen = segments[middle]

    def with_segments(*changed):
        path = dataclasses.replace(contour, segments=tuple(changed))
        return dataclasses.replace(proof, contours=(path, *proof.contours[1:]))

    def with_segment(**changed):
        new = dataclasses.replace(chosen, **changed)
        return with_segments(*segments[:middle], new, *segments[middle + 1 :])

    def with_function(**changed):
        return dataclasses.replace(proof, **changed)

    delays = proof.delays
    rows = [list(row) for row in proof.coefficients]
    rows[-1][0] = 1.0000001 * rows[-1][0] + 1e-7
    further = math.nextafter(chosen.end.imag, math.inf)
    step = 1e-3 * (chosen.end - chosen.start)
    yield "one segment removed", with_segments(*segments[:middle], *segments[middle + 1 :])
    yield "the first removed", with_segments(*segments[1:])
    yield "the last removed", with_segments(*segments[:-1])
    yield "one segment twice", with_segments(*segments[:middle], chosen, *segments[middle:])
    yield (
        "walked backwards",
        with_segments(
            *(dataclasses.replace(p, start=p.end, end=p.start) for p in reversed(segments))
        ),
    )
    for change in (1, -1):
        yield f"count changed by {change}", with_function(count=proof.count + change)
        path = dataclasses.replace(contour, count=contour.count + change)
        yield (
            f"both counts changed by {change}",
            with_function(count=proof.count + change, contours=(path, *proof.contours[1:])),
        )
    yield "an end moved", with_segment(end=chosen.end + step)
    yield "an end moved by one ulp", with_segment(end=complex(chosen.end.real, further))
    yield "a start moved", with_segment(start=chosen.start - step)
    yield "a middle moved", with_segment(middle=chosen.middle + step)
    yield "a middle moved off", with_segment(middle=chosen.middle + 1j * step)
    yield "a delay changed", with_function(delays=(*delays[:-1], delays[-1] * 1.0001))
    yield "a coefficient changed", with_function(coefficients=tuple(map(tuple, rows)))
    yield "another reference", with_segment(reference=(chosen.reference + 1) % len(delays))
    yield "no such reference", with_segment(reference=len(delays))
    yield "negative reference", with_segment(reference=chosen.reference - len(delays))
    yield "a value changed", with_segment(value=chosen.value * (1 + 1e-9))
    yield "too small an error", with_segment(error=1e-3 * chosen.error)
    yield "no error at all", with_segment(error=0.0)
    yield "too small a slope", with_segment(slope=0.5 * chosen.slope)
    yield "too large a slope", with_segment(slope=1e30 * chosen.slope)
    yield "negative bounds", with_segment(error=-1.0, slope=-1.0)
    yield "not a number", with_segment(error=math.nan)
    yield "infinite slope", with_segment(slope=math.inf)
    yield "another scale", with_function(scale=proof.scale + 1)
    yield "a root at 0 from nowhere", with_function(zeros=1, count=proof.count + 1)
    (a, b), im = proof.region
    yield "a wider region", with_function(region=((a - 1, b), im))
    yield "a region elsewhere", with_function(region=((a, b), (100.0, 200.0)))
    yield "another closed region", with_function(closed=((a - 1, b), im))
    yield "no contour", with_function(contours=())
    yield "a contour twice", with_function(contours=(*proof.contours, *proof.contours))


@pytest.mark.parametrize("name", ["armah_K2", "qpmr_ex3_neutral", "high_freq"])
def test_false_certificates_fail(name):
    proof = certify(name)
    proof.verify()
    for what, false in mutations(proof):
        assert_false(false, what)


def test_false_statements_about_open_sides_fail():
    proof = (s + 5.0 * delay(0.36)).certify(re=(0, None))
    row, radius = proof.beyond
    (a, b), (c, d) = proof.closed
    for changed in (
        {"beyond": None},
        {"beyond": (row, 0.9 * radius)},
        {"beyond": (row, -radius)},
        {"beyond": (row, math.nan)},
        {"beyond": (row + 1, radius)},
        {"beyond": (row + 2, radius)},
        {"closed": ((a, 0.5 * b), (c, d))},
        {"closed": ((a, b), (-0.5 * d, 0.5 * d))},
        {"closed": ((a, b), (0.0, d))},
        {"closed": ((a, math.inf), (c, d))},
        {"region": ((-9.0, math.inf), (-math.inf, math.inf))},
        # Nothing to prove where the closed region is empty, if it only were.
        {"closed": ((b, a), (c, d)), "contours": (), "count": 0},
        {"closed": ((a, b), (d, c)), "contours": (), "count": 0},
    ):
        assert_false(dataclasses.replace(proof, **changed), changed)
    strip = (s + delay(1.0)).certify(re=(None, None), im=(0, 30))
    strip.verify()
    (a, b), im = strip.closed
    for re in ((0.5 * a, b), (a, 1e-3 * b), (a, -b), (-math.inf, b)):
        assert_false(dataclasses.replace(strip, closed=(re, im)), re)


@pytest.mark.parametrize("tau", [0.5, 2.0])
def test_no_right_edge_lies_left_of_a_chain(tau):
    # s (1 + 5 e^(-s tau)) has its chain at ln(5)/tau; its leading terms alone decide.
    rows, delays = [[Fraction(0), Fraction(1)], [Fraction(0), Fraction(5)]], [0, Fraction(tau)]
    chain = math.log(5.0) / tau
    assert not _dominates_rightward(rows, delays, 0.99 * chain, 0.0)
    assert _dominates_rightward(rows, delays, 1.01 * chain, 0.0)


@pytest.mark.parametrize("tau", [0.5, 2.0])
def test_a_delayed_term_of_a_higher_degree_has_to_fall_from_the_edge_on(tau):
    # s^2 e^(-s tau) / s rises with s up to s = 1/tau.
    rows = [[Fraction(0), Fraction(1)], [Fraction(0), Fraction(0), Fraction(1, 100)]]
    delays = [Fraction(0), Fraction(tau)]
    assert not _dominates_rightward(rows, delays, 0.99 / tau, 0.0)
    assert _dominates_rightward(rows, delays, 1.01 / tau, 0.0)


def test_false_statements_about_the_real_axis_fail():
    proof = certify("smith_2.12", symmetric=False)
    assert proof.verify() == 25
    at = next(k for k, part in enumerate(proof.real) if isinstance(part, Monotone))
    empty = next(k for k, part in enumerate(proof.real) if isinstance(part, Segment))
    part = proof.real[at]

    def with_part(index, **changed):
        new = dataclasses.replace(proof.real[index], **changed)
        return (*proof.real[:index], new, *proof.real[index + 1 :])

    for real in (
        (),
        proof.real[:-1],
        proof.real[1:],
        (*proof.real[:at], *proof.real[at + 1 :]),
        tuple(reversed(proof.real)),
        with_part(at, end=math.nextafter(part.end, math.inf)),
        with_part(at, middle=part.end + 1),
        with_part(at, slope=-part.slope),
        with_part(at, slope=2 * part.slope),
        with_part(at, error=0.0),
        with_part(at, bend=0.5 * part.bend),
        with_part(at, bend=-part.bend),
        with_part(at, reference=-1),
        with_part(empty, error=0.0),
        with_part(empty, middle=proof.real[empty].middle + 1j),
    ):
        assert_false(dataclasses.replace(proof, real=real), real)


def test_a_root_at_0_is_not_excluded_by_the_bound():
    """Beyond |s| = 0 a single power of s has no roots, but at 0 it has."""
    proof = (s**4).certify()
    assert proof.verify() == 4
    assert_false(dataclasses.replace(proof, zeros=0, count=0), "no roots at 0")
    empty = ((-1.0, 1.0), (0.0, 0.0))
    false = dataclasses.replace(proof, zeros=0, count=0, closed=empty, beyond=(0, 0.0))
    assert_false(false, "everything is cut off")


def test_a_true_change_of_a_certificate_is_accepted():
    """A checker that refused everything would pass the tests above, but not this one."""
    proof = certify("armah_K2")
    contour = proof.contours[0]
    looser = tuple(
        dataclasses.replace(segment, error=1.5 * segment.error, slope=1.01 * segment.slope)
        for segment in contour.segments
    )
    path = dataclasses.replace(contour, segments=looser)
    assert dataclasses.replace(proof, contours=(path,)).verify() == proof.count


# Filed and read again


@pytest.mark.parametrize("name", ["armah_K2", "smith_2.12", "high_freq"])
def test_json_keeps_every_bit(name):
    proof = certify(name, symmetric=False)
    again = Certificate.from_json(proof.to_json())
    assert again == proof
    assert again.to_json(indent=1) == proof.to_json(indent=1)
    assert again.verify() == proof.count
    assert pickle.loads(pickle.dumps(proof)) == proof
    half_plane = (s + delay(0.3)).certify(re=(0, None))
    assert Certificate.from_json(half_plane.to_json()) == half_plane


def test_a_file_of_an_earlier_version_is_read_and_written_as_before():
    text = (REFERENCE / "certificate.json").read_text(encoding="utf-8")
    read = Certificate.from_json(text)
    assert read.verify() == read.count == 2
    assert read.to_json(indent=1) == text.strip()


def test_what_is_no_certificate_is_refused():
    good = json.loads(certify("armah_K2").to_json())
    texts = ["", "[]", "{}", "3", json.dumps({**good, "format": "another"})]
    for name in set(good) - {"beyond"}:
        texts.append(json.dumps({key: value for key, value in good.items() if key != name}))
        texts.append(json.dumps({**good, name: None}))
    texts.append(json.dumps({**good, "count": 12.0}))
    texts.append(json.dumps({**good, "delays": [0.0, 0.36]}))
    texts.append(json.dumps({**good, "real": [{"bend": "0x0p+0"}]}))
    texts.append(json.dumps({**good, "more": 1}))
    for text in texts:
        with pytest.raises(ValueError, match="not the text of a certificate"):
            Certificate.from_json(text)


def test_certificates_do_not_change():
    proof = certify("armah_K2")
    with pytest.raises(dataclasses.FrozenInstanceError):
        proof.count = 3
    with pytest.raises(dataclasses.FrozenInstanceError):
        proof.contours[0].segments[0].error = 0.0
    assert hash(proof) == hash(certify("armah_K2"))


# The checker stands alone


def test_the_checker_uses_neither_the_prover_nor_floating_point_functions():
    folder = Path(deadtime.__file__).parent / "roots" / "certificate"
    names = ["_certificate", "_check", "_enclosures", "_form", "_function", "_parts", "_stored"]
    for name in names:
        tree = ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                module = node.module or ""
                assert module != "deadtime.roots.certificate._proof", "this reads the prover"
                assert (
                    # What draws a proof has no part in it.
                    module
                    in {f"deadtime._base.{name}" for name in ("drawing", "errors", "notebook")}
                    or module.startswith("deadtime.roots.certificate.")
                    or not module.startswith(("deadtime", "numpy"))
                ), module
            if isinstance(node, ast.Import):
                assert not {alias.name for alias in node.names} & {"numpy", "cmath", "deadtime"}
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                called = (node.value.id, node.attr)
                # Classification and exact whole-number work only.
                allowed = {"inf", "isfinite", "isinf", "isqrt", "frexp"}
                assert called[0] != "math" or called[1] in allowed, called


@settings(deadline=None, max_examples=300)
@given(st.floats(-700, 700), st.sampled_from([64, 128, 320]))
def test_exponentials_are_enclosed(x, bits):
    low, high, shift = exponential(*dyadic(x), bits)
    with mp.workprec(1500):
        assert low <= mp.exp(mp.mpf(x)) * mp.mpf(2) ** shift <= high
    assert (high - low) << (bits - 10) <= low


@settings(deadline=None, max_examples=300)
@given(st.floats(-1e12, 1e12), st.sampled_from([64, 128, 320]))
def test_cosines_and_sines_are_enclosed(x, bits):
    with mp.workprec(1500):
        for found, wanted in zip(cos_sin(*dyadic(x), bits), (mp.cos(x), mp.sin(x)), strict=True):
            assert abs(found - wanted * 2**bits) <= 2


@settings(deadline=None, max_examples=300)
@given(st.integers(-(10**30), 10**30), st.integers(-(10**20), 10**20))
def test_angles_are_enclosed(x, y):
    assume(x or y)
    with mp.workprec(500):
        assert abs(angle(x, y) - mp.atan2(y, x) * 2**64) <= 8


def exact(rows, delays, s, index, order=1):
    """Derivatives of h e^(s tau_index), by Leibniz's rule."""
    s, found = mp.mpmathify(s), []
    for k in range(order + 1):
        total = mp.mpf(0)
        for row, tau in zip(rows, delays, strict=True):
            gap = mp.mpf(tau) - mp.mpf(delays[index])
            for j in range(k + 1):
                falling = [c * mp.ff(n, j) * s ** (n - j) for n, c in enumerate(row) if n >= j]
                total += math.comb(k, j) * (-gap) ** (k - j) * sum(falling) * mp.exp(-gap * s)
        found.append(total)
    return found


DIGITS = st.floats(-9, 9).map(lambda x: round(x, 2))


@settings(deadline=None, max_examples=100)
@given(
    rows=st.lists(st.lists(DIGITS, min_size=1, max_size=4).filter(any), min_size=2, max_size=2),
    place=st.complex_numbers(max_magnitude=9.0),
    index=st.integers(0, 1),
)
@example(rows=[[0.0, 2.0**100], [1.0]], place=2.0**-100 * (1.1 + 0.7j), index=0)
@example(rows=[[1.0], [0.0, 0.0, 0.0, 2.0**80]], place=2.0**-60 * (1.1 + 0.7j), index=1)
def test_a_function_and_its_slope_are_enclosed_with_digits_to_spare(rows, place, index):
    delays = [0.1, 0.8]
    found = ExactFunction(rows, delays, 0, 0).enclose(place, index, 1.0)
    with mp.workprec(1500):
        value, slope = (
            part * mp.mpf(2) ** found.bits for part in exact(rows, delays, place, index)
        )
        assert abs(found.vr - value.real) <= found.lost
        assert abs(found.vi - value.imag) <= found.lost
        assert abs(found.wr - slope.real) <= found.worse
        assert abs(found.wi - slope.imag) <= found.worse
        steepest = found.slope_above() * Fraction(1 << found.bits)
        assert abs(slope) <= int(steepest) + 1 <= abs(slope) + 4 * found.worse + 4
    # Errors are far below values of about 1.
    assert max(found.lost, found.worse) << 80 < 1 << found.bits


def test_bounds_on_derivatives_are_attained_where_all_terms_are_positive():
    # With the last delay as reference every term grows to the right, so the bound is the value
    # at the right end of the disc.
    rows, delays = [[0.3, 2.0, 0.7, 1.1], [1.7, 0.2]], [0.1, 0.9]
    h = ExactFunction(rows, delays, 0, 0)
    for middle, radius in ((1.3, 0.5), (0.2, 2.0**-20), (40.0, 3.0)):
        with mp.workprec(300):
            _, slope, bend = exact(rows, delays, middle + radius, 1, 2)
        assert float(h.bend(complex(middle), Fraction(radius), 1)) == pytest.approx(
            float(bend), rel=1e-14
        )
        steepest = float(h.steepness(complex(middle), Fraction(radius), 1, 1.0))
        # The remainder of the Taylor polynomial, of order 9, makes it larger.
        assert float(slope) <= steepest * (1 + 1e-14)
        if radius < 1.0:
            assert steepest == pytest.approx(float(slope), rel=1e-5)


def test_a_value_is_within_a_disc_of_a_center_to_its_last_digit():
    found = ExactFunction([[3.0, 4.0]], [0.0], 0, 0).enclose(1j, 0, 5.0)
    center, room = (Fraction(0), Fraction(1)), Fraction(2 * found.lost, 1 << found.bits)
    # 3 + 4i is sqrt(18) from i.
    length = Fraction(math.isqrt(18 << 200), 1 << 100)
    assert not found.is_within(center, length)
    assert found.is_within(center, length + 2 * room + Fraction(1, 1 << 90))
    assert not found.is_within((Fraction(0), Fraction(0)), Fraction(4))
    assert not found.is_within((Fraction(3), Fraction(0)), Fraction(39, 10))
    assert not found.is_within((Fraction(0), Fraction(4)), Fraction(29, 10))


def test_numbers_out_of_range():
    assert exponential(-(2**30), 0, 64) == (0, 1, 2**13)
    with pytest.raises(OverflowError):
        exponential(2**30, 0, 64)
    with pytest.raises(OverflowError):
        cos_sin(2**60, 0, 64)
    with mp.workprec(3000):
        assert all(abs(pi(bits) - mp.pi * 2**bits) <= 1 for bits in (64, 500, 2500))


# A third party: ball arithmetic


@pytest.mark.parametrize("name", sorted(set(CASES) - ROOT_ON_AN_EDGE))
def test_reference_cases_verify_in_ball_arithmetic(name):
    proof = certify(name)
    assert ball_count(proof) == CASES[name]["certified_winding_count"]


def test_the_plot_of_the_contour_turns_once_for_every_root():
    figures = pytest.importorskip("matplotlib.figure")
    proof = (s + delay(1.0)).certify(re=(-3, 1), im=(-30, 30))
    axes = proof.plot(figures.Figure().subplots())
    upper, lower = axes.collections
    turns = upper.get_array()
    # Upper half: half the turns, of one sign in sum.
    around = np.angle(np.exp(1j * np.diff(turns))).sum()
    assert abs(around / math.pi - proof.count) < 1
    assert len(upper.get_segments()) == len(lower.get_segments()) == len(turns)
    assert axes.get_title() == f"{proof.count} roots, proved on {len(turns)} segments"
