"""Open a bag by its first bytes; the folder of a bag of ROS 2 by the file that describes it."""

from __future__ import annotations

import os
from pathlib import Path

from deadtime._base.errors import RecordingError
from deadtime.logs.bags._bag import Bag
from deadtime.recordings import HEAD, format_of, opened

#: The file in the folder of a bag of ROS 2.
DESCRIPTION = "metadata.yaml"


def _is_folder(path: Path) -> bool:
    return path.is_dir() and (path / DESCRIPTION).is_file()


def is_bag(path: str | os.PathLike[str]) -> bool:
    """Whether a file or a folder is a bag, whatever is in it.

    Raises
    ------
    RecordingError
        When it cannot be read.
    """
    path = Path(path)
    if path.is_dir():
        return _is_folder(path)
    with opened(path) as stream:
        head = stream.read(HEAD)
    try:
        return format_of(path, head, "open_bag") is not None
    except RecordingError:  # it is something else
        return False


def open_bag(path: str | os.PathLike[str]) -> Bag:
    """Open a bag of messages and list its topics, fields and rates.

    Parameters
    ----------
    path : path-like
        An MCAP file (messages of ROS 2 or in JSON), a ``.bag`` of ROS 1, or a bag of ROS 2: its
        folder or its ``.db3``.

    Returns
    -------
    Bag
        Its topics, and `Bag.recording` for the recording of any two fields.

    Raises
    ------
    RecordingError
        When it cannot be read, is no bag, or is too damaged.
    MissingExtraError
        When the library that reads it is not installed; the message holds the line that installs
        it.

    Examples
    --------
    >>> import deadtime.logs, tempfile, pathlib, json
    >>> from mcap.writer import Writer
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "drive.mcap"
    >>> with path.open("wb") as stream:
    ...     log = Writer(stream)
    ...     log.start()
    ...     number = log.register_channel("/speed", "json", schema_id=0)
    ...     for k in range(20):
    ...         at, row = k * 50_000_000, json.dumps({"asked": float(k > 5), "value": float(k > 7)})
    ...         log.add_message(number, at, row.encode(), at)
    ...     log.finish()
    >>> bag = deadtime.logs.open_bag(path)
    >>> bag.topics["/speed"].fields
    ('asked', 'value')
    >>> len(bag.recording("/speed:asked", "/speed:value"))
    20
    """
    from deadtime.logs.bags._mcap import read_mcap
    from deadtime.logs.bags._ros import read_ros

    path = Path(path)
    if _is_folder(path):
        return read_ros(path, "ROS 2 bag")
    if path.is_dir():
        raise RecordingError(
            f"{path} is a folder without the file {DESCRIPTION}, so it is not a bag of ROS 2"
        )
    with opened(path) as stream:
        head = stream.read(HEAD)
    form = format_of(path, head, "open_bag")
    if form is None:
        raise RecordingError(
            f"{path} is not a bag. Only MCAP files and bags of ROS 1 and ROS 2 can be read"
        )
    return read_mcap(path) if form == "MCAP" else read_ros(path, form)
