"""Runs of a loop: their arguments as they were given, and as the stepper takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, increasing, real_array


class LoopRun(NamedTuple):
    """Where a run starts, and its reference, as the stepper takes them."""

    state: Array
    #: Before the start.
    command: float
    reference_before: float = 0.0
    #: A number, to which the reference steps at the start, or values that hold from their times on.
    reference: float | Array = 0.0
    reference_time: Array | None = None
    #: Commands at the samples before the start, the latest one last.
    command_history: Array | None = None
    sample_phase: float = 0.0
    #: Jumps of inputs: times since the start, which inputs, and to what.
    kicks: tuple[Array, list[int], Array] | None = None


class RunArguments(NamedTuple):
    """The arguments of `ControlLoop.simulate`, as they were given."""

    time: ArrayLike
    reference: Any
    initial_output: float = 0.0
    reference_before: float | None = None
    reference_time: ArrayLike | None = None
    command_history: ArrayLike = ()
    sample_phase: float = 0.0
    sensitivities: Sequence[str] = ()
    #: Inputs besides a held reference, None where there is none.
    inputs: Mapping[str, Any] = MappingProxyType({})
    seed: Any = 0

    def rest(self) -> tuple[float, float]:
        """Output and reference before the start."""
        initial = finite("initial_output", self.initial_output)
        if self.reference_before is None:
            return initial, initial
        return initial, finite("reference_before", self.reference_before)


class ReferenceJumps(NamedTuple):
    """A reference that holds `values` from `times` on, and `before` until the first of them."""

    times: Array
    values: Array
    before: float

    def at(self, times: Array) -> Array:
        place = np.searchsorted(self.times, times, side="right")
        return np.concatenate([[self.before], self.values])[place]

    def just_before(self, time: float) -> float:
        """The value from which it jumps, if it does, at `time`."""
        return float(self.at(np.array([np.nextafter(time, -np.inf)]))[0])


def reference_jumps(
    times: Array, reference: ArrayLike, reference_time: ArrayLike | None, before: float
) -> ReferenceJumps:
    """The reference as jumps: one number steps at the first of `times`."""
    values = real_array("reference", reference)
    if values.ndim == 0:
        if reference_time is not None:
            raise ValueError(
                f"reference={values} is one number, which needs no reference_time: give an "
                "array with one value for each time, or leave reference_time out"
            )
        return ReferenceJumps(times[:1], values.reshape(1), before)
    where = times if reference_time is None else increasing("reference_time", reference_time)
    if values.shape != where.shape or values.size == 0:
        raise ValueError(
            f"reference has shape {values.shape}, and its times have shape {where.shape}: give "
            "one value for each entry of reference_time, or of time if reference_time is left "
            "out"
        )
    return ReferenceJumps(where, values, before)
