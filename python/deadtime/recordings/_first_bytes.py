"""The format of a file by its first bytes; a name may say anything."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from io import FileIO
from typing import Literal

from deadtime._base.errors import RecordingError

Opener = Literal["read_recording", "open_log", "open_bag"]

#: So many bytes tell the format.
HEAD = 8192

#: Most bytes that are read of a file, a pipe or a device, and how many at once of the last two.
LARGEST_FILE, PIECE = 1_000_000_000, 1 << 20

#: A line of a DataFlash log in text form, which defines a message; lines before it may be damaged.
_FMT = re.compile(rb"^FMT, *\d+, *\d+, *\w+, *\w+,", re.MULTILINE)

#: The text that a clone without Git LFS has in place of each large file.
LFS, LFS_WHAT = (
    b"version https://git-lfs.github.com/spec/",
    ("a Git LFS pointer instead of the file itself"),
)

_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")


def _starts(*first: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(first)


def _is_tlog(head: bytes) -> bool:
    """A tlog has no mark: the time of the ground station, 8 bytes of µs, is before each packet."""
    return head[:1] == b"\0" and head[8:9] in (b"\xfe", b"\xfd")


def _is_dataflash_text(head: bytes) -> bool:
    return _FMT.search(head) is not None


def _is_crazyflie(head: bytes) -> bool:
    """The version follows the mark; in a text in Latin-1, a letter does."""
    return head[:1] == b"\xbc" and head[1:2] < b"\x08"


def _is_text(head: bytes) -> bool:
    return head.startswith((b"\xff\xfe", b"\xfe\xff")) or not _CONTROL.search(head)


@dataclass(frozen=True)
class Kind:
    """What a file may be: how it begins, what opens it, or else what to do with it."""

    name: str
    what: str
    begins: Callable[[bytes], bool]
    opener: Opener | None
    advice: str = ""


def _kinds() -> list[Kind]:
    tables = (
        ("gzip", "packed by gzip", _starts(b"\x1f\x8b")),
        ("Parquet", "a Parquet table", _starts(b"PAR1")),
        ("Arrow", "an Arrow table", _starts(b"ARROW1\0\0")),
        ("Arrow stream", "an Arrow table", _starts(b"\xff\xff\xff\xff")),
        ("MAT v5", "a MAT file", _starts(b"MATLAB 5.0 MAT-file")),
        ("MAT v7.3", "a MAT file", _starts(b"MATLAB 7.3 MAT-file")),
    )
    logs = (
        ("ULog", "a ULog file of PX4", _starts(b"ULog\x01\x12\x35")),
        ("DataFlash", "a DataFlash log of ArduPilot or PX4", _starts(b"\xa3\x95")),
        ("Blackbox", "a Blackbox log of Betaflight or INAV", _starts(b"H Product:Blackbox")),
        ("Crazyflie uSD", "a log of a Crazyflie's memory card", _is_crazyflie),
        ("DataFlash text", "a DataFlash log of ArduPilot in text form", _is_dataflash_text),
        ("tlog", "a MAVLink log of a ground station (tlog)", _is_tlog),
    )
    bags = (
        ("MCAP", "an MCAP file", _starts(b"\x89MCAP0\r\n")),
        ("ROS 1 bag", "a ROS bag", _starts(b"#ROSBAG V")),
        ("ROS 2 bag", "an SQLite database, like a bag of ROS 2", _starts(b"SQLite format 3\0")),
    )
    others = (
        (
            "a zip archive, like an .xlsx file of Excel",
            b"PK\x03\x04",
            "unpack the archive, or save the sheet as CSV",
        ),
        ("an Excel sheet (.xls)", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "save the sheet as CSV"),
        (
            "an HDF5 file that does not come from MATLAB",
            b"\x89HDF\r\n\x1a\n",
            "give the columns as a dict of arrays",
        ),
        ("a file of one NumPy array", b"\x93NUMPY", "give the columns of numpy.load() as a dict"),
        ("packed by bzip2", b"BZh", "unpack it"),
        ("packed by xz", b"\xfd7zXZ\0", "unpack it"),
        ("packed by zstd", b"\x28\xb5\x2f\xfd", "unpack it"),
        ("a 7z archive", b"7z\xbc\xaf\x27\x1c", "unpack it"),
        ("a Feather file of version 1", b"FEA1", "save it as version 2, or as Parquet"),
        ("a PNG picture", b"\x89PNG\r\n\x1a\n", "give the file with the data of the plot"),
        ("a JPEG picture", b"\xff\xd8\xff", "give the file with the data of the plot"),
        ("a PDF document", b"%PDF-", "give the file with the data of the plot"),
    )
    return [
        Kind("", LFS_WHAT, _starts(LFS), None, "run `git lfs pull` in its repository"),
        *(Kind(name, what, begins, "open_log") for name, what, begins in logs),
        *(Kind(name, what, begins, "open_bag") for name, what, begins in bags),
        *(Kind("", what, _starts(first), None, advice) for what, first, advice in others),
        *(Kind(name, what, begins, "read_recording") for name, what, begins in tables),
        Kind("text", "a text, but not a log of an autopilot", _is_text, "read_recording"),
    ]


#: In the order in which they are tried.
KINDS = _kinds()


def opened(path: str | os.PathLike[str]) -> FileIO:
    """Open a file for its bytes, or say why it cannot be."""
    try:
        stream = open(path, "rb", buffering=0)  # noqa: SIM115 - given to the caller
    except FileNotFoundError:
        raise RecordingError(f"the file {path} does not exist") from None
    except IsADirectoryError:
        raise RecordingError(f"{path} is a folder: give a file") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    if os.fstat(stream.fileno()).st_size > LARGEST_FILE:
        stream.close()
        raise _too_large(path)
    return stream


def is_table(path: str | os.PathLike[str]) -> bool:
    """Whether the first bytes of a file are those of a table.

    Raises
    ------
    RecordingError
        When it cannot be read.
    """
    with opened(path) as stream:
        head = stream.read(HEAD)
    kind = next((kind for kind in KINDS if kind.begins(head)), None)
    return bool(head) and kind is not None and kind.opener == "read_recording"


def _too_large(path: object) -> RecordingError:
    return RecordingError(
        f"{path} has more than {LARGEST_FILE} bytes, or never ends: give a part of this file"
    )


def whole(stream: FileIO, head: bytes) -> bytes:
    """All bytes of a file from which `head` was read."""
    if stream.seekable():  # a long file is not copied to put its head before it
        stream.seek(0)
        head = b""
    # A device or a pipe has no size and perhaps no end; a file may have grown since it was opened.
    pieces, size = [head, stream.read(os.fstat(stream.fileno()).st_size)], 0
    while pieces[-1] or len(pieces) == 2:
        size += len(pieces[-1])
        if size > LARGEST_FILE:
            raise _too_large(stream.name)
        pieces.append(stream.read(PIECE))
    return b"".join(filter(None, pieces))


def format_of(path: object, head: bytes, opener: Opener) -> str | None:
    """Name of the format if `opener` opens it, None if it is not known; else say what does."""
    kind = next((kind for kind in KINDS if kind.begins(head)), None)
    if kind is None:
        return None
    if kind.opener == opener:
        return kind.name
    place = "deadtime.logs" if kind.opener == "open_bag" else "dtm"
    advice = kind.advice or f"open it with {place}.{kind.opener}(path)"
    raise RecordingError(f"{path} is {kind.what}: {advice}")
