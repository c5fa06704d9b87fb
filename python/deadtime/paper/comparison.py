"""A printed number beside the computed one, with a verdict from its digits.

A number printed with n digits is reproduced if the computed one, rounded to n digits, is equal.
Otherwise both are rounded to fewer digits until they agree. At least two agreeing digits count as
agreement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import ROUND_HALF_UP, Decimal
from enum import Enum
from typing import Any

#: Fewest agreeing digits that count as agreement.
LEAST_DIGITS = 2


class Verdict(Enum):
    """Verdict on a number or a statement of the paper."""

    EXACT = "reproduced"
    """Every printed digit agrees."""
    PARTLY = "to fewer digits"
    """At least two digits agree, not all."""
    DIFFERENT = "not reproduced"
    """Fewer than two digits agree."""
    CONFIRMED = "confirmed"
    """A statement, or an interval, that the computed numbers confirm."""
    CONTRADICTED = "not supported"
    """A statement that the computed or the printed numbers contradict."""
    MEASURED = "measured"
    """A measurement, with the value of a model beside it where there is one."""


def printed_digits(printed: str) -> int:
    """Digits of a printed decimal number that can be compared: of a zero, its decimals.

    Parameters
    ----------
    printed : str

    Returns
    -------
    int

    Examples
    --------
    >>> from deadtime.paper import printed_digits
    >>> printed_digits("2.300"), printed_digits("0.09"), printed_digits("0.000")
    (4, 1, 3)
    """
    number = Decimal(printed)
    if number.is_zero():
        return max(1, -int(number.as_tuple().exponent))
    return len(number.as_tuple().digits)


def agreeing_digits(printed: str, computed: float) -> int:
    """Number of leading digits that a printed and a computed number share, after rounding.

    Parameters
    ----------
    printed : str
        The number with its printed digits.
    computed : float
        The computed number.

    Returns
    -------
    int
        From 0 to `printed_digits`.

    Examples
    --------
    >>> from deadtime.paper import agreeing_digits
    >>> agreeing_digits("2.300", 2.29962), agreeing_digits("-3.323", -3.3168)
    (4, 3)
    """
    number, ours = Decimal(printed), Decimal(repr(float(computed)))
    last = int(number.as_tuple().exponent)
    digits = printed_digits(printed)
    if number.is_zero():
        return digits if _rounded(ours, last).is_zero() else 0
    for left_out in range(digits):
        if _rounded(number, last + left_out) == _rounded(ours, last + left_out):
            return digits - left_out
    return 0


def _rounded(number: Decimal, exponent: int) -> Decimal:
    return number.quantize(Decimal(1).scaleb(exponent), rounding=ROUND_HALF_UP)


@dataclass(frozen=True)
class Comparison:
    """One number or statement of the paper, with the computed value.

    Made by its constructors, which compute the verdict.

    Attributes
    ----------
    where : str
        Table, figure or section.
    quantity : str
        Name of the quantity.
    printed : str
        The printed digits.
    computed : float or complex or None
        The computed number; None where there is none.
    shown : str
        The computed value as text, with two more digits than printed.
    model : str
        The model of the computation.
    verdict : Verdict
        The verdict.
    digits : (int, int) or None
        Agreeing and printed digits, of numbers.
    note : str
        Explanation, if any.
    details : mapping of str to float
        Further numbers.

    Examples
    --------
    >>> from deadtime.paper import Comparison
    >>> found = Comparison.of_number("Fig 10", "rightmost root", "-3.323", -3.31678, "Lambert W")
    >>> found.outcome
    'to 3 of 4 digits'
    """

    where: str
    quantity: str
    printed: str
    computed: float | complex | None
    shown: str
    model: str
    verdict: Verdict
    digits: tuple[int, int] | None = None
    note: str = ""
    details: Mapping[str, float] = field(default_factory=dict)

    @property
    def outcome(self) -> str:
        """The verdict in words."""
        if self.digits is None:
            return self.verdict.value
        agreeing, printed = self.digits
        if self.verdict is Verdict.EXACT:
            return "the printed digit" if printed == 1 else f"all {printed} digits"
        if self.verdict is Verdict.PARTLY:
            return f"to {agreeing} of {printed} digits"
        return f"not reproduced ({agreeing} of {printed} digits)"

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain values.

        Returns
        -------
        dict of str to object
        """
        return {
            "where": self.where,
            "quantity": self.quantity,
            "printed": self.printed,
            "computed": self.computed,
            "shown": self.shown,
            "model": self.model,
            "verdict": self.verdict.value,
            "agreeing_digits": None if self.digits is None else self.digits[0],
            "printed_digits": None if self.digits is None else self.digits[1],
            "note": self.note,
            "details": dict(self.details),
        }

    @classmethod
    def of_number(
        cls,
        where: str,
        quantity: str,
        printed: str,
        computed: float,
        model: str,
        note: str = "",
        **details: float,
    ) -> Comparison:
        """Compare a number digit by digit."""
        digits = agreeing_digits(printed, computed), printed_digits(printed)
        shown, verdict, ours = _shown(printed, computed), _verdict(*digits), float(computed)
        return cls(where, quantity, printed, ours, shown, model, verdict, digits, note, details)

    @classmethod
    def of_root(
        cls,
        where: str,
        quantity: str,
        printed: tuple[str, str],
        computed: complex,
        model: str,
        note: str = "",
        **details: float,
    ) -> Comparison:
        """Compare a pair of roots, the part with fewer agreeing digits counting."""
        root = complex(computed.real, abs(computed.imag))
        parts = list(zip(printed, (root.real, root.imag), strict=True))
        digits = min((agreeing_digits(*part), printed_digits(part[0])) for part in parts)
        shown = " ± ".join(_shown(*part) for part in parts) + "i"
        pair, verdict = " ± ".join(printed) + "i", _verdict(*digits)
        return cls(where, quantity, pair, root, shown, model, verdict, digits, note, details)

    @classmethod
    def of_limits(
        cls,
        where: str,
        quantity: str,
        printed: str,
        limits: tuple[float, float],
        computed: float,
        model: str,
        note: str = "",
        **details: float,
    ) -> Comparison:
        """Compare a number with an interval of the paper."""
        holds = limits[0] <= computed <= limits[1]
        shown, ours = f"{computed:.3f}", float(computed)
        verdict = Verdict.CONFIRMED if holds else Verdict.DIFFERENT
        return cls(where, quantity, printed, ours, shown, model, verdict, None, note, details)

    @classmethod
    def of_statement(
        cls,
        where: str,
        quantity: str,
        printed: str,
        holds: bool,
        shown: str,
        model: str,
        note: str = "",
        computed: float | complex | None = None,
        **details: float,
    ) -> Comparison:
        """Check a statement."""
        verdict = Verdict.CONFIRMED if holds else Verdict.CONTRADICTED
        return cls(where, quantity, printed, computed, shown, model, verdict, None, note, details)

    @classmethod
    def of_measurement(
        cls,
        where: str,
        quantity: str,
        printed: str,
        computed: float | None,
        model: str,
        note: str = "",
        shown: str = "",
        **details: float,
    ) -> Comparison:
        """Show a measurement beside the value of a model, if there is one."""
        if not shown:
            shown = "–"
            if computed is not None:
                off = 100.0 * (computed / float(printed) - 1.0)
                shown = f"{_shown(printed, computed)} ({off:+.0f} %)"
        verdict = Verdict.MEASURED
        return cls(where, quantity, printed, computed, shown, model, verdict, None, note, details)


def _verdict(agreeing: int, printed: int) -> Verdict:
    if agreeing == printed:
        return Verdict.EXACT
    return Verdict.PARTLY if agreeing >= LEAST_DIGITS else Verdict.DIFFERENT


def _shown(printed: str, computed: float) -> str:
    decimals = max(0, -int(Decimal(printed).as_tuple().exponent))
    return f"{computed:.{decimals + 2}f}"
