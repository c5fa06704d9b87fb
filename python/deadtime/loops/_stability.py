"""Poles of a sampled loop, and stable ranges of the numbers of any loop, limit left out.

A sampled loop has the poles s = ln(z)/Ts, z the eigenvalues of its transition matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

import deadtime.loops._native as native
from deadtime.loops._controllers import Controller
from deadtime.loops._factored_plant import PAIR
from deadtime.loops._model import LoopModel
from deadtime.loops._specification import refuse_discretised
from deadtime.loops._native import sampled_abscissa_grid
from deadtime.loops._parametric_plant import ParametricPlant
from deadtime.loops._plants import Plant
from deadtime.roots import Parameter, QuasiPolynomial, RootSet

#: Numbers of a loop that cannot be negative.
_NON_NEGATIVE = frozenset({"delay", "lag", "sample_time", "omega", "damping"}) | {
    f"lag_{i}" for i in range(1, 10)
}
#: Numbers that keep their sign, since the loop has no meaning at zero.
_KEEPS_SIGN = frozenset({"time_constant", *PAIR})
#: Numbers of a filter.
_OF_FILTER = frozenset({"omega", "damping"})


#: Changes of a number, relative to it, for which the loop is compared to find whether it depends on
#: the number: any two that are not special values.
_CHANGES = (0.37, 0.71)


def sampled_abscissa(model: LoopModel, delay: float, sample_time: float) -> float:
    """Return ln(rho)/Ts with rho the largest modulus of the loop's eigenvalues."""
    native = model.native(delay, sample_time)
    found = native.abscissa()
    return float(native.poles()[0].real) if found is None else found


def sampled_is_stable(model: LoopModel, delay: float, sample_time: float) -> bool:
    """Whether all poles of a sampled loop are inside the unit circle, by a proved count.

    Raises
    ------
    ValueError
        If a pole is nearer to the circle than the rounding of the transition matrix.
    """
    native = model.native(delay, sample_time)
    number = native.unstable_poles()
    if number is not None:
        return number == 0
    z, errors = _eigenvalues(_balanced(native.balanced_matrix()))
    sizes = np.abs(z)
    if (sizes + errors < 1.0).all():
        return True
    # Without feedback a pole at z = 1 is an integrator of the plant, and stays there.
    is_open = not model.K.any() and model.L == 0.0
    if (sizes - errors > 1.0).any() or (is_open and (z == 1.0).any()):
        return False
    nearest = int(np.argmax(sizes))
    raise ValueError(
        f"a pole at abs(z)={sizes[nearest]:.15g}, known to {errors[nearest]:.1e}, is as near to "
        "the unit circle as rounding: whether this loop is stable is beyond double precision; "
        "change a gain, or take a sample_time nearer to the time constants of the loop"
    )


def _balanced(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix in units that make its norm small, each command in its own."""
    from scipy.linalg import matrix_balance

    with np.errstate(invalid="ignore"):  # units beyond integers, read as places as well
        return np.asarray(matrix_balance(matrix, permute=False)[0], dtype=np.float64)


def _rounding(matrix: NDArray[np.float64]) -> float:
    """Backward error of the QR algorithm."""
    return float(len(matrix) * np.finfo(float).eps * np.linalg.norm(matrix))


def _eigenvalues(
    matrix: NDArray[np.float64],
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Eigenvalues and first-order bounds on their errors."""
    from scipy.linalg import eig

    z, left, right = cast(Any, eig)(matrix, left=True, right=True)
    # |dz| <= ||error|| / |y* x|.
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return z.astype(np.complex128), _rounding(matrix) / overlap


def sampled_roots(matrix: NDArray[np.float64], sample_time: float, n: int) -> RootSet:
    """Return the `n` rightmost poles and their mirror images, with first-order error bounds.

    A pole at z = 0, which is gone after a sample, is none in s.
    """
    z, errors = _eigenvalues(_balanced(matrix))
    z, errors = z[z != 0.0], errors[z != 0.0]
    with np.errstate(divide="ignore", invalid="ignore"):
        poles = np.asarray(np.log(z) / sample_time, dtype=np.complex128)
        radii = errors / (np.abs(z) * sample_time)
    order = np.lexsort((-z.imag, np.abs(poles.imag), -poles.real))
    # A pole and its mirror image are neighbours, the upper one first: keep n uppers.
    order = order[np.cumsum(z[order].imag >= 0.0) <= n]
    roots, radii = poles[order], radii[order]
    gaps = np.abs(roots[:, None] - poles[None, :])
    gaps[np.arange(len(order)), order] = np.inf
    furthest = float(roots.real.min()) if len(roots) else -np.inf
    return RootSet(
        roots,
        np.ones(len(roots), dtype=np.int64),
        radii,
        radii < 0.5 * gaps.min(axis=1, initial=np.inf),
        len(roots),
        ((furthest, np.inf), (-np.pi / sample_time, np.pi / sample_time)),
    )


def continuous_range(
    plant: Plant, controller: Controller, values: Mapping[str, float], name: str
) -> tuple[float, float]:
    """Stable values of one number of a continuous loop, around its present one."""
    value = values[name]
    if name == "delay":
        return native.delay_range(family._family, value)
    if name in _OF_FILTER:
        seek = native.damping_range if name == "damping" else native.corner_range
        return seek(family._family, value, _highest_crossing(plant, controller, values))
    return native.gain_range(family._family, value, _bounds(plant, name, value))


def _highest_crossing(plant: Plant, controller: Controller, values: Mapping[str, float]) -> float:
    """A frequency beyond which the loop gain is below one; infinite where there is none.

    Whatever the corner of its filter is, and for all dampings from the present one on.
    """
    b, a = plant._polynomials(values)
    terms, damping = controller._terms(values), values["damping"]
    # The least modulus of x^2 + 2 damping x + 1 where Re x >= 0.
    least = 1.0 if damping >= math.sqrt(0.5) else 2.0 * damping * math.sqrt(1.0 - damping * damping)
    feedback = [abs(terms.derivative) / least, abs(terms.proportional), abs(terms.integral)]
    gain = np.polymul(np.abs(b), feedback)[::-1]
    rest = np.append(0.0, np.asarray(a, dtype=np.float64)[::-1])
    return native.end_of_gain(
        QuasiPolynomial([gain], [0.0])._native, QuasiPolynomial([rest], [0.0])._native, 1.0
    )


def sampled_range(
    plant: Plant, controller: Controller, values: Mapping[str, float], name: str
) -> tuple[float, float]:
    """Stable values of one number of a sampled loop, around its present one."""
    value, bounds = values[name], _bounds(plant, name, values[name])

    def loop(**changed: float) -> native.LinearLoop:
        given = {**values, **changed}
        model = LoopModel.build(plant, controller, given)
        return model.native(given["delay"], given["sample_time"])

    def at(changed: float) -> native.LinearLoop:
        return loop(**{name: changed})

    if name == "delay":
        return at(value).held_delay_range()
    gains = controller._gains()
    if name == "gain" or name in gains:
        # The feedback is linear in the gains of the controller times the gain of the plant.
        total = {gain: values[gain] * (values["gain"] if name != "gain" else 1.0) for gain in gains}
        none = dict.fromkeys(gains, 0.0)
        own = total if name == "gain" else {**none, name: values["gain"]}
        rest = none if name == "gain" else {**total, name: 0.0}
        return loop(gain=1.0, **rest).held_gain_range(loop(gain=1.0, **own), value, bounds)
    if name != "sample_time" and _is_idle(plant, controller, values, name):
        return bounds
    return native.LinearLoop.held_range(at, name, value, bounds)


def _is_idle(plant: Plant, controller: Controller, values: Mapping[str, float], name: str) -> bool:
    """Whether the stability of a loop does not depend on a number."""
    value = values[name]
    size = abs(value) if value != 0.0 else 1.0
    here, *others = (
        LoopModel.build(plant, controller, {**values, name: value + part * size})
        for part in (0.0, *_CHANGES)
    )

    def same(one: Any, other: Any, matrices: tuple[str, ...]) -> bool:
        return all(
            np.array_equal(getattr(one, matrix), getattr(other, matrix)) for matrix in matrices
        )

    return all(
        same(here, other, ("A", "B", "K", "L"))
        and (here.update is None or same(here.update, other.update, ("states", "command")))
        for other in others
    )


def _bounds(plant: Plant, name: str, value: float) -> tuple[float, float]:
    """Between what a number can be."""
    keeps_sign = _keeps_sign(plant, name) and value != 0.0
    if keeps_sign and value < 0.0:
        return -math.inf, 0.0
    return (0.0 if name in _NON_NEGATIVE or keeps_sign else -math.inf), math.inf


def _keeps_sign(plant: Plant, name: str) -> bool:
    """Whether a number of a loop with this plant keeps its sign."""
    return name in _KEEPS_SIGN or (isinstance(plant, ParametricPlant) and name in plant.numbers)


class SampledLoops(NamedTuple):
    """Loops of one structure: every array holds one entry for all of them, or one a loop."""

    cells: int
    states: int
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    K: NDArray[np.float64]
    L: NDArray[np.float64]
    #: Factor on B.
    gain: NDArray[np.float64]
    delay: NDArray[np.float64]
    sample_time: NDArray[np.float64]


class SampledCells(NamedTuple):
    """What is known of the poles of each of many loops."""

    abscissa: NDArray[np.float64]
    unstable: NDArray[np.int32]
    status: NDArray[np.uint8]


def sampled_grid(
    plant: Plant,
    controller: Controller,
    values: Mapping[str, ArrayLike],
    decay: float = 0.0,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> SampledCells:
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
        found = _grid_of_gains(plant, controller, part, size, decay, threads, report)
        abscissa[group], unstable[group] = found.abscissa, found.unstable
        status[group] = found.status
        done += size
    return SampledCells(abscissa, unstable, status)


def _grid_of_gains(
    plant: Plant,
    controller: Controller,
    arrays: Mapping[str, NDArray[np.float64]],
    cells: int,
    decay: float,
    threads: int | None,
    progress: Callable[[int], object] | None,
) -> native.SampledCells:
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
    gain = arrays["gain"] if "gain" in arrays else np.ones(1)
    loops = SampledLoops(
        cells=cells,
        states=len(model.B),
        A=model.A,
        B=model.B,
        K=feedback,
        L=direct * gain,
        gain=gain,
        delay=arrays["delay"],
        sample_time=arrays["sample_time"],
    )
    return sampled_abscissa_grid(loops, decay=decay, threads=threads, progress=progress)
