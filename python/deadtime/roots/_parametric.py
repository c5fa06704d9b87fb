"""Quasi-polynomials with named parameters, by algebra.

A parametric quasi-polynomial is a sum of terms

    c * p1**e1 * p2**e2 * ... * s**k * e^(-s (t0 + q1 p1 + q2 p2 + ...)),

a number, whole powers of parameters and of s, and a delay that is affine in the parameters. Sums,
differences and products of such sums are such sums again; quotients are not, which is why
parameters do not divide.
"""

from __future__ import annotations

import keyword
import math
import numbers
import sys
from collections.abc import Collection, Mapping
from functools import cached_property
from typing import Any, NamedTuple, SupportsFloat, cast

from deadtime._base.frozen import Immutable
from deadtime._base.validation import finite, numbers_at
from deadtime.roots._exponential import NoExponential
from deadtime.roots._native import Family
from deadtime.roots._quasipolynomial import QuasiPolynomial, is_number
from deadtime.roots._text import Delay, Monomial, Powers, Terms, family_text, latex

#: Most terms of a product: bounds memory and time.
_MAX_TERMS = 100_000

_EPS = sys.float_info.epsilon

_NO_DELAY: Delay = (0.0, ())
_ONE: Monomial = ((), 0, _NO_DELAY)


class FamilyTerm(NamedTuple):
    """One term as the native core takes it."""

    coefficient: float
    exponents: Powers
    power: int
    constant: float
    slopes: tuple[tuple[str, float], ...]


class ParametricQuasiPolynomial(NoExponential, Immutable):
    """A quasi-polynomial whose coefficients and delays depend on named parameters.

    Made by algebra from `parameters`, `s`, `delay` and numbers: ``+``, ``-``, ``*``, whole powers
    and division by numbers. Immutable.

    See Also
    --------
    parameters : The parameters to begin with.
    stability_map : Stability over two of them.

    Examples
    --------
    >>> import deadtime as dtm
    >>> Kp, Kv, T = dtm.parameters("Kp Kv T")
    >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(T)
    >>> h
    s + (Kp + Kv s) exp(-T s)
    >>> h.names
    ('Kp', 'Kv', 'T')
    >>> round(h.at(Kp=2.0, Kv=0.3, T=0.36).spectral_abscissa(), 6)
    -3.31678
    """

    _names: tuple[str, ...]
    _terms: Terms

    def __init__(self) -> None:
        raise TypeError(
            "make a ParametricQuasiPolynomial by algebra: Kp, T = parameters('Kp T'), and then "
            "for example s + Kp * delay(T)"
        )

    @classmethod
    def _of(
        cls, names: tuple[str, ...], terms: Mapping[Monomial, float]
    ) -> ParametricQuasiPolynomial:
        for coefficient in terms.values():
            if not math.isfinite(coefficient):
                raise ValueError(
                    f"a coefficient is {coefficient}, but coefficients must be finite: scale "
                    "the equation"
                )
        self = object.__new__(ParametricQuasiPolynomial)
        self._adopt(names, {key: value for key, value in terms.items() if value != 0.0})
        return self

    def _adopt(self, names: tuple[str, ...], terms: Terms) -> None:
        object.__setattr__(self, "_names", names)
        object.__setattr__(self, "_terms", terms)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of their first appearance."""
        return self._names

    def at(self, /, **values: SupportsFloat) -> Any:
        """Give some parameters a value, or all of them.

        Parameters
        ----------
        **values : float
            For any of `names`.

        Returns
        -------
        ParametricQuasiPolynomial or QuasiPolynomial
            The former as long as a parameter has no value.

        Raises
        ------
        TypeError
            If a value is not a number.
        ValueError
            If a name is unknown, a value is not finite or a delay is negative there.

        Examples
        --------
        >>> import deadtime as dtm
        >>> Kp, T = dtm.parameters("Kp T")
        >>> h = dtm.s + Kp * dtm.delay(T)
        >>> h.at(T=0.36)
        s + Kp exp(-0.36 s)
        >>> h.at(Kp=2.0, T=0.36).kind
        'retarded'
        """
        self._refuse_unknown(values)
        if len(values) < len(self._names):
            return self._with({name: finite(name, value) for name, value in values.items()})
        point = [finite(name, values[name]) for name in self._names]
        return QuasiPolynomial._wrap(self._family.at(point))

    def _with(self, values: Mapping[str, float]) -> ParametricQuasiPolynomial:
        """Return the family of the parameters that are not in `values`."""
        found: Terms = {}
        for (powers, power, (constant, slopes)), number in self._terms.items():
            exponents, rates = dict(powers), dict(slopes)
            factor = math.prod((values[q] ** exponents.get(q, 0) for q in values), start=number)
            shifts = [values[q] * rates.get(q, 0.0) for q in values]
            time = constant + sum(shifts)
            kept = tuple(pair for pair in slopes if pair[0] not in values)
            if time < 0.0 and not kept:
                size = abs(constant) + sum(map(abs, shifts))
                if time < -_EPS * (len(shifts) + 1) * size:
                    place = ", ".join(f"{name}={value}" for name, value in values.items())
                    raise ValueError(
                        f"a delay is {time} s at {place}, but delays must not be negative: give "
                        "other values of the parameters"
                    )
                time = 0.0  # negative by rounding only
            key = (tuple(pair for pair in powers if pair[0] not in values), power, (time, kept))
            found[key] = found.get(key, 0.0) + factor
        return self._of(tuple(name for name in self._names if name not in values), found)

    def _refuse_unknown(self, names: Collection[str]) -> None:
        unknown = [name for name in names if name not in self._names]
        if unknown:
            raise ValueError(
                f"{', '.join(unknown)} is not a parameter of this expression. Its parameters are "
                + (", ".join(self._names) or "none")
            )

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial:
        """Return this expression, whose parameters must be those in `names`."""
        self._refuse_unknown(names)
        missing = [name for name in self.names if name not in names]
        if missing:
            raise ValueError(
                f"{', '.join(missing)} has no value: give it a range, or a value in "
                f"at={{{missing[0]!r}: ...}}"
            )
        return self

    def root_sensitivity(
        self, root: complex, *, at: Mapping[str, SupportsFloat]
    ) -> dict[str, complex]:
        """Derivatives of a simple root by the parameters, at a point.

        Parameters
        ----------
        root : complex
            A root of ``family.at(**at)``, in 1/s; its last digits do not matter.
        at : mapping of str to float
            The values of all parameters.

        Returns
        -------
        dict of str to complex
            By the name of the parameter, in 1/s per unit of it.

        Raises
        ------
        TypeError, ValueError
            As in `at` and as in `QuasiPolynomial.root_sensitivity`; ValueError also if a parameter
            has no value.

        Examples
        --------
        The gain of an integrator with dead time at the edge of stability: the pair moves right.

        >>> import math
        >>> import deadtime as dtm
        >>> K, T = dtm.parameters("K T")
        >>> h = dtm.s + K * dtm.delay(T)
        >>> move = h.root_sensitivity(0.5j * math.pi, at={"K": 0.5 * math.pi, "T": 1.0})
        >>> move["K"].real > 0, move["T"].real > 0
        (True, True)
        """
        point = numbers_at(at)
        self._family_of(point)
        h: QuasiPolynomial = self.at(**point)
        terms = list(self._terms.items())
        times = [
            max(0.0, constant + sum(slope * point[name] for name, slope in slopes))
            for (_, _, (constant, slopes)), _ in terms
        ]
        found = h._native.sensitivity(complex(root), times, [power for (_, power, _), _ in terms])
        moves = dict.fromkeys(self._names, 0j)
        for ((powers, _, (_, slopes)), number), slope in zip(
            terms, found.coefficients.tolist(), strict=True
        ):
            factors = [point[name] ** exponent for name, exponent in powers]
            for index, (name, exponent) in enumerate(powers):
                others = math.prod(factors[:index] + factors[index + 1 :])
                change = number * exponent * point[name] ** (exponent - 1) * others
                moves[name] += slope * change
            for name, rate in slopes:
                # A delay changes its term by -s times the term.
                moves[name] -= found.root * slope * number * math.prod(factors) * rate
        return moves

    @cached_property
    def _family(self) -> Family:
        """The same function as the native core holds it."""
        terms = [
            FamilyTerm(coefficient, exponents, power, constant, slopes)
            for (exponents, power, (constant, slopes)), coefficient in self._terms.items()
        ]
        return Family(list(self._names), terms)

    def _exponential(self) -> ParametricQuasiPolynomial:
        """e^(-s T) with T this function: what `delay` gives for a parametric delay."""
        constant = 0.0
        slopes: dict[str, float] = {}
        for (powers, power, delay), coefficient in self._terms.items():
            if power or delay != _NO_DELAY or sum(exponent for _, exponent in powers) > 1:
                raise ValueError(
                    f"delay({self!r}): give a number, a parameter, or a sum of parameters times "
                    "numbers and a number"
                )
            if powers:
                slopes[powers[0][0]] = coefficient
            else:
                constant = coefficient
        key: Monomial = ((), 0, (constant, tuple(sorted(slopes.items()))))
        return self._of(self._names, {key: 1.0})

    def __add__(self, other: object) -> ParametricQuasiPolynomial:
        right = _coerced(other)
        if right is None:
            return NotImplemented
        names, terms = right
        total = dict(self._terms)
        for key, value in terms.items():
            total[key] = total.get(key, 0.0) + value
        return self._of(_united(self._names, names), total)

    __radd__ = __add__

    def __neg__(self) -> ParametricQuasiPolynomial:
        return self._of(self._names, {key: -value for key, value in self._terms.items()})

    def __pos__(self) -> ParametricQuasiPolynomial:
        return self

    def __sub__(self, other: object) -> ParametricQuasiPolynomial:
        right = _coerced(other)
        if right is None:
            return NotImplemented
        return self + -self._of(*right)

    def __rsub__(self, other: object) -> ParametricQuasiPolynomial:
        return (-self).__add__(other)

    def __mul__(self, other: object) -> ParametricQuasiPolynomial:
        right = _coerced(other)
        if right is None:
            return NotImplemented
        names, terms = right
        if len(self._terms) * len(terms) > _MAX_TERMS:
            raise ValueError(
                f"the product has more than {_MAX_TERMS} terms. The roots of a product are the "
                "roots of its factors, so keep the factors separate"
            )
        product: Terms = {}
        for a, x in self._terms.items():
            for b, y in terms.items():
                key = _times(a, b)
                product[key] = product.get(key, 0.0) + x * y
        return self._of(_united(self._names, names), product)

    __rmul__ = __mul__

    def __pow__(self, exponent: object) -> ParametricQuasiPolynomial:
        if not isinstance(exponent, numbers.Integral):
            return NotImplemented
        if exponent < 0:
            raise ValueError(
                f"power {exponent}: give a whole number of zero or more. Instead of a negative "
                "power, multiply the equation by the divisor"
            )
        power = self._of(self._names, {_ONE: 1.0})
        for bit in bin(int(exponent))[2:]:
            power = power * power
            if bit == "1":
                power = power * self
        return power

    def __truediv__(self, other: object) -> ParametricQuasiPolynomial:
        if is_number(other):
            divisor = finite("divisor", cast(float, other))
            return self._of(
                self._names, {key: value / divisor for key, value in self._terms.items()}
            )
        if isinstance(other, ParametricQuasiPolynomial | QuasiPolynomial):
            raise TypeError(_no_quotient(other))
        return NotImplemented

    def __rtruediv__(self, other: object) -> ParametricQuasiPolynomial:
        if _coerced(other) is None:
            return NotImplemented
        raise TypeError(_no_quotient(self))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ParametricQuasiPolynomial):
            return NotImplemented
        return set(self._names) == set(other._names) and self._terms == other._terms

    def __hash__(self) -> int:
        return hash((frozenset(self._names), frozenset(self._terms.items())))

    def __reduce__(self) -> tuple[object, ...]:
        return ParametricQuasiPolynomial._of, (self._names, self._terms)

    def __repr__(self) -> str:
        return family_text(self._terms, self._names)

    def _repr_latex_(self) -> str:
        return f"${latex(repr(self))}$"


class Parameter(ParametricQuasiPolynomial):
    """A named number that has no value yet; made by `parameters`."""

    def __init__(self, name: str) -> None:
        if not isinstance(name, str):
            raise TypeError(f"name={name!r}: give a string, such as 'Kp'")
        if not name.isidentifier() or keyword.iskeyword(name):
            raise ValueError(
                f"{name!r} cannot be the name of a parameter: use letters, digits and underscores"
            )
        if name == "s":
            raise ValueError("'s' is the variable of every quasi-polynomial: use another name")
        self._adopt((name,), {(((name, 1),), 0, _NO_DELAY): 1.0})

    @property
    def name(self) -> str:
        """The name."""
        return self._names[0]

    def __reduce__(self) -> tuple[object, ...]:
        return Parameter, (self.name,)


def parameters(names: str) -> tuple[Parameter, ...]:
    """Parameters for gains and delays.

    Parameters
    ----------
    names : str
        One name or more, with spaces or commas between them. Parameters of the same name are the
        same.

    Returns
    -------
    tuple of Parameter
        One for each name, also where there is only one.

    Raises
    ------
    TypeError
        If `names` is not a string.
    ValueError
        If there is no name, one is not a Python identifier, is ``s``, or is given twice.

    Examples
    --------
    >>> import deadtime as dtm
    >>> Kp, T = dtm.parameters("Kp T")
    >>> dtm.s**2 + 0.5 * dtm.s + Kp * dtm.delay(2 * T + 0.1)
    0.5 s + s^2 + Kp exp(-(2 T + 0.1) s)
    """
    if not isinstance(names, str):
        raise TypeError(f"names={names!r}: give the names in one string, such as 'Kp Kv T'")
    words = names.replace(",", " ").split()
    if not words:
        raise ValueError(f"names={names!r}: give at least one name")
    for word in words:
        if words.count(word) > 1:
            raise ValueError(f"the name {word!r} is given twice: give every parameter its own name")
    return tuple(Parameter(word) for word in words)


def _coerced(other: object) -> tuple[tuple[str, ...], Terms] | None:
    """Names and terms of an operand; None for what this algebra does not know."""
    if isinstance(other, ParametricQuasiPolynomial):
        return other._names, other._terms
    if isinstance(other, QuasiPolynomial):
        terms: Terms = {}
        for row, delay in zip(other.coefficients.tolist(), other.delays.tolist(), strict=True):
            for power, value in enumerate(row):
                if value != 0.0:
                    terms[(), power, (delay, ())] = value
        return (), terms
    if is_number(other):
        return (), {_ONE: finite("number", cast(float, other))}
    return None


def _no_quotient(divisor: object) -> str:
    return (
        f"dividing by {divisor!r} would not give a quasi-polynomial. Multiply the equation by "
        "this divisor: a + b/T = 0 becomes T*a + b = 0"
    )


def _united(left: tuple[str, ...], right: tuple[str, ...]) -> tuple[str, ...]:
    return left + tuple(name for name in right if name not in left)


def _times(a: Monomial, b: Monomial) -> Monomial:
    exponents = dict(a[0])
    for name, exponent in b[0]:
        exponents[name] = exponents.get(name, 0) + exponent
    (constant, slopes), (more, others) = a[2], b[2]
    total = dict(slopes)
    for name, slope in others:
        total[name] = total.get(name, 0.0) + slope
    delay = (constant + more, tuple(sorted((n, slope) for n, slope in total.items() if slope)))
    return tuple(sorted(exponents.items())), a[1] + b[1], delay
