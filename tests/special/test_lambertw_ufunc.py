"""Lambert W as ufuncs: out, where and dtype, memory, scalars, foreign objects, flags."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime import _deadtime as native
from lambertw_points import BRANCH_POINT, LARGE, points, same_bits

# --- out, where, dtype, casting -----------------------------------------------------------


@pytest.mark.parametrize("n", [3, LARGE])
def test_the_result_is_written_to_out(n):
    z = points(n)
    out = np.empty(n, complex)
    assert dtm.lambertw(z, out=out) is out
    assert same_bits(out, dtm.lambertw(z))
    other = np.empty(n, complex)
    assert dtm.lambertw(z, 0, (other,)) is other
    assert same_bits(other, out)


def test_the_result_of_a_scalar_is_written_to_out():
    out = np.empty((2, 3), complex)
    assert dtm.lambertw(1.0, out=out) is out
    assert (out == dtm.lambertw(1.0)).all()
    single = np.array(0j)
    assert dtm.lambertw(1.0, out=single) is single
    assert single == dtm.lambertw(1.0)


def test_a_result_of_single_precision_is_rounded_once():
    z = points(100)
    out = np.empty(100, np.complex64)
    assert dtm.lambertw(z, out=out) is out
    assert same_bits(out, dtm.lambertw(z).astype(np.complex64))


def test_a_result_that_does_not_fit_is_refused():
    z = points(3)
    fixed = np.empty(3, complex)
    fixed.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        dtm.lambertw(z, out=fixed)
    with pytest.raises(ValueError, match="broadcast"):
        dtm.lambertw(z, out=np.empty(4, complex))
    for dtype in (float, int, bool):
        with pytest.raises(TypeError, match="output"):
            dtm.lambertw(z, out=np.empty(3, dtype))
    with pytest.raises(TypeError, match="array"):
        dtm.lambertw(z, out=[0j, 0j, 0j])


@pytest.mark.parametrize("n", [7, 5_000, LARGE])
def test_where_leaves_the_other_elements_unchanged(n):
    z = points(n)
    where = np.random.default_rng(1).random(n) < 0.5
    out = np.full(n, 3 + 4j)
    dtm.lambertw(z, -1, out, where=where)
    assert (out[~where] == 3 + 4j).all()
    assert same_bits(out[where], dtm.lambertw(z[where], -1))
    dtm.lambertw(z, out=out, where=False)
    assert same_bits(out[where], dtm.lambertw(z[where], -1))


def test_where_skips_arguments_that_would_be_refused():
    delay = np.array([1.0, -1.0, np.nan])
    out = np.zeros(3, complex)
    dtm.dde_roots(-1.0, -0.5, delay, out=out, where=delay > 0)
    assert out[0] == dtm.dde_roots(-1.0, -0.5, 1.0)
    assert (out[1:] == 0).all()
    with pytest.raises(ValueError, match=r"must not be negative, got -1\.0"):
        dtm.dde_roots(-1.0, -0.5, delay, out=out, where=[True, True, False])


def test_the_type_of_the_result_can_be_chosen():
    z = points(50)
    exact = dtm.lambertw(z)
    for dtype in (np.complex64, "F"):
        narrow = dtm.lambertw(z, dtype=dtype)
        assert same_bits(narrow, dtm.lambertw(z.astype(np.complex64)))
    assert same_bits(dtm.lambertw(z, dtype=complex), exact)
    assert type(dtm.lambertw(1.0, dtype=np.complex64)) is np.complex64
    assert dtm.lambertw(np.ones(2, np.complex64), dtype=complex).dtype == complex
    for dtype in (float, int, object):
        with pytest.raises(TypeError, match="no result of type"):
            dtm.lambertw(z, dtype=dtype)


@pytest.mark.parametrize("dtype", ["?", "b", "B", "h", "i", "q", "Q", "e", "f", "d", "F", "D"])
@pytest.mark.parametrize("order", ["=", "S"])
def test_every_type_of_number_is_taken(dtype, order):
    z = np.array([0, 1, 1, 0, 1]).astype(np.dtype(dtype).newbyteorder(order))
    w = dtm.lambertw(z, -1)
    assert w.dtype == (np.complex64 if dtype == "F" else np.complex128)
    assert (w == dtm.lambertw(z.astype(complex), -1).astype(w.dtype)).all()


@pytest.mark.parametrize("dtype", ["b", "B", "h", "i", "q", "Q", ">i8", ">i2"])
def test_every_type_of_integer_is_a_branch(dtype):
    k = np.array([0, 1, 2, 3]).astype(dtype)
    assert same_bits(dtm.lambertw(1.0, k), dtm.lambertw(1.0, [0, 1, 2, 3]))


@pytest.mark.parametrize("keywords", [{"casting": "unsafe"}, {"dtype": complex}, {"out": ...}])
def test_no_cast_changes_a_branch(keywords):
    if "out" in keywords:
        keywords = {"out": np.empty(2, complex)}
    for k in ([1.5, 2.0], [True, False], np.float32(1)):
        with pytest.raises(TypeError, match="is not an integer"):
            dtm.lambertw(1.0, k, **keywords)
    for k in (np.uint64(2**63), np.array([1, 2**64 - 1], np.uint64), 2**63, -(2**63) - 1):
        with pytest.raises(ValueError, match=f"k={int(np.max(k))}|k=-9223372036854775809"):
            dtm.lambertw(1.0, k, **keywords)


def test_what_numpy_does_not_know_is_refused():
    with pytest.raises(TypeError, match="tol"):
        dtm.lambertw(1.0, tol=1e-8)
    with pytest.raises(TypeError, match="x has dtype complex128: give real numbers"):
        dtm.lambertw0(1j)
    with pytest.raises(TypeError, match=r"k=0\.5 "):
        dtm.dde_roots(0.0, -1.0, 1.0, 0.5)
    with pytest.raises(ValueError, match=r"a0 \(2,\), a1 \(3,\), delay \(\), k \(\)"):
        dtm.dde_roots([0.0, 1.0], [1.0, 2.0, 3.0], 1.0)


def test_a_casting_rule_is_kept():
    with pytest.raises(TypeError, match="cast"):
        dtm.lambertw(np.ones(2, np.float32), casting="no")
    assert dtm.lambertw(np.ones(2), casting="no").dtype == complex


# --- memory -------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 5, 600, LARGE])
def test_results_may_overwrite_arguments(n):
    z = points(n)
    exact = dtm.lambertw(z, -1)
    for place in (lambda a: a, lambda a: a[::-1]):
        work = z.copy()
        dtm.lambertw(work, -1, out=place(work))
        assert same_bits(place(work), exact)
    # Shifted by one, and beside it in the same memory.
    work = np.append(z, 0)
    dtm.lambertw(work[:-1], -1, out=work[1:])
    assert same_bits(work[1:], exact)
    work = np.repeat(z, 2)
    dtm.lambertw(work[::2], -1, out=work[1::2])
    assert same_bits(work[1::2], exact)
    assert same_bits(work[::2], z)


def test_results_may_overwrite_real_arguments():
    # The memory of two real numbers becomes that of a complex one.
    x = np.random.default_rng(3).uniform(0, 9, 2_000)
    exact = dtm.lambertw(x[:1_000])
    dtm.lambertw(x[:1_000], out=x.view(complex))
    assert same_bits(x.view(complex), exact)
    x = np.random.default_rng(3).uniform(0, 9, LARGE)
    exact = dtm.lambertw0(x)
    assert dtm.lambertw0(x, out=x) is x
    assert same_bits(x, exact)


LAYOUTS = {
    "strided": lambda z: z[::3],
    "backwards": lambda z: z[::-1],
    "rows": lambda z: z[:-1].reshape(-1, 6)[:, 1:4],
    "columns": lambda z: z[:-1].reshape(-1, 6).T,
    "fortran": lambda z: np.asfortranarray(z[:-1].reshape(-1, 6)),
    "repeated": lambda z: np.broadcast_to(z[0], 5_000),
    "swapped": lambda z: z.astype(">c16"),
    "0-d": lambda z: z[0].reshape(()),
    "empty": lambda z: z[:0],
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_bits_do_not_depend_on_the_memory_layout(layout):
    z = LAYOUTS[layout](points(9_001))
    w = dtm.lambertw(z, 2)
    plain = dtm.lambertw(z.astype(complex).ravel(), 2).reshape(z.shape)
    assert same_bits(w, plain)
    out = np.empty(z.shape[::-1], complex).T
    dtm.lambertw(z, 2, out)
    assert same_bits(out, plain)


def test_unaligned_memory_is_read_and_written():
    z = points(5_000)
    memory = np.zeros((2, z.size * 16 + 1), np.uint8)
    odd, out = memory[0, 1:].view(complex), memory[1, 1:].view(complex)
    odd[:] = z
    assert not odd.flags.aligned
    dtm.lambertw(odd, out=out)
    assert same_bits(out.copy(), dtm.lambertw(z))


def test_branches_broadcast_against_points():
    z, k = points(300), np.arange(-3, 4)
    table = dtm.lambertw(z, k[:, None])
    assert table.shape == (7, 300)
    for row, branch in zip(table, k, strict=True):
        assert same_bits(row, dtm.lambertw(z, branch))
    assert same_bits(dtm.lambertw(z[:, None], k), np.ascontiguousarray(table.T))
    assert same_bits(native.lambertw.outer(k * 1.0, k)[6, 0], dtm.lambertw(3.0, -3))


# --- scalars, subclasses, objects of others -----------------------------------------------


def test_scalars_have_the_same_bits_as_arrays():
    numbers = [1, -1, 0.0, -0.0, -0.2, 1e300, math.inf, 2 + 3j, complex(-1, -0.0), BRANCH_POINT]
    for number in numbers:
        for z in (number, np.complex128(number)):
            for k in (0, -1, 5, 2**63 - 1):
                w = dtm.lambertw(z, k)
                assert type(w) is np.complex128
                assert same_bits(w, dtm.lambertw(np.array([z]), np.array([k]))[0])
                assert same_bits(w, dtm.lambertw(z, np.int64(k)))
    for x in (1, 0.5, np.float64(0.5), -0.2, -0.0, 0, -1.0, math.nan, math.inf):
        for f in (dtm.lambertw0, dtm.lambertwm1):
            assert type(f(x)) is np.float64
            assert same_bits(f(x), f(np.array([x], float))[0])
    s = dtm.dde_roots(0, -2.0, 0.36, -1)
    assert type(s) is np.complex128
    assert same_bits(s, dtm.dde_roots([0], -2.0, 0.36, -1)[0])


def test_an_int_is_taken_as_in_an_array():
    assert dtm.lambertw(2**53 + 1) == dtm.lambertw(np.array([2**53 + 1]))[0]
    assert dtm.lambertw(2**64) == dtm.lambertw(2.0**64)
    with pytest.raises(TypeError, match="dtype object"):
        dtm.lambertw(10**400)


class Tagged(np.ndarray):
    """A subclass of arrays without methods of its own."""


class Length(float):
    """A subclass of numbers with its own ``__array_ufunc__``."""

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        return ufunc.__name__, method, len(inputs), sorted(keywords)


def test_subclasses_of_arrays_are_kept():
    z = points(5).view(Tagged)
    assert type(dtm.lambertw(z)) is Tagged
    assert type(dtm.lambertw(z, subok=False)) is np.ndarray
    assert type(dtm.lambertw(1.0, np.zeros(2, np.int8).view(Tagged))) is Tagged


def test_masked_arrays_stay_masked():
    z = np.ma.masked_array(points(4), [False, True, False, False])
    w = dtm.lambertw(z, np.ma.masked_array([0, 0, 1, 1], [False, False, False, True]))
    assert isinstance(w, np.ma.MaskedArray)
    assert w.mask.tolist() == [False, True, False, True]
    assert w[0] == dtm.lambertw(z.data[0])


@pytest.mark.filterwarnings("default")
def test_series_keep_their_index():
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    z = pandas.Series([0.5, 1.0], index=["a", "b"])
    w = dtm.lambertw(z, pandas.Series([0, -1], index=["a", "b"]))
    assert w.index.tolist() == ["a", "b"]
    assert w["b"] == dtm.lambertw(1.0, -1)
    assert dtm.lambertw0(z)["a"] == dtm.lambertw0(0.5)
    assert dtm.dde_roots(0.0, -z, 1.0)["a"] == dtm.dde_roots(0.0, -0.5, 1.0)


def test_array_ufunc_of_other_objects_is_called():
    assert dtm.lambertw(Length(1.0)) == ("lambertw", "__call__", 2, [])
    assert dtm.lambertw(1.0, Length(1.0)) == ("lambertw", "__call__", 2, [])
    answer = dtm.lambertw(Length(1.0), 0, np.zeros(1, complex), where=[True], dtype="F", order="C")
    assert answer == ("lambertw", "__call__", 2, ["dtype", "order", "out", "where"])
    assert dtm.dde_roots(0.0, Length(1.0), 1.0)[0] == "dde_roots"
    assert dtm.lambertw0(Length(1.0), threads=1)[0] == "lambertw0"


def test_they_are_ufuncs():
    for name, nin in (("lambertw", 2), ("lambertw0", 1), ("lambertwm1", 1), ("dde_roots", 4)):
        ufunc = getattr(native, name)
        assert isinstance(ufunc, np.ufunc)
        assert (ufunc.__name__, ufunc.nin, ufunc.nout) == (name, nin, 1)


def test_methods_of_ufuncs_work_or_are_refused():
    z = points(4)
    work = z.copy()
    native.lambertw.at(work, [0, 2, 2], -1)
    assert work[0] == dtm.lambertw(z[0], -1)
    assert work[1] == z[1]
    assert work[2] == dtm.lambertw(dtm.lambertw(z[2], -1), -1)
    for method in (native.lambertw.reduce, native.lambertw.accumulate):
        with pytest.raises(TypeError):
            method(z)


# --- floating-point flags -----------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 40, LARGE])
def test_hard_arguments_cause_no_warning(n):
    parts = [0.0, -0.0, 5e-324, 1e-308, BRANCH_POINT, -0.2, 1.8e308, math.inf, -math.inf, math.nan]
    z = np.array([complex(a, b) for a in parts for b in parts])
    x = np.resize(np.array(parts), max(n, len(parts)))
    narrow = np.resize(np.array([1e-45, -3e38, 1e-45j, BRANCH_POINT], np.complex64), n)
    with np.errstate(all="raise"):
        for k in (0, -1, 1, 7, 2**63 - 1, -(2**63)):
            dtm.lambertw(np.resize(z, max(n, z.size)), k)
            for point in z[:n]:
                dtm.lambertw(point, k)
                dtm.lambertw(np.array(point), k)
        dtm.lambertw(narrow, [[0], [-1]])
        dtm.lambertw0(x)
        dtm.lambertwm1(x)
        dtm.dde_roots(1.7e308, -1.7e308, np.resize([0.0, 1e-300, 1e300], n), [[0], [3]])


def test_flags_of_a_kernel_are_not_reported_as_those_of_a_cast():
    # NumPy looks at the flags after a cast, and once found an underflow inside the kernel there.
    parts = [5e-324, 1e-308, -0.2, 1.8e308, 1e-160, math.inf, math.nan, 1e38]
    z = np.array([complex(a, b) for a in parts for b in parts])
    out = np.empty(z.shape, np.complex64)
    with np.errstate(all="raise"):
        for k in (5, -7, 2**62):
            dtm.lambertw(z, k, out)
            dtm.lambertw(z.real.astype(">f8"), k, out)
        dtm.lambertw(np.array([0, 1, -1, 2**62]), [[0], [-1], [1]])
    with np.errstate(over="raise"), pytest.raises(FloatingPointError, match="overflow"):
        dtm.lambertw(np.array([1e300]), out=np.empty(1, np.complex64), dtype=np.complex64)
