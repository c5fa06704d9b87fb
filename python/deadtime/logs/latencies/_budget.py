"""Where in the vehicle the time goes, for one axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import NOT_CLAIMED, Verdict, claimed
from deadtime.logs._log import Log
from deadtime.logs.latencies._filters import FilterDelay
from deadtime.logs.latencies._relation import LoopLatency


@dataclass(frozen=True)
class Stage:
    """A part of the time from setpoint to response.

    Attributes
    ----------
    name : str
        What takes it.
    time : float
        s.
    stderr : float
        Its standard error, s; zero for what is computed.
    source : str
        The parameter it is computed from, or the loop it was estimated in.
    verdict : {"reliable", "indication"}
        That on the estimate it comes from; ``"reliable"`` for what is computed.
    part : bool
        Whether it is a part of the stage before.
    """

    name: str
    time: float
    stderr: float
    source: str
    verdict: Verdict = "reliable"
    part: bool = False

    def line(self) -> str:
        """The stage in one line."""
        indent = "  " if self.part else ""
        return f"{indent}{self.name}: {self.shown()} ({self.source})"

    def shown(self) -> str:
        """The time, with its error where that is claimed to hold."""
        time = claimed(self.verdict, self.time, self.stderr, "s")
        return time if self.verdict == "reliable" else f"{time}, {NOT_CLAIMED}"

    def to_dict(self) -> dict[str, Any]:
        """The stage as plain values for JSON."""
        return plain_fields(vars(self))


def stages_of(
    log: Log, loop: str, relations: list[LoopLatency], filters: tuple[FilterDelay, ...]
) -> tuple[Stage, ...]:
    """The stages of one loop that the log tells about.

    From setpoint to response the loop is closed, and this is no sum of what follows. From what the
    controller commands to the response it is: filters are computed, and the rest is that
    of actuators and airframe.
    """
    own = {fit.command: fit for fit in relations if fit.loop == loop and fit.verdict != "none"}
    stages = []
    if "setpoint" in own:
        stages.append(_measured(own["setpoint"], "setpoint to response, with the loop closed"))
    if "actuator" not in own:
        return tuple(stages)
    vehicle = own["actuator"]
    whole = _measured(vehicle, "controller's command to response")
    stages.append(whole)
    if vehicle.kind != "rate":
        return tuple(stages)
    known = [part for part in filters if part.path == "response"]
    stages += [Stage(part.name, part.delay, 0.0, part.source, part=True) for part in known]
    computed = math.fsum(stage.time for stage in stages if stage.part)
    if computed > 0.0:
        rest = whole.time - computed
        stages.append(
            Stage(
                "motors, airframe and the rest", rest, whole.stderr,
                "what is left", whole.verdict if rest >= 0.0 else "indication", part=True,
            )
        )  # fmt: skip
    return tuple(stages)


def _measured(loop: LoopLatency, name: str) -> Stage:
    start, stop = loop.windows[0]
    where = f"estimated from {start:.1f} to {stop:.1f} s"
    if len(loop.windows) > 1:
        more = len(loop.windows) - 1
        where += f" and {more} more window{'s' if more > 1 else ''}"
    return Stage(name, loop.time, loop.stderr, where, loop.verdict)
