"""Read ULog files of PX4 with pyulog."""

from __future__ import annotations

import contextlib
import io
from typing import Any

import numpy as np

from deadtime._base.errors import RecordingError
from deadtime._base.extras import library
from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._px4_modes import MODES, VEHICLES, version_of
from deadtime.logs._series import DAY
from deadtime.logs._windows import changes_of

#: Seconds of one count of the clock.
MICROSECOND = 1e-6

#: Bytes of an unwritten tail that are kept: longer than the longest message, which has 65 538.
TAIL = 70_000


def read_ulog(data: bytes, source: str) -> LogContents:
    """All topics of a ULog file.

    Parameters
    ----------
    data : bytes
        The file.
    source : str
        Its name, for messages.

    Raises
    ------
    MissingExtraError
        When pyulog is not installed.
    RecordingError
        When not even the header can be read.
    """
    pyulog = library("pyulog.core", "reading ULog files", "'deadtime[logs]'")
    with contextlib.redirect_stdout(io.StringIO()):  # the library prints what it finds damaged
        try:
            log = pyulog.ULog(_Endless(without_tail(data)))
        except pyulog.ULogException as error:
            raise RecordingError(f"{source} is a damaged ULog file: {error}") from None
    topics: dict[str, Topic] = {}
    for found in log.data_list:
        if "timestamp" in found.data and len(found.data["timestamp"]):
            name = found.name if found.multi_id == 0 else f"{found.name}[{found.multi_id}]"
            topics.setdefault(name, _topic(found.data))
    if not topics:
        raise RecordingError(f"{source} is a ULog file without a message that can be read")
    parameters = dict(log.initial_parameters)
    parameters.update({name: value for _, name, value in log.changed_parameters})
    information = log.msg_info_dict
    span = (log.start_timestamp * MICROSECOND, log.last_timestamp * MICROSECOND)
    return LogContents(
        format="ULog",
        autopilot="PX4" if information.get("sys_name", "PX4") == "PX4" else "",
        vehicle=_vehicle(topics, str(information.get("ver_hw", ""))),
        firmware=_firmware(information),
        topics=topics,
        parameters={
            name: float(value)
            for name, value in parameters.items()
            if isinstance(value, (int, float))  # damaged ones are bytes
        },
        modes=_modes(topics),
        remarks=_remarks(log),
        span=span if 0.0 < span[1] - span[0] < DAY else None,
        gaps=tuple(
            (gap.timestamp * MICROSECOND, gap.timestamp * MICROSECOND + 1e-3 * gap.duration)
            for gap in log.dropouts
        ),
    )


def without_tail(data: bytes) -> bytes:
    """A file without the bytes at its end that a card had allocated and nobody has written.

    They are all 0 or all 255. The library looks for a message at each of them, at 1.4 and 4 s for
    a megabyte. `TAIL` of them stay, because the last message may end in such bytes.
    """
    end = min(len(data.rstrip(b"\0")), len(data.rstrip(b"\xff"))) + TAIL
    return data if end >= len(data) else data[:end]


class _Endless(io.BytesIO):
    """A file in which a read beyond the end moves on as if all bytes were there.

    The library goes back by the length it has asked for, also where the file ended before; on a
    file that is cut off it then reads the same bytes for ever.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        start = self.tell()
        found = super().read(size)
        if size is not None and size > len(found):
            self.seek(start + size)
        return found


def _topic(data: dict[str, Any]) -> Topic:
    columns = {name: values for name, values in data.items() if "_padding" not in name}
    return Topic(np.asarray(data["timestamp"], dtype=float) * MICROSECOND, columns)


def _vehicle(topics: dict[str, Topic], board: str) -> str:
    status = topics.get("vehicle_status")
    kind = ""
    if status is not None and "system_type" in status.columns:
        kind = VEHICLES.get(int(status.columns["system_type"][-1]), "")
    return f"{kind} ({board})" if kind and board else kind or board


def _firmware(information: dict[str, Any]) -> str:
    """Version and commit."""
    release = information.get("ver_sw_release")
    parts = []
    if isinstance(release, int) and release >> 8:
        parts.append(version_of(release))
    if information.get("ver_sw"):
        parts.append(str(information["ver_sw"])[:10])
    return " ".join(parts)


def _modes(topics: dict[str, Topic]) -> tuple[tuple[float, str], ...]:
    status = topics.get("vehicle_status")
    if status is None or "nav_state" not in status.columns:
        return ()
    state = np.asarray(status.columns["nav_state"]).astype(np.int64)
    changes = changes_of(status.time, state)
    return tuple((at, MODES.get(number, f"mode {number}")) for at, number in changes)


def _remarks(log: Any) -> tuple[str, ...]:
    remarks = []
    if log.file_corruption:
        remarks.append("the file is damaged, so parts that cannot be read are left out")
    if log.dropouts:
        lost = 1e-3 * sum(gap.duration for gap in log.dropouts)
        remarks.append(f"the logger lost data {len(log.dropouts)} times, for {lost:.3g} s in total")
    return tuple(remarks)
