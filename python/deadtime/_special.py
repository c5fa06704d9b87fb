"""The Lambert W function and the characteristic roots it gives in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime import _deadtime
from deadtime._validation import thread_number

__all__ = ["dde_roots", "lambertw"]


def lambertw(z: ArrayLike, k: ArrayLike = 0, *, threads: int | None = None) -> Any:
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
    threads : int, optional
        Number of threads for large arrays; all cores unless told (see ``DEADTIME_NUM_THREADS``).
        The result does not depend on it.

    Returns
    -------
    ndarray or scalar of complex128
        W with the common shape of `z` and `k`; complex64 when `z` is complex64.

    Raises
    ------
    TypeError
        `z` is not numeric (or has more precision than complex128), or `k` is not of integers.
    ValueError
        The shapes do not broadcast, or `k` exceeds 64 bits.

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
    """
    points = _numbers("z", z, np.complex128)
    branches = _integers("k", k)
    narrow = points.dtype == np.complex64
    shape = _common_shape(z=points, k=branches)
    w = _deadtime.lambertw(
        _native(_spread(points, shape), np.complex128),
        branches if branches.size == 1 else _spread(branches, shape),
        thread_number(threads),
    )
    return (w.astype(np.complex64) if narrow else w)[()]


def dde_roots(
    a0: ArrayLike,
    a1: ArrayLike,
    delay: ArrayLike,
    k: ArrayLike = 0,
    *,
    threads: int | None = None,
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
    threads : int, optional
        Number of threads for large arrays; the result does not depend on it.

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
    own, delayed = _numbers("a0", a0, np.float64), _numbers("a1", a1, np.float64)
    lag = _numbers("delay", delay, np.float64)
    branches = _integers("k", k)
    for name, values in (("a0", own), ("a1", delayed), ("delay", lag)):
        _refuse(values, ~np.isfinite(values), f"{name} must be finite")
    _refuse(lag, lag < 0, "delay must not be negative")
    shape = _common_shape(a0=own, a1=delayed, delay=lag, k=branches)
    s = _deadtime.dde_roots(
        _one_or_all(own, shape),
        _one_or_all(delayed, shape),
        _one_or_all(lag, shape),
        _spread(branches, shape),
        thread_number(threads),
    )
    return s[()]


def _one_or_all(values: NDArray[Any], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Broadcast, except a single value, which the native code repeats."""
    return _native(values if values.size == 1 else _spread(values, shape), np.float64)


def _spread(values: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    return values if values.shape == shape else np.broadcast_to(values, shape)


def _native(values: NDArray[Any], dtype: type) -> NDArray[Any]:
    """Values as the native code reads them: aligned, machine byte order, `dtype`."""
    if values.dtype == dtype and values.flags.aligned:
        return values
    return np.require(values, dtype, "A")


def _numbers(name: str, values: ArrayLike, dtype: type) -> NDArray[Any]:
    array = np.asarray(values)
    if not np.can_cast(array.dtype, dtype, "safe"):
        kind = "real" if dtype is np.float64 else "real or complex"
        raise TypeError(
            f"{name} has dtype {array.dtype}: give {kind} numbers of at most double precision"
        )
    return array


def _integers(name: str, values: ArrayLike) -> NDArray[np.int64]:
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        example = next(iter(array.flat), None)
        if array.dtype == object and array.size and all(type(i) is int for i in array.flat):
            raise ValueError(f"{name}={_largest(array)} does not fit a 64-bit integer")
        raise TypeError(
            f"{name}={example!r} (dtype {array.dtype}) is not an integer: branches are "
            "numbered by integers such as 0 and -1"
        )
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise ValueError(f"{name}={_largest(array)} does not fit a 64-bit integer")
    return _native(array, np.int64)


def _largest(array: NDArray[Any]) -> int:
    return max((int(i) for i in array.flat), key=abs)


def _common_shape(**arrays: NDArray[Any]) -> tuple[int, ...]:
    present = [array.shape for array in arrays.values()]
    if present.count(present[0]) == len(present):
        return present[0]
    try:
        return np.broadcast_shapes(*present)
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"shapes do not broadcast: {shapes}") from None


def _refuse(values: NDArray[Any], bad: NDArray[np.bool_], reason: str) -> None:
    if bad.any():
        raise ValueError(f"{reason}, got {values[bad].flat[0]}")
