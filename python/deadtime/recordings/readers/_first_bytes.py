"""The format of a file by its first bytes; a name may say anything."""

from __future__ import annotations

import os
from io import FileIO
from typing import Literal

from deadtime._base.errors import RecordingError

Format = Literal["text", "gzip", "Parquet", "Arrow", "Arrow stream", "MAT v5", "MAT v7.3"]

#: So many bytes tell the format.
HEAD = 1024

#: First bytes of the formats that hold tables.
TABLES: dict[bytes, Format] = {
    b"\x1f\x8b": "gzip",
    b"PAR1": "Parquet",
    b"ARROW1\0\0": "Arrow",
    b"\xff\xff\xff\xff": "Arrow stream",
    b"MATLAB 5.0 MAT-file": "MAT v5",
    b"MATLAB 7.3 MAT-file": "MAT v7.3",
}

#: First bytes of the logs of autopilots. The log of a ground station begins with a time instead.
LOGS = {
    b"ULog\x01\x12\x35": "a ULog file of PX4",
    b"\xa3\x95": "a DataFlash log of ArduPilot",
    b"FMT, 128, 89, FMT,": "a DataFlash log of ArduPilot in text form",
    b"H Product:Blackbox": "a Blackbox log of Betaflight or INAV",
    b"\xbc\x01": "a log of a Crazyflie's memory card",
    b"\xbc\x02": "a log of a Crazyflie's memory card",
}

#: First bytes of other files, and what to do with them.
OTHERS = {
    b"PK\x03\x04": ("a zip archive, as Excel's .xlsx is", "unpack it, or save the sheet as CSV"),
    b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": ("an Excel sheet (.xls)", "save the sheet as CSV"),
    b"\x89HDF\r\n\x1a\n": (
        "an HDF5 file that MATLAB has not written",
        "give its columns as a dict of arrays",
    ),
    b"\x93NUMPY": ("a file of one NumPy array", "give the columns of numpy.load() as a dict"),
    b"BZh": ("packed by bzip2", "unpack it"),
    b"\xfd7zXZ\0": ("packed by xz", "unpack it"),
    b"\x28\xb5\x2f\xfd": ("packed by zstd", "unpack it"),
    b"7z\xbc\xaf\x27\x1c": ("a 7z archive", "unpack it"),
    b"SQLite format 3\0": ("an SQLite database", "give a table of it as a DataFrame"),
    b"#ROSBAG V": ("a ROS bag", "export its topic as CSV"),
    b"\x89MCAP0\r\n": ("an MCAP file", "export its topic as CSV"),
    b"FEA1": ("a Feather file of version 1", "write version 2, or Parquet"),
    b"\x89PNG\r\n\x1a\n": ("a PNG picture", "give the numbers behind it"),
    b"\xff\xd8\xff": ("a JPEG picture", "give the numbers behind it"),
    b"%PDF-": ("a PDF document", "give the numbers behind it"),
}

#: Microseconds since 1970 that begin a log of a ground station: the years 2000 to 2100.
TLOG_TIMES = range(946_684_800_000_000, 4_102_444_800_000_000)


def opened(path: str | os.PathLike[str]) -> FileIO:
    """Open a file for its bytes, or say why it cannot be."""
    try:
        return open(path, "rb", buffering=0)
    except FileNotFoundError:
        raise RecordingError(f"there is no file {path}") from None
    except IsADirectoryError:
        raise RecordingError(f"{path} is a folder: give a file") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None


def whole(stream: FileIO, head: bytes) -> bytes:
    """All bytes of a file from which `head` was read."""
    if stream.seekable():  # a long file is not copied to put its head before it
        stream.seek(0)
        head = b""
    rest = stream.readall()
    return head + rest if head else rest


def table_format(path: object, head: bytes) -> Format:
    """The format of a table by the first bytes of its file, or an error that names another one."""
    log = log_format(head)
    if log is not None:
        raise RecordingError(f"{path} is {log}: open it with dtm.open_log(path)")
    for magic, (what, instead) in OTHERS.items():
        if head.startswith(magic):
            raise RecordingError(f"{path} is {what}, not a text file or a table: {instead}")
    return next((one for magic, one in TABLES.items() if head.startswith(magic)), "text")


def log_format(head: bytes) -> str | None:
    """What log of an autopilot begins with these bytes, None if none does."""
    stamp = int.from_bytes(head[:8], "big")
    if len(head) > 8 and head[8] in (0xFD, 0xFE) and stamp in TLOG_TIMES:
        return "a MAVLink log of a ground station (tlog)"
    return next((what for magic, what in LOGS.items() if head.startswith(magic)), None)
