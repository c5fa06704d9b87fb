"""The telemetry link of a tlog: how long messages take, how much that varies, how many are lost.

A message is stamped by the vehicle, v, and by the ground station when it arrives, g. With clocks of
an unknown offset a and rates that differ by b,

    g - v = a + b v + t,    t >= 0 the transport.

The line below all points that is nearest to them on average gives b, and t above its least value
(Moon, Skelly and Towsley 1999, eq. 5); it holds the edge of the lower convex hull over the mean of
v. What all messages take alike is in a. A TIMESYNC request of the ground station comes back with
the same ts1, and half the least round trip is the least transport if both ways take equally long
(RFC 5905, section 8). Packets of one sender are numbered modulo 256: numbers that are missing were
lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.digits import stated
from deadtime._base.plain import plain_fields

#: Fewest messages with both stamps, and the least time that they span, s.
FEWEST, SHORTEST = 50, 2.0

#: Packet numbers begin anew here; a step forward of half of it or more is one back.
NUMBERS = 256


@dataclass(frozen=True)
class Link:
    """The way of the messages from a vehicle to the ground station that logged them.

    Attributes
    ----------
    message : str
        The messages whose stamps tell; those of the vehicle are in whole milliseconds.
    count : int
        How many there are.
    median, quantile_95 : float
        Transport above its least value, s.
    drift : float
        By how much faster the clock of the ground station runs, as a share.
    half_round_trip : float or None
        Half the least round trip of TIMESYNC, s: the least transport, if both ways take equally
        long; None where the log has no such messages.
    round_trips : int
        How many round trips it is the least of.
    received, lost : int
        Packets of the vehicle, by their numbers. Of a pause of 128 packets or more the
        number is not seen.
    """

    message: str
    count: int
    median: float
    quantile_95: float
    drift: float
    half_round_trip: float | None
    round_trips: int
    received: int
    lost: int

    @property
    def loss(self) -> float:
        """Share of the packets that were lost."""
        return self.lost / (self.received + self.lost)

    def summary(self) -> str:
        """The link in a sentence."""
        above = "above the shortest time" if self.half_round_trip is None else "in total"
        least = self.half_round_trip or 0.0
        median, late = (stated(least + time, 0.0, "s") for time in (self.median, self.quantile_95))
        lines = (
            f"link to the ground: {self.message} takes {median} {above} (median), 95 % of the "
            f"messages take at most {late}"
        )
        if self.half_round_trip is None:
            lines += ". Without TIMESYNC the shortest time is not known"
        else:
            half = stated(self.half_round_trip, 0.0, "s")
            lines += f", of which {half} is half of the shortest round trip"
        return (
            f"{lines}. {100.0 * self.loss:.2g} % of {self.received + self.lost} packets are "
            f"lost. The clocks drift by {1e6 * self.drift:.0f} ppm, and this drift is removed"
        )

    def to_dict(self) -> dict[str, Any]:
        """The link as plain values for JSON."""
        return plain_fields({**vars(self), "loss": self.loss})


def transport_of(vehicle: Array, ground: Array) -> tuple[Array, float] | None:
    """Transport of messages above its least value, s, and the drift of the clocks.

    None where there are too few messages for that.
    """
    if vehicle.size < FEWEST or np.ptp(vehicle) < SHORTEST:
        return None
    order = np.lexsort((ground, vehicle))
    v = vehicle[order] - np.mean(vehicle)
    d = ground[order] - ground[order[0]] - v
    first = np.r_[True, np.diff(v) > 0.0]  # the earliest of each stamp
    hull = _lower_hull(v[first].tolist(), d[first].tolist())
    place = next(k for k in range(1, len(hull)) if hull[k][0] >= 0.0)
    (left, low), (right, high) = hull[place - 1], hull[place]
    drift = (high - low) / (right - left)
    return np.asarray(d - low - drift * (v - left)), float(drift)


def _lower_hull(x: Sequence[float], y: Sequence[float]) -> list[tuple[float, float]]:
    """Corners of the lower convex hull of points with increasing x (Andrew 1979)."""
    hull: list[tuple[float, float]] = []
    for point in zip(x, y, strict=True):
        while len(hull) > 1:
            (a, b), (c, d) = hull[-2:]
            if (c - a) * (point[1] - b) > (d - b) * (point[0] - a):
                break
            hull.pop()
        hull.append(point)
    return hull


def half_round_trip(
    asked: tuple[NDArray[np.int64], Array], answered: tuple[NDArray[np.int64], Array]
) -> tuple[float | None, int]:
    """Half the least time from a request to its answer, s, and how many there are.

    Requests and answers are given by their ts1, and when the ground station logged them.
    """
    sent = dict(zip(asked[0].tolist(), asked[1].tolist(), strict=True))
    pairs = zip(answered[0].tolist(), answered[1].tolist(), strict=True)
    trips = [at - sent[number] for number, at in pairs if number in sent]
    trips = [trip for trip in trips if trip > 0.0]
    return (0.5 * min(trips), len(trips)) if trips else (None, 0)


def lost_packets(numbers: NDArray[np.uint8]) -> int:
    """How many packet numbers are missing, in the order of arrival."""
    steps = np.mod(np.diff(numbers.astype(np.int64)) + NUMBERS // 2, NUMBERS) - NUMBERS // 2
    places = np.unique(np.concatenate([[0], np.cumsum(steps)]))
    return int(places[-1] - places[0]) + 1 - int(places.size)
