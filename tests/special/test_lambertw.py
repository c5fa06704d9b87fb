"""Lambert W against a table, mpmath and scipy, and over arrays."""

import cmath
import math
from pathlib import Path

import deadtime as dtm
import mpmath
import numpy as np
import pytest
import scipy.special
from hypothesis import given, settings, strategies as st
from lambertw_points import BRANCH_POINT, EPS, bits, log_of, one_by_one

TABLE = Path(__file__).parents[1] / "reference" / "lambertw.npz"

# Recorded largest |w - W|/(|W| eps) in each category; correct rounding is at most 0.5.
# A ratchet: lower a number when the kernel gets better, never raise one.
RECORDED = {
    "A_random": 0.4912,
    "B_branchpt": 0.4987,
    "B_branchpt_axis": 0.4919,
    "B_branchpt_tinyim": 0.4659,
    "B_branchpt_ulps": 0.4659,
    "C_negaxis": 0.4825,
    "C_negaxis_tinyim": 0.4719,
    "D_near0_kne0": 0.4911,
    "E_imag": 0.4710,
    "F_largek": 0.4956,
    "G_posaxis": 0.4717,
    "H_typical": 0.4810,
    "I_extreme": 0.3636,
    "J_reW0": 0.4617,
    "K_unitcircle": 0.4365,
}
# Components, in spacings of their own, where they are not below 1e-3 of |W|: nearly vanishing
# ones have the error of the large one. Next to -1/e, Im W is small beside 1 and comes from a
# square root and a series; elsewhere components are rounded correctly but for a hundredth.
COMPONENTS = {"B_branchpt": 2.2, "B_branchpt_axis": 1.8, "B_branchpt_tinyim": 0.9}
COMPONENTS |= dict.fromkeys(set(RECORDED) - set(COMPONENTS), 0.51)
SMALL_COMPONENT = 1e-3


def pair(re, im):
    """A complex array whose signed zeros survive (``re + 1j*im`` loses them)."""
    z = np.empty(np.broadcast(re, im).shape, complex)
    z.real, z.imag = re, im
    return z


# --- the reference table ------------------------------------------------------------------


@pytest.fixture(scope="module")
def table():
    with np.load(TABLE) as data:
        columns = {name: data[name] for name in data.files}
    columns["z"] = pair(columns["z_re"], columns["z_im"])
    columns["w"] = dtm.lambertw(columns["z"], columns["k"])
    columns["names"] = columns["category_names"][columns["category"]]
    columns["error_re"] = (columns["w"].real - columns["w_re"]) - columns["w_re_lo"]
    columns["error_im"] = (columns["w"].imag - columns["w_im"]) - columns["w_im_lo"]
    return columns


def test_the_table_holds_no_nan_and_no_wrong_branch(table):
    assert len(table["z"]) == 21355
    assert np.isfinite(table["w"]).all()
    size = np.hypot(table["w_re"], table["w_im"])
    assert (np.hypot(table["error_re"], table["error_im"]) <= EPS * size).all()


@pytest.mark.parametrize("category", RECORDED)
def test_errors_do_not_grow_beyond_what_was_reached(table, category):
    inside = table["names"] == category
    assert inside.any()
    size = np.hypot(table["w_re"], table["w_im"])[inside]
    error = np.hypot(table["error_re"], table["error_im"])[inside] / size / EPS
    assert error.max() <= RECORDED[category]


@pytest.mark.parametrize("category", RECORDED)
def test_components_are_rounded_correctly_too(table, category):
    inside = table["names"] == category
    size = np.hypot(table["w_re"], table["w_im"])
    for part in ("re", "im"):
        seen = inside & (np.abs(table[f"w_{part}"]) >= SMALL_COMPONENT * size)
        if seen.any():
            spacing = np.spacing(np.abs(table[f"w_{part}"][seen]))
            error = np.abs(table[f"error_{part}"][seen]) / spacing
            assert error.max() <= COMPONENTS[category]


def test_real_answers_have_a_zero_of_the_right_sign(table):
    real = table["w_im"] == 0
    assert real.sum() > 1000
    assert (table["w"].imag[real] == 0).all()
    assert (np.signbit(table["w"].imag) == np.signbit(table["w_im"])).all()
    assert (np.signbit(table["w"].real) == np.signbit(table["w_re"])).all()


# --- properties ---------------------------------------------------------------------------

finite = st.floats(allow_nan=False, allow_infinity=False)
# Numbers at trouble: any exponent, ulps and decades around -1/e, both sides of the axes.
decades = st.floats(-320, 308).map(lambda power: 10.0**power)
polar = st.builds(lambda r, a: cmath.rect(r, a), decades, st.floats(-math.pi, math.pi))
near = st.builds(
    lambda power, a: complex(BRANCH_POINT) + cmath.rect(10.0**power, a),
    st.floats(-17, 0.5),
    st.floats(-math.pi, math.pi),
)
ulps = st.builds(
    lambda n, zero: complex(BRANCH_POINT + n * 2.0**-54, zero),
    st.integers(-9, 9),
    st.sampled_from([0.0, -0.0, 5e-324, -1e-300, 1e-17]),
)
axis = st.builds(
    complex, st.one_of(decades, decades.map(lambda x: -x)), st.sampled_from([0.0, -0.0])
)
points = st.one_of(st.builds(complex, finite, finite), polar, near, ulps, axis)
branches = st.one_of(st.integers(-2, 2), st.integers(-1000, 1000), st.integers(-(2**62), 2**62))


@given(points, branches)
def test_conjugate_arguments_give_conjugate_values(z, k):
    left = dtm.lambertw(z.conjugate(), -k)
    right = np.conj(dtm.lambertw(z, k))
    assert (bits(left) == bits(right)).all()


@given(points, branches)
@settings(max_examples=200)
def test_identities_hold_at_fifty_digits(z, k):
    w = complex(dtm.lambertw(z, k))
    if w == 0 or not np.isfinite(w.real):
        assert z == 0
        return
    if max(abs(z.real), abs(z.imag)) < 1e-300 and k == 0:
        return  # W_0 is z itself there; test_tiny_arguments_of_the_principal_branch
    with mpmath.workdps(50):
        exact = mpmath.mpc(w)
        # w + log w - log z - 2 pi i k vanishes with slope (1 + w)/w, so an error of an eps of w
        # leaves |1 + w| eps, and next to -1/e eps^2 more.
        total = exact + log_of(exact, w.imag) - log_of(mpmath.mpc(z), z.imag)
        rest = total - 2 * mpmath.pi * mpmath.mpc(0, k)
        allowed = EPS * abs(1 + exact) + 4 * EPS**2
        assert abs(rest) <= allowed
        # The same as w e^w = z, where e^w is still resolved.
        if abs(k) < 1000:
            assert abs(exact * mpmath.exp(exact) / mpmath.mpc(z) - 1) <= 2 * allowed


@given(st.builds(cmath.rect, st.floats(-323, -9).map(lambda p: 10.0**p), st.floats(-3.2, 3.2)))
def test_tiny_arguments_of_the_principal_branch(z):
    w = complex(dtm.lambertw(z))
    with mpmath.workdps(700):
        exact = mpmath.mpc(z)
        exact = exact - exact**2 + 1.5 * exact**3
        # Half a spacing for each component, subnormal ones included.
        assert abs(w.real - exact.real) <= 0.501 * math.ulp(float(abs(exact.real)))
        assert abs(w.imag - exact.imag) <= 0.501 * math.ulp(float(abs(exact.imag)))


@given(points.filter(lambda z: z != 0), st.integers(-30, 30))
@settings(max_examples=100)
def test_mpmath_agrees(z, k):
    # mpmath knows no signed zeros: compare on the upper side, where its convention is ours.
    z = complex(z.real, abs(z.imag))
    w = complex(dtm.lambertw(z, k))
    with mpmath.workdps(40):
        exact = mpmath.lambertw(mpmath.mpc(z), k)
        # Half an ulp; 0.55 where the series next to -1/e hands over.
        assert abs(w - exact) <= 0.55 * EPS * abs(exact) + 5e-324


@given(st.floats(-0.36787944117144228, 1e300))
def test_real_arguments_give_real_answers(x):
    w = dtm.lambertw(x)
    assert w.imag == 0
    assert w.real >= -1
    if x < 0:
        behind = dtm.lambertw(x, -1)
        assert behind.imag == 0
        assert behind.real <= -1


# --- special values -----------------------------------------------------------------------

INF, NAN, PI = math.inf, math.nan, math.pi


@pytest.mark.parametrize(
    ("z", "k", "expected"),
    [
        (complex(0.0, 0.0), 0, complex(0.0, 0.0)),
        (complex(-0.0, -0.0), 0, complex(-0.0, -0.0)),
        (complex(0.0, 0.0), 1, complex(-INF, PI)),
        (complex(-0.0, 0.0), -1, complex(-INF, -0.0)),
        (complex(-0.0, -0.0), 1, complex(-INF, 0.0)),
        (complex(0.0, 0.0), -2, complex(-INF, -3 * PI)),
        (complex(INF, 0.0), 0, complex(INF, 0.0)),
        (complex(INF, -0.0), 0, complex(INF, -0.0)),
        (complex(-INF, 0.0), 0, complex(INF, PI)),
        (complex(-INF, -0.0), 0, complex(INF, -PI)),
        (complex(-INF, -0.0), 1, complex(INF, PI)),
        (complex(1.0, INF), 0, complex(INF, PI / 2)),
        (complex(1.0, -INF), 2, complex(INF, 3.5 * PI)),
        (complex(INF, INF), 0, complex(INF, PI / 4)),
        (complex(INF, 1.0), -3, complex(INF, -6 * PI)),
    ],
)
def test_limits(z, k, expected):
    assert (bits(dtm.lambertw(z, k)) == bits(expected)).all()


@pytest.mark.parametrize("z", [complex(NAN, 0), complex(0, NAN), complex(INF, NAN)])
def test_nan_in_either_part_is_nan_in_both(z):
    for k in (0, -1, 5):
        w = dtm.lambertw(z, k)
        assert math.isnan(w.real)
        assert math.isnan(w.imag)


def test_the_double_next_to_the_branch_point_is_below_it():
    # scipy 1.17 returns nan here.
    with mpmath.workdps(50):
        exact = complex(mpmath.lambertw(BRANCH_POINT))
    w = dtm.lambertw(complex(BRANCH_POINT, 0.0), [0, -1])
    assert w[0] == exact
    assert w[1] == exact.conjugate()
    assert dtm.lambertw(complex(BRANCH_POINT, -0.0)) == exact.conjugate()


def test_the_real_branch_below_starts_like_a_square_root():
    # scipy 1.17 stops too early here and is off by 7e-5.
    w = dtm.lambertw(BRANCH_POINT + 1e-9, -1)
    assert w == pytest.approx(-1.0000737348695, abs=1e-13)


def test_the_sides_of_the_branch_cut_are_distinguished():
    # scipy 1.17 ignores the sign of zero on k = -1.
    above, below = dtm.lambertw(pair([-0.2, -0.2], [0.0, -0.0]), -1)
    assert above.imag == 0
    assert below == pytest.approx(-3.7223 - 7.3872j, abs=1e-4)
    assert np.conj(below) == dtm.lambertw(-0.2 + 0j, 1)


# --- scipy, where it is right -------------------------------------------------------------


@pytest.mark.parametrize("k", [-3, -1, 0, 1, 7])
def test_scipy_agrees_away_from_the_branch_point(k):
    generator = np.random.default_rng(20)
    z = 10 ** generator.uniform(-3, 3, 2000) * np.exp(2j * np.pi * generator.random(2000))
    z = z[np.abs(z - BRANCH_POINT) > 0.1]
    theirs = scipy.special.lambertw(z, k)
    # Both are within 2 eps of the truth in this region.
    np.testing.assert_array_less(np.abs(dtm.lambertw(z, k) - theirs), 3 * EPS * np.abs(theirs))


# --- arrays -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def block():
    generator = np.random.default_rng(4)
    return generator.normal(size=(6, 5, 4)) + 1j * generator.normal(size=(6, 5, 4))


@pytest.mark.parametrize(
    "view",
    [
        lambda z: z,
        lambda z: z[::2],
        lambda z: z[::-1, :, ::-2],
        lambda z: z.T,
        lambda z: np.asfortranarray(z),
        lambda z: z[:, :0],
        lambda z: z[3, 2, 1],
        lambda z: np.broadcast_to(z[0], (3, 5, 4)),
        lambda z: z.astype(">c16"),
    ],
    ids=[
        "whole",
        "strided",
        "backwards",
        "transposed",
        "fortran",
        "empty",
        "0-d",
        "broadcast",
        "swapped",
    ],
)
def test_memory_layout_does_not_matter(block, view):
    z = view(block)
    w = dtm.lambertw(z, -1)
    assert w.shape == z.shape
    assert w.dtype == np.complex128
    assert (bits(w) == bits(one_by_one(z, -1))).all()


def test_read_only_and_unaligned_memory(block):
    z = block.copy()
    z.flags.writeable = False
    assert (bits(dtm.lambertw(z)) == bits(one_by_one(block))).all()
    raw = np.zeros(block.size * 16 + 1, np.uint8)
    odd = raw[1:].view(np.complex128)
    odd[:] = block.ravel()
    assert not odd.flags.aligned
    assert (bits(dtm.lambertw(odd)) == bits(one_by_one(block.ravel()))).all()


def test_arguments_broadcast(block):
    k = np.arange(-2, 3)[:, None]
    assert (bits(dtm.lambertw(block, k)) == bits(one_by_one(block, k))).all()
    assert dtm.lambertw(1.0, [[0, 1], [2, 3]]).shape == (2, 2)
    assert dtm.lambertw(np.ones((3, 1)), np.zeros((1, 2), int)).shape == (3, 2)
    assert dtm.lambertw([1.0], [0]).shape == (1,)
    assert dtm.lambertw(np.ones((1, 1)), 0).shape == (1, 1)
    assert dtm.lambertw(1.0, np.zeros((1, 1), int)).shape == (1, 1)
    assert dtm.lambertw(np.ones(0), [[1], [2]]).shape == (2, 0)
    with pytest.raises(ValueError, match=r"z \(2,\), k \(3,\)"):
        dtm.lambertw([1.0, 2.0], [0, 1, 2])


@pytest.mark.parametrize("z", [1, 1.0, 1j, True, np.float32(1), np.int8(1), np.array(1.0)])
def test_scalars_come_back_as_scalars(z):
    assert type(dtm.lambertw(z)) is np.complex128


def test_single_precision_stays_single_and_is_rounded_once(block):
    z = block.astype(np.complex64)
    w = dtm.lambertw(z)
    assert w.dtype == np.complex64
    assert (w == dtm.lambertw(z.astype(np.complex128)).astype(np.complex64)).all()
    assert type(dtm.lambertw(np.complex64(1))) is np.complex64
    assert dtm.lambertw(np.ones(2, np.float32)).dtype == np.complex128


@pytest.mark.parametrize("kind", [np.float16, np.float32, float, np.complex64, complex, np.int8])
@pytest.mark.parametrize(
    "function",
    [
        dtm.lambertw,
        dtm.lambertw0,
        dtm.wrightomega,
        dtm.special.lambertw_log,
        lambda z: dtm.lambertw(z, np.array([0, -1])),
        lambda z: dtm.special.lambertw_offset(z)[1],
    ],
)
def test_scalars_and_arrays_have_one_dtype(function, kind):
    if function is dtm.lambertw0 and np.dtype(kind).kind == "c":
        pytest.skip("takes real numbers")
    forms = (kind(0), np.array(kind(0)), [kind(0)], np.zeros(2, kind), np.zeros((3, 1), kind))
    assert len({np.asarray(function(z)).dtype for z in forms}) == 1


@pytest.mark.parametrize("z", ["1", None, object(), [1, "a"], 10**400, np.longdouble(1) * 1])
def test_what_is_no_number_is_refused(z):
    if np.asarray(z).dtype == np.float64:
        pytest.skip("long double is double on this machine")
    with pytest.raises(TypeError, match="z has dtype"):
        dtm.lambertw(z)


@pytest.mark.parametrize("k", [1.5, 1.0, [0, 2.5], "1", True, None, 1j])
def test_branches_must_be_integers(k):
    with pytest.raises(TypeError, match="is not an integer"):
        dtm.lambertw(1.0, k)


def test_the_message_names_the_branch():
    with pytest.raises(TypeError, match=r"k=.*1\.5"):
        dtm.lambertw(1.0, 1.5)


@pytest.mark.parametrize("k", [2**63, -(2**63) - 1, 10**30, np.uint64(2**63), [0, 2**64]])
def test_branches_beyond_64_bits_are_refused(k):
    with pytest.raises(ValueError, match="fits a 64-bit integer"):
        dtm.lambertw(1.0, k)


@pytest.mark.parametrize("k", [2**63 - 1, -(2**63), np.uint64(2**63 - 1)])
def test_the_outermost_branches_work(k):
    w = complex(dtm.lambertw(1.0, k))
    # w = 2 pi i k - log w to first order, and log w = log(2 pi |k|) +- pi i/2.
    assert w.imag == pytest.approx(2 * math.pi * int(k), rel=EPS)
    assert w.real == pytest.approx(-math.log(2 * math.pi * abs(int(k))), rel=4 * EPS)


def test_bits_do_not_depend_on_threads_and_position():
    generator = np.random.default_rng(9)
    n = 25_000
    z = 10 ** generator.uniform(-20, 20, n) * np.exp(2j * np.pi * generator.random(n))
    k = generator.integers(-5, 6, n)
    one, two = dtm.lambertw(z, k, threads=1), dtm.lambertw(z, k, threads=2)
    assert (bits(one) == bits(two)).all()
    assert (bits(one) == bits(dtm.lambertw(z, k))).all()
    assert (bits(one[777:790]) == bits(dtm.lambertw(z[777:790], k[777:790]))).all()
    some = generator.integers(0, n, 300)
    assert (bits(one[some]) == bits(one_by_one(z[some], k[some]))).all()
    with pytest.raises(ValueError, match="threads=0"):
        dtm.lambertw(1.0, threads=0)


# --- real branches ------------------------------------------------------------------------


def test_real_branches_are_those_of_the_complex_function():
    x = np.concatenate([-np.logspace(-300, math.log10(0.3678), 500), np.logspace(-300, 300, 500)])
    np.testing.assert_allclose(dtm.lambertw0(x), dtm.lambertw(x).real, rtol=4 * 2.0**-52)
    x = x[x < 0]
    np.testing.assert_allclose(dtm.lambertwm1(x), dtm.lambertw(x, -1).real, rtol=4 * 2.0**-52)


def test_real_branches_end_at_the_branch_point():
    x = np.array([-math.inf, -1.0, np.nextafter(BRANCH_POINT, -1), math.nan])
    assert np.isnan(dtm.lambertw0(x)).all()
    assert np.isnan(dtm.lambertwm1(x)).all()
    assert np.isnan(dtm.lambertwm1([5e-324, 1.0, math.inf])).all()
    assert dtm.lambertw0(BRANCH_POINT) == dtm.lambertwm1(BRANCH_POINT) == -1.0
    assert dtm.lambertw0(0.0) == 0.0
    assert dtm.lambertw0(math.inf) == math.inf
    assert dtm.lambertwm1(0.0) == dtm.lambertwm1(-0.0) == -math.inf
    assert math.copysign(1.0, dtm.lambertw0(-0.0)) == -1.0
