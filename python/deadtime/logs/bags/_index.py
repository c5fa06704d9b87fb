"""What one pass through a bag tells of its topics."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from deadtime.logs.bags._bag import NANOSECOND, BagTopic, Message, sound
from deadtime.logs.bags._fields import numbers_in, stamp_of

#: Messages of a topic that are decoded for one that can be.
TRIES = 5

#: Times of so many messages tell the rate of a topic.
ENOUGH = 10_000


class Index:
    """The topics, from the messages in their order."""

    def __init__(self) -> None:
        self._types: dict[str, str] = {}
        self._counts: dict[str, int] = {}
        self._times: dict[str, array[int]] = {}
        self._samples: dict[str, Any] = {}
        self.ends: tuple[int, int] | None = None

    def fill(self, messages: Iterator[Message], type_of: Callable[[str], str]) -> None:
        """Count the messages, and decode one of each topic."""
        for topic, received, decode in sound(messages):
            count = self._counts.get(topic, 0)
            self._counts[topic] = count + 1
            if count == 0:
                self._types[topic], self._times[topic] = type_of(topic), array("q")
            if count < ENOUGH:
                self._times[topic].append(received)
            low, high = self.ends or (received, received)
            self.ends = min(low, received), max(high, received)
            if topic not in self._samples and count < TRIES:
                try:
                    self._samples[topic] = decode()
                except Exception:  # damaged, or of an encoding that is not known
                    continue

    @property
    def undecoded(self) -> list[str]:
        """Topics of which no message could be decoded."""
        return [topic for topic in self._counts if topic not in self._samples]

    def topics(self) -> list[BagTopic]:
        """All topics of which a message was decoded."""
        found = []
        for name, sample in self._samples.items():
            time = np.array(self._times[name], dtype=float) * NANOSECOND
            period = float(np.median(np.diff(np.sort(time)))) if time.size > 1 else np.inf
            rate = 1.0 / period if period > 0.0 else 0.0
            fields, header = tuple(numbers_in(sample)), stamp_of(sample) is not None
            kind, count = self._types[name], self._counts[name]
            found.append(BagTopic(name, kind, count, rate, fields, header))
        return found

    def remarks(self) -> list[str]:
        """A sentence about topics that cannot be decoded."""
        if not self.undecoded:
            return []
        return [f"not decoded, because their encoding is not known: {', '.join(self.undecoded)}"]
