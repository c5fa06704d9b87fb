"""What the rules on logging and flying look at: the loops of a log, and how well it shows them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from deadtime.logs._log import Log, LogLoop
from deadtime.logs.latencies._promise import Promise

#: Rows a second from which the time of each kind of loop is hardly limited by them, Hz.
ENOUGH = {"rate": 250.0, "attitude": 100.0, "velocity": 20.0, "position": 20.0}

#: Standard error that is asked for, as a share of the time.
WANTED = 0.05


class Facts(NamedTuple):
    """What the rules look at."""

    log: Log
    loops: list[LogLoop]
    promises: Mapping[str, Promise]

    @property
    def settings(self) -> Mapping[str, float]:
        """The parameters of the log."""
        return self.log.parameters

    @property
    def plane(self) -> bool:
        """Whether it is a fixed wing."""
        return "Plane" in f"{self.log.vehicle} {self.log.firmware}"

    @property
    def version(self) -> tuple[int, int]:
        """First two numbers of the firmware, zero if it has none."""
        found = re.search(r"(\d+)\.(\d+)", self.log.firmware)
        return (int(found[1]), int(found[2])) if found else (0, 0)

    def lacks(self, name: str, bits: int) -> bool:
        """Whether a parameter is known and has none of these bits."""
        return name in self.settings and not int(self.settings[name]) & bits

    @property
    def is_slow(self) -> bool:
        """Whether a loop is logged at fewer rows than its kind needs."""
        return any(
            min(loop.setpoint.rate, loop.response.rate) < 0.9 * ENOUGH[loop.kind]
            for loop in self.loops
            if loop.kind in ("rate", "attitude")
        )

    def worst(self, *names: str) -> LogLoop | None:
        """The followed loop, of these or of all, that is known worst, if not well enough.

        One whose time is badly determined comes before one without a time.
        """
        known = [
            (loop, share_of(self.promises[loop.name]))
            for loop in self.loops
            if loop.name in self.promises and (not names or loop.name in names)
        ]
        poor = [(loop, share) for loop, share in known if share > WANTED]
        return max(poor, key=lambda pair: (math.isfinite(pair[1]), pair[1]))[0] if poor else None


def share_of(promise: Promise) -> float:
    """Standard error of a time as a share of it."""
    if not math.isfinite(promise.stderr):
        return math.inf
    return promise.stderr / max(promise.time, 1e-9)
