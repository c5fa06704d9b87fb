"""Response of a plant without a controller to a logged command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from deadtime._base.arrays import Array
from deadtime.loops._native import held_response
from deadtime.loops._plants import Plant


def open_response(
    plant: Plant, values: Mapping[str, Any], times: Array, command_time: Array, command: Array
) -> Array:
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
    return held_response(num, den, command_time, command, times)
