"""Read bags of ROS 1 and ROS 2 with the library `rosbags`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from deadtime._base.errors import MissingExtraError, RecordingError, printable
from deadtime._base.extras import library
from deadtime.logs.bags._bag import Bag, Message, bag_of
from deadtime.logs.bags._bounded import BoundedPath
from deadtime.logs.bags._index import Index

EXTRA = "'deadtime[logs]'"

#: Names of the file that holds a bag, by its version; the library goes by them.
ENDINGS = {"ROS 1 bag": ".bag", "ROS 2 bag": ".db3"}


class _RosBag:
    """A bag, opened each time that it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path if path.is_dir() else BoundedPath(path)
        self.types: dict[str, str] = {}
        self.damage: Exception | None = None

    def messages(self, wanted: Iterable[str] | None = None) -> Iterator[Message]:
        """The messages of these topics, or all, up to the first damage."""
        self.damage = None
        try:
            yield from self._messages(wanted)
        except MissingExtraError:
            raise
        except Exception as error:  # the library raises what the damage leads to
            self.damage = error

    def _messages(self, wanted: Iterable[str] | None) -> Iterator[Message]:
        highlevel = library("rosbags.highlevel", "reading ROS bags", EXTRA)
        typesys = library("rosbags.typesys", "reading ROS bags", EXTRA)
        # Bags of ROS 2 before Iron hold no definitions; those of common messages are the same.
        common = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        with highlevel.AnyReader([self.path], default_typestore=common) as reader:
            chosen: list[Any] = reader.connections
            if wanted is not None:
                names = set(wanted)
                chosen = [channel for channel in chosen if channel.topic in names]
            if not chosen:
                return
            for channel, received, data in reader.messages(connections=chosen):
                self.types.setdefault(channel.topic, channel.msgtype)
                yield channel.topic, received, partial(reader.deserialize, data, channel.msgtype)


def read_ros(path: str | os.PathLike[str], form: str) -> Bag:
    """The topics of a ROS bag: a file, or the folder of one of ROS 2."""
    file = _RosBag(Path(path))
    if not file.path.is_dir() and file.path.suffix != ENDINGS[form]:
        raise RecordingError(
            f"{path} is a {form}, but its name does not end in {ENDINGS[form]}: rename the file"
        )
    index = Index()
    index.fill(file.messages(), lambda topic: file.types[topic])
    remarks = index.remarks()
    if file.damage is not None:
        if index.ends is None:
            why = printable(f"{type(file.damage).__name__}: {file.damage}")
            raise RecordingError(f"{path} is a damaged {form}, and reading it ended with {why}")
        remarks.append("the bag is cut off or damaged, so it is read only up to this place")
    ends = index.ends or (0, 0)
    return bag_of(file.path.name, form, index.topics(), ends, file.messages, remarks)
