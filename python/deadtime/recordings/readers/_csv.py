"""CSV files: the kernel reads the columns that are needed."""

from __future__ import annotations

from dataclasses import dataclass, replace as changed

import deadtime.recordings._native as native
from deadtime._base.errors import RecordingError
from deadtime._base.validation import Range
from deadtime.recordings.readers._columns import Signals
from deadtime.recordings.readers._repeated import spread, time_error
from deadtime.recordings.readers._text import Text, indices

#: Stands for a separator that is not ASCII: the separator of ASCII itself.
_UNIT = "\x1f"


@dataclass(frozen=True)
class Layout:
    """What to read, for the kernel; the time is the first of the columns."""

    start: int
    delimiter: int
    width: int
    columns: list[tuple[int, str]]
    window: Range
    line: int


def read_csv(text: Text, names: dict[str, str], ends: Range) -> Signals:
    """The columns of the signals within a window; rows outside it need only a time."""
    if not text.delimiter.isascii():
        body = text.body.replace(text.delimiter.encode(text.encoding), _UNIT.encode())
        text = changed(text, delimiter=_UNIT, raw=body, start=0)
    columns = [(place, names[signal]) for signal, place in indices(text, names).items()]
    layout = Layout(text.start, ord(text.delimiter), len(text.header), columns, ends, text.line)
    try:
        found = native.csv_columns(text.raw, layout)
    except RecordingError as error:
        raise RecordingError(f"{text.path}, {error}") from None
    if found.backward is not None:
        line, before, now = found.backward
        raise time_error(f"{text.path}, line {line}", before, now)
    signals = dict(zip(names, found.values, strict=True))
    if found.repeated is not None:
        line, _, now = found.repeated
        signals["time"] = spread(signals["time"], f"{text.path}, line {line}", now)
    return signals
