"""A recording that is saved row by row as it comes, so that no crash loses what was flown."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from errno import EEXIST
from pathlib import Path
from types import TracebackType
from typing import Self

__all__ = ["Journal"]


class Journal:
    """Rows of numbers in a CSV file; each is in the file before `write` returns.

    A process that dies between two rows leaves a whole file behind. Against a machine that loses
    power there is `sync`, which closing does as well.

    Parameters
    ----------
    path : path-like
        File to make; its folder is made where it is not there.
    columns : sequence of str
        Names for the first line, best with their units: ``height_m``.

    Raises
    ------
    FileExistsError
        If the file is there: a recording is never written over.
    OSError
        Also of `write`: if the disk is full, or the file cannot be made.
    ValueError
        If names repeat or hold a comma, a quote or the end of a line.

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
            raise ValueError(f"columns={list(columns)}: give one or more names, each once")
        for name in self.columns:
            if not name or any(sign in name for sign in ',"\r\n'):
                raise ValueError(f"the column name {name!r} cannot stand in the first line of CSV")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # Unbuffered: one row is one call of the system, whole or not at all.
        try:
            self._file = open(self.path, "xb", buffering=0)  # noqa: SIM115
        except FileExistsError:
            raise FileExistsError(
                EEXIST, "there already; give another name", str(self.path)
            ) from None
        self._size = 0
        try:
            self._put(self.columns)
        except OSError:
            self._file.close()
            raise

    def write(self, row: Iterable[float | None]) -> None:
        """Append one row; `None` leaves a cell empty.

        Raises
        ------
        ValueError
            If the row has another length than the columns, a value is not finite, or the journal
            is closed.
        """
        values = list(row)
        if len(values) != len(self.columns):
            raise ValueError(
                f"a row of {len(values)} values for the {len(self.columns)} columns "
                f"{', '.join(self.columns)}"
            )
        for name, value in zip(self.columns, values, strict=True):
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name}={value} in row {self.rows}: give a finite number or None")
        # 12 digits: a microsecond of a day, a micrometre of a megametre.
        self._put("" if value is None else _printed(value) for value in values)
        self.rows += 1

    def _put(self, cells: Iterable[str]) -> None:
        if self._file.closed:
            raise ValueError(f"the journal {self.path} is closed: open another one")
        line = (",".join(cells) + "\n").encode()
        written = 0
        try:
            while written < len(line):  # a disk that is all but full takes a part
                written += self._file.write(line[written:])
        except OSError as error:
            self._file.seek(self._size)
            self._file.truncate()
            raise OSError(error.errno, error.strerror, str(self.path)) from None
        self._size += len(line)

    def sync(self) -> None:
        """Have the system put all rows on the disk."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Put all rows on the disk and close the file; may be called twice."""
        if not self._file.closed:
            self.sync()
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _printed(value: float) -> str:
    return repr(float(f"{value:.12g}"))
