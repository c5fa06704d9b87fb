"""The matrices of a loop whose delay and gains change, in floats, for the search of a form."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import discretised, realise
from deadtime.tuning.adaptive._claims import Claims

Array = NDArray[np.float64]


class Case(NamedTuple):
    """A transition matrix A, and the c for which A'PA <= c P is asked."""

    matrix: Array
    kept: float


@dataclass(frozen=True, eq=False)
class SwitchedLoop:
    """The loop of `Claims`: its matrices, the row of z, and the state after a step from rest."""

    cases: list[Case]
    signal: Array
    stepped: Array


def switched_loop(claims: Claims) -> SwitchedLoop:
    """Make the matrices that a form has to decrease for."""
    from scipy.linalg import expm

    space = realise(claims.num, claims.den)
    n, period = len(space.B), claims.sample_time
    held = np.zeros((n + 1, n + 1))
    held[:n, :n], held[:n, n] = space.A, space.B
    after = expm(period * held)
    transition, shares = after[:n, :n], [after[:n, n]]
    if n == 2:
        # Q is first * B: G(Ts) = first * B + last * (transition B).
        tangents = np.stack([space.B, transition @ space.B], axis=1)
        first = float(np.linalg.solve(tangents, shares[0])[0]) * space.B
        shares = [first, shares[0] - first]

    now = n + (0 if claims.filter is None else 2)
    size = now + max(last for _, last in claims.ages)
    signal, stepped, common = np.zeros(size), np.zeros(size), np.zeros((size, size))
    common[:n, :n] = transition
    signal[0] = stepped[0] = 1.0
    if n == 2:
        stepped[1] = -space.A[0, 0]
    if claims.filter is not None:
        omega, damping, rule = claims.filter
        F = np.array([[0.0, omega], [-omega, -2.0 * damping * omega]])
        into = np.array([0.0, omega])
        smooth = discretised(F, into, into, period, rule)
        common[n:now, 0], common[n:now, n:now] = smooth.G, smooth.F
        signal[0] += claims.Kv / claims.Kp * smooth.D
        signal[n:now] = claims.Kv / claims.Kp * smooth.C
        stepped[n] = 1.0
    elif claims.Kv:
        signal[:n] += claims.Kv / claims.Kp * space.A[0]
    if size > now:
        common[now] = signal
        common[now + 1 :, now:-1] = np.eye(size - now - 1)
    seen = np.vstack([signal, np.eye(size)[now:]])

    cases = []
    everyday = min(claims.factors)
    kept = float(np.exp(-2.0 * claims.decay * period))
    for least, most_kept in {(everyday, kept), (claims.least_factor, 1.0)}:
        if least == everyday and most_kept > kept:
            continue
        ends = _gains(claims, least)
        for chain in combinations_with_replacement(sorted(ends), len(shares)):
            ages = sorted(set(chain))
            for gains in product(*(ends[age] for age in ages)):
                gain_at = dict(zip(ages, gains, strict=True))
                matrix = common.copy()
                for age, share in zip(chain, shares, strict=True):
                    matrix[:n] -= gain_at[age] * np.outer(share, seen[age])
                cases.append(Case(matrix, most_kept))
    return SwitchedLoop(cases, signal, stepped)


def _gains(claims: Claims, least: float) -> dict[int, tuple[float, float]]:
    """Smallest and largest loop gain of the commands of each age."""
    low, high = sorted(claims.gain, key=abs)
    largest: dict[int, float] = {}
    for factor, (first, last) in zip(claims.factors, claims.ages, strict=True):
        for age in range(first, last + 1):
            largest[age] = max(largest.get(age, 0.0), factor)
    return {
        age: (low * least * claims.Kp, high * factor * claims.Kp) for age, factor in largest.items()
    }
