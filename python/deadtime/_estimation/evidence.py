"""What a fit can determine: which numbers are free, which the data part, how uncertain each is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deadtime._errors import NotIdentifiableError
from deadtime._loop import ControlLoop

__all__ = [
    "FREE_NAMES",
    "check_distinguishable",
    "checked_names",
    "embedded",
    "standard_errors",
]

Array = NDArray[np.float64]

#: Ratio of singular values of the scaled Jacobian below which data do not tell two numbers apart:
#: rounding in difference quotients is at about 1e-8.
INDISTINGUISHABLE = 1e-6

#: What fits can determine, in the order they report.
FREE_NAMES = ("delay", "gain", "lag")


def checked_names(free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
    """Return the names of what is to be fitted, or raise where this loop has no such number."""
    if isinstance(free, str):
        free = (free,)
    unknown = [name for name in free if name not in FREE_NAMES]
    if unknown or not free:
        raise ValueError(f"free={tuple(free)!r}: choose from {FREE_NAMES}, at least one")
    missing = [name for name in free if name != "delay" and name not in loop.parameters]
    if missing:
        raise ValueError(
            f"the plant {loop.plant!r} has no {missing[0]} to fit: use an Integrator or a "
            "FirstOrder, or leave it out of `free`"
        )
    if "delay" not in free and loop.delay is None:
        raise ValueError("the delay of the loop is unknown, so it has to be among `free`")
    return tuple(name for name in FREE_NAMES if name in free)


def check_distinguishable(jacobian: Array, names: list[str]) -> None:
    """Refuse numbers that the recording does not part, by name."""
    norms = np.linalg.norm(jacobian, axis=0)
    if not np.all(np.isfinite(norms)) or np.any(norms == 0.0):
        blind = [name for name, norm in zip(names, norms, strict=True) if not norm > 0.0]
        raise NotIdentifiableError(
            f"the recording does not depend on the {' or '.join(blind) or 'parameters'}: the "
            "window holds no response to a step, or the command is at its limit throughout"
        )
    _, singular, directions = np.linalg.svd(jacobian / norms)
    if singular[-1] < INDISTINGUISHABLE * singular[0]:
        weights = np.abs(directions[-1])
        mixed = [name for name, weight in zip(names, weights, strict=True) if weight > 0.2]
        raise NotIdentifiableError(
            f"{' and '.join(mixed)} cannot be told apart by this recording: fix one of them, or "
            "record a step that is not at the limit throughout"
        )


def embedded(cov: Array, loose: list[int], size: int) -> Array:
    """Covariance of all parameters: what stands at its bound has none of its own."""
    full = np.zeros((size, size))
    full[np.ix_(loose, loose)] = cov
    return full


def standard_errors(names: tuple[str, ...], cov: Array) -> dict[str, float]:
    """Standard errors of `names`, and of ``delay+lag`` where the delay is among them."""
    errors = {name: float(np.sqrt(cov[i, i])) for i, name in enumerate(names)}
    if "delay" in names:
        total = np.array([1.0 if name in ("delay", "lag") else 0.0 for name in names])
        count = len(names)
        errors["delay+lag"] = float(np.sqrt(total @ cov[:count, :count] @ total))
    return errors
