"""Whether a response that is in its settling band at the end of a run stays there.

A response may pass through the band, or leave it slowly after the end of the run. It counts as
settled if it has been inside for three of the slowest time constants of the closed loop,
1/abs(abscissa). To ask the poles of a loop takes longer than its simulation, so they are asked in
two cases only: if the response had not decayed to well within the band, or if a pole or zero of
plant or controller is slow compared with the simulated time. Closed-loop poles are slow close to
these, or close to the stability limit, where the response oscillates. Where the simulated time is
given, a count of the slow poles of a continuous loop is enough; where it is to be found, they are
computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops._control_loop import ControlLoop

#: Time for which a response must have been in its band to count as settled, in slowest time
#: constants of the closed loop: more misjudge fewer responses, and take longer simulations.
TIME_CONSTANTS = 3.0


def _any(values: Any) -> bool:
    """Whether a number, or any of an array, is not zero."""
    return bool(values.any() if isinstance(values, np.ndarray) else values)


def slowest_times(loop: ControlLoop, numbers: Mapping[str, Any]) -> float | Array:
    """Upper bound in s on 1/abs(root) of plant and controller, except for roots at zero.

    1/abs(root) <= 2 max_k abs(c_k/c_0)^(1/k) for c_0 + c_1 s + ... (Fujiwara 1916).
    """
    longest: Any = 0.0
    parts = (*loop.plant._polynomials(numbers), *loop.controller._feedback(numbers))
    for coefficients in parts:
        rising = [abs(c) for c in coefficients[::-1]]
        open_: Any = True
        for low, c in enumerate(rising[:-1]):
            # c_0 is the first coefficient that is not zero: lower powers are roots at zero.
            here = open_ & (c > 0.0)
            for k, other in enumerate(rising[low + 1 :], 1):
                if not (_any(here) and _any(other)):
                    continue
                if here is True:
                    ratio = other / c
                else:
                    ratio = np.where(here, other, 0.0) / np.where(here, c, 1.0)
                longest = np.maximum(longest, 2.0 * ratio ** (1.0 / k))
            open_ = open_ & (c == 0.0)
            if not _any(open_):
                break
    return float(longest) if np.ndim(longest) == 0 else np.asarray(longest)
