"""Write a recording to a CSV file row by row, on a thread of its own."""

from __future__ import annotations

import math
import os
import threading
import weakref
from collections.abc import Iterable, Sequence
from errno import EEXIST
from io import FileIO
from pathlib import Path
from queue import SimpleQueue
from typing import Self


class Journal:
    """A CSV file of numbers whose rows are written by a background thread.

    `write` does not wait for the disk, so a slow one does not delay a control loop. Rows are
    complete and in order in the file as soon as the system accepts them; `close` waits until all
    are on the disk. An open journal is closed when the program ends, also by an exception. A
    process that is killed loses the rows that were not yet written.

    Parameters
    ----------
    path : path-like
        File to create; its folder is created if it does not exist.
    columns : sequence of str
        Names for the first line, preferably with units: ``height_m``.

    Raises
    ------
    FileExistsError
        If the file exists: recordings are never overwritten.
    OSError
        If the file cannot be created. Also from `write` and `close`: if an earlier row could not
        be written, for example because the disk is full.
    ValueError
        If names repeat or contain a comma, a quote or a line end.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "flight.csv"
    >>> with Journal(path, ["time_s", "height_m", "climb_m_s"]) as journal:
    ...     journal.write([0.0, 0.75, None])
    ...     journal.write([0.065, 0.76, 0.1])
    >>> print(path.read_text(), end="")
    time_s,height_m,climb_m_s
    0.0,0.75,
    0.065,0.76,0.1
    """

    def __init__(self, path: str | os.PathLike[str], columns: Sequence[str]) -> None:
        self.path = Path(path)
        self.columns = tuple(columns)
        self.rows = 0
        if not self.columns or len(set(self.columns)) != len(self.columns):
            raise ValueError(f"columns={list(columns)}: give one or more names, all different")
        for name in self.columns:
            if not name or any(sign in name for sign in ',"\r\n'):
                raise ValueError(
                    f"the column name {name!r} contains a comma, a quote or a line end, or is empty"
                )
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # Unbuffered, so that every accepted row is in the file.
        try:
            file = open(self.path, "xb", buffering=0)  # noqa: SIM115
        except FileExistsError:
            raise FileExistsError(
                EEXIST, "the file exists already: give another name", str(self.path)
            ) from None
        self._writer = _Writer(file, str(self.path))
        # Also closes the file at the end of the program.
        self._finish = weakref.finalize(self, self._writer.finish)
        self._put(self.columns)

    def write(self, row: Iterable[float | None]) -> None:
        """Append one row; `None` leaves a cell empty.

        Raises
        ------
        OSError
            If an earlier row could not be written.
        ValueError
            If the row has another length than the columns, a value is not finite, or the journal
            is closed.
        """
        values = list(row)
        if len(values) != len(self.columns):
            raise ValueError(
                f"a row of {len(values)} values was given for the {len(self.columns)} columns "
                f"{', '.join(self.columns)}: give one value for each column"
            )
        for name, value in zip(self.columns, values, strict=True):
            if value is not None and not math.isfinite(value):
                raise ValueError(
                    f"{name}={value} in row {self.rows}: give a finite number, or None"
                )
        # 12 digits: a microsecond of a day, a micrometre of a megametre.
        self._put("" if value is None else _printed(value) for value in values)
        self.rows += 1

    def _put(self, cells: Iterable[str]) -> None:
        if not self._finish.alive:
            raise ValueError(f"the journal {self.path} is closed: open a new journal")
        self._writer.check()
        self._writer.lines.put((",".join(cells) + "\n").encode())

    def close(self) -> None:
        """Wait until all rows are on the disk, and close the file; may be called again.

        Raises
        ------
        OSError
            If a row could not be written.
        """
        self._finish()
        self._writer.check()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            self.close()
        except OSError as full:
            if error is None:
                raise
            if error is not full:
                error.add_note(f"{full.filename}: {full.strerror}")


class _Writer:
    """The thread and the file of a journal, without a reference to the journal itself."""

    def __init__(self, file: FileIO, path: str) -> None:
        #: Lines to be written; None ends the thread.
        self.lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._file, self._path = file, path
        self._error: OSError | None = None
        # A daemon thread, so that the program does not wait for it before it calls `finish`.
        self._thread = threading.Thread(target=self._write_all, daemon=True, name=f"journal {path}")
        self._thread.start()

    def check(self) -> None:
        """Raise the error of an earlier row."""
        if self._error is not None:
            raise self._error

    def finish(self) -> None:
        """Write the waiting lines to the disk, and close the file."""
        self.lines.put(None)
        self._thread.join()

    def _write_all(self) -> None:
        try:
            with self._file:
                while self._write(self._waiting()):
                    pass
                os.fsync(self._file.fileno())
        except OSError as error:
            self._error = OSError(error.errno, error.strerror, self._path)

    def _waiting(self) -> list[bytes | None]:
        """All waiting lines; waits for the first."""
        waiting = [self.lines.get()]
        while not self.lines.empty():
            waiting.append(self.lines.get())
        return waiting

    def _write(self, waiting: list[bytes | None]) -> bool:
        """Write lines; return False after the last."""
        lines = b"".join(line for line in waiting if line is not None)
        begin, written = self._file.tell(), 0
        try:
            while written < len(lines):  # a nearly full disk may accept a part
                written += self._file.write(lines[written:])
        except OSError:
            whole = lines.rfind(b"\n", 0, written) + 1
            self._file.seek(begin + whole)
            self._file.truncate()
            raise
        return None not in waiting


def _printed(value: float) -> str:
    return repr(float(f"{value:.12g}"))
