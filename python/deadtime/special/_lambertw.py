"""The Lambert W function: every branch, the two real ones, and their C code.

The functions are NumPy ufuncs with a thin layer on top: single numbers go past NumPy's machinery,
which takes longer than W itself; and where NumPy refuses the arguments, the reason is looked up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Unpack

from numpy.typing import ArrayLike, DTypeLike, NDArray

import deadtime.special._native as native
from deadtime.special._ufunc import UfuncOptions, apply, branches

if TYPE_CHECKING:
    import scipy


def lambertw(
    z: ArrayLike,
    k: ArrayLike = 0,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Lambert W function, every branch.

    :math:`w = W_k(z)` solves :math:`w e^w = z`; the branch is the integer :math:`k` in
    :math:`w + \log w = \log z + 2 \pi i k`.

    Parameters
    ----------
    z : array_like of numbers
        Where to evaluate. The sign of a zero imaginary part tells the side of a branch cut:
        ``+0`` is above, ``-0`` below.
    k : array_like of int, optional
        Branch, any 64-bit integer. Broadcasts against `z`. The real branches are ``k=0`` for
        real ``z >= -1/e`` and ``k=-1`` for real ``-1/e <= z < 0``.
    out : ndarray or tuple of one ndarray, optional
        Where to put the result, of complex numbers; it may be `z` itself.
    where : array_like of bool, optional
        Where to compute; elsewhere `out` stays as it is (and is arbitrary without `out`).
    dtype : dtype, optional
        Type of the result, complex64 or complex128; NumPy converts `z` to it first.
    threads : int, optional
        Number of threads for large arrays; all cores by default (see ``DEADTIME_NUM_THREADS``).
        The result does not depend on it.
    **options
        `casting`, `order`, `subok`, as for any NumPy ufunc.

    Returns
    -------
    ndarray or scalar of complex128
        W with the common shape of `z` and `k`; complex64 when `z` is complex64. Subclasses of
        arrays and objects with an ``__array_ufunc__`` of their own are treated as by any ufunc.

    Raises
    ------
    TypeError
        `z` is not numeric (or has more precision than complex128), or `k` is not of integers.
    ValueError
        The shapes do not broadcast, `k` exceeds 64 bits, or `out` does not fit.

    See Also
    --------
    lambertw0, lambertwm1 : the real branches of real arguments.

    Notes
    -----
    The error :math:`|w - W|/|W|` stays near that of a correctly rounded result everywhere, next
    to the branch point :math:`-1/e` as elsewhere. A small component beside a large one may have
    a larger relative error of its own.

    :math:`W_k(\bar z) = \overline{W_{-k}(z)}` holds without exception, signs of zeros included;
    a real answer has an imaginary part of exactly zero. ``W_0(0) = 0``; on the other branches
    the real part at 0 is ``-inf`` and the imaginary part the limit along the direction of the
    signed zero. At infinity the result is ``inf + 1j*(angle(z) + 2*pi*k)``, where `z` has a NaN
    it is NaN in both parts.

    References
    ----------
    R. M. Corless, G. H. Gonnet, D. E. G. Hare, D. J. Jeffrey, D. E. Knuth, "On the Lambert W
    function", Advances in Computational Mathematics 5 (1996) 329-359.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> print(dtm.lambertw(1.0))
    (0.5671432904097838+0j)
    >>> w = dtm.lambertw(-0.2, [-1, 0])
    >>> w.real.round(6)
    array([-2.542641, -0.259171])
    >>> bool(np.allclose(w * np.exp(w), -0.2))
    True

    In place, without a new array:

    >>> z = np.array([1.0 + 1.0j, -5.0 + 0.0j])
    >>> dtm.lambertw(z, out=z) is z
    True
    """
    if out is None and threads is None and where is True and dtype is None and not options:
        number = native.lambertw_number(z, k)
        if number is not None:
            return number
    return apply(native.lambertw, (z, branches(k)), options, out, where, dtype, threads)


def lambertw0(
    x: ArrayLike,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Principal branch of the Lambert W function for real numbers.

    The solution :math:`w \ge -1` of :math:`w e^w = x`; real in, real out, and several times
    faster than `lambertw`.

    Parameters
    ----------
    x : array_like of float
        Where to evaluate.
    out, where, dtype, threads, **options
        As for `lambertw`, with real types.

    Returns
    -------
    ndarray or scalar of float64
        :math:`W_0(x)`; NaN for :math:`x < -1/e`, where it is not real. float32 when `x` is.

    Raises
    ------
    TypeError
        `x` is not real, or has more precision than float64.

    Notes
    -----
    The double next to :math:`-1/e` lies below it by 1.2e-17 and counts as :math:`-1/e` here: W is
    -1. As a complex number, `lambertw` takes it for what it is.

    References
    ----------
    R. M. Corless et al., "On the Lambert W function", Advances in Computational Mathematics 5
    (1996) 329-359.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> print(dtm.lambertw0(1.0))
    0.5671432904097838
    >>> dtm.lambertw0([-0.2, 0.0, np.e]).round(6)
    array([-0.259171,  0.      ,  1.      ])
    """
    if out is None and threads is None and where is True and dtype is None and not options:
        number = native.lambertw0_number(x)
        if number is not None:
            return number
    return apply(native.lambertw0, (x,), options, out, where, dtype, threads)


def lambertwm1(
    x: ArrayLike,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Lower real branch of the Lambert W function.

    The solution :math:`w \le -1` of :math:`w e^w = x` for :math:`-1/e \le x < 0`; real in, real
    out.

    Parameters
    ----------
    x : array_like of float
        Where to evaluate.
    out, where, dtype, threads, **options
        As for `lambertw`, with real types.

    Returns
    -------
    ndarray or scalar of float64
        :math:`W_{-1}(x)`; NaN outside :math:`[-1/e, 0]`, ``-inf`` at 0. float32 when `x` is.

    Raises
    ------
    TypeError
        `x` is not real, or has more precision than float64.

    Notes
    -----
    The double next to :math:`-1/e` counts as :math:`-1/e`, as for `lambertw0`.

    References
    ----------
    R. M. Corless et al., "On the Lambert W function", Advances in Computational Mathematics 5
    (1996) 329-359.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.lambertwm1([-0.3, -0.2, 0.0]).round(6)
    array([-1.781337, -2.542641,      -inf])
    """
    if out is None and threads is None and where is True and dtype is None and not options:
        number = native.lambertwm1_number(x)
        if number is not None:
            return number
    return apply(native.lambertwm1, (x,), options, out, where, dtype, threads)


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

    if name not in native._deadtime.__pyx_capi__:
        names = ", ".join(sorted(native._deadtime.__pyx_capi__))
        raise ValueError(f"name={name!r}: give one of {names}")
    return scipy.LowLevelCallable.from_cython(native._deadtime, name)
