"""Numbers with as many digits as their standard error leaves."""

from __future__ import annotations

import math

#: Units of time that are shown, and each in s, the largest first.
TIMES = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))

#: Share of its error below which a value is shown as zero.
NEXT_TO_NOTHING = 0.02

#: Share of a value below which its error is that of rounding, and is not shown.
ROUNDING = 1e-9

#: Most digits behind the point, and digits of a number without an error.
MOST, PLAIN = 12, 4


def places(error: float) -> int:
    """Digits behind the point of a number with this error: its first two, one from 3 on.

    Negative for digits before the point that are not known.
    """
    if not (math.isfinite(error) and error > 0.0):
        return MOST
    size = math.floor(math.log10(error))
    leading = error / 10.0**size
    # 2.96 rounds to 3, which has one digit; 9.7 to 10, which has two.
    return min(MOST, -size + (1 if leading < 2.95 else 0))


def rounded(value: float, error: float) -> str:
    """The value up to the last digit that its error leaves."""
    if not math.isfinite(value):
        return f"{value}"
    if not (math.isfinite(error) and error > 0.0):
        return f"{value:.{PLAIN}g}"
    digits = places(error)
    # Zero has no sign, whichever way it was rounded from.
    return f"{round(value, digits) + 0.0:.{max(digits, 0)}f}"


def stated(value: float, error: float, unit: str = "") -> str:
    """Value and standard error: "3.42 ± 0.05 ms"; seconds in the unit that suits them.

    Examples
    --------
    >>> stated(0.003421, 0.00005, "s"), stated(0.4302, 0.0151, "s"), stated(0.8512, 0.034)
    ('3.42 ± 0.05 ms', '430 ± 15 ms', '0.85 ± 0.03')
    >>> stated(12.3, float("nan"), "m"), stated(12.3, float("inf"), "m")
    ('12.3 m', '12.3 m, not determined')
    >>> stated(0.0121, 0.48, "s")
    '12 ± 500 ms'
    """
    if error < ROUNDING * abs(value):
        error = 0.0
    unit, factor = time_unit(value, error) if unit == "s" else (unit, 1.0)
    behind = f" {unit}" if unit else ""
    value, error = value / factor, error / factor
    if error == math.inf:
        return f"{rounded(value, error)}{behind}, not determined"
    if not (math.isfinite(error) and error > 0.0):
        return f"{rounded(value, error)}{behind}"
    # A value below its error keeps its first digits: zero would say that it is known to be that.
    least = min(error, max(abs(value), NEXT_TO_NOTHING * error))
    return f"{rounded(value, least)} ± {rounded(error, error)}{behind}"


def shown(value: float, error: float, unit: str = "") -> str:
    """The value with as many digits as `stated` gives it, without the error: "3.42 ms"."""
    if error < ROUNDING * abs(value):
        error = 0.0
    unit, factor = time_unit(value, error) if unit == "s" else (unit, 1.0)
    return f"{rounded(value / factor, error / factor)} {unit}".rstrip()


def between(low: float, high: float, error: float, unit: str = "") -> str:
    """Both ends of an interval, to the digits of the standard error: "3.31 to 3.53 ms"."""
    unit, factor = time_unit(max(abs(low), abs(high)), error) if unit == "s" else (unit, 1.0)
    if not (math.isfinite(error) and error > 0.0):
        error = 0.1 * (high - low)
    error = min(error, 0.5 * (high - low) or error)
    if error < ROUNDING * max(abs(low), abs(high)):
        error = 0.0
    ends = " to ".join(rounded(end / factor, error / factor) for end in (low, high))
    return f"{ends} {unit}".rstrip()


def time_unit(value: float, error: float = 0.0) -> tuple[str, float]:
    """The unit of time in which a number is shown, and that unit in s."""
    size = max((abs(number) for number in (value, error) if math.isfinite(number)), default=0.0)
    for unit, factor in TIMES:
        if size >= factor:
            return unit, factor
    return TIMES[1] if size == 0.0 else TIMES[-1]
