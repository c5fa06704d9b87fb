"""Lambert W by other arguments: its logarithm, its distance from -1/e; and the derivative."""

from __future__ import annotations

from typing import Any, NamedTuple, Unpack

from numpy.typing import ArrayLike, DTypeLike, NDArray

import deadtime.special._native as native
from deadtime.special._ufunc import UfuncOptions, apply, branches


def lambertw_log(
    log_z: ArrayLike,
    k: ArrayLike = 0,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Lambert W function of an argument given by its logarithm.

    The solution of :math:`w + \log w = \log z + 2 \pi i k`: :math:`W_k(z)` where z itself
    would overflow, underflow or lose its digits.

    Parameters
    ----------
    log_z : array_like of numbers
        Logarithm of z. An imaginary part beyond :math:`\pm\pi` continues the branch analytically
        (it adds turns to `k`).
    k : array_like of int, optional
        Branch, any 64-bit integer.
    out, where, dtype, threads, **options
        As for `lambertw`.

    Returns
    -------
    ndarray or scalar of complex128
        W with the common shape of `log_z` and `k`; complex64 when `log_z` is complex64. NaN where
        the imaginary part of `log_z` is not finite, which leaves the branch open.

    Raises
    ------
    TypeError
        `log_z` is not numeric, or `k` is not of integers.
    ValueError
        The shapes do not broadcast, `k` exceeds 64 bits, or `out` does not fit.

    See Also
    --------
    wrightomega : the same for ``k = 0``.

    Notes
    -----
    The relative error is that of `lambertw`. Where the result is too small for a double
    (``k = 0`` and a real part of `log_z` below -745), it is zero.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> w = dtm.special.lambertw_log(1e6)  # W_0(e^1000000)
    >>> print((w + np.log(w)).real)
    1000000.0
    >>> print(dtm.special.lambertw_log(0.0, -3) == dtm.lambertw(1.0, -3))
    True
    """
    arguments = (log_z, branches(k))
    return apply(native.lambertw_log, arguments, options, out, where, dtype, threads)


def wrightomega(
    z: ArrayLike,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Wright omega function.

    The solution of :math:`\omega + \log \omega = z`, which is :math:`W_K(e^z)` with
    :math:`K = \lceil (\mathrm{Im}\,z - \pi)/(2 \pi) \rceil`.

    Parameters
    ----------
    z : array_like of numbers
        Where to evaluate.
    out, where, dtype, threads, **options
        As for `lambertw`, also with real types.

    Returns
    -------
    ndarray or scalar of float64 or complex128
        Real for real `z`; in single precision when `z` is.

    Raises
    ------
    TypeError
        `z` is not numeric.

    Notes
    -----
    The function jumps across the half lines :math:`z = x \pm i\pi`, :math:`x \le -1`. No double
    lies on them, since :math:`\pi` is none: the double next to it is just inside.

    References
    ----------
    R. M. Corless, D. J. Jeffrey, "The Wright omega function", Artificial Intelligence, Automated
    Reasoning, and Symbolic Computation, LNCS 2385 (2002) 76-89.

    Examples
    --------
    >>> import deadtime as dtm
    >>> print(dtm.wrightomega(0.0))
    0.5671432904097838
    >>> dtm.wrightomega([1.0, 1e10]).round(6)
    array([1.00000000e+00, 9.99999998e+09])
    """
    return apply(native.wrightomega, (z,), options, out, where, dtype, threads)


def lambertw_derivative(
    z: ArrayLike,
    k: ArrayLike = 0,
    out: NDArray[Any] | tuple[NDArray[Any]] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> Any:
    r"""Derivative of the Lambert W function.

    :math:`W_k'(z) = \frac{W_k(z)}{z\,(1 + W_k(z))}`, with a :math:`1 + W` that keeps its digits
    next to the branch point, where the derivative grows without bound.

    Parameters
    ----------
    z : array_like of numbers
        Where to evaluate.
    k : array_like of int, optional
        Branch, any 64-bit integer.
    out, where, dtype, threads, **options
        As for `lambertw`.

    Returns
    -------
    ndarray or scalar of complex128
        The derivative; complex64 when `z` is complex64. At 0 it is 1 for branch 0 and infinite
        for the others.

    Raises
    ------
    TypeError
        `z` is not numeric, or `k` is not of integers.
    ValueError
        The shapes do not broadcast, `k` exceeds 64 bits, or `out` does not fit.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> print(dtm.special.lambertw_derivative(0.0))
    (1+0j)
    >>> w = dtm.lambertw(3.0, 2)
    >>> bool(np.isclose(dtm.special.lambertw_derivative(3.0, 2), w / (3.0 * (1 + w))))
    True
    """
    arguments = (z, branches(k))
    return apply(native.lambertw_derivative, arguments, options, out, where, dtype, threads)


class OffsetW(NamedTuple):
    """What `lambertw_offset` returns: W, and 1 + W to its own relative accuracy."""

    w: Any
    one_plus_w: Any


def lambertw_offset(
    delta: ArrayLike,
    k: ArrayLike = 0,
    out: tuple[NDArray[Any] | None, NDArray[Any] | None] | None = None,
    *,
    where: ArrayLike = True,
    dtype: DTypeLike | None = None,
    threads: int | None = None,
    **options: Unpack[UfuncOptions],
) -> OffsetW:
    r"""Lambert W function of an argument given by its distance from the branch point.

    :math:`w = W_k(-1/e + \delta)`, and :math:`1 + w`, which vanishes with :math:`\delta` on the
    branches that meet there. A double root of a delay equation is such a point: the argument
    itself, rounded to a double, would not know how far from -1/e it is.

    Parameters
    ----------
    delta : array_like of numbers
        Distance from -1/e.
    k : array_like of int, optional
        Branch, any 64-bit integer.
    out : tuple of two ndarrays or None, optional
        Where to put w and 1 + w.
    where, dtype, threads, **options
        As for `lambertw`.

    Returns
    -------
    OffsetW
        Named tuple of two arrays or scalars of complex128 (complex64 when `delta` is): ``w`` and
        ``one_plus_w``.

    Raises
    ------
    TypeError
        `delta` is not numeric, or `k` is not of integers.
    ValueError
        The shapes do not broadcast, `k` exceeds 64 bits, or `out` does not fit.

    Notes
    -----
    With :math:`p = \sqrt{2 e \delta}`, :math:`1 + W = \pm p - p^2/3 \pm \dots` (Corless et al.
    1996, eq. 4.22).

    Examples
    --------
    >>> import deadtime as dtm
    >>> w, one_plus_w = dtm.special.lambertw_offset(1e-20)
    >>> print(w)
    (-0.9999999997668356+0j)
    >>> print(one_plus_w)
    (2.3316439814159054e-10+0j)
    """
    arguments = (delta, branches(k))
    both = apply(native.lambertw_offset, arguments, options, out, where, dtype, threads)
    return OffsetW(*both)
