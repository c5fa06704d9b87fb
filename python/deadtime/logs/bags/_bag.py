"""A bag: its topics with their fields and rates, and the recording of two fields.

A message has up to two times: that in its header, when its values were measured or computed, and
that at which the recorder received it. A delay is the difference of two times, so both have to be
of one kind. Those of the headers are taken where both topics have them and tell of one clock, for
the way to the recorder is not in them; else those of reception, which every message has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError, printable
from deadtime._base.frozen import FrozenDict
from deadtime._base.plain import plain_fields
from deadtime.logs._recording import recording_of
from deadtime.logs._series import Series, increasing
from deadtime.logs.bags._fields import number_at, stamp_of
from deadtime.recordings import Recording

Stamps = Literal["header", "received"]

#: Name of a topic, when it was received, ns, and what decodes it.
Message = tuple[str, int, Callable[[], Any]]

#: Headers whose median age at reception differs by more than this, s, are of two clocks.
ONE_CLOCK = 1.0

#: Seconds of a nanosecond; times are below this many, and damaged ones are left out.
NANOSECOND, LATEST = 1e-9, 1 << 63


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag.

    Attributes
    ----------
    name, type : str
        For example ``"/odom"`` and ``"nav_msgs/msg/Odometry"``.
    count : int
        How many messages it has.
    rate : float
        Messages a second, from the median time between their receptions, Hz.
    fields : tuple of str
        The numbers in its messages, as ``"twist.twist.linear.x"`` or ``"position[0]"``.
    has_header : bool
        Whether its first message has a time in its header.
    """

    name: str
    type: str
    count: int
    rate: float
    fields: tuple[str, ...]
    has_header: bool


@dataclass(frozen=True, eq=False)
class Bag:
    """What a bag holds.

    Attributes
    ----------
    source : str
        Name of the file or folder.
    format : str
        ``"MCAP"``, ``"ROS 1 bag"`` or ``"ROS 2 bag"``.
    start, duration : float
        When the first message was received, s since 1970, and the time to the last one, s.
    topics : dict of str to BagTopic
        By their names.
    remarks : tuple of str
        What was damaged or could not be decoded, in sentences.
    """

    source: str
    format: str
    start: float
    duration: float
    topics: Mapping[str, BagTopic]
    remarks: tuple[str, ...]
    _messages: Callable[[Iterable[str]], Iterator[Message]] = field(repr=False)
    _first: int = field(repr=False)

    def recording(
        self,
        command: str,
        output: str,
        reference: str | None = None,
        *,
        stamps: Stamps | None = None,
    ) -> Recording:
        """How one field follows another, as a recording.

        Parameters
        ----------
        command, output : str
            Topic and field, as ``"/cmd_vel:linear.x"``.
        reference : str, optional
            The set value of a loop around them, if it is logged.
        stamps : {"header", "received"}, optional
            The times that are used for all of them; by default those of the headers, if all topics
            have them and they are of one clock, else those of reception.

        Returns
        -------
        Recording
            With the rows of the output; each command holds from its own time (`Recording.sent`).
            `Recording.source` says which times were used, and why.

        Raises
        ------
        RecordingError
            When a field is not in the bag, with those that are; when headers are asked for and
            missing; when fewer than 8 rows of the output follow a command.
        """
        if stamps not in (None, "header", "received"):
            raise ValueError(f"stamps={stamps!r}: give 'header', 'received' or None")
        named = {"command": command, "output": output}
        if reference is not None:
            named["reference"] = reference
        places = {signal: self._place(name) for signal, name in named.items()}
        rows = self._rows(places)
        used, why = _stamps(rows, places, stamps)
        series = {
            signal: _series(rows[signal], used, self._first, named[signal]) for signal in named
        }
        commands, outputs = series["command"], series["output"]
        for signal, samples in series.items():
            if not len(samples) or not np.isfinite(samples.values).any():
                raise RecordingError(f"{named[signal]} contains no number in {self.source}")
        name = f"{self.source}, {why}"
        return recording_of(name, series.get("reference"), outputs, commands, (None, None))

    def _place(self, name: str) -> tuple[str, str]:
        """Topic and field of a name, or an error with those that exist."""
        topic, colon, path = name.partition(":")
        known = self.topics.get(topic)
        if known is None:
            has = ", ".join(map(printable, self.topics)) or "none"
            raise RecordingError(f"{self.source} has no topic {topic!r}. Its topics are {has}")
        if not colon or path not in known.fields:
            has = ", ".join(map(printable, known.fields)) or "no field that is a number"
            wanted = f"no field {path!r}" if colon else "several fields, so one has to be named"
            raise RecordingError(f"{topic} in {self.source} has {wanted}. Its fields are {has}")
        return topic, path

    def _rows(self, places: Mapping[str, tuple[str, str]]) -> dict[str, _Rows]:
        """Times and values of the fields, decoded in one pass through the bag."""
        found = {signal: _Rows() for signal in places}
        wanted = {topic for topic, _ in places.values()}
        for topic, received, decode in sound(self._messages(wanted)):
            try:
                message = decode()
            except Exception:  # a damaged message, for which each library raises its own
                continue
            stamp = stamp_of(message)
            stamp = None if stamp is None or not 0 <= stamp < LATEST else stamp
            for signal, (name, path) in places.items():
                if name == topic:
                    found[signal].add(received, stamp, number_at(message, path))
        return found

    def summary(self) -> str:
        """The bag in lines of text."""
        lines = [f"{self.source}: {self.format}, {self.duration:.2f} s"]
        for topic in self.topics.values():
            header = ", times in its header" if topic.has_header else ""
            rate = f"{topic.rate:.4g} Hz" if topic.count > 1 else "one message"
            lines.append(
                f"{printable(topic.name)} [{printable(topic.type)}]: {topic.count}, {rate}{header}"
            )
            lines += [f"  {printable(topic.name)}:{printable(path)}" for path in topic.fields]
        return "\n".join([*lines, *self.remarks])

    def to_dict(self) -> dict[str, Any]:
        """The bag as plain values, without its messages."""
        topics = [vars(topic) for topic in self.topics.values()]
        names = ("source", "format", "start", "duration", "remarks")
        found = {name: getattr(self, name) for name in names}
        return plain_fields({**found, "topics": topics})


def sound(messages: Iterable[Message]) -> Iterator[Message]:
    """The messages whose time of reception is one."""
    for message in messages:
        received = message[1]
        if isinstance(received, int) and 0 <= received < LATEST:
            yield message


class _Rows:
    """The messages of a field as they come."""

    def __init__(self) -> None:
        self.received: list[int] = []
        self.stamps: list[int | None] = []
        self.values: list[float] = []

    def add(self, received: int, stamp: int | None, value: float) -> None:
        self.received.append(received)
        self.stamps.append(stamp)
        self.values.append(value)

    @property
    def has_stamps(self) -> bool:
        return bool(self.stamps) and None not in self.stamps

    def age(self) -> float:
        """Median time from the header to reception, s."""
        ages = [got - (sent or 0) for got, sent in zip(self.received, self.stamps, strict=True)]
        return NANOSECOND * float(np.median(np.array(ages, dtype=float)))


def _stamps(
    rows: Mapping[str, _Rows], places: Mapping[str, tuple[str, str]], asked: Stamps | None
) -> tuple[Stamps, str]:
    """Which times are used, and why."""
    without = sorted({places[signal][0] for signal, topic in rows.items() if not topic.has_stamps})
    if without and asked == "header":
        raise RecordingError(
            f"the headers of {', '.join(without)} contain no time, so stamps='header' is not "
            "possible: give stamps='received'"
        )
    if asked is not None:
        return asked, f"by the times {_of(asked)}, as the argument stamps asks"
    if without:
        return "received", (
            f"by the times of reception, because {', '.join(without)} has no other times"
        )
    ages = [topic.age() for topic in rows.values()]
    if max(ages) - min(ages) > ONE_CLOCK:
        return "received", (
            "by the times of reception, because the times in the headers come from different clocks"
        )
    return "header", "by the times in the headers, because all topics have these times"


def _of(stamps: Stamps) -> str:
    return "in the headers" if stamps == "header" else "of reception"


def _series(rows: _Rows, stamps: Stamps, first: int, source: str) -> Series:
    """A field over time, s from the first reception of the bag."""
    times: NDArray[np.int64] = np.array(
        rows.stamps if stamps == "header" else rows.received, dtype=np.int64
    )
    time = NANOSECOND * (times - first).astype(float)
    kept = increasing(time, last=True)
    values: Array = np.array(rows.values, dtype=float)
    return Series(time[kept], values[kept], "", source)


def bag_of(
    source: str,
    form: str,
    topics: Iterable[BagTopic],
    ends: tuple[int, int],
    messages: Callable[[Iterable[str]], Iterator[Message]],
    remarks: Iterable[str],
) -> Bag:
    """A bag of its topics in the order of their names."""
    named = {topic.name: topic for topic in sorted(topics, key=lambda topic: topic.name)}
    if not named:
        raise RecordingError(f"{source} is a {form} without a message that can be read")
    first, last = ends
    start, duration = NANOSECOND * first, NANOSECOND * (last - first)
    shown = tuple(map(printable, remarks))
    return Bag(source, form, start, duration, FrozenDict(named), shown, messages, first)
