"""`solve_dde` refuses compiled functions of other types, None and complex numbers."""

import ctypes

import deadtime as dtm
import numpy as np
import pytest

DOUBLES = ctypes.POINTER(ctypes.c_double)
EXPECTED = (
    r"must have the signature void \(double, double \*, double \*, double \*, double \*, void \*\)"
)


def solve(fun, **options):
    return dtm.solve_dde(fun, (0, 1), 1.0, 1.0, **options)


def decay(t, y, z):
    return -z[0]


def numba_types():
    types = pytest.importorskip("numba").types
    pointer = types.CPointer(types.float64)
    return types, types.float64, pointer


def test_a_numba_cfunc_of_another_signature_is_refused():
    # It was called all the same, with whatever stood in the registers.
    numba = pytest.importorskip("numba")
    types, real, pointer = numba_types()
    single = types.CPointer(types.float32)
    signatures = [
        types.float64(real),
        types.void(real, pointer, pointer, pointer, pointer),
        types.float64(real, pointer, pointer, pointer, pointer, types.voidptr),
        types.void(real, single, pointer, pointer, pointer, types.voidptr),
        types.void(types.int64, pointer, pointer, pointer, pointer, types.voidptr),
        types.void(real, pointer, pointer, pointer, pointer, real),
    ]
    for signature in signatures:
        names = ", ".join(f"a{k}" for k in range(len(signature.args)))
        value = "0.0" if signature.return_type != types.void else "None"
        function = numba.cfunc(signature)(eval(f"lambda {names}: {value}"))
        with pytest.raises(ValueError, match=EXPECTED):
            solve(function)


def test_the_user_data_may_be_any_pointer():
    numba = pytest.importorskip("numba")
    types, real, pointer = numba_types()

    @numba.cfunc(types.void(real, pointer, pointer, pointer, pointer, pointer))
    def fun(t, y, z, dz, dy, data):
        dy[0] = -z[0]

    assert solve(fun).y[0, -1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "types",
    [
        (None, ctypes.c_double),
        (None,),
        (ctypes.c_double, ctypes.c_double, *[DOUBLES] * 4, ctypes.c_void_p),
        (None, ctypes.c_float, *[DOUBLES] * 4, ctypes.c_void_p),
        (None, ctypes.c_double, DOUBLES, *[ctypes.POINTER(ctypes.c_float)] * 3, ctypes.c_void_p),
        (None, ctypes.c_double, *[DOUBLES] * 4, ctypes.c_double),
    ],
)
def test_ctypes_functions_of_other_types_are_refused(types):
    function = ctypes.CFUNCTYPE(*types)(lambda *_: 0.0)
    with pytest.raises(ValueError, match=EXPECTED):
        solve(function)


def test_an_object_with_an_address_is_no_compiled_function():
    class Host:
        address = 12345

    with pytest.raises(TypeError, match="not a function"):
        solve(Host())


# --- values of functions --------------------------------------------------------------------


def nothing(*_):
    pass


def complex_number(*_):
    return 1.0 + 0.0j


CASES = {
    "fun": lambda bad: {"fun": bad},
    "fun for": lambda bad: {"fun": bad, "vectorized": True},
    "event 0": lambda bad: {"events": bad},
    "the change": lambda bad: {"jumps": [(0.5, bad)]},
    "history": lambda bad: {"history": bad},
    "history at": lambda bad: {"history": lambda t: 1.0 if t == 0.0 else bad()},
    "the derivative of the history": lambda bad: {"history": (np.cos, bad), "neutral": True},
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        # A forgotten return read "[NaN]"; an imaginary part was dropped.
        (nothing, "returned None"),
        (complex_number, "complex"),
        (lambda *_: np.array([1j]), "complex"),
        (lambda *_: [1.0j], "complex"),
        (lambda *_: [None], "None|object"),
        (lambda *_: "1.0", "(give|return) real numbers"),
    ],
)
def test_values_that_are_no_real_numbers_are_refused_by_name(name, bad, message):
    def neutral(t, y, z, dz):
        return -z[0]

    changes = CASES[name](bad)
    fun = neutral if "neutral" in changes else decay
    arguments = {"fun": fun, "t_span": (0, 1), "history": 1.0, "delays": 1.0} | changes
    with pytest.raises(TypeError, match=message) as caught:
        dtm.solve_dde(**arguments)
    assert str(caught.value).startswith(name)


def test_rows_of_a_vectorised_function_are_checked_too():
    def fun(t, y, z):
        return [y[1], 1j * y[0]]

    with pytest.raises(TypeError, match="complex"):
        dtm.solve_dde(fun, (0, 1), [1.0, 1.0], 1.0, vectorized=True)


def test_whole_numbers_fractions_and_logical_values_are_numbers():
    fractions = pytest.importorskip("fractions")
    for value in (1, True, np.float32(1.0), fractions.Fraction(1), [1], np.array([1])):
        found = solve(lambda t, y, z, value=value: value)
        assert found.y[0, -1] == pytest.approx(2.0, abs=1e-14)
