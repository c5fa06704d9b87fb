"""Open the log of an autopilot: the format is told by the first bytes."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from deadtime._base.errors import DeadtimeError, RecordingError
from deadtime.recordings.logs._autopilots import names_of
from deadtime.recordings.logs._contents import LogContents
from deadtime.recordings.logs._log import Log, log_of


@dataclass(frozen=True)
class Format:
    """One format: how it begins, and its reader, which is imported when it is needed."""

    name: str
    begins: Callable[[bytes], bool]
    file: str
    function: str

    def read(self, data: bytes, source: str) -> LogContents:
        """Read a file of this format."""
        reader = importlib.import_module(f"deadtime.recordings.logs.{self.file}")
        contents: LogContents = getattr(reader, self.function)(data, source)
        return contents


def _is_text(head: bytes) -> bool:
    return b"FMT," in head and b"\0" not in head


def _is_tlog(head: bytes) -> bool:
    """A tlog has no mark: the time of the ground station, 8 bytes of µs, is before each packet."""
    return head[:1] == b"\0" and head[8:9] in (b"\xfe", b"\xfd")


def _starts(first: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(first)


#: In the order in which they are tried; each looks at no more than the first 8 kB.
FORMATS = (
    Format("ULog", _starts(b"ULog\x01\x12\x35"), "_ulog", "read_ulog"),
    Format("DataFlash", _starts(b"\xa3\x95"), "_dataflash", "read_dataflash"),
    Format("Blackbox", _starts(b"H Product:Blackbox flight"), "_blackbox", "read_blackbox"),
    Format("Crazyflie uSD", _starts(b"\xbc"), "_crazyflie", "read_crazyflie"),
    Format("DataFlash text", _is_text, "_dataflash_text", "read_dataflash_text"),
    Format("tlog", _is_tlog, "_tlog", "read_tlog"),
)

#: What other files begin with, and what to do with them.
FOREIGN = {
    b"\x1f\x8b": "is compressed (gzip): unpack it",
    b"PK\x03\x04": "is an archive (zip): unpack it",
    b"MATLAB 5.0": "is a MAT file: it holds arrays, so open it with read_recording",
    b"\x89HDF": "is an HDF5 file: it holds arrays, so open it with read_recording",
}


def open_log(path: str | os.PathLike[str]) -> Log:
    r"""Open the log of an autopilot and list the loops that are in it.

    Parameters
    ----------
    path : path-like
        The file. Its format is told by its first bytes, whatever its name: ULog (PX4), DataFlash
        (ArduPilot, binary or text), tlog (MAVLink, of a ground station), Blackbox (Betaflight,
        INAV) or Crazyflie uSD.

    Returns
    -------
    Log
        The vehicle, the modes, the parameters, and each loop with setpoint, response and actuator
        in SI units.

    Raises
    ------
    RecordingError
        When the file cannot be read, is no such log, or is too damaged to be read. A log that is
        cut off is read as far as it goes, with a remark.
    MissingExtraError
        When the library that reads the format is not installed; the message holds the line that
        installs it.

    Examples
    --------
    >>> import deadtime as dtm, pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "flight.log"
    >>> lines = ["FMT, 1, 23, ATT, Qcc, TimeUS,DesRoll,Roll"]
    >>> lines += [f"ATT, {k * 20000}, {k % 50 // 25}, {(k - 3) % 50 // 25}" for k in range(200)]
    >>> _ = file.write_text("\n".join(lines))
    >>> log = dtm.open_log(file)
    >>> log.loops["roll"]
    <LogLoop roll: ATT.DesRoll to ATT.Roll, 1 segments, 3.98 s>
    >>> log.loops["roll"].setpoint.conversion
    'ATT.DesRoll [deg] to rad'
    """
    path = Path(path)
    data = _bytes(path)
    form = _format(path, data)
    try:
        contents = form.read(data, path.name)
        return log_of(contents, names_of(contents), path.name)
    except DeadtimeError:
        raise
    except MemoryError:
        raise RecordingError(f"{path} does not fit into memory") from None
    except Exception as error:
        # Libraries raise what the damage leads to: an index, a key, a missing byte.
        raise RecordingError(
            f"{path} is a damaged {form.name} log: reading it ended with "
            f"{type(error).__name__}: {error}"
        ) from error


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise RecordingError(f"there is no file {path}") from None
    except IsADirectoryError:
        raise RecordingError(f"{path} is a folder: give a log file") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None


def _format(path: Path, data: bytes) -> Format:
    head = data[:8192]
    for form in FORMATS:
        if form.begins(head):
            return form
    if not data:
        raise RecordingError(f"{path} is empty")
    for first, told in FOREIGN.items():
        if head.startswith(first):
            raise RecordingError(f"{path} {told}")
    known = ", ".join(form.name for form in FORMATS)
    raise RecordingError(
        f"{path} is no log of a known format: it begins with {head[:8].hex(' ')}; these are read: "
        f"{known}"
    )
