"""C pointers to Lambert W, for scipy, ctypes and numba."""

import ctypes
import math

import deadtime as dtm
import numpy as np
import pytest
import scipy.integrate
from deadtime import _deadtime as native
from lambertw_points import BRANCH_POINT


def test_scipy_integrates_without_python():
    # The substitution x = w e^w turns it into the integral of w (1 + w) e^w.
    value, _ = scipy.integrate.quad(dtm.special.low_level_callable("lambertw0"), 0.0, math.e)
    assert value == pytest.approx(math.e - 1.0, rel=1e-12)
    # From -2 e^-2 to -e^-1 on the lower branch: (w^2 - w + 1) e^w from w = -2 to -1.
    lower = dtm.special.low_level_callable("lambertwm1")
    value, _ = scipy.integrate.quad(lower, -2.0 * math.exp(-2.0), -math.exp(-1.0))
    assert value == pytest.approx(3.0 * math.exp(-1.0) - 7.0 * math.exp(-2.0), rel=1e-9)


def pointer(name):
    get = ctypes.pythonapi.PyCapsule_GetPointer
    get.restype, get.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    signature = ctypes.pythonapi.PyCapsule_GetName
    signature.restype, signature.argtypes = ctypes.c_char_p, [ctypes.py_object]
    capsule = native.__pyx_capi__[name]
    return get(capsule, signature(capsule)), signature(capsule).decode()


def test_pointers_compute_what_the_functions_do():
    for name in ("lambertw0", "lambertwm1"):
        address, signature = pointer(name)
        assert signature == "double (double)"
        function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(address)
        for x in (-0.2, BRANCH_POINT, -1e-10):
            assert function(x) == getattr(dtm, name)(x)
    address, signature = pointer("lambertw")
    assert signature == dtm.special.low_level_callable("lambertw").signature
    double, parts = ctypes.c_double, ctypes.c_double * 2
    types = (double, double, ctypes.c_int64, ctypes.POINTER(double))
    function, out = ctypes.CFUNCTYPE(None, *types)(address), parts()
    for z, k in ((1 + 2j, -3), (complex(-1, -0.0), 1), (0.3j, 2**62)):
        function(z.real, z.imag, k, out)
        assert complex(*out) == dtm.lambertw(z, k)
    with pytest.raises(ValueError, match="give one of lambertw, lambertw0, lambertwm1"):
        dtm.special.low_level_callable("wright")


@pytest.mark.filterwarnings("default")
def test_numba_compiles_loops_over_them():
    numba = pytest.importorskip("numba", reason="numba is not installed")
    from numba.extending import get_cython_function_address

    address = get_cython_function_address("deadtime._deadtime", "lambertw0")
    lambertw0 = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(address)

    @numba.njit
    def total(n):
        result = 0.0
        for i in range(n):
            result += lambertw0(i * 0.5)
        return result

    exact = math.fsum(dtm.lambertw0(np.arange(100) * 0.5))
    assert total(100) == pytest.approx(exact, rel=1e-14)
