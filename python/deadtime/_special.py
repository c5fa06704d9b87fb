"""The Lambert W function and the characteristic roots it gives in closed form.

The functions are NumPy ufuncs with a thin layer on top: single numbers go past NumPy's machinery,
which takes longer than W itself; and where NumPy refuses the arguments, the reason is looked up.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from deadtime import _deadtime
from deadtime._validation import thread_number

__all__ = ["dde_roots", "lambertw", "lambertw0", "lambertwm1"]


class UfuncOptions(TypedDict, total=False):
    """What every ufunc takes and few need."""

    casting: Literal["no", "equiv", "safe", "same_kind", "unsafe"]
    order: Literal["K", "A", "C", "F"]
    subok: bool


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
        Number of threads for large arrays; all cores unless told (see ``DEADTIME_NUM_THREADS``).
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
        number = _deadtime.lambertw_number(z, k)
        if number is not None:
            return number
    return _apply(_deadtime.lambertw, (z, _branches(k)), options, out, where, dtype, threads)


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
    >>> import deadtime as dtm
    >>> print(dtm.lambertw0(1.0))
    0.5671432904097838
    >>> dtm.lambertw0([-0.2, 0.0, np.e]).round(6)
    array([-0.259171,  0.      ,  1.      ])
    """
    if out is None and threads is None and where is True and dtype is None and not options:
        number = _deadtime.lambertw0_number(x)
        if number is not None:
            return number
    return _apply(_deadtime.lambertw0, (x,), options, out, where, dtype, threads)


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
        number = _deadtime.lambertwm1_number(x)
        if number is not None:
            return number
    return _apply(_deadtime.lambertwm1, (x,), options, out, where, dtype, threads)


def dde_roots(
    a0: ArrayLike,
    a1: ArrayLike,
    delay: ArrayLike,
    k: ArrayLike = 0,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Characteristic roots of the scalar equation with one delay.

    The roots of :math:`s = a_0 + a_1 e^{-s T}`, which belong to
    :math:`x'(t) = a_0\,x(t) + a_1\,x(t - T)`, are

    .. math:: s_k = \frac{1}{T} W_k(T a_1 e^{-a_0 T}) + a_0, \qquad k \in \mathbb{Z}.

    Parameters
    ----------
    a0, a1 : array_like of float
        Coefficients of the present and the delayed state, 1/s.
    delay : array_like of float
        Delay T in s, not negative.
    k : array_like of int, optional
        Which root; all four arguments broadcast. ``k=0`` is rightmost. The roots k and -k are
        conjugate when ``a1 > 0``, k and -1-k when ``a1 < 0`` (unless both are real).
    out, where, threads, **options
        As for `lambertw`; arguments are not looked at where `where` is false.

    Returns
    -------
    ndarray or scalar of complex128
        The roots in 1/s. With ``delay=0`` or ``a1=0`` one root is left, ``a0 + a1``; the others
        have real part ``-inf``. NaN where ``a0*delay`` or ``a1*delay`` exceeds 1e300.

    Raises
    ------
    TypeError
        An argument is not real, or `k` is not of integers.
    ValueError
        A coefficient or delay is not finite, a delay is negative, or shapes do not broadcast.

    Notes
    -----
    The formula overflows for large :math:`|a_0 T|` and loses digits where its terms cancel. Here
    W only gives the start; the last steps are taken on s itself, so that every root comes to
    nearly full precision. Where two roots meet, they are as sensitive to rounding of the
    arguments as any computed value can be.

    References
    ----------
    Armah & Yi, eq. (3), after F. M. Asl, A. G. Ulsoy, "Analysis of a system of linear delay
    differential equations", J. Dyn. Syst. Meas. Control 125 (2003) 215-223, and S. Yi,
    P. W. Nelson, A. G. Ulsoy, "Time-Delay Systems: Analysis and Control Using the Lambert W
    Function", World Scientific 2010.

    Examples
    --------
    Proportional control of an integrator, gain 2/s, delay 0.36 s:

    >>> import deadtime as dtm
    >>> dtm.dde_roots(0.0, -2.0, 0.36, [0, -1, 1, -2]).round(4)
    array([-1.5154 +3.1005j, -1.5154 -3.1005j, -6.6601+20.9621j,
           -6.6601-20.9621j])
    """
    if out is None and threads is None and where is True and not options:
        number = _deadtime.dde_root_number(a0, a1, delay, k)
        if number is not None:
            return number
    own, delayed = _finite("a0", a0, where), _finite("a1", a1, where)
    lag = _finite("delay", delay, where)
    if not _foreign(lag):
        _refuse(lag, lag < 0, where, "delay must not be negative")
    arguments = (own, delayed, lag, _branches(k))
    return _apply(_deadtime.dde_roots, arguments, options, out, where, None, threads)


def _apply(
    ufunc: np.ufunc,
    arguments: tuple[Any, ...],
    options: UfuncOptions,
    out: NDArray[Any] | tuple[NDArray[Any]] | None,
    where: ArrayLike,
    dtype: DTypeLike | None,
    threads: int | None,
) -> Any:
    """Call `ufunc`; where it refuses the arguments, say which and why."""
    keywords: dict[str, Any] = cast("dict[str, Any]", options)
    if out is not None:
        keywords["out"] = out
    if where is not True:
        keywords["where"] = where
    if dtype is not None:
        keywords["dtype"] = dtype
    before = None if threads is None else _deadtime.limit_threads(thread_number(threads))
    try:
        return ufunc(*arguments, **keywords)
    except (TypeError, ValueError, OverflowError) as error:
        refused = error
    finally:
        if threads is not None:
            _deadtime.limit_threads(before)
    _explain(ufunc, arguments)
    raise refused


# The names of the arguments in messages, and the widest type that each may have.
_COMPLEX, _FLOAT, _BRANCH = np.complex128, np.float64, np.int64
_ARGUMENTS: dict[np.ufunc, dict[str, type]] = {
    _deadtime.lambertw: {"z": _COMPLEX, "k": _BRANCH},
    _deadtime.lambertw0: {"x": _FLOAT},
    _deadtime.lambertwm1: {"x": _FLOAT},
    _deadtime.dde_roots: {"a0": _FLOAT, "a1": _FLOAT, "delay": _FLOAT, "k": _BRANCH},
}


def _explain(ufunc: np.ufunc, arguments: tuple[Any, ...]) -> None:
    """Raise what is wrong with the arguments, in their own names, unless it is something else."""
    if any(_foreign(values) for values in arguments):
        return
    shapes = {}
    for (name, widest), values in zip(_ARGUMENTS[ufunc].items(), arguments, strict=True):
        if widest is _BRANCH:
            shapes[name] = _integers(name, values).shape
        else:
            shapes[name] = _numbers(name, values, widest).shape
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(f"shapes do not broadcast: {listed}") from None


def _foreign(values: object) -> bool:
    """Whether the object has its own way with ufuncs, which is left to it."""
    way = getattr(type(values), "__array_ufunc__", None)
    return way is not None and way is not np.ndarray.__array_ufunc__


def _branches(k: ArrayLike) -> Any:
    """Branches as NumPy takes them without a wrong cast: it would wrap the largest uint64."""
    if type(k) is int or getattr(k, "dtype", None) is _INT64 or _foreign(k):
        return k
    return _integers("k", k)


_INT64 = np.dtype(np.int64)


def _numbers(name: str, values: ArrayLike, widest: type) -> NDArray[Any]:
    array = np.asanyarray(values)
    if not np.can_cast(array.dtype, widest, "safe"):
        kind = "real" if widest is np.float64 else "real or complex"
        raise TypeError(
            f"{name} has dtype {array.dtype}: give {kind} numbers of at most double precision"
        )
    return array


def _finite(name: str, values: ArrayLike, where: ArrayLike) -> Any:
    if _foreign(values):
        return values
    array = _numbers(name, values, np.float64)
    _refuse(array, ~np.isfinite(array), where, f"{name} must be finite")
    return array


def _integers(name: str, values: ArrayLike) -> NDArray[np.int64]:
    array = np.asanyarray(values)
    if array.dtype.kind not in "iu":
        example = next(iter(array.ravel()[:1].tolist()), None)
        if array.dtype == object and array.size and all(type(i) is int for i in array.flat):
            raise ValueError(f"{name}={_largest(array)} does not fit a 64-bit integer")
        raise TypeError(
            f"{name}={example!r} (dtype {array.dtype}) is not an integer: branches are "
            "numbered by integers such as 0 and -1"
        )
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise ValueError(f"{name}={_largest(array)} does not fit a 64-bit integer")
    return array.astype(np.int64, copy=False)


def _largest(array: NDArray[Any]) -> int:
    return max((int(i) for i in array.flat), key=abs)


def _refuse(values: NDArray[Any], bad: NDArray[np.bool_], where: ArrayLike, reason: str) -> None:
    if where is not True:
        bad, values = np.broadcast_arrays(np.logical_and(bad, where), values)
    if bad.any():
        raise ValueError(f"{reason}, got {values[bad].flat[0]}")
