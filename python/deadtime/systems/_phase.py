"""The argument of a quasi-polynomial along the imaginary axis, continuous from zero on.

An interval is divided until no turn can go unseen in it. With g = h e^(s centre), Taylor's formula
keeps g in a half plane where |g(m)| > |g'(m)| r + B r^2/2. Where one row p_c outweighs all others
together, g = p_c e^(-j omega d) (1 + zeta) with |zeta| < 1: only polynomials have to keep a half
plane there, so that intervals grow with the frequency and not with the turns of the delays.
Beyond a frequency where lower powers are lost to rounding, the leading coefficients alone are left.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from deadtime.roots import QuasiPolynomial
from deadtime.roots._frequency import OnAxis, powers_of_s, without_powers

__all__ = ["argument"]

Vector = NDArray[np.float64]

_EPS = float(np.finfo(np.float64).eps)

# Halvings of an interval, and intervals in hand before the phase is given up.
_HALVINGS = 400
_MOST = 200_000

# Lower powers than this part of the leading one are lost to rounding.
_LOST = 1e-17


class _Rows:
    """The rows of h on the axis, each a polynomial in omega."""

    def __init__(self, h: QuasiPolynomial) -> None:
        turns = np.resize([1.0, 1j, -1.0, -1j], h.degree + 1)
        self.rows = np.asarray(h.coefficients * turns)
        self.delays = h.delays
        self._sizes = np.abs(self.rows)

    def leader(self, a: Vector, b: Vector) -> NDArray[np.int64]:
        """The row that outweighs all others from a to b, -1 where none is sure to."""
        m, r = 0.5 * (a + b), 0.5 * (b - a)
        sizes = np.stack([polynomial.polyval(b, row) for row in self._sizes])
        bends = np.stack([polynomial.polyval(b, polynomial.polyder(x, 2)) for x in self._sizes])
        values = np.abs(np.stack([polynomial.polyval(m, row) for row in self.rows]))
        slopes = np.stack([polynomial.polyval(m, polynomial.polyder(row)) for row in self.rows])
        least = values - np.abs(slopes) * r - 0.5 * bends * r * r - 1e-12 * sizes
        c = np.argmax(values, axis=0)
        own = np.take_along_axis(least, c[None], axis=0)[0]
        others = sizes.sum(axis=0) - np.take_along_axis(sizes, c[None], axis=0)[0]
        return np.where(own > others * (1.0 + 1e-9), c, -1)

    def turned(self, c: int, a: Vector, b: Vector, centre: float) -> Vector:
        """How far the argument of g turns from a to b, where row c outweighs the others."""
        m = 0.5 * (a + b)
        at_a, at_m, at_b = (polynomial.polyval(w, self.rows[c]) for w in (a, m, b))
        own = np.angle(at_m / at_a) + np.angle(at_b / at_m)
        return np.asarray(own - (self.delays[c] - centre) * (b - a) + self._excess(c, a, b))

    def _excess(self, c: int, a: Vector, b: Vector) -> Vector:
        """Change of the argument of 1 + zeta."""

        def angle(w: Vector) -> Vector:
            total = np.ones(w.shape, np.complex128)
            own = polynomial.polyval(w, self.rows[c])
            for row, tau in zip(np.delete(self.rows, c, 0), np.delete(self.delays, c), strict=True):
                turn = np.exp(-1j * w * (tau - self.delays[c]))
                total += polynomial.polyval(w, row) / own * turn
            return np.asarray(np.angle(total))

        return angle(b) - angle(a)


def argument(h: QuasiPolynomial, omega: Vector) -> Vector:
    """Argument of h(j omega) in rad, continuous from omega = 0+ on, for omega > 0.

    It starts from k quarter turns for a factor s^k, and half a turn more where the rest is
    negative. Passing a zero on the axis, it grows by half a turn for each multiplicity, as if the
    zero lay just left of the axis.

    Raises
    ------
    ValueError
        Where turns cannot be followed that far.
    """
    k = powers_of_s(h)
    h = without_powers(h, k)
    centre = float(h.delays[int(np.argmax(h.coefficients[:, -1] != 0.0))])
    places, back = np.unique(omega, return_inverse=True)
    if places.size == 0:
        return np.zeros_like(omega)
    with np.errstate(over="ignore", invalid="ignore"):
        turns = places * centre
        if not np.isfinite(turns).all():
            raise ValueError(
                f"omega={places[-1]:g}: the phase, {centre:g} s times that, is beyond 1e308"
            )
        far, c = _far(h)
        near = np.minimum(places, far)
        followed = _followed(h, near, centre)
        outer = places > far
        if outer.any():
            leading = _Rows(QuasiPolynomial(h.coefficients[:, -1:], h.delays))
            followed[outer] += leading.turned(c, near[outer], places[outer], centre)
    found = followed - turns + 0.5 * np.pi * k
    return np.asarray(found[back].reshape(omega.shape))


def _far(h: QuasiPolynomial) -> tuple[float, int]:
    """From where on the leading coefficient of one row outweighs all others; inf if none does."""
    size = np.abs(h.coefficients)
    lead = size[:, -1]
    c = int(np.argmax(lead))
    room = float(2.0 * lead[c] - lead.sum())
    if room <= 1e-9 * lead[c]:
        return np.inf, c
    lower = size[:, :-1].sum(axis=0)
    powers = h.degree - np.arange(h.degree)
    with np.errstate(divide="ignore"):
        logs = (np.log(lower) - np.log(room) - np.log(_LOST)) / powers
    far = float(np.exp(np.max(logs, initial=-np.inf)))
    return far, c


def _followed(h: QuasiPolynomial, omega: Vector, centre: float) -> Vector:
    """Argument of h e^(j omega centre) at increasing frequencies, some of them equal."""
    g, rows = OnAxis(h, centre), _Rows(h)

    def value(w: Vector) -> NDArray[np.complex128]:
        return np.asarray(g(w) * np.exp(1j * w * centre))

    if not np.isfinite(g.bounds(omega[-1:])).all():
        raise ValueError(
            f"omega={omega[-1]:g}: its powers leave the range of doubles, and no term outweighs "
            "the others up to there; ask for lower frequencies or choose another unit of time"
        )
    origin = 0.0
    start = value(np.zeros(1))[0]
    if abs(start) <= g.rounding(np.zeros(1))[0] * g.bounds(np.zeros(1))[0][0]:
        origin = 1e-3 * float(omega[0])
        start = value(np.array([origin]))[0]
    nodes = np.concatenate([[origin], omega])
    grown = np.zeros(omega.size)
    a, b, owner = nodes[:-1], nodes[1:], np.arange(omega.size)
    for _ in range(_HALVINGS):
        apart = b > a
        a, b, owner = a[apart], b[apart], owner[apart]
        if a.size == 0:
            break
        if a.size > _MOST:
            raise ValueError(
                f"the phase takes more than {_MOST} intervals between {a.min():g} and "
                f"{b.max():g} rad/s, since no term outweighs the others there: ask for lower "
                "frequencies"
            )
        leaders = rows.leader(a, b)
        for c in np.unique(leaders[leaders >= 0]).tolist():
            led = leaders == c
            turned = rows.turned(c, a[led], b[led], centre)
            grown += np.bincount(owner[led], turned, minlength=omega.size)
        a, b, owner = a[leaders < 0], b[leaders < 0], owner[leaders < 0]
        m, r = 0.5 * (a + b), 0.5 * (b - a)
        at = value(m)
        slope = np.abs(g.slope(m) + 1j * centre * g(m))
        bound, _, curvature = g.bounds(b)
        noise = g.rounding(b) * bound
        change = slope * r + 0.5 * curvature * r * r
        inside = np.abs(at) > change + noise
        hidden = ~inside & ((change <= noise) | (r <= 2.0 * _EPS * m))
        for chosen, lowest in ((inside, -np.pi), (hidden, -0.5 * np.pi)):
            if chosen.any():
                first, last = value(a[chosen]), value(b[chosen])
                middle = at[chosen]
                if lowest == -np.pi:
                    turned = np.angle(middle / first) + np.angle(last / middle)
                else:
                    turned = np.angle(last) - np.angle(first)
                    turned = lowest + np.mod(turned - lowest, 2.0 * np.pi)
                grown += np.bincount(owner[chosen], turned, minlength=omega.size)
        rest = ~inside & ~hidden
        a, m, b, owner = a[rest], m[rest], b[rest], owner[rest]
        a, b, owner = np.concatenate([a, m]), np.concatenate([m, b]), np.tile(owner, 2)
    return np.asarray(np.angle(start) + np.cumsum(grown))
