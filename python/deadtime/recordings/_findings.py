"""What a check finds in a recording, and the columns that the checks read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import ControlLoop, P

#: Whether a fit can proceed: as if nothing were, with care, or not at all.
Severity: TypeAlias = Literal["note", "warning", "refused"]


@dataclass(frozen=True)
class Finding:
    """One thing that a check has found in a recording.

    Attributes
    ----------
    code : str
        Short name, such as ``"rows_lost"``.
    severity : {"note", "warning", "refused"}
        A note has no effect that this recording could show, a warning has the effect that is
        stated, and with a refused one no estimate would be right.
    message : str
        What was found, with its numbers, and what to do.
    effect : str
        What it would do to an estimate of the delay.
    shift : float
        By up to how much it may move the delay, s; infinite where that is not known.
    share : float
        The same as a share of the delay.
    """

    code: str
    severity: Severity
    message: str
    effect: str = ""
    shift: float = 0.0
    share: float = 0.0

    def __str__(self) -> str:
        return f"{self.severity}: {self.message}" + (
            f". Effect: {self.effect}" if self.effect else ""
        )


class Columns(NamedTuple):
    """The columns of a recording, each of shape (n,); the command may be missing.

    `sent` has the times, shape (m,), at which commands changed that have their own.
    """

    time: Array
    reference: Array
    output: Array
    command: Array | None
    sent: Array | None = None

    def commands(self, loop: ControlLoop) -> Array | None:
        """The command of each row: logged, or that of a P controller; None if unknown."""
        if self.command is not None:
            return self.command
        if not isinstance(loop.controller, P):
            return None
        limit = np.inf if loop.limit is None else loop.limit
        return np.clip(loop.controller.Kp * (self.reference - self.output), -limit, limit)


def decimal_step(values: Array) -> float:
    """Last decimal place to which values were rounded, such as 0.001; zero if they were not."""
    few = values[:: max(1, values.size // 1000)]
    for places in range(8):
        for some in (few, values):
            scaled = some * 10.0**places
            if np.any(np.abs(scaled - np.rint(scaled)) > 1e-6):
                break
        else:
            return float(10.0**-places)
    return 0.0


def seconds(time: float, digits: int = 4) -> str:
    """A time with a unit that suits its size."""
    scale, unit = (1.0, "s") if abs(time) >= 0.9995 else (1e3, "ms")
    if abs(time) < 0.9995e-3:
        scale, unit = 1e6, "µs"
    return f"{time * scale:.{digits}g} {unit}"
