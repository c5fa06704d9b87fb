"""Whether the command of a recording follows the output.

In a loop the sensor noise is in the output and, through the controller, in the command: methods
that take the one for the cause of the other then find relations that go the other way round.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deadtime.recordings import Recording

__all__ = ["FEEDBACK", "feedback_p_value"]

Array = NDArray[np.float64]

#: Below this p-value the command follows the output.
FEEDBACK = 1e-3

#: Samples of the past that the test looks at.
PAST = 2


def feedback_p_value(recording: Recording) -> float:
    """How often a command that is not made from the output would look so much as if it were.

    An F test of Granger's (1969) kind: does the output, to `PAST` samples back, help to predict the
    command beyond what reference and past commands do?
    """
    from scipy import special

    command = recording.command
    if command is None:  # computed from the output, then
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
