"""Characteristic roots of the scalar equation with one delay, in closed form by Lambert W."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

import deadtime.roots._native as native
from deadtime._base.validation import whole_number
from deadtime.special import UfuncOptions, apply, branches, finite, foreign, refuse


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
        As for `lambertw`; arguments are not checked where `where` is false.

    Returns
    -------
    ndarray or scalar of complex128
        The roots in 1/s. With ``delay=0`` or ``a1=0`` there is only one root, ``a0 + a1``; the
        others have real part ``-inf``. NaN where ``a0*delay`` or ``a1*delay`` exceeds 1e300.

    Raises
    ------
    TypeError
        An argument is not real, or `k` is not an array of integers.
    ValueError
        A coefficient or delay is not finite, a delay is negative, or shapes do not broadcast.

    Notes
    -----
    The formula overflows for large :math:`|a_0 T|` and loses digits where its terms cancel. Here W
    only gives the initial value of an iteration for s, so that every root has nearly full
    precision. Close to a double root the error is that caused by rounding of the arguments.

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
        number = native.dde_root_number(a0, a1, delay, k)
        if number is not None:
            return number
    present, delayed = finite("a0", a0, where), finite("a1", a1, where)
    delays = finite("delay", delay, where)
    if not foreign(delays):
        refuse(delays, delays < 0, where, "delay must not be negative")
    arguments = (present, delayed, delays, branches(k))
    return apply(native.dde_roots, arguments, options, out, where, None, threads)


def rightmost_branches(a1: float, n: int = 2) -> NDArray[np.int64]:
    r"""Which branches of Lambert W give the rightmost roots of the scalar equation.

    Parameters
    ----------
    a1 : float
        Coefficient of the delayed state in :math:`s = a_0 + a_1 e^{-s T}`, 1/s; only its sign
        counts.
    n : int, optional
        How many.

    Returns
    -------
    ndarray of int64, shape (n,)
        Branches `k` for `dde_roots` by descending real part; of a conjugate pair the upper one
        first.

    Raises
    ------
    ValueError
        `a1` is zero or not finite (there is one root only, or none), or `n` is not positive.

    Notes
    -----
    The real part of :math:`W_k(z)` falls with the distance of the branch from the principal one
    (Shinozaki & Mori, Automatica 42, 2006, lemma 3): k = 0 is rightmost. For :math:`a_1 > 0` the
    argument of W is positive, branch 0 is real and k and -k are conjugate; for :math:`a_1 < 0` it
    is negative, and the pairs are 0 and -1, 1 and -2, and so on.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.roots.rightmost_branches(-2.0, n=4)
    array([ 0, -1,  1, -2])
    >>> roots = dtm.dde_roots(0.0, -2.0, 0.36, dtm.roots.rightmost_branches(-2.0, n=4))
    >>> roots.real.round(4)
    array([-1.5154, -1.5154, -6.6601, -6.6601])
    """
    if not (np.isfinite(a1) and a1 != 0):
        raise ValueError(
            f"a1={a1}: without the delayed term, the equation has no branches to choose from"
        )
    k = np.arange(whole_number("n", n), dtype=np.int64)
    half = (k + 1) // 2
    return np.where((k % 2 == 1) == (a1 > 0), half, -half)
