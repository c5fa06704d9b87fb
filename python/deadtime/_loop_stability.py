"""Characteristic function, poles and stable ranges of a control loop, its limit left out.

A continuous loop with plant b/a and feedback f/g has the characteristic function
a g + b f e^(-s Td); a sampled one the eigenvalues z of its transition matrix, poles s = ln(z)/Ts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig
from scipy.optimize import brentq

from deadtime._controllers import Controller
from deadtime._deadtime import sampled_abscissa_grid
from deadtime._loop_model import LoopModel, refuse_discretised
from deadtime._plants import Plant
from deadtime._quasipolynomial import delay, s
from deadtime._rootset import RootSet
from deadtime._transfer import TransferFunction

__all__ = [
    "characteristic",
    "closed_loop",
    "open_loop",
    "sampled_abscissa",
    "sampled_grid",
    "sampled_roots",
    "stable_end",
    "stable_range",
]

# Numbers of a loop that cannot be negative, those of them that may be zero, and those that keep
# their sign because the loop has no meaning at zero.
_NON_NEGATIVE = frozenset({"delay", "lag", "sample_time", "omega", "damping"})
_MAY_BE_ZERO = frozenset({"delay", "lag"})
_KEEPS_SIGN = frozenset({"time_constant"})

# The walk away from the present value: first step, growth from step to step, how far it goes and
# what counts as zero on the way down; lengths as parts of the value.
_FIRST_STEP = 1.0 / 64.0
_GROWTH = 1.2
_FARTHEST = 1e3
_NEARLY_ZERO = 1e-6


def characteristic(plant: Plant, controller: Controller, values: Mapping[str, Any]) -> Any:
    """Build a g + b f e^(-s delay) from numbers or symbols in `values`."""
    b, a = plant._polynomials(values)
    f, g = controller._feedback(values)
    return _in_s(a) * _in_s(g) + _in_s(b) * _in_s(f) * delay(values["delay"])


def open_loop(
    plant: Plant, controller: Controller, values: Mapping[str, float]
) -> TransferFunction:
    """Build b f e^(-s delay) / (a g)."""
    b, a = plant._polynomials(values)
    f, g = controller._feedback(values)
    return TransferFunction(_in_s(b) * _in_s(f) * delay(values["delay"]), _in_s(a) * _in_s(g))


def closed_loop(
    plant: Plant, controller: Controller, values: Mapping[str, float], late: bool
) -> TransferFunction:
    """Build b r [e^(-s delay)] / (a g + b f e^(-s delay)) with the controller's R = r/g."""
    b, _ = plant._polynomials(values)
    r, _ = controller._reference(values)
    num = _in_s(b) * _in_s(r)
    if late:
        num = num * delay(values["delay"])
    return TransferFunction(num, characteristic(plant, controller, values))


def _in_s(coefficients: Sequence[Any]) -> Any:
    """Polynomial in s from descending coefficients, numbers or symbols."""
    total: Any = 0.0 * s
    for power, c in enumerate(reversed(coefficients)):
        if not (isinstance(c, float) and c == 0.0):
            total = total + c * s**power
    return total


def sampled_abscissa(model: LoopModel, delay: float, sample_time: float) -> float:
    """Return ln(rho)/Ts with rho the largest modulus of the loop's eigenvalues."""
    return float(model.native(delay, sample_time).poles()[0].real)


def sampled_roots(matrix: NDArray[np.float64], sample_time: float, n: int) -> RootSet:
    """Return the `n` rightmost poles and their mirror images, with first-order error bounds."""
    z, left, right = cast(Any, eig)(matrix, left=True, right=True)
    # |dz| <= ||error|| / |y* x| with the backward error of the QR algorithm.
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    error = len(matrix) * np.finfo(float).eps * np.linalg.norm(matrix)
    with np.errstate(divide="ignore", invalid="ignore"):
        poles = np.log(z.astype(np.complex128)) / sample_time
        radii = error / (overlap * np.abs(z) * sample_time)
    order = np.lexsort((-z.imag, np.abs(poles.imag), -poles.real))
    # A pole and its mirror image are neighbours, the upper one first: keep n uppers.
    order = order[np.cumsum(z[order].imag >= 0.0) <= n]
    roots, radii = poles[order], radii[order]
    with np.errstate(invalid="ignore"):  # z = 0 is a pole at minus infinity, never resolved
        gaps = np.abs(roots[:, None] - poles[None, :])
    gaps[np.arange(len(order)), order] = np.inf
    furthest = float(roots.real.min())
    return RootSet(
        roots,
        np.ones(len(roots), dtype=np.int64),
        radii,
        radii < 0.5 * gaps.min(axis=1),
        len(roots),
        ((furthest, np.inf), (-np.pi / sample_time, np.pi / sample_time)),
    )


def stable_range(
    abscissa: Callable[[float], float], name: str, value: float, nearest: float, farthest: float
) -> tuple[float, float]:
    """Walk from `value` both ways to the first sign change of `abscissa`.

    The walk ends at `farthest`, and on the way down to zero at `nearest`.
    """
    if not abscissa(value) < 0.0:
        raise ValueError(
            f"the loop is not stable at {name}={value}: start from a stable one, for example with "
            "lower gains"
        )
    down = stable_end(abscissa, name, value, -1.0, nearest, farthest)
    return down, stable_end(abscissa, name, value, 1.0, nearest, farthest)


def stable_end(
    abscissa: Callable[[float], float],
    name: str,
    value: float,
    direction: float,
    nearest: float,
    farthest: float,
) -> float:
    """Walk from a stable `value` one way, as `stable_range` does."""
    size = abs(value) if value != 0.0 else 1.0
    stops_at_zero = name in _NON_NEGATIVE or (name in _KEEPS_SIGN and value > 0.0)
    inside, step = value, _FIRST_STEP * size
    while abs(inside - value) < _FARTHEST * size:
        outside = inside + direction * step
        if stops_at_zero and direction < 0.0:
            outside = max(outside, 0.5 * inside)
            if outside < max(nearest, _NEARLY_ZERO * size):
                if name not in _MAY_BE_ZERO or abscissa(0.0) < 0.0:
                    return 0.0
                return _refine(abscissa, inside, 0.0)
        if outside > farthest:
            break
        if not abscissa(outside) < 0.0:
            return _refine(abscissa, inside, outside)
        inside, step = outside, step * _GROWTH
    return direction * np.inf


def _refine(abscissa: Callable[[float], float], inside: float, outside: float) -> float:
    """Zero of `abscissa` between a stable and an unstable value."""
    if abscissa(outside) == 0.0:
        return outside
    size = max(abs(inside), abs(outside))
    zero = float(brentq(abscissa, inside, outside, xtol=1e-13 * size, rtol=1e-14, maxiter=200))
    return 0.0 if abs(zero) < 1e-12 * size else zero


def sampled_grid(
    plant: Plant,
    controller: Controller,
    values: Mapping[str, ArrayLike],
    decay: float = 0.0,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]:
    """Abscissa, number of poles outside exp(-decay Ts) and status of loops of one structure.

    `values` names every number of the loop; each is one for all cells or an array with one entry
    a cell. The feedback is linear in the controller's gains and the plant's input in its gain, so
    these, the delay and the sample time vary inside one native call; every distinct combination
    of the other numbers makes a call of its own.
    """
    refuse_discretised(controller, 1.0, "a map")
    arrays = {name: np.atleast_1d(np.asarray(v, dtype=np.float64)) for name, v in values.items()}
    cells = max(len(array) for array in arrays.values())
    inside = (*controller._gains(), "gain", "delay", "sample_time")
    outside = [name for name, array in arrays.items() if name not in inside and len(array) > 1]
    groups: list[Any] = [slice(None)]
    if outside:
        columns = np.column_stack([np.broadcast_to(arrays[name], cells) for name in outside])
        _, place = np.unique(columns, axis=0, return_inverse=True)
        order = np.argsort(place.ravel(), kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(place.ravel()[order])) + 1)

    abscissa = np.empty(cells)
    unstable = np.empty(cells, dtype=np.int32)
    status = np.empty(cells, dtype=np.uint8)
    done = 0
    for group in groups:
        part = {name: a if len(a) == 1 else a[group] for name, a in arrays.items()}
        size = cells if isinstance(group, slice) else len(group)
        report = None if progress is None else lambda n, done=done: progress(done + n)
        abscissa[group], unstable[group], status[group] = _grid_of_gains(
            plant, controller, part, size, decay, threads, report
        )
        done += size
    return abscissa, unstable, status


def _grid_of_gains(
    plant: Plant,
    controller: Controller,
    arrays: Mapping[str, NDArray[np.float64]],
    cells: int,
    decay: float,
    threads: int | None,
    progress: Callable[[int], object] | None,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]:
    """Like `sampled_grid`, where only gains, delay and sample time vary."""
    fixed = {name: float(array[0]) for name, array in arrays.items()} | {"gain": 1.0}
    gains = controller._gains()
    feedback: Any = 0.0
    direct: Any = 0.0
    for name in gains:
        alone = fixed | dict.fromkeys(gains, 0.0) | {name: 1.0}
        model = LoopModel.build(plant, controller, alone)
        feedback = feedback + arrays[name][:, None] * model.K
        direct = direct + arrays[name] * model.L
    scale = arrays["gain"] if "gain" in arrays else np.ones(1)
    return sampled_abscissa_grid(
        cells,
        len(model.B),
        np.ascontiguousarray(model.A),
        model.B,
        feedback,
        direct * scale,
        scale,
        arrays["delay"],
        arrays["sample_time"],
        decay,
        threads,
        progress,
    )
