"""One recording or several, each with its loop and its window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from deadtime._base.ranges import OpenRange, is_range, open_interval
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

__all__ = ["Flights", "FlownOnce", "Window", "each_flight"]

#: One recording, or several of the same vehicle.
Flights: TypeAlias = Recording | Sequence[Recording]

#: The part to use, s: one for all recordings, or a list with one for each.
Window: TypeAlias = OpenRange | list[OpenRange | None] | None


@dataclass(frozen=True)
class FlownOnce:
    """One recording, the loop that made it, and the part to use."""

    recording: Recording
    loop: ControlLoop
    window: OpenRange | None


def each_flight(
    recording: Flights, loop: ControlLoop | Sequence[ControlLoop], window: Window
) -> list[FlownOnce]:
    """Pair recordings with loops and windows; what is given once holds for all."""
    recordings = list(recording) if isinstance(recording, (list, tuple)) else [recording]
    if not recordings:
        raise ValueError("no recording was given: give one, or a list of them")
    number = len(recordings)
    loops = list(loop) if isinstance(loop, (list, tuple)) else [loop] * number
    one_for_all = window is None or (is_range(window) and len(window) == 2)
    windows: list[Any] = [window] * number if one_for_all else list(window or ())
    for name, given in (("loop", loops), ("window", windows)):
        if len(given) != number:
            raise ValueError(
                f"{number} recordings and {len(given)} of `{name}`: give one for all, or one each"
            )
    flights = []
    for index, (one, its_loop, ends) in enumerate(zip(recordings, loops, windows, strict=True)):
        if not isinstance(one, Recording):
            raise TypeError(f"recording {index} is a {type(one).__name__}, not a Recording")
        if not isinstance(its_loop, ControlLoop):
            raise TypeError(f"loop {index} is a {type(its_loop).__name__}, not a ControlLoop")
        open_interval("window", ends)
        flights.append(FlownOnce(one, its_loop, ends))
    plants = {type(flight.loop.plant).__name__ for flight in flights}
    if len(plants) > 1:
        raise ValueError(
            f"the recordings are of different plants ({', '.join(sorted(plants))}): they are to be "
            "of one vehicle"
        )
    return flights
