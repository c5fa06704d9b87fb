"""Open the log of an autopilot: the format is told by the first bytes."""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from deadtime._base.errors import DeadtimeError, RecordingError
from deadtime.logs._autopilots import names_of
from deadtime.logs._contents import LogContents
from deadtime.logs._log import Log, log_of
from deadtime.recordings import HEAD, format_of, opened, whole

#: File and function that read a format; the file is imported when it is needed.
READERS = {
    "ULog": ("_ulog", "read_ulog"),
    "DataFlash": ("_dataflash", "read_dataflash"),
    "Blackbox": ("_blackbox", "read_blackbox"),
    "Crazyflie uSD": ("_crazyflie", "read_crazyflie"),
    "DataFlash text": ("_dataflash_text", "read_dataflash_text"),
    "tlog": ("_tlog", "read_tlog"),
}


def open_log(path: str | os.PathLike[str], *, flight: int | None = None) -> Log:
    r"""Open the log of an autopilot and list the loops that are in it.

    Parameters
    ----------
    path : path-like
        The file. Its format is told by its first bytes, whatever its name: ULog (PX4), DataFlash
        (ArduPilot, binary or text; PX4 before ULog), tlog (MAVLink, of a ground station), Blackbox
        (Betaflight, Cleanflight, INAV) or Crazyflie uSD. `deadtime.logs.open_bag` opens bags of
        ROS and MCAP files.
    flight : int, optional
        Which flight of a Blackbox file that holds several, counted from 1; by default the longest,
        with a remark that names the others.

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
    ValueError
        When `flight` is given for a log of another format.
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
    with opened(path) as stream:
        head = stream.read(HEAD)
        form = _format(path, head)
        if flight is not None and form != "Blackbox":
            raise ValueError(
                f"flight={flight}: {path} is a {form} log, which contains only one flight. "
                "Leave flight out"
            )
        data = whole(stream, head)
    try:
        contents = _read(form, data, path.name, flight)
        return log_of(contents, names_of(contents), path.name)
    except DeadtimeError:
        raise
    except MemoryError:
        raise RecordingError(f"{path} is too large for the memory of this computer") from None
    except Exception as error:
        # Libraries raise what the damage leads to: an index, a key, a missing byte.
        raise RecordingError(
            f"{path} is a damaged {form} log, and reading it ended with "
            f"{type(error).__name__}: {error}"
        ) from error


def _read(form: str, data: bytes, source: str, flight: int | None) -> LogContents:
    file, function = READERS[form]
    reader = importlib.import_module(f"deadtime.logs.{file}")
    which = {} if flight is None else {"flight": flight}
    contents: LogContents = getattr(reader, function)(data, source, **which)
    return contents


def _format(path: Path, head: bytes) -> str:
    if not head:
        raise RecordingError(f"{path} is empty")
    form = format_of(path, head, "open_log")
    if form is None:
        raise RecordingError(
            f"{path} is not a log of a known format, because it begins with "
            f"{head[:8].hex(' ')}. These formats can be read: {', '.join(READERS)}"
        )
    return form
