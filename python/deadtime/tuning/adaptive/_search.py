"""Search for a quadratic form by semidefinite programming.

P is looked for with c P - A'PA >= margin P for all cases, and P >= (f_least Kp/limit)^2 c'c, so
that v'Pv <= 1 bounds z. Its value at a unit step from rest is made smallest: the step that is
proved becomes largest. The cases are added as the form of fewer turns out to need them. What is
found is a candidate: rounding and tolerances are left to the check of the proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import CertificateError, MissingExtraError
from deadtime.tuning.adaptive._check import check
from deadtime.tuning.adaptive._claims import Claims
from deadtime.tuning.adaptive._switched import Case, SwitchedLoop, switched_loop

Array = NDArray[np.float64]

#: Shares of P by which a form decreases more than it has to: larger ones bear more rounding, and
#: leave out loops that are stable by little.
_MARGINS = (1e-5, 1e-4, 1e-3)

#: Most rounds in which cases are added, and most cases added in one.
_ROUNDS, _ADDED = 40, 12

#: A candidate is a little larger than the solver's, which meets its bounds: share, and the number
#: of steps into which the step is rounded down.
_LARGER, _DIGITS = 1e-6, 1e-9

#: Smallest eigenvalue of P, in the units of the bounds: a smaller one permits worse conditioned
#: forms.
_LEAST = 1e-5


def proved(claims: Claims) -> Claims | None:
    """The claims with a form that proves them and the largest step found; None without one."""
    loop = switched_loop(claims)
    for margin in _MARGINS:
        form = _form(loop, margin)
        if form is None:
            return None  # a larger margin is asked for no more easily
        found = _with_form(claims, loop, form)
        try:
            check(found)
        except CertificateError:
            continue
        return found
    return None


def _with_form(claims: Claims, loop: SwitchedLoop, form: Array) -> Claims:
    """The candidate: scaled so that v'Pv <= 1 bounds the command, with its step."""
    if claims.limit is not None:
        form = (1.0 + _LARGER) * (claims.least_factor * claims.Kp / claims.limit) ** 2 * form
    energy = float(loop.stepped @ form @ loop.stepped)
    step = float(np.floor((1.0 - _LARGER) / np.sqrt(energy) / _DIGITS) * _DIGITS)
    form = 0.5 * (form + form.T)
    return replace(claims, form=tuple(map(tuple, form.tolist())), step=step)


def _form(loop: SwitchedLoop, margin: float) -> Array | None:
    """A form for all cases, in units in which it is at least z^2."""
    matrices = np.array([case.matrix for case in loop.cases])
    kept = np.array([case.kept for case in loop.cases])
    chosen = list(range(0, len(loop.cases), max(1, len(loop.cases) // _ADDED)))
    for _ in range(_ROUNDS):
        form = _solved(loop, [loop.cases[i] for i in chosen], margin)
        if form is None:
            return None
        excess = _excesses(form, matrices, kept)
        if excess is None:
            return None
        worst = [int(i) for i in np.argsort(-excess)[:_ADDED] if excess[i] > -0.5 * margin]
        added = [i for i in worst if i not in chosen]
        if not added:
            return form
        chosen += added
    return None


def _excesses(form: Array, matrices: Array, kept: Array) -> Array | None:
    """The largest v'A'PAv / (c v'Pv) - 1 of each case; None where P is not positive definite."""
    try:
        lower = np.linalg.cholesky(form)
    except np.linalg.LinAlgError:
        return None
    moved = lower.T @ matrices @ np.linalg.inv(lower.T)
    return np.asarray(np.linalg.norm(moved, 2, axis=(1, 2)) ** 2 / kept - 1.0)


def _solved(loop: SwitchedLoop, cases: Sequence[Case], margin: float) -> Array | None:
    """The form with the smallest value at the step."""
    solver = _solver()
    from scipy import sparse

    size = len(loop.signal)
    upper = np.array([(i, j) for j in range(size) for i in range(j + 1)])
    rows, columns = upper.T
    # The columns of a triangle hold sqrt(2) times its entries off the diagonal.
    weight = np.where(rows == columns, 1.0, np.sqrt(2.0))
    units = np.zeros((len(upper), size, size))
    places = np.arange(len(upper))
    units[places, rows, columns] = units[places, columns, rows] = 1.0

    def triangle(matrices: Array) -> Array:
        return np.asarray(matrices[..., rows, columns] * weight)

    blocks, right = [], []
    for case in cases:
        after = case.matrix.T @ units @ case.matrix
        blocks.append(-triangle(case.kept * (1.0 - margin) * units - after).T)
        right.append(np.zeros(len(upper)))
    least = np.outer(loop.signal, loop.signal) + _LEAST * np.eye(size)
    blocks.append(-triangle(units).T)
    right.append(-triangle(least))
    cost = triangle(np.outer(loop.stepped, loop.stepped)) * weight
    settings = solver.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.chordal_decomposition_enable = False
    found = solver.DefaultSolver(
        sparse.csc_matrix((len(upper), len(upper))),
        cost,
        sparse.csc_matrix(np.vstack(blocks)),
        np.concatenate(right),
        [solver.PSDTriangleConeT(size)] * len(blocks),
        settings,
    ).solve()
    if "Infeasible" in str(found.status):
        return None
    return np.asarray(np.tensordot(found.x, units, axes=1))


def _solver() -> Any:
    try:
        import clarabel  # type: ignore[import, unused-ignore]
    except ImportError as error:
        raise MissingExtraError(
            "the proof for changing delays needs clarabel, which is not installed. This "
            "command installs it: pip install 'deadtime[adapt]'"
        ) from error
    return clarabel
