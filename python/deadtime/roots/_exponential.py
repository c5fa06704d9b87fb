"""What quasi-polynomials answer where an exponential of s is written in another way.

``np.exp(-12 * s)``, ``math.exp(-12 * s)`` and ``math.e ** (-12 * s)`` are no quasi-polynomials to
Python; the answer says how a delay is written. Everything else of NumPy is left to the class.
"""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

#: The operators of NumPy, and which method of the right operand answers each.
_REFLECTED: dict[np.ufunc, str] = {
    np.add: "__radd__",
    np.subtract: "__rsub__",
    np.multiply: "__rmul__",
    np.true_divide: "__rtruediv__",
    np.power: "__rpow__",
    np.equal: "__eq__",
    np.not_equal: "__ne__",
}


class NoExponential:
    """Base of what is an expression in s: says how exp(-T s) is written."""

    __slots__ = ()

    def _time(self) -> float | None:
        """T where this is -T s with a positive number T."""
        return None

    def _spelling(self) -> str:
        time = self._time()
        if time is not None:
            return f"exp(-{time:g} s) is written deadtime.delay({time:g})"
        return "exp(-T s) is written deadtime.delay(T), with a number or a parameter T"

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Answer ``number * h`` and ``array * h`` as ``h`` does, and no other function."""
        if ufunc is np.exp:
            raise TypeError(self._spelling())
        name = _REFLECTED.get(ufunc)
        if method == "__call__" and name and not options and inputs[1] is self:
            found = getattr(self, name)(inputs[0])
            if found is not NotImplemented:
                return found
            if ufunc in (np.equal, np.not_equal):
                return ufunc is np.not_equal
        raise TypeError(
            f"numpy.{ufunc.__name__} does not work on a {type(self).__name__}: give numbers, "
            "such as the values of the expression at given s"
        )

    def __rpow__(self, base: object) -> NoReturn:
        raise TypeError(
            f"{base!r} cannot be raised to the power of an expression in s. {self._spelling()}"
        )

    def __float__(self) -> NoReturn:
        raise TypeError(f"an expression in s is not a number. {self._spelling()}")
