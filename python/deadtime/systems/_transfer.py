"""Transfer functions with delays: ratios of two quasi-polynomials, nothing approximated."""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import Immutable
from deadtime._base.validation import OpenRange, non_negative, unmasked
from deadtime.roots import (
    NoExponential,
    Parameter,
    ParametricQuasiPolynomial,
    QuasiPolynomial,
    Ratio,
    RootSet,
    delay,
    is_number,
    latex,
    s,
)
from deadtime.systems._frequency_domain import FrequencyDomain
from deadtime.systems._interchange import Writable, polynomials_of
from deadtime.systems._native import ratio
from deadtime.systems._parts import (
    Polynomial,
    quasi_polynomial,
    without_common_delay,
    without_common_factor,
    without_common_powers,
)
from deadtime.systems._poles import Determinant, HasPoles, T
from deadtime.systems._realisation import Realisable, Realisation, of_ratio
from deadtime.systems._responses import HasResponses

if TYPE_CHECKING:
    pass


class TransferFunction(NoExponential, Immutable, FrequencyDomain, HasPoles, HasResponses, Writable):
    """A transfer function num(s)/den(s) of two quasi-polynomials.

    Usually made by dividing: ``2.0 / s * delay(0.36)``. Immutable. A delay common to numerator
    and denominator is cancelled; common roots stay in both, with one exception: a sum takes equal
    denominators, and equal powers of s in them, once. Common roots are no poles, because the
    ratio is finite there, and `hidden_modes` lists them.

    Parameters
    ----------
    num, den : QuasiPolynomial, float or sequence of float
        A sequence holds the coefficients of a polynomial in descending powers of s. Alone, `num`
        may be a continuous system of python-control or scipy.signal with one input and output.
    delay : float, default 0
        A delay in series, in s, zero or more.

    Raises
    ------
    ZeroDivisionError
        If `den` is zero.
    ValueError
        If a coefficient is not finite, a sequence is empty, or the delay is negative.
    TypeError
        If the coefficients are not real numbers.

    See Also
    --------
    feedback : Close a loop.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime import delay, s
    >>> G = 2.0 / s * delay(0.36)
    >>> G
    2 exp(-0.36 s) / s
    >>> G == dtm.TransferFunction([2.0], [1.0, 0.0], delay=0.36)
    True
    >>> dtm.feedback(G)
    2 exp(-0.36 s) / (s + 2 exp(-0.36 s))
    >>> dtm.feedback(G).is_stable()
    True
    """

    __slots__ = ("_den", "_num")

    _num: QuasiPolynomial
    _den: QuasiPolynomial

    def __init__(self, num: Polynomial, den: Polynomial = 1.0, *, delay: float = 0.0) -> None:
        if isinstance(den, float) and (given := polynomials_of(num)) is not None:
            num, below = given
            den = below if den == 1.0 else den * below
        n, d = quasi_polynomial("num", num), quasi_polynomial("den", den)
        if not d.coefficients.any():
            raise ZeroDivisionError("den is zero: give a denominator that is not zero")
        dead = non_negative("delay", delay)
        if dead:
            n = n * QuasiPolynomial([[1.0]], [dead])
        n, d = without_common_delay(n, d)
        object.__setattr__(self, "_num", n)
        object.__setattr__(self, "_den", d)

    def __reduce__(self) -> tuple[Any, ...]:
        return (TransferFunction, (self._num, self._den))

    # What it is

    @property
    def num(self) -> QuasiPolynomial:
        """Numerator."""
        return self._num

    @property
    def den(self) -> QuasiPolynomial:
        """Denominator."""
        return self._den

    @property
    def is_proper(self) -> bool:
        """Whether the numerator has no higher power of s than the denominator."""
        return self._num.degree <= self._den.degree

    @property
    def is_causal(self) -> bool:
        """Whether the output never comes before its input.

        So the numerator has no smaller delay than the denominator, and the denominator is not
        'advanced'.
        """
        ahead = self._num.delays[0] < self._den.delays[0] and bool(self._num.coefficients.any())
        return not ahead and self._den.kind != "advanced"

    def __eq__(self, other: object) -> bool:
        """Whether numerator and denominator are the same; G and 2G/2 need not be."""
        if not isinstance(other, TransferFunction):
            return NotImplemented
        return self._num == other._num and self._den == other._den

    def __hash__(self) -> int:
        return hash((self._num, self._den))

    def __repr__(self) -> str:
        num, den = repr(self._num), repr(self._den)
        above = f"({num})" if _is_sum(num) else num
        below = f"({den})" if _is_sum(den) or " " in den or "-" in den else den
        return f"{above} / {below}" if den != "1" else num

    def _repr_latex_(self) -> str:
        return rf"$\frac{{{latex(repr(self._num))}}}{{{latex(repr(self._den))}}}$"

    # Algebra

    def __pos__(self) -> TransferFunction:
        return self

    def __neg__(self) -> TransferFunction:
        return TransferFunction(-self._num, self._den)

    def __add__(self, other: object) -> TransferFunction:
        second = _operand(other)
        return NotImplemented if second is None else _sum(self, second)

    __radd__ = __add__

    def __sub__(self, other: object) -> TransferFunction:
        second = _operand(other)
        return NotImplemented if second is None else _sum(self, -second)

    def __rsub__(self, other: object) -> TransferFunction:
        first = _operand(other)
        return NotImplemented if first is None else _sum(first, -self)

    def __mul__(self, other: object) -> TransferFunction:
        second = _operand(other)
        if second is None:
            return NotImplemented
        return TransferFunction(self._num * second._num, self._den * second._den)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> TransferFunction:
        second = _operand(other)
        return NotImplemented if second is None else self * _inverse(second)

    def __rtruediv__(self, other: object) -> TransferFunction:
        first = _operand(other)
        return NotImplemented if first is None else first * _inverse(self)

    def __pow__(self, exponent: object) -> TransferFunction:
        try:
            power = operator.index(cast(int, exponent))
        except TypeError:
            return NotImplemented
        base = self if power >= 0 else _inverse(self)
        return TransferFunction(base._num ** abs(power), base._den ** abs(power))

    # Values

    @overload
    def __call__(self, s: complex) -> complex: ...
    @overload
    def __call__(self, s: NDArray[Any] | Sequence[Any]) -> NDArray[np.complex128]: ...
    def __call__(self, s: Any) -> Any:
        """Value at `s` (1/s): a complex number, or an array of the shape of `s`.

        Finite also where numerator and denominator leave the range of doubles and their ratio
        does not. Infinite where only the denominator is zero, NaN where both are.
        """
        points = np.asarray(unmasked("s", s))
        if points.dtype.kind not in "biufc":
            raise TypeError(f"s has the dtype {points.dtype}: give complex or real numbers")
        flat = points.astype(np.complex128).ravel()
        values = ratio(self._num._native, self._den._native, flat)
        return values.reshape(points.shape) if points.ndim else complex(values[0])

    # Poles and zeros

    def zeros(self, re: OpenRange | None = None, im: OpenRange | None = None) -> RootSet:
        """Locate every root of the numerator in a region, as `poles` does for the denominator.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `poles`.

        Returns
        -------
        RootSet

        Raises
        ------
        ContourError, CountMismatchError, ValueError
            As in `poles`; ValueError also for the zero transfer function.

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.TransferFunction([1.0, 3.0], [1.0, 2.0, 5.0]).zeros().roots
        array([-3.+0.j])
        """
        return self._num.roots(re, im)

    def hidden_modes(
        self, re: OpenRange | None = None, im: OpenRange | None = None
    ) -> NDArray[np.complex128]:
        """List the roots of the denominator that are no poles, as the numerator is zero there too.

        They do not show between input and output. Whether they are modes of what is built, the
        ratio does not say: an integral over a finite time, as (1 - exp(-s))/s, has none. Two
        blocks in series, of which one cancels a pole of the other, have one; an unstable one makes
        them useless.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `poles`, edges included. By default everywhere; where the denominator has delays,
            the right half plane.

        Returns
        -------
        ndarray of complex, shape (n,)
            Each as often as it is a common root.

        Raises
        ------
        ContourError, CountMismatchError, ValueError
            As in `poles`.

        Notes
        -----
        A root counts as common where the numerator is zero to the rounding of coefficients and
        delays: relative changes of four units in the last place make it zero.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> G = (s - 1.0) / (s + 2.0) * (3.0 / (s - 1.0))
        >>> G.hidden_modes()
        array([1.+0.j])
        >>> L = 3.0 / (s - 1.0) * delay(0.1)
        >>> T = L / (1 + L)
        >>> T.is_stable(), T.hidden_modes()
        (True, array([1.+0.j]))
        """
        if re is None and im is None and self._den.kind != "polynomial":
            re = (0.0, None)
        return self.poles(re, im, edge="inside").hidden

    def minreal(self) -> TransferFunction:
        """Cancel what cancels exactly: the greatest polynomial that divides all coefficients.

        A common factor whose coefficients or quotients were rounded stays, and so do common roots
        that are no roots of a common polynomial; they are no poles, and `hidden_modes` lists them.

        Returns
        -------
        TransferFunction

        Examples
        --------
        >>> from deadtime import s
        >>> (s / (s * (s + 1.0))).minreal()
        1 / (1 + s)
        >>> ((s - 1.0) * (s + 2.0) / ((s - 1.0) * (s + 3.0))).minreal()
        (2 + s) / (3 + s)
        """
        if not self._num.coefficients.any():
            return TransferFunction(0.0)
        return TransferFunction(*without_common_factor(self._num, self._den))

    def _ask(self, question: Callable[[Determinant], T]) -> T:
        return question(Ratio(self._num, self._den))

    def _exactly(self) -> QuasiPolynomial:
        return self._den

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial:
        """Characteristic function of the loop closed around this one."""
        unknown = [name for name in names if name not in ("gain", "delay")]
        if unknown:
            raise ValueError(
                f"{unknown[0]} is not a parameter of a loop gain. Its parameters are 'gain', a "
                "factor, and 'delay', a further delay"
            )
        gain: Any = Parameter("gain") if "gain" in names else 1.0
        late: Any = delay(Parameter("delay")) if "delay" in names else 1.0
        found: ParametricQuasiPolynomial = self._den + gain * self._num * late
        return found

    # In time

    def _realised(self) -> Realisation:
        num, den = self.num, self.den
        if not self.is_proper:
            raise ValueError(
                f"the numerator has degree {num.degree}, and the denominator only {den.degree}. "
                "Such an improper transfer function differentiates its input, so it has no "
                "step response"
            )
        if not self.is_causal:
            raise ValueError(
                f"{self!r} is not causal, because its output would depend on later inputs (or "
                "its equation is advanced)"
            )
        return of_ratio(*without_common_factor(num, den))

    def _differentiated(self) -> Realisable:
        if self._num.degree >= self._den.degree and self._num.coefficients.any():
            raise ValueError(
                f"the numerator has degree {self._num.degree} and the denominator "
                f"{self._den.degree}, so the impulse response contains an impulse. Subtract the "
                "direct feedthrough first"
            )
        return self * s

    def _gains_at_rest(self) -> NDArray[np.float64]:
        return np.array([[self.dcgain()]])

    def sensitivity(self) -> TransferFunction:
        """Sensitivity S = 1/(1 + G) of the loop closed around this one.

        Returns
        -------
        TransferFunction
            From a disturbance of the output to the output; 1 - S is ``feedback(G)``.

        Raises
        ------
        ValueError
            If G is -1 everywhere.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (2.0 / s * delay(0.36)).sensitivity()
        s / (s + 2 exp(-0.36 s))
        """
        return feedback(1.0, self)

    # Other packages


def feedback(G: Any, H: Any = 1.0, sign: int = -1) -> TransferFunction:
    """Close a loop: G / (1 - sign G H), with G forward and H back.

    The denominator is the characteristic function of the closed loop: with G = n/d and H = p/q
    the result is n q / (d q - sign n p), in which neither denominator appears twice.

    Parameters
    ----------
    G, H : TransferFunction, QuasiPolynomial, float or system
        Forward and return path; a system is one of python-control or scipy.signal.
    sign : {-1, 1}, default -1
        -1 for negative, 1 for positive feedback.

    Returns
    -------
    TransferFunction

    Raises
    ------
    ValueError
        If `sign` is neither, or the loop has no solution: G H is 1/sign everywhere.
    TypeError
        If `G` or `H` is no transfer function.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime import delay, s
    >>> T = dtm.feedback(2.0 / s * delay(0.36))
    >>> T.den.kind, T.dcgain()
    ('retarded', 1.0)
    >>> round(T.spectral_abscissa(), 6)
    -1.515362
    """
    forward, back = _operand(G), _operand(H)
    for name, block, given in (("G", forward, G), ("H", back, H)):
        if block is None:
            raise TypeError(f"{name}={given!r}: give a TransferFunction, for example 2.0 / s")
    if sign not in (-1, 1):
        raise ValueError(f"sign={sign!r}: give -1 for negative or 1 for positive feedback")
    n, d = cast(TransferFunction, forward)._num, cast(TransferFunction, forward)._den
    p, q = cast(TransferFunction, back)._num, cast(TransferFunction, back)._den
    closed = d * q - float(sign) * (n * p)
    if not closed.coefficients.any():
        raise ValueError(
            "1 minus sign times G times H is zero for every s, so the loop has no solution"
        )
    return TransferFunction(n * q, closed)


def _operand(value: object) -> TransferFunction | None:
    """Turn a number or a quasi-polynomial into a transfer function; None for foreign types."""
    if isinstance(value, TransferFunction):
        return value
    if isinstance(value, QuasiPolynomial) or is_number(value):
        return TransferFunction(cast(Any, value))
    found = polynomials_of(value)
    return None if found is None else TransferFunction(*found)


def _inverse(G: TransferFunction) -> TransferFunction:
    if not G._num.coefficients.any():
        raise ZeroDivisionError(
            "a transfer function cannot be divided by the zero transfer function"
        )
    return TransferFunction(G._den, G._num)


def _sum(first: TransferFunction, second: TransferFunction) -> TransferFunction:
    """Over the common denominator as far as it is seen exactly: all of it, or its powers of s."""
    if first._den == second._den:
        return TransferFunction(first._num + second._num, first._den)
    d, q = without_common_powers(first._den, second._den)
    return TransferFunction(first._num * q + second._num * d, first._den * q)


def _is_sum(text: str) -> bool:
    """Whether the text of a quasi-polynomial needs brackets before a division."""
    inner = text
    while "(" in inner:  # sums inside brackets do not count
        start, end = inner.index("("), inner.index(")")
        inner = inner[:start] + inner[end + 1 :]
    return " + " in inner or " - " in inner
