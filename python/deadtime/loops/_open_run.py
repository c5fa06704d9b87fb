"""Response of a plant without a controller to a logged command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime.loops._model import LoopModel, LoopRun
from deadtime.loops._plants import Plant, realise, rest

Vector = NDArray[np.float64]


def open_response(
    plant: Plant, values: Mapping[str, Any], times: Vector, command_time: Vector, command: Vector
) -> Vector:
    """Output of a plant under a held command, exact to rounding.

    Parameters
    ----------
    plant : Plant
    values : mapping of str to float
        Its numbers.
    times : ndarray, shape (n,)
        Output times in s, increasing.
    command_time, command : ndarray, shape (m,)
        From when each command holds, s, increasing. A plant that comes to rest under a constant
        command rests under the first one; one that integrates is at zero until then.

    Returns
    -------
    ndarray, shape (n,)
    """
    num, den = plant._polynomials(values)
    model = realise(num, den)
    n = len(model.B)
    none = np.zeros(n)
    open_loop = LoopModel(model.A, model.B, none, none, 0.0, 1.0, model.C, model.D, 0.0)
    state, before = np.zeros(n), 0.0
    if den[-1] != 0.0:
        before = float(command[0])
        state, _ = rest(num, den, before * num[-1] / den[-1])
    # The run begins where the earlier of the two clocks does.
    start = float(min(times[0], command_time[0]))
    clock = np.concatenate([[start], times]) if times[0] > start else times
    run = LoopRun(state, before, before, command, command_time)
    outputs = open_loop.native(0.0).respond(clock, run, False).outputs
    return np.asarray(outputs[clock.size - times.size :])
