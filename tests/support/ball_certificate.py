"""Certificates verified in ball arithmetic, by code that shares nothing with the package."""

from itertools import pairwise

import flint

# Order of Taylor polynomials next to several roots.
ORDER = 9


def ball_count(proof):
    """Verify a certificate of a closed rectangle in python-flint's balls and return its count.

    Each segment: g on the whole of it, by the mean value form over balls, or in a disc by its
    Taylor polynomial; then the turns of arg h between the ends of segments, as principal arguments
    of quotients of balls.
    """
    acb, acb_series, arb = flint.acb, flint.acb_series, flint.arb
    old = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = 320, ORDER + 1
    try:
        rows = [[arb(c) * arb(2) ** proof.scale for c in row] for row in proof.coefficients]
        rows = [row[proof.zeros :] for row in rows]
        taus = [arb(tau) for tau in proof.delays]

        def ball(z):
            return acb(arb(z.real), arb(z.imag))

        def horner(row, z):
            value = acb(0)
            for c in reversed(row):
                value = value * z + c
            return value

        def g(z, c):
            terms = zip(rows, taus, strict=True)
            return sum(
                (horner(row, z) * (-z * (tau - taus[c])).exp() for row, tau in terms), acb(0)
            )

        def taylor(z, c):
            """Coefficients at z, or enclosed in a ball, up to the order."""
            total, step = acb_series([0]), acb_series([z, 1])
            for row, tau in zip(rows, taus, strict=True):
                polynomial = acb_series([0])
                for coefficient in reversed(row):
                    polynomial = polynomial * step + coefficient
                total += polynomial * (step * (taus[c] - tau)).exp()
            return total

        def slope(z, c):
            total = acb(0)
            for row, tau in zip(rows, taus, strict=True):
                primed = [k * a for k, a in enumerate(row)][1:]
                gap = tau - taus[c]
                total += (horner(primed, z) - gap * horner(row, z)) * (-z * gap).exp()
            return total

        def taylor_turn(part):
            """Change of arg g, whose Taylor polynomial shows that it stays in a disc without 0."""
            middle = ball(part.middle)
            radius = max(abs(part.end - part.middle), abs(part.middle - part.start))
            reach = arb(radius) * (1 + arb(2) ** -50)
            near = taylor(middle, part.reference)
            around = taylor(middle + acb(arb(0, reach), arb(0, reach)), part.reference)
            change = around[ORDER].abs_upper() * reach**ORDER
            for k in range(1, ORDER):
                change += near[k].abs_upper() * reach**k
            assert change < near[0].abs_lower(), "g may vanish"
            first, last = (g(ball(end), part.reference) / near[0] for end in (part.start, part.end))
            return last.arg() - first.arg()

        total = 0
        for contour in proof.contours:
            turned = arb(0)
            assert all(one.end == two.start for one, two in pairwise(contour.segments))
            ends = [contour.segments[0].start, contour.segments[-1].end]
            (a, b), (c, d) = contour.re, contour.im
            assert ends == [complex(b if contour.symmetric else a, c), complex(a, c)]
            assert {complex(b, d), complex(a, d)} <= {part.end for part in contour.segments}
            for part in contour.segments:
                turned -= taus[part.reference] * (arb(part.end.imag) - arb(part.start.imag))
                along = arb(0)
                # In eight pieces, because a rectangle of balls is wider than the disc.
                ends = [part.start + k / 8 * (part.end - part.start) for k in range(8)] + [part.end]
                for start, end in pairwise(ends):
                    a, b = ball(start), ball(end)
                    hull = a.union(b)
                    first, last = g(a, part.reference), g(b, part.reference)
                    over = (first + slope(hull, part.reference) * (hull - a)) / first
                    if not over.real > 0:
                        along = taylor_turn(part)
                        break
                    along += (last / first).arg()
                turned += along
            unit = arb.pi() * (1 if contour.symmetric else 2)
            number = (turned / unit).unique_fmpz()
            assert number is not None
            assert int(number) == contour.count
            total += int(number)
    finally:
        flint.ctx.prec, flint.ctx.cap = old
    (a, b), (c, d) = proof.region
    if c != 0 and d != 0:
        inside = a < 0 < b and c < 0 < d
        assert total + (proof.zeros if inside else 0) == proof.count
        return proof.count
    return total
