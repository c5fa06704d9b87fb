"""C functions for compiled callers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from deadtime import _deadtime

if TYPE_CHECKING:
    import scipy


def low_level_callable(
    name: Literal["lambertw", "lambertw0", "lambertwm1"],
) -> scipy.LowLevelCallable:
    r"""Return a function of this package as C code, which scipy calls without Python.

    Parameters
    ----------
    name : {'lambertw0', 'lambertwm1', 'lambertw'}
        The real branches have the signature ``double (double)``; `lambertw` has
        ``void (double, double, int64_t, double *)``: real part, imaginary part, branch, and where
        to put the two parts of W.

    Returns
    -------
    scipy.LowLevelCallable
        For `scipy.integrate.quad` and others. The functions hold no state, take no lock and may
        be called from any thread.

    Raises
    ------
    ValueError
        There is no function of that name.

    Notes
    -----
    The pointers are kept as a Cython module keeps its own, in ``__pyx_capi__``, so that numba
    finds them as well::

        address = numba.extending.get_cython_function_address("deadtime._deadtime", "lambertw0")
        lambertw0 = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(address)

    where ``lambertw0`` may then be called in functions that numba compiles.

    Examples
    --------
    With :math:`x = w e^w`, the integral of :math:`W_0` from 0 to e is that of
    :math:`w (1 + w) e^w` from 0 to 1, which is :math:`e - 1`.

    >>> import math
    >>> import deadtime as dtm
    >>> from scipy.integrate import quad
    >>> value, error = quad(dtm.special.low_level_callable("lambertw0"), 0.0, math.e)
    >>> abs(value - (math.e - 1.0)) < 1e-12
    True
    """
    import scipy

    if name not in _deadtime.__pyx_capi__:
        names = ", ".join(sorted(_deadtime.__pyx_capi__))
        raise ValueError(f"name={name!r}: give one of {names}")
    return scipy.LowLevelCallable.from_cython(_deadtime, name)
