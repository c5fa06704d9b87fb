"""Transfer functions of python-control and scipy.signal: reading, and writing with Padé.

Neither package supports delays in continuous time. For reading, a delay is a separate argument; for
writing, delays are refused, or on request replaced by the diagonal Padé approximant

    e^(-s T) = p(-s T) / p(s T),   p(x) = sum_k c_k x^k,
    c_k = (2n - k)! n! / ((2n)! k! (n - k)!),

which is all-pass, and whose phase is wrong from about omega T = 2n on.
"""

from __future__ import annotations

import importlib
from math import factorial
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import whole_number
from deadtime.roots import QuasiPolynomial, expanded

# Upper limit on the order of a Padé approximant: the coefficients of higher ones differ so much in
# size that polynomials in double precision lose their digits.
_HIGHEST_ORDER = 20


def control_package() -> Any:
    """Return the module of python-control, or say how to install it."""
    try:
        return importlib.import_module("control")
    except ImportError as error:
        raise ImportError(
            "this function needs python-control, which is not installed. This command "
            "installs it: pip install control"
        ) from error


def polynomials_of(system: object) -> tuple[Array, Array] | None:
    """Numerator and denominator of a system of python-control or scipy.signal; None for others."""
    package = type(system).__module__
    if package.startswith("control."):
        return _of_control(system)
    if package.startswith("scipy.signal"):
        return _of_scipy(system)
    return None


def _of_control(system: Any) -> tuple[Array, Array]:
    """Numerator and denominator, descending, of a continuous system with one input and output."""
    control = control_package()
    if not isinstance(system, (control.TransferFunction, control.StateSpace)):
        raise TypeError(
            f"system is of type {type(system).__name__}: give a TransferFunction or StateSpace of "
            "python-control"
        )
    if system.dt not in (None, 0):
        raise _is_sampled(system)
    if (system.ninputs, system.noutputs) != (1, 1):
        raise ValueError(
            f"the system has {system.ninputs} inputs and {system.noutputs} outputs: choose one "
            "input and one output, for example by system[0, 0]"
        )
    if isinstance(system, control.StateSpace):
        return _of_state_space(system.A, system.B, system.C, system.D)
    return _numbers(system.num[0][0]), _numbers(system.den[0][0])


def _of_scipy(system: Any) -> tuple[Array, Array]:
    """Numerator and denominator, descending, of an `lti`."""
    from scipy import signal

    if isinstance(system, signal.dlti):
        raise _is_sampled(system)
    if not isinstance(system, signal.lti):
        raise TypeError(f"the system has {type(system).__name__} outputs: choose one output first")
    if isinstance(system, signal.StateSpace):
        if system.D.shape != (1, 1):
            raise ValueError(
                f"the system has {system.D.shape[1]} inputs and {system.D.shape[0]} outputs: "
                "choose one input and one output first"
            )
        return _of_state_space(system.A, system.B, system.C, system.D)
    transfer = system.to_tf()
    if np.ndim(transfer.num) > 1 and len(transfer.num) > 1:
        raise ValueError(f"the system has {len(transfer.num)} outputs: choose one output first")
    return _numbers(np.ravel(transfer.num)), _numbers(transfer.den)


def _is_sampled(system: Any) -> ValueError:
    return ValueError(
        f"the system has the time step dt={system.dt}, but only continuous systems can be "
        "converted. For a sampled loop, use ControlLoop with sample_time"
    )


def _of_state_space(A: Any, B: Any, C: Any, D: Any) -> tuple[Array, Array]:
    """Expand both determinants exactly, because rounding could leave a wrong degree."""
    a, b, c, d = (_numbers(matrix) for matrix in (A, B, C, D))
    n = len(a)
    entries = [[{(0, 0.0): -float(v)} if v else {} for v in row] for row in a]
    for i in range(n):
        entries[i][i] = {(1, 0.0): 1.0, **entries[i][i]}
    den = expanded(entries) if n else QuasiPolynomial([[1.0]], [0.0])
    bordered = [[*row, {(0, 0.0): float(b[i, 0])}] for i, row in enumerate(entries)]
    bordered.append([*({(0, 0.0): -float(v)} for v in c[0]), {(0, 0.0): float(d[0, 0])}])
    num = expanded(bordered, bordered=True)
    return num.coefficients[0, ::-1].copy(), den.coefficients[0, ::-1].copy()


def _numbers(coefficients: Any) -> Array:
    array = np.asarray(coefficients)
    if np.iscomplexobj(array):
        raise TypeError("the coefficients are complex: give real coefficients")
    return array.astype(np.float64)


def rational(num: QuasiPolynomial, den: QuasiPolynomial, order: int | None) -> tuple[Array, Array]:
    """Descending coefficients of num/den, its delays replaced by Padé approximants of `order`."""
    delays = sorted({float(t) for h in (num, den) for t in h.delays} - {0.0})
    if not delays:
        return num.coefficients[0, ::-1].copy(), den.coefficients[0, ::-1].copy()
    if order is None:
        raise ValueError(
            f"the system has a delay of {delays[-1]:g} s, and a rational transfer function can "
            "only approximate a delay. Give pade=n for Padé approximants of order n. Their phase "
            f"is wrong above about n times {2.0 / delays[-1]:.3g} rad/s"
        )
    n = whole_number(
        "pade", order, limit=_HIGHEST_ORDER + 1, otherwise=", as polynomials in double precision"
    )
    size = np.array(
        [
            factorial(2 * n - k)
            * factorial(n)
            / (factorial(2 * n) * factorial(k) * factorial(n - k))
            for k in range(n, -1, -1)
        ]
    )
    powers = np.arange(n, -1, -1)
    below = {t: size * t**powers for t in delays}
    above = {t: size * (-t) ** powers for t in delays}

    def without_delays(h: QuasiPolynomial) -> Array:
        """Multiply h by the denominators of all approximants."""
        total = np.zeros(1)
        for row, tau in zip(h.coefficients, h.delays, strict=True):
            term = row[::-1]
            for t in delays:
                term = np.convolve(term, above[t] if t == tau else below[t])
            total = np.polyadd(total, term)
        return total

    return without_delays(num), without_delays(den)


class Writable:
    """Base of `TransferFunction`: conversion to classes of other packages."""

    __slots__ = ()

    _num: QuasiPolynomial
    _den: QuasiPolynomial

    def to_control(self, pade: int | None = None) -> Any:
        """Convert to a transfer function of python-control, which supports no delays.

        Parameters
        ----------
        pade : int, optional
            Replace every delay by a Padé approximant of this order; by default a system with
            delays is refused.

        Returns
        -------
        control.TransferFunction

        Raises
        ------
        ImportError
            If python-control is not installed.
        ValueError
            If there are delays and `pade` is None or out of its range.
        """
        package = control_package()
        return package.TransferFunction(*rational(self._num, self._den, pade))

    def to_scipy(self, pade: int | None = None) -> Any:
        """Convert to a transfer function of scipy.signal, which supports no delays.

        Parameters
        ----------
        pade : int, optional
            As in `to_control`.

        Returns
        -------
        scipy.signal.TransferFunction

        Raises
        ------
        ValueError
            As in `to_control`.
        """
        from scipy import signal

        return signal.TransferFunction(*rational(self._num, self._den, pade))
