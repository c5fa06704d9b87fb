"""Round trip of a link and offset of the two clocks, by TIMESYNC.

A request carries the time ``ts1`` of its sender; the answer returns it together with the time
``tc1`` of the vehicle. Both directions and the time until the vehicle reads its input are in the
round trip. It is the share of the link in the delay of a control loop: what remains is the vehicle.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import fmean, median

#: Time between two requests, s, and the time over which answers count, s.
EVERY, WINDOW = 0.1, 30.0

#: Time after which a request counts as lost, s.
LOST_AFTER = 5.0


@dataclass(frozen=True)
class LinkTime:
    """What the answers of the last `WINDOW` seconds tell.

    Attributes
    ----------
    least, median, mean : float
        Round trip, s.
    answers, lost : int
        Answers, and requests that were not answered, since the link was opened.
    offset : float
        Clock of the vehicle minus `deadtime.links.now`, s, by the fastest answer. It is exact to
        half of the difference of the two directions.
    """

    least: float
    median: float
    mean: float
    answers: int
    lost: int
    offset: float


class TimeSync:
    """Requests and answers of one link; all times are in s.

    Examples
    --------
    >>> sync = TimeSync()
    >>> stamp = sync.request(10.0)
    >>> sync.answered(stamp, 5_130_000_000, 10.26)
    >>> sync.link_time.median, sync.link_time.offset
    (0.26, -5.0)
    """

    def __init__(self) -> None:
        self._asked: dict[int, float] = {}
        self._answers: deque[tuple[float, float, float]] = deque()
        self._count = self._lost = 0

    def request(self, now: float) -> int:
        """The ``ts1`` of the next request, ns."""
        old = [stamp for stamp, asked in self._asked.items() if now - asked > LOST_AFTER]
        for stamp in old:
            del self._asked[stamp]
        self._lost += len(old)
        stamp = round(now * 1e9)
        self._asked[stamp] = now
        return stamp

    def answered(self, ts1: int, tc1: int, now: float) -> None:
        """Take an answer; one that was not asked for, or comes twice, is ignored."""
        asked = self._asked.pop(ts1, None)
        if asked is None or tc1 == 0:
            return
        trip = round(now - asked, 9)
        self._count += 1
        self._answers.append((now, trip, 1e-9 * tc1 - asked - 0.5 * trip))
        while self._answers[0][0] < now - WINDOW:
            self._answers.popleft()

    @property
    def link_time(self) -> LinkTime | None:
        """The result, or None before the first answer."""
        if not self._answers:
            return None
        trips = [trip for _, trip, _ in self._answers]
        offset = min(self._answers, key=lambda answer: answer[1])[2]
        return LinkTime(
            min(trips), median(trips), fmean(trips), self._count, self._lost, round(offset, 9)
        )
