"""What an answer claims, and how a number is shown under that claim."""

from __future__ import annotations

from typing import Literal, TypeAlias

from deadtime._base.digits import shown, stated

#: What an answer claims: intervals that hold, numbers whose intervals are not claimed to, nothing.
Verdict: TypeAlias = Literal["reliable", "indication", "none"]

#: Numbers that are shown rounded where no interval says how exact they are: an error of this share.
#: Smaller: digits are shown that nothing supports; larger: answers that differ look alike.
ROUGH = 0.05

#: What is said of a number whose interval is not claimed to hold.
NOT_CLAIMED = "interval not reliable"


def verdict_if(reliable: bool) -> Verdict:
    """The verdict on a number, by whether its interval is claimed to hold."""
    return "reliable" if reliable else "indication"


def rough(value: float, unit: str = "") -> str:
    """A number without an interval, rounded: "12.3 s"."""
    return shown(value, ROUGH * abs(value), unit)


def claimed(verdict: Verdict, value: float, error: float, unit: str = "") -> str:
    """Value and standard error where they are claimed to hold, otherwise about which value.

    Examples
    --------
    >>> claimed("reliable", 0.4302, 0.0151, "s"), claimed("indication", 0.4302, 0.0151, "s")
    ('430 ± 15 ms', 'about 430 ms')
    """
    return stated(value, error, unit) if verdict == "reliable" else f"about {rough(value, unit)}"
