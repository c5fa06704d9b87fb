"""A number of the paper beside ours, and the verdict, which is computed from its digits.

A number printed with n digits is reproduced when ours, rounded to the last of them, is the same.
Otherwise both are rounded to fewer and fewer digits until they agree. One agreeing digit is no
agreement: two of them are the least that is called one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import ROUND_HALF_UP, Decimal
from enum import Enum
from typing import Any

__all__ = ["Comparison", "Verdict", "agreeing_digits", "printed_digits"]

#: Fewer agreeing digits than this are no agreement.
LEAST_DIGITS = 2


class Verdict(Enum):
    """What became of a number or a statement of the paper."""

    EXACT = "reproduced"
    """Every printed digit agrees."""
    PARTLY = "to fewer digits"
    """At least two digits agree, not all."""
    DIFFERENT = "not reproduced"
    """Fewer than two digits agree."""
    CONFIRMED = "confirmed"
    """A statement, or limits between which ours lies, that our numbers bear out."""
    CONTRADICTED = "not supported"
    """A statement that our numbers, or the paper's own, contradict."""
    MEASURED = "measured"
    """Read off an experiment: no model has to give it; where one can, it stands beside it."""


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
    """How many leading digits of a printed number a computed one has, after rounding.

    Parameters
    ----------
    printed : str
        The number as it is printed, with the digits it is printed with.
    computed : float
        The same, computed.

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
    """One number or statement of the paper, and what our models make of it.

    Made by its constructors, which compute the verdict.

    Attributes
    ----------
    where : str
        Table, figure or section.
    quantity : str
        What it is.
    printed : str
        As printed, with its digits.
    computed : float or complex or None
        Ours; None where nothing can be computed.
    shown : str
        Ours in words, with two digits more than are printed.
    model : str
        What it was computed with.
    verdict : Verdict
        Computed from the two.
    digits : (int, int) or None
        Digits that agree and digits printed, of numbers.
    note : str
        Why, where there is more to say.
    details : mapping of str to float
        Further numbers that belong to it.

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
        return cls(
            where,
            quantity,
            printed,
            float(computed),
            _shown(printed, computed),
            model,
            _verdict(*digits),
            digits,
            note,
            details,
        )

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
        shown = " ± ".join(_shown(*part) for part in parts)
        shown_printed = " ± ".join(printed)
        return cls(
            where,
            quantity,
            f"{shown_printed}i",
            root,
            f"{shown}i",
            model,
            _verdict(*digits),
            digits,
            note,
            details,
        )

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
        """Ask whether a number lies between two that the paper gives."""
        holds = limits[0] <= computed <= limits[1]
        shown = f"{computed:.3f}"
        verdict = Verdict.CONFIRMED if holds else Verdict.DIFFERENT
        return cls(
            where,
            quantity,
            printed,
            float(computed),
            shown,
            model,
            verdict,
            None,
            note,
            details,
        )

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
        """Ask whether a statement holds."""
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
        """Put beside a measurement what a model gives, if one can."""
        if not shown:
            shown = "–"
            if computed is not None:
                off = 100.0 * (computed / float(printed) - 1.0)
                shown = f"{_shown(printed, computed)} ({off:+.0f} %)"
        return cls(
            where,
            quantity,
            printed,
            computed,
            shown,
            model,
            Verdict.MEASURED,
            None,
            note,
            details,
        )


def _verdict(agreeing: int, printed: int) -> Verdict:
    if agreeing == printed:
        return Verdict.EXACT
    return Verdict.PARTLY if agreeing >= LEAST_DIGITS else Verdict.DIFFERENT


def _shown(printed: str, computed: float) -> str:
    decimals = max(0, -int(Decimal(printed).as_tuple().exponent))
    return f"{computed:.{decimals + 2}f}"
