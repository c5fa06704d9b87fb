"""Write rust/core/src/lambertw/real_coefficients.rs: approximations for W_0 and W_-1 of real x.

`python tests/reference/make_lambertw_real.py` prints the file. Everything is computed with mpmath
at 40 digits, from its `lambertw`. Polynomials interpolate at Chebyshev nodes. Rational functions
are least squares with the weights of Sanathanan and Koerner (1963), which make the problem linear,
and of Lawson (1961), which lead to the least largest error. What is left of W after the step from
a starting value that is off by e is c(w) e^3, with c = (2 + 4 v + 3 v^2)/6 and v = 1/(1 + w), so
that the error of a start is measured as the cube root of c e^3/W.
"""

from collections.abc import Callable, Sequence
from typing import Any

import mpmath as mp

mp.mp.dps = 40

Function = Callable[[Any], Any]

#: Largest argument with a rational start of W_0, and of W_-1.
LARGEST, LOWER_END = 1024, -mp.mpf(1) / 256
#: Leading constant and centre of the polynomial of W_0 below zero.
TOP, CENTRE = mp.mpf("1.4375"), mp.mpf(1)
#: Share of log 2 by which the range of the exponential lies lower.
AHEAD = mp.mpf("0.078125")
SQRT_2 = mp.sqrt(2)


def argument(p: Any) -> Any:
    """x from p = sqrt(2 (1 + e x))."""
    return (p * p / 2 - 1) / mp.e


def nodes(low: Any, high: Any, n: int) -> list[Any]:
    """Chebyshev nodes of a range."""
    middle, half = (low + high) / 2, (high - low) / 2
    return [middle + half * mp.cos(mp.pi * (2 * k + 1) / (2 * n)) for k in range(n)]


def interpolated(f: Function, low: Any, high: Any, degree: int) -> list[Any]:
    """Ascending coefficients of the polynomial through the Chebyshev nodes."""
    points = nodes(low, high, degree + 1)
    powers = mp.matrix([[x**k for k in range(degree + 1)] for x in points])
    return list(mp.lu_solve(powers, mp.matrix([f(x) for x in points])))


def value(ascending: Sequence[Any], x: Any) -> Any:
    return mp.polyval(list(reversed(ascending)), x)


def rational(
    f: Function, points: Sequence[Any], weights: Sequence[Any], degrees: tuple[int, int]
) -> tuple[Any, list[Any], list[Any]]:
    """Largest weighted error, numerator and denominator, which starts with 1."""
    n, m = degrees
    truth = [f(x) for x in points]
    lawson = [mp.mpf(1)] * len(points)
    below = [mp.mpf(1)] * len(points)
    best: tuple[Any, list[Any], list[Any]] = (mp.inf, [], [])
    for turn in range(24):
        rows, right = [], []
        for x, y, w, own, q in zip(points, truth, weights, lawson, below, strict=True):
            scale = mp.sqrt(own) * w / abs(q)
            rows.append(
                [scale * x**k for k in range(n + 1)] + [-scale * y * x**k for k in range(1, m + 1)]
            )
            right.append(scale * y)
        found, _ = mp.qr_solve(mp.matrix(rows), mp.matrix(right))
        above, under = list(found[: n + 1]), [mp.mpf(1), *found[n + 1 : n + m + 1]]
        below = [value(under, x) for x in points]
        errors = [
            w * abs(value(above, x) / q - y)
            for x, y, w, q in zip(points, truth, weights, below, strict=True)
        ]
        largest = max(errors)
        if largest < best[0]:
            best = (largest, above, under)
        if turn > 3:
            lawson = [
                own * (e / largest + mp.mpf("1e-9")) for own, e in zip(lawson, errors, strict=True)
            ]
            most = max(lawson)
            lawson = [own / most for own in lawson]
    return best


def left_over(w: Any) -> Any:
    """Factor on the error of a start whose cube is the relative error after the step."""
    v = 1 / (1 + w)
    return mp.cbrt((2 + 4 * v + 3 * v * v) / 6 / abs(w))


def principal(x: Any) -> Any:
    return mp.lambertw(x, 0).real


def lower(x: Any) -> Any:
    return mp.lambertw(x, -1).real


def ratio(p: Any) -> Any:
    """W_0(x)/x."""
    return mp.exp(-principal(argument(p)))


def ratio_slope(p: Any) -> Any:
    """Derivative of W_0(x)/x by p, over 2 p: what the square of p has to be corrected by."""
    w = principal(argument(p))
    return -mp.exp(-2 * w) / (2 * mp.e * (1 + w))


def exponential_rest(a: Any) -> Any:
    """(e^-a - 1 + a)/a^2, by its series."""
    return mp.fsum((-a) ** k / mp.factorial(k + 2) for k in range(40))


def adjusted(ascending: Sequence[Any], x: Any, power: int) -> list[Any]:
    """The coefficients with one changed so that all, once rounded, have the same value at `x`."""
    lost = sum((c - mp.mpf(float(c))) * x**k for k, c in enumerate(ascending) if k != power)
    return [c + lost / x**k if k == power else c for k, c in enumerate(ascending)]


def literal(x: Any) -> str:
    """A double as Rust writes it, its digits in groups of three."""
    digits, _, exponent = repr(float(x)).partition("e")
    whole, _, fraction = digits.partition(".")
    groups = [fraction[i : i + 3] for i in range(0, len(fraction), 3)]
    return f"{whole}.{'_'.join(groups or ['0'])}" + (f"e{int(exponent)}" if exponent else "")


def constant(comment: str, name: str, coefficients: Sequence[Any]) -> str:
    lines = "".join(f"    {literal(c)},\n" for c in coefficients)
    return f"{comment}pub(super) const {name}: [f64; {len(coefficients)}] = [\n{lines}];\n"


def comment(text: str) -> str:
    return "".join(f"/// {line}\n" for line in text.splitlines())


def main() -> None:
    span = 1 / mp.e
    ys = nodes(mp.log(span), mp.log(LARGEST + span), 120)
    xs = [mp.exp(y) - span for y in ys]
    weights = [x * left_over(principal(x)) for x in xs]
    above = rational(lambda x: principal(x) / x, xs, weights, (7, 7))

    end = mp.sqrt(1 + mp.e * LOWER_END)
    ps = nodes(mp.mpf(0), end, 120)
    reach = [lower((p * p - 1) / mp.e) for p in ps]
    weights = [p * left_over(w) for p, w in zip(ps, reach, strict=True)]
    below = rational(lambda p: -(1 + lower((p * p - 1) / mp.e)) / p, ps, weights, (6, 5))

    ratio_rest = interpolated(lambda t: ratio(t + CENTRE) - (TOP - t), -CENTRE, SQRT_2 - CENTRE, 23)
    ps = nodes(mp.mpf(0), SQRT_2, 60)
    _, slope, _ = rational(ratio_slope, ps, [p * p / ratio(p) for p in ps], (2, 0))
    middle, half = -AHEAD * mp.log(2), mp.log(2) / 2
    ps = nodes(middle - half, middle + half, 80)
    _, exponential, _ = rational(exponential_rest, ps, [r * r for r in ps], (10, 0))

    print(
        "//! Approximations for the real branches, printed by\n"
        "//! `tests/reference/make_lambertw_real.py`.\n"
        "//!\n"
        "//! Ascending coefficients; p = sqrt(2 (1 + e x)). A start that is off by e leaves the\n"
        "//! relative error (largest error stated here)^3 after the step of `real`.\n"
    )
    blocks = [
        constant(
            comment(
                "W_0(x)/x - (RATIO_TOP - t) in t = p - RATIO_CENTRE, -1/e <= x <= 0: within 3e-18."
            ),
            "RATIO_REST",
            adjusted(ratio_rest, -CENTRE, 6),
        ),
        f"/// The constant of W_0(x)/x.\npub(super) const RATIO_TOP: f64 = {literal(TOP)};\n",
        "/// The value of p about which it is expanded.\n"
        f"pub(super) const RATIO_CENTRE: f64 = {literal(CENTRE)};\n",
        constant(
            comment("Derivative of W_0(x)/x by p^2, in p, with low accuracy where p is small."),
            "RATIO_SLOPE",
            slope,
        ),
        constant(
            comment("(e^-r - 1 + r)/r^2 for |r/log 2 + AHEAD| <= 1/2: within 3e-18/r^2."),
            "EXP_REST",
            exponential,
        ),
        constant(
            comment(f"Numerator of W_0(x)/x for 0 <= x <= {LARGEST}: {mp.nstr(above[0], 2)}."),
            "ABOVE_NUMERATOR",
            above[1],
        ),
        constant(
            comment("Denominator that belongs to [`ABOVE_NUMERATOR`]."),
            "ABOVE_DENOMINATOR",
            above[2],
        ),
        constant(
            comment(
                "Numerator of -(1 + W_-1(x))/p in p = sqrt(1 + e x), -1/e <= x <= -1/256: "
                f"{mp.nstr(below[0], 2)}."
            ),
            "LOWER_NUMERATOR",
            below[1],
        ),
        constant(
            comment("Denominator that belongs to [`LOWER_NUMERATOR`]."),
            "LOWER_DENOMINATOR",
            below[2],
        ),
    ]
    print("\n".join(blocks), end="")


if __name__ == "__main__":
    main()
