"""Whether the command of a recording follows the output.

In a closed loop the sensor noise is in the output and, through the controller, in the command.
Methods that assume that the command causes the output then also find the effect of the output on
the command.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deadtime.recordings import Recording

__all__ = ["FEEDBACK", "feedback_p_value"]

Array = NDArray[np.float64]

#: The command is taken to follow the output below this p-value.
FEEDBACK = 1e-3

#: Past samples in the test.
PAST = 2


def feedback_p_value(recording: Recording) -> float:
    """P-value of the test that the command does not depend on the output.

    A Granger (1969) F test: whether the output, up to `PAST` samples back, improves the prediction
    of the command by the reference and past commands.
    """
    from scipy import special

    command = recording.command
    if command is None:  # it is then computed from the output
        return 0.0
    rows = np.arange(PAST, command.size)

    def back(values: Array, first: int) -> list[Array]:
        return [values[rows - lag] for lag in range(first, PAST + 1)]

    plain = [np.ones(rows.size), *back(command, 1), *back(recording.reference, 0)]
    full = [*plain, *back(recording.output, 0)]
    left, ranks = [], []
    for columns in (plain, full):
        matrix = np.stack(columns, axis=1)
        weights, _, rank, _ = np.linalg.lstsq(matrix, command[rows], rcond=1e-10)
        left.append(float(np.sum((command[rows] - matrix @ weights) ** 2)))
        ranks.append(int(rank))
    more, freedom = ranks[1] - ranks[0], rows.size - ranks[1]
    floor = 1e-20 * float(np.sum((command - command.mean()) ** 2))
    if more < 1 or freedom < 1 or left[0] <= floor:
        return 1.0
    ratio = (left[0] - left[1]) / more / (max(left[1], floor) / freedom)
    return float(special.fdtrc(more, freedom, max(ratio, 0.0)))
