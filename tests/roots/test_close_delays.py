"""Neutral equations with almost equal delays.

The truth is the argument principle on a function without cancellation: for delays tau + d with a
tiny d the moments sum b_j d_j^i are summed in fractions, and e^(-sd) is its Taylor series.
"""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from deadtime import QuasiPolynomial, delay, s

ORDER = 14


class Truth:
    """A function with close delays, in groups."""

    def __init__(self, rows, delays):
        groups = []
        for row, tau in zip(rows, delays, strict=True):
            if not groups or tau - groups[-1][0] > 2e-3 * delays[-1]:
                groups.append((tau, []))
            groups[-1][1].append((row, tau))
        self.groups = [(base, self._moments(base, members)) for base, members in groups]

    @staticmethod
    def _moments(base, members):
        width = len(members[0][0])
        return [
            [
                float(
                    sum(
                        Fraction(float(row[k])) * (Fraction(base) - Fraction(tau)) ** i
                        for row, tau in members
                    )
                    / math.factorial(i)
                )
                for k in range(width)
            ]
            for i in range(ORDER)
        ]

    def __call__(self, z):
        total = 0.0
        for base, moments in self.groups:
            row = sum(np.polyval(m[::-1], z) * z**i for i, m in enumerate(moments))
            total = total + row * np.exp(-base * z)
        return total

    def roots_in(self, re, im):
        (a, b), (c, d) = re, im
        corners = [complex(a, c), complex(b, c), complex(b, d), complex(a, d), complex(a, c)]
        turned = 0.0
        for start, end in pairwise(corners):
            z = start + (end - start) * np.linspace(0.0, 1.0, 2001)
            for _ in range(40):
                value = self(z)
                steps = np.angle(value[1:] / value[:-1])
                wide = np.abs(steps) > 0.3
                if not wide.any():
                    break
                z = np.insert(z, np.flatnonzero(wide) + 1, 0.5 * (z[:-1] + z[1:])[wide])
            turned += steps.sum()
        return round(turned / (2.0 * np.pi))


def close_case(rng):
    """Rows of the size 1/d whose differences cancel, delays 1e-12 to 1e-3 apart."""
    n = int(rng.integers(1, 4))
    tau = float(rng.choice([0.36, 1.0, 1.344, 3.0]) * rng.uniform(0.5, 1.5))
    second = tau + tau * 10.0 ** rng.uniform(-12, -3)
    first = np.append(3.0 * rng.normal(size=n), 1.0)
    q, r = rng.normal(size=(2, n + 1))
    q[n], r[n] = rng.uniform(0.05, 0.6), -rng.uniform(0.02, 0.3)
    large = np.append(rng.normal(size=n), 0.0) * 10.0 ** rng.uniform(-2, 0.5) / (second - tau)
    return [first, q + large, r - large], [0.0, tau, second]


# Answers, not refusals, which take some seconds each.
SEEDS = [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("strong", [True, False])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_abscissa_is_never_below_a_root_that_can_be_found(seed, strong):
    # The search gave up after three lines and took the chains, far left, for the answer.
    rows, delays = close_case(np.random.default_rng(seed))
    h = QuasiPolynomial(rows, delays)
    try:
        abscissa = h.spectral_abscissa(strong=strong)
    except ValueError:
        return
    height = min(60.0, 0.3 / (delays[2] - delays[1]))
    right = (abscissa + 1e-6 * max(1.0, abs(abscissa)), max(abscissa, 0.0) + 60.0)
    assert Truth(rows, delays).roots_in(right, (-height, height)) == 0


def test_the_rightmost_root_is_found_where_close_delays_cancel():
    d = 7e-9
    g = 0.1 / d
    h = s**2 - 0.75 * s - 1 + (0.3 * s**2 + 0.3 * g * s - 0.2 * g) * delay(1.344)
    h += (-0.28 * s**2 - 0.3 * g * s + 0.2 * g) * delay(1.344 + d)
    assert h.spectral_abscissa() == pytest.approx(1.437930577, abs=1e-8)
    assert h.spectral_abscissa(strong=False) == h.spectral_abscissa()
    assert len(h.rightmost()) == 1
    assert h.count(re=(0, None)) == 1


def test_an_empty_set_says_that_a_line_beside_the_chains_was_counted():
    h = s * (1 + 0.5 * delay(1.0)) + 1.0 - 0.2 * delay(1.0)
    for candidate in (h, s * (1 - 0.9 * delay(2.0)) + 3.0 - 2.7 * delay(2.0)):
        found = candidate.rightmost()
        distance = found.region[0][0] - candidate.chain_abscissa()
        assert len(found) or distance <= 1e-3 / candidate.delays[-1]


def test_what_lies_between_a_line_and_the_chains_is_not_passed_over():
    # Roots with |Im s| of about 1e8 may lie there: the claim was the abscissa of the chains.
    d = 7e-9
    g = 0.05 / d
    h = s + 5.0 + (0.3 * s + g) * delay(1.344) - (0.28 * s + g) * delay(1.344 + d)
    with pytest.raises(ValueError, match="could not be counted"):
        h.spectral_abscissa()
