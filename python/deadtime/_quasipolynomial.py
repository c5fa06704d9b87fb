"""Quasi-polynomials: characteristic functions of linear systems with delays.

One class, kept whole: most of the file is its documentation.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, TypeAlias, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime import _deadtime
from deadtime._certificate import Certificate
from deadtime._chains import Chain, chains_of
from deadtime._rootset import Range, RootSet, ends, root_set
from deadtime._sensitivity import Sensitivity

if TYPE_CHECKING:
    from deadtime._parametric import ParametricQuasiPolynomial
    from deadtime._transfer import TransferFunction

__all__ = ["QuasiPolynomial", "delay", "s"]

Kind: TypeAlias = Literal["polynomial", "retarded", "neutral", "difference", "advanced"]


class QuasiPolynomial:
    r"""A quasi-polynomial :math:`h(s) = \sum_j p_j(s)\, e^{-s\tau_j}` with real coefficients.

    Usually built by algebra with `deadtime.s`, `deadtime.delay` and numbers. Immutable; equal
    delays are merged, zero rows dropped and delays sorted.

    Parameters
    ----------
    coefficients : array_like of float, shape (m, d+1)
        Row j holds the ascending powers of s of the polynomial that belongs to ``delays[j]``.
    delays : array_like of float, shape (m,)
        Delays in s, finite and not negative.

    Raises
    ------
    ValueError
        If a number is not finite, a delay is negative, or the shapes do not fit.
    TypeError
        If the numbers are not real.

    Examples
    --------
    >>> from deadtime import delay, s
    >>> h = s + (2.0 + 0.3 * s) * delay(0.36)
    >>> h
    s + (2 + 0.3 s) exp(-0.36 s)
    >>> h.kind
    'neutral'
    >>> h(0.0)
    (2+0j)
    >>> round(h.spectral_abscissa(), 4)
    -3.3168
    """

    __slots__ = ("_coefficients", "_delays", "_native")

    # NumPy leaves `array * h` and `number * h` to this class.
    __array_ufunc__ = None

    # What a quotient is: set by the module of transfer functions, which builds on this one.
    _ratio: ClassVar[type[TransferFunction]]

    _native: _deadtime.QuasiPolynomial
    _coefficients: NDArray[np.float64]
    _delays: NDArray[np.float64]

    def __init__(self, coefficients: ArrayLike, delays: ArrayLike) -> None:
        rows = _real_array("coefficients", coefficients, 2)
        times = _real_array("delays", delays, 1)
        if len(rows) != len(times):
            raise ValueError(
                f"{len(rows)} rows of coefficients but {len(times)} delays: "
                "give one delay for every row"
            )
        self._adopt(_deadtime.QuasiPolynomial(rows, times))

    @classmethod
    def _wrap(cls, native: _deadtime.QuasiPolynomial) -> QuasiPolynomial:
        new = object.__new__(cls)
        new._adopt(native)
        return new

    def _adopt(self, native: _deadtime.QuasiPolynomial) -> None:
        put = object.__setattr__
        put(self, "_native", native)
        put(self, "_coefficients", _frozen(native.coefficients()))
        put(self, "_delays", _frozen(native.delays()))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a QuasiPolynomial does not change: cannot set {name!r}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a QuasiPolynomial does not change: cannot delete {name!r}")

    def __reduce__(self) -> tuple[Any, ...]:
        return (QuasiPolynomial, (self._coefficients, self._delays))

    # What it is

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Ascending coefficients, shape (m, d+1), row j belongs to ``delays[j]``; read-only."""
        return self._coefficients

    @property
    def delays(self) -> NDArray[np.float64]:
        """Delays in s, shape (m,), ascending; read-only."""
        return self._delays

    @property
    def degree(self) -> int:
        """Highest power of s."""
        return self._native.degree()

    @property
    def kind(self) -> Kind:
        """Kind of equation, told after the smallest delay is factored out.

        'polynomial' (one row), 'retarded' (the highest power of s without delay only), 'neutral'
        (also with delay), 'difference' (no power of s at all), or 'advanced' (the highest power
        with delay only: no causal system).
        """
        return cast(Kind, self._native.kind())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, QuasiPolynomial):
            return NotImplemented
        return np.array_equal(self._delays, other._delays) and np.array_equal(
            self._coefficients, other._coefficients
        )

    def __hash__(self) -> int:
        # Negative zeros equal positive ones but have other bytes.
        return hash(((self._coefficients + 0.0).tobytes(), self._delays.tobytes()))

    def __repr__(self) -> str:
        terms = [_term(row, tau) for row, tau in zip(self._coefficients, self._delays, strict=True)]
        return " + ".join(terms).replace("+ -", "- ")

    # Algebra

    def __pos__(self) -> QuasiPolynomial:
        return self

    def __neg__(self) -> QuasiPolynomial:
        return self._wrap(self._native.scale(-1.0))

    def __add__(self, other: object) -> QuasiPolynomial:
        second = _operand(other)
        if second is None:
            return NotImplemented
        return self._wrap(self._native.add(second._native))

    __radd__ = __add__

    def __sub__(self, other: object) -> QuasiPolynomial:
        second = _operand(other)
        if second is None:
            return NotImplemented
        return self._wrap(self._native.sub(second._native))

    def __rsub__(self, other: object) -> QuasiPolynomial:
        first = _operand(other)
        if first is None:
            return NotImplemented
        return self._wrap(first._native.sub(self._native))

    def __mul__(self, other: object) -> QuasiPolynomial:
        if isinstance(other, QuasiPolynomial):
            return self._wrap(self._native.mul(other._native))
        if is_number(other):
            return self._wrap(self._native.scale(float(cast(float, other))))
        return NotImplemented

    __rmul__ = __mul__

    @overload
    def __truediv__(self, other: float) -> QuasiPolynomial: ...
    @overload
    def __truediv__(self, other: QuasiPolynomial) -> TransferFunction: ...
    def __truediv__(self, other: object) -> QuasiPolynomial | TransferFunction:
        """By a number: a quasi-polynomial; by a quasi-polynomial: a `TransferFunction`."""
        if is_number(other):
            divisor = float(cast(float, other))
            if divisor == 0.0:
                raise ZeroDivisionError("division of a quasi-polynomial by zero")
            return self._wrap(_deadtime.QuasiPolynomial(self._coefficients / divisor, self._delays))
        if isinstance(other, QuasiPolynomial):
            return self._ratio(self, other)
        return NotImplemented

    def __rtruediv__(self, other: float) -> TransferFunction:
        first = _operand(other)
        if first is None:
            return NotImplemented
        return self._ratio(first, self)

    def __pow__(self, exponent: object) -> Any:
        """To a whole power; to a negative one it is a `TransferFunction`."""
        try:
            power = operator.index(cast(int, exponent))
        except TypeError:
            return NotImplemented
        if abs(power) >= 2**31:
            raise ValueError(f"exponent {power}: a power that high does not fit into memory")
        if power < 0:
            return 1.0 / self._wrap(self._native.pow(-power))
        return self._wrap(self._native.pow(power))

    # Values

    @overload
    def __call__(self, s: complex) -> complex: ...
    @overload
    def __call__(self, s: NDArray[Any] | Sequence[Any]) -> NDArray[np.complex128]: ...
    def __call__(self, s: Any) -> Any:
        """Value at `s` (1/s): a complex number, or an array of the shape of `s`.

        Where the value exceeds the range of double precision it is infinite.
        """
        points = np.asarray(s)
        if points.dtype.kind not in "biufc":
            raise TypeError(f"s of dtype {points.dtype}: give complex or real numbers")
        values = self._native.values(points.astype(np.complex128, copy=False))
        return values.reshape(points.shape) if points.ndim else complex(values[0])

    def derivative(self, n: int = 1) -> QuasiPolynomial:
        """Differentiate `n` times by s.

        Parameters
        ----------
        n : int, default 1
            Order, not negative.

        Returns
        -------
        QuasiPolynomial

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s**2 + s * delay(2.0)).derivative()
        2 s + (1 - 2 s) exp(-2 s)
        """
        order = operator.index(n)
        if not 0 <= order < 2**31:
            raise ValueError(f"n={n}: the order of a derivative is a whole number from 0 up")
        return self._wrap(self._native.derivative(order))

    # Roots

    def count(self, re: Range | None = None, im: Range | None = None) -> int:
        """Count the roots in a region, with multiplicity, and prove the number.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            Ranges of the real part (1/s) and of the imaginary part (rad/s); None is an open end.
            A root on the real axis belongs to a region that has the axis as its edge.

        Returns
        -------
        int

        Raises
        ------
        ContourError
            If a root lies on the edge, or closer to it than double precision can tell. The edge
            is never moved silently.
        ValueError
            If a range is not increasing, or the region holds infinitely many roots.

        Notes
        -----
        Argument principle: on every segment of the contour a bound on the second derivative and
        on the rounding error shows that the function keeps its half plane (Taylor's formula), so
        the change of its argument is the principal one. Exponentials, sines and angles are the
        package's own, with derived error bounds. `certify` gives the same number with its proof.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s + delay(1.0)).count(re=(-12, 2), im=(0, 1000))
        159
        >>> (s + 5.0 * delay(0.36)).count(re=(0, None))
        2
        """
        return self._native.count(ends("re", re), ends("im", im))

    def certify(self, re: Range | None = None, im: Range | None = None) -> Certificate:
        """Count the roots in a region and write the proof down.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`.

        Returns
        -------
        Certificate
            Its ``count`` is that of `count`; its ``verify()`` proves it again with exact numbers
            and none of the code that made it.

        Raises
        ------
        ContourError, ValueError
            As in `count`.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> proof = (s + delay(1.0)).certify(re=(-12, 2), im=(0, 100))
        >>> proof.count, proof.verify()
        (16, 16)
        """
        region = ends("re", re), ends("im", im)
        rows, delays = self._coefficients.tolist(), self._delays.tolist()
        return Certificate._made(rows, delays, region, self._native.certify(*region))

    def roots(self, re: Range | None = None, im: Range | None = None) -> RootSet:
        """Locate every root in a region, each with a disc proved to hold it.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`.

        Returns
        -------
        RootSet
            Its multiplicities add up to the number counted.

        Raises
        ------
        ContourError, ValueError
            As in `count`.
        CountMismatchError
            If double precision does not suffice to locate all roots that were counted.

        Notes
        -----
        The region is divided into cells with proved counts; Newton's iteration in each; a disc
        about every limit by Rouché's theorem, or by a winding number for clusters.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> ((s + delay(1.0)) ** 2).roots(re=(-1, 1), im=(0, 5)).multiplicities
        array([2])
        """
        return root_set(self._native.roots(ends("re", re), ends("im", im)))

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost roots and prove that nothing else lies that far right.

        Parameters
        ----------
        n : int, default 1
            How many, not counting those with a negative imaginary part, which are listed as well.

        Returns
        -------
        RootSet
            More than `n` if the real parts of the next ones cannot be told apart. Fewer if there
            are no more, or for a neutral equation no more clearly right of its chains of roots
            (see `chain_abscissa`). ``region`` is the half plane in which these are all.

        Raises
        ------
        ValueError
            If `n` is less than 1, or the equation is advanced.
        CountMismatchError
            If double precision does not tell the roots apart.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> h = s + (2.0 + 0.7 * s) * delay(0.36)
        >>> [complex(round(root.real, 3), round(root.imag, 3)) for root in h.rightmost()]
        [(-0.926+7.713j), (-0.926-7.713j)]
        """
        number = operator.index(n)
        if number < 1:
            raise ValueError(f"n={n}: ask for at least 1 rightmost root")
        return root_set(self._native.rightmost(number))

    def spectral_abscissa(self) -> float:
        """Give the largest real part of a root, or `chain_abscissa` if that is larger.

        For a neutral equation, roots closer to the chains than the search comes to them are not
        told from them: ``rightmost().region`` shows how close, usually within 1e-4 of one over
        the longest delay.

        Returns
        -------
        float
            In 1/s; infinite for an advanced equation.
        """
        if self.kind == "advanced":
            return math.inf
        return self._native.spectral_abscissa()

    def chain_abscissa(self) -> float:
        r"""Give the real part that the chains of roots of a neutral equation can come to.

        The solution c of :math:`\sum_j |b_j| e^{-c d_j} = |a|` with a the coefficient of the
        highest power of s without delay, b_j those with the delays d_j [1]_: the supremum over
        arbitrarily small changes of the delays. If the delays have a common divisor and are
        exact, the chains may lie further left.

        Returns
        -------
        float
            In 1/s; -inf where there are no chains (polynomial, retarded), inf if advanced.

        References
        ----------
        .. [1] C. E. Avellar and J. K. Hale, "On the zeros of exponential polynomials", Journal of
           Mathematical Analysis and Applications 73 (1980).

        Examples
        --------
        >>> from deadtime import delay, s
        >>> round((s + (2.0 + 0.3 * s) * delay(0.36)).chain_abscissa(), 4)
        -3.3444
        """
        return self._native.chain_abscissa()

    def chains(self) -> tuple[Chain, ...]:
        r"""Give the laws that the roots of large modulus follow.

        Returns
        -------
        tuple of Chain
            One for every sequence of roots in the upper half plane, from the least bend to the
            largest; none for a polynomial.

        Notes
        -----
        Each edge of the upper convex hull of the points (delay, degree of its row) makes chains
        with :math:`\mathrm{Re}\, s \approx c - \mu \ln|s|`, the slope of the edge being
        :math:`-\mu` [1]_. Asymptotic: nothing is proved about any single root.

        References
        ----------
        .. [1] R. Bellman and K. L. Cooke, Differential-Difference Equations, Academic Press
           (1963), chapter 12.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (chain,) = (s + 2.0 * delay(0.36)).chains()
        >>> chain.kind, round(chain.bend, 4), round(chain.spacing, 4)
        ('retarded', 2.7778, 17.4533)
        >>> [chain.kind for chain in (s + (2.0 + 0.3 * s) * delay(0.36)).chains()]
        ['neutral']
        """
        return chains_of(self)

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every root is proved to lie left of the imaginary axis.

        Parameters
        ----------
        strong : bool, default True
            Ask for strong stability [1]_: also under arbitrarily small changes of the delays,
            which matters for neutral equations. With False, delays that are whole multiples of a
            common one (to rounding) are taken as exactly that.

        Returns
        -------
        bool
            False also where a root lies on the axis or too close to it to tell, and for an
            advanced equation.

        Raises
        ------
        ValueError
            For the zero function.

        References
        ----------
        .. [1] J. K. Hale and S. M. Verduyn Lunel, "Strong stabilization of neutral functional
           differential equations", IMA Journal of Mathematical Control and Information 19 (2002).

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s + 4.0 * delay(0.36)).is_stable(), (s + 5.0 * delay(0.36)).is_stable()
        (True, False)
        """
        return self._native.is_stable(bool(strong))

    def sensitivity(self, root: complex) -> Sensitivity:
        r"""Derivatives of a simple root by every coefficient and every delay.

        Parameters
        ----------
        root : complex
            A root in 1/s, as `roots` or `rightmost` list it; its last digits do not matter.

        Returns
        -------
        Sensitivity
            ``coefficients``, shape (m, d+1), and ``delays``, shape (m,), arranged as those of the
            quasi-polynomial.

        Raises
        ------
        ValueError
            If the place given is no root, or the root is multiple or in a cluster that double
            precision does not tell apart: it has no derivative.

        Notes
        -----
        :math:`ds/dp = -(\partial h/\partial p) / h'(s)` for :math:`h(s; p) = 0`, the exponential
        of the dominating term cancelled beforehand so that nothing overflows.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> h = s + 4.0 * delay(0.36)
        >>> move = h.sensitivity(h.rightmost()[0])
        >>> bool(move.coefficients[1, 0].real > 0), bool(move.delays[1].real > 0)
        (True, True)
        """
        place = complex(root)
        rows, width = self._coefficients.shape
        found, slopes = self._native.sensitivity(
            place, np.repeat(self._delays, width).tolist(), list(range(width)) * rows
        )
        coefficients = slopes.reshape(rows, width)
        # h depends on a delay through its row alone, d/dtau of which is -s times the row.
        delays = -found * (coefficients * self._coefficients).sum(axis=1)
        return Sensitivity(found, coefficients, delays)


@overload
def delay(T: float) -> QuasiPolynomial: ...
@overload
def delay(T: ParametricQuasiPolynomial) -> ParametricQuasiPolynomial: ...
def delay(
    T: float | ParametricQuasiPolynomial,
) -> QuasiPolynomial | ParametricQuasiPolynomial:
    """Transfer function of a pure delay, exp(-s T).

    Parameters
    ----------
    T : float or ParametricQuasiPolynomial
        Delay in s, finite and not negative; or a parameter, or a sum of multiples of parameters
        and a number.

    Returns
    -------
    QuasiPolynomial or ParametricQuasiPolynomial
        The latter for a delay with parameters in it.

    Raises
    ------
    ValueError
        If `T` is negative or not finite.
    TypeError
        If `T` is not a real number.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.s + 2.0 * dtm.delay(0.36)
    s + 2 exp(-0.36 s)
    """
    if hasattr(T, "_exponential"):
        return T._exponential()
    if not is_number(T):
        raise TypeError(f"T={T!r}: a delay is a real number of seconds")
    return QuasiPolynomial([[1.0]], [float(T)])


def _operand(value: object) -> QuasiPolynomial | None:
    """Turn a real number into a quasi-polynomial; None for foreign types."""
    if isinstance(value, QuasiPolynomial):
        return value
    if is_number(value):
        return QuasiPolynomial([[float(cast(float, value))]], [0.0])
    return None


def is_number(value: object) -> bool:
    """Whether algebra takes `value` for a real number: 0-d arrays too."""
    scalar = isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "biuf"
    return isinstance(value, Real | np.bool_) or scalar


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array


def _real_array(name: str, values: ArrayLike, ndim: int) -> NDArray[np.float64]:
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name}: rows of different lengths, fill up with zeros") from error
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} of dtype {array.dtype}: give real numbers")
    if array.ndim != ndim or array.size == 0:
        raise ValueError(f"{name} of shape {array.shape}: give {ndim} dimensions, none empty")
    return array.astype(np.float64, copy=False)


def _term(row: NDArray[np.float64], tau: float) -> str:
    parts = []
    for power, c in enumerate(row.tolist()):
        if c == 0.0:
            continue
        name = "" if power == 0 else "s" if power == 1 else f"s^{power}"
        if name and abs(c) == 1.0:
            parts.append(("-" if c < 0.0 else "") + name)
        else:
            parts.append(f"{c:.12g} {name}".rstrip())
    text = " + ".join(parts).replace("+ -", "- ") or "0"
    if tau == 0.0:
        return text
    factor = f"exp(-{tau:.12g} s)"
    if text in ("1", "-1"):
        return text[:-1] + factor
    return f"({text}) {factor}" if len(parts) > 1 else f"{text} {factor}"


s: Final = QuasiPolynomial([[0.0, 1.0]], [0.0])
"""The complex variable of the Laplace transform, in 1/s."""
