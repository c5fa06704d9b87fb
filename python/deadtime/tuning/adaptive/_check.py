"""Independent check of a `SwitchingProof` in exact arithmetic, without any code that found it.

The loop is made again from its numbers, in numbers between fractions (`_enclosed`). Each inequality
of `_claims` says that a symmetric matrix is positive definite. It is decided on the matrix of the
middles, less a multiple of the identity that is larger than what the radii can change, by the signs
of its leading principal minors (Sylvester), in integers (Bareiss 1968).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, product
from typing import NoReturn

from deadtime._base.errors import CertificateError
from deadtime.roots.certificate import check_types, refusing, scaled, whole
from deadtime.tuning.adaptive._claims import Claims, FilterNumbers
from deadtime.tuning.adaptive._enclosed import DIGITS, Enclosed, exponential_of

Row = list[Enclosed]
Integers = list[list[int]]

#: Most states, and most matrices, of a proof that is checked (bounds the time to some minutes).
MOST_STATES, MOST_MATRICES = 60, 20_000


def check(claims: Claims) -> float:
    """Verify all claims and return the step that they hold for.

    Raises
    ------
    CertificateError
        If a claim is false or not proved; the message names the first one.
    """
    with refusing("proof"):
        check_form(claims)
        _check_numbers(claims)
        return _Checker(claims).step()


def check_form(claims: Claims) -> None:
    """Check the types of all parts, and that all numbers are finite.

    Raises
    ------
    ValueError
        If a part is not valid.
    """
    check_types(claims)
    numbers = [*claims.num, *claims.den, *claims.gain, claims.sample_time, claims.Kp, claims.Kv]
    numbers += [*claims.factors, claims.least_factor, claims.decay, claims.step]
    numbers += [entry for row in claims.form for entry in row]
    numbers += [] if claims.limit is None else [claims.limit]
    numbers += [] if claims.filter is None else claims.filter[:2]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("it contains a number that is not finite")


def _check_numbers(claims: Claims) -> None:
    """Refuse numbers that no proof has."""
    low, high = claims.gain
    if not (low <= high and low * high > 0.0):
        _fail(
            f"its gain of the plant is from {low:g} to {high:g}, but this range must increase "
            "and must not contain zero"
        )
    if not (claims.sample_time > 0.0 and claims.Kp != 0.0):
        _fail(
            f"its sample time is {claims.sample_time:g} s and its Kp {claims.Kp:g}, but the "
            "sample time must be above zero, and Kp must not be zero"
        )
    if not claims.factors or len(claims.factors) != len(claims.ages):
        _fail(f"it has {len(claims.factors)} factors, but {len(claims.ages)} ranges of ages")
    if not 0.0 < claims.least_factor <= min(claims.factors):
        _fail(
            f"its least factor is {claims.least_factor:g}, which is not possible with the "
            f"factors {claims.factors}"
        )
    if claims.limit is None and claims.least_factor != min(claims.factors):
        _fail(
            f"the command has no limit, so its least factor must be {min(claims.factors):g}, the "
            f"smallest of its factors, not {claims.least_factor:g}"
        )
    if claims.limit is not None and claims.limit <= 0.0:
        _fail(f"its limit is {claims.limit:g}, but a limit must be above zero")
    for first, last in claims.ages:
        if not 0 <= first <= last:
            _fail(f"its ages run from {first} to {last}, which is not possible")
    if claims.decay < 0.0 or claims.step < 0.0:
        _fail(
            f"its decay is {claims.decay:g}/s and its step {claims.step:g}, but neither may be "
            "negative"
        )


@dataclass(frozen=True)
class _Plant:
    """Matrix and shares of the command over one sample, and the rows of y and y'."""

    transition: list[Row]
    shares: list[Row]
    output: Row
    slope: Row | None
    rest: Row


class _Checker:
    """The matrices of a proof between fractions, and the claims about them."""

    def __init__(self, claims: Claims) -> None:
        self.claims = claims
        self.plant = _plant(claims)
        self.smooth = None if claims.filter is None else _Filter(claims.filter, claims.sample_time)
        self.now = len(self.plant.output) + (2 if self.smooth else 0)
        self.size = self.now + max(last for _, last in claims.ages)
        if len(claims.form) != self.size or any(len(row) != self.size for row in claims.form):
            _fail(f"its form does not have {self.size} states")
        if self.size > MOST_STATES:
            raise OverflowError(f"its form has {self.size} states, too many to check")
        self.form = [[Fraction(entry) for entry in row] for row in claims.form]
        self.whole, _ = whole(self.form)
        if any(self.form[i][j] != self.form[j][i] for i in range(self.size) for j in range(i)):
            _fail("its form is not symmetric")
        self.signal = self._signal()

    def step(self) -> float:
        """Verify all claims."""
        if not _is_positive(self.whole):
            _fail("its form is not positive definite")
        claims = self.claims
        kept = exponential_of(Enclosed(-2.0 * claims.decay) * Enclosed(claims.sample_time)).low
        everyday = min(claims.factors)
        self._check_matrices(everyday, kept)
        if claims.least_factor < everyday:
            self._check_matrices(claims.least_factor, Fraction(1))
        self._check_reach()
        return claims.step

    def _check_matrices(self, least: float, kept: Fraction) -> None:
        """Verify kept P - A'PA > 0 for all matrices with factors from `least` on."""
        low, high = sorted(self.claims.gain, key=abs)
        ends: dict[int, tuple[Fraction, Fraction]] = {}
        for factor, (first, last) in zip(self.claims.factors, self.claims.ages, strict=True):
            for age in range(first, last + 1):
                before = ends.get(age, (Fraction(0), Fraction(0)))[1]
                largest = max(before, abs(Fraction(high)) * Fraction(factor))
                ends[age] = (abs(Fraction(low)) * Fraction(least), largest)
        sign = 1 if high > 0.0 else -1
        chains = list(combinations_with_replacement(sorted(ends), len(self.plant.shares)))
        if len(chains) * 2 ** len(self.plant.shares) > MOST_MATRICES:
            raise OverflowError(f"it has {len(chains)} orders of commands, too many to check")
        for chain in chains:
            # A command has one factor, also where it is obeyed in both parts of a sample.
            ages = sorted(set(chain))
            for chosen in product((0, 1), repeat=len(ages)):
                loop = {age: sign * ends[age][end] for age, end in zip(ages, chosen, strict=True)}
                matrix = self._matrix([(age, loop[age]) for age in chain])
                if not self._decreases(matrix, kept):
                    gains = ", ".join(
                        f"{float(gain):.4g} at age {age}" for age, gain in loop.items()
                    )
                    _fail(f"with the loop gains {gains}, its form is not proved to decrease")

    def _matrix(self, commands: Sequence[tuple[int, Fraction]]) -> list[Row]:
        """The transition over a sample in which these ages with these gains are obeyed."""
        plant = self.plant
        n = len(plant.output)
        rows = [[Enclosed(0)] * self.size for _ in range(self.size)]
        for i in range(n):
            rows[i][:n] = plant.transition[i]
            for (age, gain), share in zip(commands, plant.shares, strict=True):
                entry = share[i] * Enclosed(-gain * Fraction(self.claims.Kp))
                if age > 0:
                    rows[i][self.now + age - 1] += entry
                    continue
                for j in range(self.now):
                    rows[i][j] += entry * self.signal[j]
        if self.smooth is not None:
            for i in range(2):
                rows[n + i][:n] = [self.smooth.G[i] * coefficient for coefficient in plant.output]
                rows[n + i][n : n + 2] = self.smooth.F[i]
        if self.size > self.now:
            rows[self.now] = list(self.signal)
        for i in range(self.now + 1, self.size):
            rows[i] = self._unit(i - 1)
        return rows

    def _unit(self, place: int) -> Row:
        return [Enclosed(1 if j == place else 0) for j in range(self.size)]

    def _signal(self) -> Row:
        """The row of z = y + (Kv/Kp) y'."""
        claims, plant = self.claims, self.plant
        share = Enclosed(claims.Kv) / Enclosed(claims.Kp)
        row = list(plant.output)
        if self.smooth is not None:
            row = [entry + share * self.smooth.D * entry for entry in row]
            row += [share * entry for entry in self.smooth.C]
        elif claims.Kv != 0.0:
            if plant.slope is None:
                _fail(
                    "the velocity y' is not a state of the plant, and the controller has no filter"
                )
            row = [entry + share * slope for entry, slope in zip(row, plant.slope, strict=True)]
        return row + [Enclosed(0)] * (self.size - len(row))

    def _decreases(self, matrix: list[Row], kept: Fraction) -> bool:
        """Whether kept P - A'PA is positive definite, whatever the radii."""
        size, form = self.size, self.whole
        # A in units of 2^-unit and P as whole numbers, so A'PA is in units of 4^-unit.
        unit = DIGITS + 1
        middle = [[scaled(entry.middle, unit) for entry in row] for row in matrix]
        radius = max(scaled(entry.radius, unit) for row in matrix for entry in row)
        largest = max(abs(entry) for row in middle for entry in row)
        heaviest = max(abs(entry) for row in form for entry in row)
        # Each entry of A'PA sums size^2 products; a row of the change sums `size` such entries.
        change = size**3 * heaviest * radius * (2 * largest + radius)
        used = [[(j, entry) for j, entry in enumerate(row) if entry] for row in middle]
        weighted = [[0] * size for _ in range(size)]  # P A
        for k, row in enumerate(used):
            for j, entry in row:
                for i in range(size):
                    weighted[i][j] += form[i][k] * entry
        share = scaled(kept, 2 * unit)
        result = [[share * entry for entry in row] for row in form]
        for k, row in enumerate(used):
            for i, entry in row:
                for j in range(size):
                    result[i][j] -= entry * weighted[k][j]
        for i in range(size):
            result[i][i] -= change
        return _is_positive(result)

    def _check_reach(self) -> None:
        """Verify that v'Pv <= 1 bounds z, and that it contains the step."""
        claims = self.claims
        if claims.limit is not None:
            most = Fraction(claims.least_factor) * Fraction(claims.Kp) / Fraction(claims.limit)
            bound = [
                [
                    entry - most * most * (a * b).middle
                    for entry, b in zip(row, self.signal, strict=True)
                ]
                for row, a in zip(self.form, self.signal, strict=True)
            ]
            radius = max((a * b).radius for a in self.signal for b in self.signal)
            for i in range(self.size):
                bound[i][i] -= most * most * radius * self.size
            if not _is_positive(whole(bound)[0]):
                _fail("the quadratic form of the proof does not bound the command")
        start = list(self.plant.rest)
        start += [Enclosed(1), Enclosed(0)] if self.smooth is not None else []
        energy = Enclosed(0)
        for i, a in enumerate(start):
            for j, b in enumerate(start):
                energy = energy + a * b * Enclosed(self.form[i][j])
        if energy.high * Fraction(claims.step) ** 2 > 1:
            _fail(f"a step of {claims.step:g} can leave the level set of its form")


def _plant(claims: Claims) -> _Plant:
    """The plant over a sample, of the loop gain one: see `_claims`."""
    num, den = list(claims.num), list(claims.den)
    if len(den) not in (2, 3) or den[0] == 0.0 or den[-1] != 0.0 or den[-2] == 0.0:
        _fail(f"the denominator is {den}, but the plant must be an integrator with at most one lag")
    if not 1 <= len(num) < len(den) or num[-1] == 0.0:
        _fail(f"the numerator is {num}, which is not possible")
    unity, zero, period = Enclosed(1), Enclosed(0), Enclosed(claims.sample_time)
    if len(den) == 2:
        drive = Enclosed(num[0]) / Enclosed(den[0])
        return _Plant([[unity]], [[drive * period]], [unity], None, [unity])
    lead = Enclosed(den[0])
    a, b0 = Enclosed(den[1]) / lead, Enclosed(num[-1]) / lead
    b1 = Enclosed(num[0]) / lead if len(num) == 2 else zero
    faded = exponential_of(zero - a * period)
    slow = (unity - faded) / a
    # The velocity of G at both ends, and G after a sample.
    ending = faded * b1 + slow * b0
    reached = b1 * slow + b0 * (period - slow) / a
    later = (reached - period * b1) / (ending - b1)
    first = period - later
    if first.low <= 0 or later.low <= 0:
        _fail("the tangents at the ends of the plant's response meet outside of the response")
    return _Plant(
        transition=[[faded, slow], [zero, unity]],
        shares=[[first * b1, first * b0], [later * ending, later * b0]],
        output=[unity, zero],
        slope=[zero - a, unity] if len(num) == 1 else None,
        rest=[unity, a],
    )


class _Filter:
    """w^2 s / (s^2 + 2 d w s + w^2) on samples, with the states of y and of y'/w.

    With s for (z - 1)/(Ts (h z + 1 - h)), h = 1/2 (Tustin) or 1 (backward), and J = (1 - h Ts A)^-1
    for the A of the continuous filter.
    """

    def __init__(self, numbers: FilterNumbers, sample_time: float) -> None:
        omega, damping, rule = numbers
        if rule not in ("tustin", "backward") or omega <= 0.0 or damping <= 0.0:
            raise ValueError(
                f"a filter of {omega:g} rad/s with damping {damping:g} by the rule {rule!r} is "
                "not possible"
            )
        weight = Fraction(1, 2) if rule == "tustin" else Fraction(1)
        w = Fraction(omega)
        x = Fraction(sample_time) * w  # Ts w
        a, b = weight * x, 2 * weight * x * Fraction(damping)
        # J = [[1 + b, a], [-a, 1]] / det
        det = 1 + b + a * a
        inverse = [[(1 + b) / det, a / det], [-a / det, 1 / det]]
        rest = (1 - weight) / weight if weight < 1 else Fraction(0)
        right = [[Fraction(1), rest * a], [-rest * a, 1 - rest * b]]
        self.F = [
            [Enclosed(sum(inverse[i][k] * right[k][j] for k in range(2))) for j in range(2)]
            for i in range(2)
        ]
        G = [inverse[i][1] * x for i in range(2)]
        self.G = [Enclosed(coefficient) for coefficient in G]
        self.C = [Enclosed(w * inverse[1][j]) for j in range(2)]
        self.D = Enclosed(weight * w * G[1])


def _is_positive(matrix: Integers) -> bool:
    """Whether a symmetric matrix is positive definite: all leading principal minors are."""
    rows = [list(row) for row in matrix]
    before = 1
    for k, pivot_row in enumerate(rows):
        pivot = pivot_row[k]
        if pivot <= 0:
            return False
        # Each pivot is a minor; the entries on and above the diagonal are enough.
        for i in range(k + 1, len(rows)):
            row, factor = rows[i], pivot_row[i]
            for j in range(i, len(rows)):
                row[j] = (pivot * row[j] - factor * pivot_row[j]) // before
        before = pivot
    return True


def _fail(message: str) -> NoReturn:
    raise CertificateError(f"the proof is false: {message}")
