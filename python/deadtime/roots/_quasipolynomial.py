"""Quasi-polynomials: characteristic functions of linear systems with delays."""

from __future__ import annotations

import cmath
import operator
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import (
    TYPE_CHECKING,
    Any,
    Final,
    Literal,
    Protocol,
    SupportsFloat,
    TypeAlias,
    TypeVar,
    cast,
    overload,
)

import numpy as np
from numpy.typing import ArrayLike, NDArray

import deadtime.roots._native as native
from deadtime._base.frozen import Immutable
from deadtime._base.validation import Range, unmasked, whole_number
from deadtime.roots._characteristic import Characteristic
from deadtime.roots._expansion import Expansion
from deadtime.roots._exponential import NoExponential
from deadtime.roots._text import joined, latex, row_text

if TYPE_CHECKING:
    from deadtime.systems import Margins, TransferFunction


Kind: TypeAlias = Literal["polynomial", "retarded", "neutral", "difference", "advanced"]

#: A family of quasi-polynomials.
_Family = TypeVar("_Family", covariant=True)


class QuasiPolynomial(NoExponential, Immutable, Characteristic):
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

    _native: native.QuasiPolynomial
    _coefficients: NDArray[np.float64]
    _delays: NDArray[np.float64]

    def __init__(self, coefficients: ArrayLike, delays: ArrayLike) -> None:
        rows = _real_array("coefficients", coefficients, 2)
        times = _real_array("delays", delays, 1)
        if len(rows) != len(times):
            raise ValueError(
                f"{len(rows)} rows of coefficients and {len(times)} delays are given: give one "
                "delay for each row"
            )
        self._adopt(native.QuasiPolynomial(rows, times))

    @classmethod
    def _wrap(cls, native: native.QuasiPolynomial) -> QuasiPolynomial:
        new = object.__new__(cls)
        new._adopt(native)
        return new

    def _adopt(self, native: native.QuasiPolynomial) -> None:
        put = object.__setattr__
        put(self, "_native", native)
        put(self, "_coefficients", _frozen(native.coefficients()))
        put(self, "_delays", _frozen(native.delays()))

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
        """Kind of equation, determined after the smallest delay is factored out.

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
        rows = zip(self._coefficients.tolist(), self._delays.tolist(), strict=True)
        return joined([row_text(row, tau) for row, tau in rows])

    def _repr_latex_(self) -> str:
        return f"${latex(repr(self))}$"

    # Algebra

    def _time(self) -> float | None:
        rows = self._coefficients
        slope = float(rows[0, 1]) if rows.shape == (1, 2) else 0.0
        return -slope if slope < 0.0 and not (rows[0, 0] or self._delays[0]) else None

    def __pos__(self) -> QuasiPolynomial:
        return self

    def __neg__(self) -> QuasiPolynomial:
        return self._wrap(self._native.scale(-1.0))

    def __add__(self, other: object) -> QuasiPolynomial:
        second = _operand(other)
        if second is None:
            return cast(QuasiPolynomial, _beyond(self, "__add__", other))
        return self._wrap(self._native.add(second._native))

    __radd__ = __add__

    def __sub__(self, other: object) -> QuasiPolynomial:
        second = _operand(other)
        if second is None:
            return cast(QuasiPolynomial, _beyond(self, "__sub__", other))
        return self._wrap(self._native.sub(second._native))

    def __rsub__(self, other: object) -> QuasiPolynomial:
        first = _operand(other)
        if first is None:
            return cast(QuasiPolynomial, _beyond(self, "__rsub__", other))
        return self._wrap(first._native.sub(self._native))

    def __mul__(self, other: object) -> QuasiPolynomial:
        if isinstance(other, QuasiPolynomial):
            return self._wrap(self._native.mul(other._native))
        if is_number(other):
            return self._wrap(self._native.scale(float(cast(float, other))))
        return cast(QuasiPolynomial, _beyond(self, "__mul__", other))

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
                raise ZeroDivisionError("a quasi-polynomial cannot be divided by zero")
            return self._wrap(native.QuasiPolynomial(self._coefficients / divisor, self._delays))
        if isinstance(other, QuasiPolynomial):
            return _quotient(self, other)
        return cast(QuasiPolynomial, _beyond(self, "__truediv__", other))

    def __rtruediv__(self, other: float) -> TransferFunction:
        first = _operand(other)
        if first is None:
            return cast("TransferFunction", _beyond(self, "__rtruediv__", other))
        return _quotient(first, self)

    def __pow__(self, exponent: object) -> Any:
        """To a whole power; to a negative one it is a `TransferFunction`."""
        try:
            power = operator.index(cast(int, exponent))
        except TypeError:
            return NotImplemented
        if abs(power) >= 2**31:
            raise ValueError(
                f"power {power}: the result would not fit into memory, so give a lower power"
            )
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
        points = _places(s)
        values = self._native.values(points)
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
        return self._wrap(self._native.derivative(whole_number("n", n, least=0, limit=2**31)))

    def logarithmic_derivative(self, s: ArrayLike) -> Any:
        r"""Logarithmic derivative :math:`h'(s)/h(s)`, which no exponential makes overflow.

        Parameters
        ----------
        s : array_like of complex
            Places in 1/s.

        Returns
        -------
        complex, or ndarray of complex of the shape of `s`
            NaN at a root.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> h = s + 2.0 * delay(0.36)
        >>> h.logarithmic_derivative(-1e5)
        (-0.36+0j)
        """
        points = _places(s)
        values = self._native.logarithmic_derivatives(points)
        return values.reshape(points.shape) if points.ndim else complex(values[0])

    # As the characteristic function of a loop

    def _loop_gain(self) -> TransferFunction:
        """Give the part with delays over the part without, the smallest delay factored out."""
        delays = self._delays - self._delays[0]
        rows = self._coefficients
        late = QuasiPolynomial(rows[1:], delays[1:]) if len(rows) > 1 else 0.0
        return late / QuasiPolynomial(rows[:1], delays[:1])

    def margin(self) -> Margins:
        """Gain, phase and delay margin of the loop whose characteristic function this is.

        The loop gain is the part with delays over the part without: ``h = d + n`` with the delay
        in n is that of ``feedback(n / d)``.

        Returns
        -------
        Margins
            As of `TransferFunction.margin`.

        Raises
        ------
        ValueError
            As in `TransferFunction.margin`.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s + 2.0 * delay(0.36)).margin()
        <Margins: gain 2.182 at 4.363 rad/s, phase 48.75° at 2 rad/s, delay 0.4254 s at 2 rad/s>
        """
        return self._loop_gain().margin()

    def crossings(
        self, ranges: Mapping[str, Range], *, at: Mapping[str, SupportsFloat] | None = None
    ) -> Any:  # Crossings, which itself is made of quasi-polynomials
        """Every crossing of the imaginary axis as the part with delays changes.

        Parameters
        ----------
        ranges : mapping of str to (low, high)
            ``gain``, a factor on the part with delays, or ``delay``, a further delay of it in s.
        at : mapping of str to float, optional
            The value of the other one.

        Returns
        -------
        Crossings

        Raises
        ------
        ValueError, TypeError
            As in `deadtime.crossings`.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s + 2.0 * delay(0.36)).crossings({"delay": (0.0, 1.0)}).values.round(4)
        array([0.4254])
        """
        return self._loop_gain().crossings(ranges, at=at)

    def _delay_margin(self) -> float:
        return self.margin()._delay_margin()

    def expansion(self, s: complex, order: int = 1) -> Expansion:
        r"""Taylor coefficients at a place, with bounds on their errors.

        Parameters
        ----------
        s : complex
            Place in 1/s.
        order : int, default 1
            Highest power, from 0 to 60.

        Returns
        -------
        Expansion
            Of :math:`h(s)\,e^{s\tau}` with the delay :math:`\tau` of the term that dominates at the
            place, so that nothing overflows; computed in two words, about 32 digits.

        Raises
        ------
        ValueError
            If `s` is not finite, the order is out of range, or a power of s leaves the range of
            double precision.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> near = (s - 1 + delay(1.0)).expansion(0.0, order=2)
        >>> print(near.coefficients.real.round(12), near.errors[0] < 1e-29)
        [0.  0.  0.5] True
        """
        place, highest = complex(s), whole_number("order", order, least=0, limit=61)
        if not cmath.isfinite(place):
            raise ValueError(f"s={place}: give a finite number")
        found = self._native.expansion(place, highest)
        if not np.isfinite(found.errors).all():
            raise ValueError(
                f"s={place}: here a power of s or an exponential exceeds the range of double "
                "precision"
            )
        return Expansion(found.coefficients, found.errors, found.delay)


def _quotient(num: QuasiPolynomial, den: QuasiPolynomial) -> TransferFunction:
    from deadtime.systems import TransferFunction

    return TransferFunction(num, den)


def _beyond(h: QuasiPolynomial, operation: str, other: object) -> Any:
    """Leave a system of another package, which has no type here, to the transfer function of h."""
    if type(other).__module__.partition(".")[0] not in ("control", "scipy"):
        return NotImplemented
    return getattr(_quotient(h, QuasiPolynomial([[1.0]], [0.0])), operation)(other)


class Exponent(Protocol[_Family]):
    """A delay with parameters in it."""

    def _exponential(self) -> _Family: ...


@overload
def delay(T: float) -> QuasiPolynomial: ...
@overload
def delay(T: Exponent[_Family]) -> _Family: ...
def delay(T: Any) -> Any:
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
        raise TypeError(f"T={T!r}: give the delay as a real number of seconds")
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


def _places(s: Any) -> NDArray[np.complex128]:
    points = np.asarray(unmasked("s", s))
    if points.dtype.kind not in "biufc":
        raise TypeError(f"s has the dtype {points.dtype}: give complex or real numbers")
    return points.astype(np.complex128, copy=False)


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array


def _real_array(name: str, values: ArrayLike, ndim: int) -> NDArray[np.float64]:
    values = unmasked(name, values)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(
            f"the rows of {name} have different lengths: fill shorter rows up with zeros"
        ) from error
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} has the dtype {array.dtype}: give real numbers")
    if array.ndim != ndim or array.size == 0:
        raise ValueError(
            f"{name} has shape {array.shape}: give an array of {ndim} dimensions that is not empty"
        )
    return array.astype(np.float64, copy=False)


s: Final = QuasiPolynomial([[0.0, 1.0]], [0.0])
"""The complex variable of the Laplace transform, in 1/s."""
