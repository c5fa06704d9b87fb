"""What a vehicle reports again and again, believed once messages agree.

A single message may be forged, sent twice, or come a second late: heartbeats have no time, and
their sequence numbers begin anew every 256 messages.
"""

from __future__ import annotations

import math
from typing import Generic, TypeVar

T = TypeVar("T")

#: Messages in a row that have to agree before a value is believed.
AGREEING = 2

#: Messages in a row, and the time from the first to the last of them, s, that make sure of it: no
#: three messages do.
SURE, SURE_AFTER = 4, 1.0


class Belief(Generic[T]):
    """A value that a vehicle reports.

    Attributes
    ----------
    value : object or None
        What was last said by `AGREEING` messages in a row.
    newest : object or None
        What the newest message said.
    heard : float
        Arrival of that, s.

    Examples
    --------
    >>> armed = Belief()
    >>> for second, said in enumerate([True, True, False, True, True, True, True]):
    ...     armed.take(said, float(second))
    >>> armed.value, armed.is_sure(True), armed.is_sure(False)
    (True, True, False)
    """

    def __init__(self) -> None:
        self.value: T | None = None
        self.newest: T | None = None
        self.heard = -math.inf
        self._first = math.inf
        self._count = 0

    def take(self, said: T, time: float) -> None:
        """Take what a message says that arrived at a time, s."""
        if self._count == 0 or said != self.newest:
            self.newest, self._first, self._count = said, time, 0
        self._count += 1
        self.heard = time
        if self._count >= AGREEING:
            self.value = said

    def is_sure(self, value: T) -> bool:
        """Whether so many newest messages, over such a time, all say this value."""
        long_enough = self._count >= SURE and self.heard - self._first >= SURE_AFTER
        return self.newest == value and long_enough
