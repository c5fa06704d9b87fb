"""Recordings of a control loop: reference, output and command over time."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.errors import RecordingError
from deadtime._base.frozen import FrozenDict, ReadOnlyArrays
from deadtime._base.validation import OpenRange, open_interval, unmasked
from deadtime.recordings._missing import HELD, rows_with_output, with_rows_missing
from deadtime.recordings._native import rate_limited

if TYPE_CHECKING:
    from deadtime.loops import ControlLoop
    from deadtime.recordings._check import RecordingCheck

#: Largest absolute value. The squares of larger ones may overflow, and no physical quantity has
#: them.
LARGEST = 1e100

#: Columns that may have missing values, NaN; a reference in all rows or none.
MAY_MISS = ("reference", "output")

#: Fewest samples of a recording: enough for two parameters, an initial output, and a test of the
#: residuals.
MINIMUM_SAMPLES = 8


@dataclass(frozen=True)
class Step:
    """One step of a reference.

    Attributes
    ----------
    index : int
        First row with the new reference.
    time : float
        Time of that row, s.
    before, after : float
        Reference before and after.
    """

    index: int
    time: float
    before: float
    after: float

    @property
    def amplitude(self) -> float:
        """Reference after the step minus that before."""
        return self.after - self.before


class SentCommands(NamedTuple):
    """Commands that were sent at times of their own.

    Attributes
    ----------
    time : ndarray, shape (m,)
        When each was sent, s, strictly increasing; each holds until the next.
    values : ndarray, shape (m,)
        The commands, after any limit.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recording(ReadOnlyArrays):
    """Reference and output of a loop over time, with the command where it was logged.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time stamps in seconds, strictly increasing.
    reference : array_like, shape (n,), or None
        The reference of the loop; None where there is none or it was not logged, and `reference`
        is then NaN in all rows.
    output : array_like, shape (n,)
        The measured output, in the unit of the reference; NaN in rows where it is missing.
    command : array_like, shape (n,), optional
        The command sent to the plant, after any limit.
    units : dict of str to str, optional
        Unit of each signal, for labels.
    source : str, optional
        Origin of the recording, for messages and labels.
    sent : (array_like, array_like), each of shape (m,), optional
        Instead of `command`: times at which commands were sent and their values, where these are
        not the times of the rows. The first is not after the first row. `command` then has the
        last one sent at each row. Where regular times have gaps, estimates take it that the log has
        lost commands there, or that each command holds until the next, whichever is likelier.

    Raises
    ------
    RecordingError
        When the time does not increase, lengths differ, values are infinite or beyond 1e100,
        or there are fewer than 8 samples; when a missing value hides a change of the reference or
        of the command.
    TypeError
        When both `command` and `sent` are given.

    Notes
    -----
    A value that is masked (`numpy.ma`) or NaN is missing. A row whose output is missing stays, with
    its command: `complete` leaves such rows out. Reference and command hold where they are missing
    between equal values. A row without a time is left out.

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> t = np.arange(20) * 0.1
    >>> recording = dtm.Recording(t, np.where(t < 0.5, 0.0, 1.0), np.zeros(20))
    >>> recording.steps()
    [Step(index=5, time=0.5, before=0.0, after=1.0)]
    """

    time: NDArray[np.float64]
    reference: NDArray[np.float64]
    output: NDArray[np.float64]
    command: NDArray[np.float64] | None = None
    units: dict[str, str] = field(default_factory=dict)
    source: str = ""
    sent: SentCommands | None = None

    def __init__(
        self,
        time: ArrayLike,
        reference: ArrayLike | None,
        output: ArrayLike,
        command: ArrayLike | None = None,
        units: dict[str, str] | None = None,
        source: str = "",
        sent: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> None:
        if command is not None and sent is not None:
            raise TypeError(
                "the command of each row and the commands between rows are both given: give "
                "only one of the two"
            )
        if reference is None:
            reference = np.full(np.shape(output), np.nan)
        columns = {"time": time, "reference": reference, "output": output}
        if command is not None:
            columns["command"] = command
        arrays = {
            name: _column(name, values, may_miss=name in MAY_MISS)
            for name, values in with_rows_missing(columns).items()
        }
        lengths = {name: array.size for name, array in arrays.items()}
        if len(set(lengths.values())) > 1:
            raise RecordingError(f"the columns of a recording have different lengths: {lengths}")
        _check_time(arrays["time"])
        _check_missing(arrays)
        commands = None
        if sent is not None:
            commands = _sent(*sent)
            arrays["command"] = _last_sent(commands, arrays["time"])
        held: dict[str, Any] = {"command": None, **arrays, "source": source, "sent": commands}
        held["units"] = FrozenDict(units or {})
        for name, value in held.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        origin = f" from {self.source}" if self.source else ""
        signals = ("reference, " if self.has_reference else "") + "output"
        signals += ", command" if self.command is not None else ""
        missing = int(np.count_nonzero(np.isnan(self.output)))
        signals += f", {missing} without output" if missing else ""
        return (
            f"<Recording{origin}: {len(self)} samples, {self.time[0]:g} to {self.time[-1]:g} s, "
            f"{signals}>"
        )

    @property
    def has_reference(self) -> bool:
        """Whether a reference was given."""
        return not bool(np.isnan(self.reference[0]))

    @property
    def sample_time(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))

    def window(self, start: float | None = None, stop: float | None = None) -> Recording:
        """The part with ``start <= time <= stop``; `None` leaves an end open.

        Raises
        ------
        RecordingError
            When fewer than 8 samples lie in the window.
        """
        rows = self.rows(start, stop)
        if rows == slice(0, len(self)) and self.sent is None:
            return self
        return self._part(rows)

    def _part(self, rows: slice | NDArray[np.bool_]) -> Recording:
        """The recording with these rows alone."""
        parts: dict[str, Any] = {name: column[rows] for name, column in self._columns().items()}
        if self.sent is not None:
            kept = int(np.searchsorted(self.sent.time, parts["time"][-1], side="right"))
            sent = SentCommands(self.sent.time[:kept], self.sent.values[:kept])
            parts |= {"command": None, "sent": sent}
        return replace(self, **parts)

    def rows(self, start: float | None = None, stop: float | None = None) -> slice:
        """The rows with ``start <= time <= stop``, as a slice."""
        low = -np.inf if start is None else float(start)
        high = np.inf if stop is None else float(stop)
        if not low < high:
            raise RecordingError(
                f"the window ({start}, {stop}) s is empty: give (low, high) with low below high"
            )
        # Time stamps printed with few digits may miss the ends by rounding.
        slack = 1e-6 * self.sample_time
        first = int(np.searchsorted(self.time, low - slack, side="left"))
        last = int(np.searchsorted(self.time, high + slack, side="right"))
        if last - first < MINIMUM_SAMPLES:
            raise RecordingError(
                f"the window ({start}, {stop}) s contains {max(0, last - first)} samples, but "
                f"at least {MINIMUM_SAMPLES} are needed. The recording runs from "
                f"{self.time[0]:g} to {self.time[-1]:g} s"
            )
        return slice(first, last)

    def complete(self) -> Recording:
        """The rows that have an output, for methods that need all of them.

        Raises
        ------
        RecordingError
            When there is no reference, or when the reference or the command changes in a row whose
            output is missing: without that row, the change would be at an unknown time.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> t = np.arange(20.0)
        >>> flight = dtm.Recording(t, t > 5.5, np.where(t == 9.0, np.nan, 0.1 * t))
        >>> len(flight), len(flight.complete())
        (20, 19)
        """
        if not self.has_reference:
            raise RecordingError(
                "the recording has no reference, which this method needs. Name the column of "
                "the reference, or estimate without a loop: dtm.estimate_delay(recording)"
            )
        columns = self._columns()
        held = HELD if self.sent is None else ("reference",)
        kept = rows_with_output(self.output, {key: columns[key] for key in held if key in columns})
        return self if kept is None else self._part(kept)

    def behind_limits(self, rate: float, rate_of_rate: float | None = None) -> Recording:
        """The recording with commands that follow its own within limits, as in many vehicles.

        An estimate from it is that of the linear plant behind the limits, which you need not name.
        The commands start at rest at the first one, and hold between the times in `sent`
        (`RateLimited`).

        Parameters
        ----------
        rate : float
            Largest rate of change of the command, in its unit per s.
        rate_of_rate : float, optional
            Largest change of that rate, in the unit of the command per s²; none by default.

        Returns
        -------
        Recording
            With `sent`: the means of the limited command over parts of the time between commands.

        Raises
        ------
        RecordingError
            When the recording has no command.
        ValueError
            If a limit is not above zero.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> t = np.arange(500) * 0.05
        >>> told = 0.8 * np.sign(np.sin(0.9 * t) + np.sin(0.37 * t))
        >>> sent = dtm.Recording(t, None, np.zeros(500), told).behind_limits(1.0, 5.0).sent
        >>> plant = dtm.FactoredPlant([0.15], integrator=True).transfer_function() * dtm.delay(0.2)
        >>> height = plant.simulate(t, sent.values, input_time=sent.time).outputs
        >>> height = height + 0.002 * np.random.default_rng(1).standard_normal(500)
        >>> fit = dtm.estimate_delay(dtm.Recording(t, None, height, told).behind_limits(1.0, 5.0))
        >>> fit.verdict, round(fit.delay, 2)
        ('reliable', 0.2)
        """
        if self.sent is not None:
            time, command = self.sent
        elif self.command is not None:
            time, command = self.time, self.command
        else:
            raise RecordingError("the recording has no command that a vehicle could limit")
        sent = rate_limited(time, command, rate, np.inf if rate_of_rate is None else rate_of_rate)
        return replace(self, command=None, sent=SentCommands(*sent))

    def check(self, loop: ControlLoop, window: OpenRange | None = None) -> RecordingCheck:
        """Check the recording against the loop that made it, before anything is fitted.

        Parameters
        ----------
        loop : ControlLoop
            What is known of the loop: plant, controller, sample time and limit.
        window : (low, high), optional
            The part to check, s; None leaves an end open.

        Returns
        -------
        RecordingCheck
            The findings, each with what it would do to an estimate of the delay, and the facts
            that a fit needs.

        Raises
        ------
        RecordingError
            When fewer than 8 samples lie in the window.
        TypeError
            If `loop` is no `ControlLoop`.

        Notes
        -----
        Checked are: the time between rows against the sample time and its unit; missing and
        repeated rows; jitter; whether the command is that of a P controller on these rows, or one
        row earlier or later, in another unit, or of another sign; whether its limit is seen;
        whether anything excites the loop.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), delay=0.3, sample_time=0.065)
        >>> flight = dtm.Experiment.step(8.0).run(loop, noise=0.005)
        >>> in_ms = dtm.Recording(1e3 * flight.time, flight.reference, flight.output)
        >>> check = in_ms.check(loop)
        >>> check.refused, check.findings[0].code
        (True, 'time_unit')
        >>> print(check.findings[0].effect)
        delays would be 1000 times too long, and gains too small by the same factor
        """
        from deadtime.loops import ControlLoop
        from deadtime.recordings._check import check_columns
        from deadtime.recordings._findings import Columns

        if not isinstance(loop, ControlLoop):
            raise TypeError(f"loop must be a ControlLoop, not {type(loop).__name__}")
        open_interval("window", window)
        low, high = (None, None) if window is None else window
        whole = self.complete()
        if whole is not self:
            return whole.check(loop, window)
        rows = self.rows(low, high)
        command = None if self.command is None else self.command[rows]
        sent = None
        if self.sent is not None:
            changes = self.sent.time[1:][np.diff(self.sent.values) != 0.0]
            sent = changes[(changes >= self.time[rows][0]) & (changes <= self.time[rows][-1])]
        columns = Columns(self.time[rows], self.reference[rows], self.output[rows], command, sent)
        return check_columns(columns, loop, in_motion=rows.start > 0)

    def steps(self) -> list[Step]:
        """Every change of the reference, in order of time; none without a reference."""
        if not self.has_reference:
            return []
        changed = np.flatnonzero(np.diff(self.reference)) + 1
        return [
            Step(
                int(row),
                float(self.time[row]),
                float(self.reference[row - 1]),
                float(self.reference[row]),
            )
            for row in changed
        ]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the recording to a file from which `load` makes the same one, bit for bit.

        Parameters
        ----------
        path : path-like
            Ends in ``.csv`` or ``.parquet``. A CSV file begins with the comment
            ``# deadtime recording`` and one with source and units in JSON; then come a header and
            the rows. A Parquet file has this JSON in its metadata under ``deadtime``. Both have
            the columns ``time``, ``reference``, ``output`` and, if there is one, ``command``.

        Raises
        ------
        ValueError
            When the path has another ending.
        MissingExtraError
            When the path ends in ``.parquet`` and pyarrow is not installed.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> t = np.arange(20) * 0.1
        >>> recording = dtm.Recording(t, t > 0.5, np.zeros(20), units={"output": "m"})
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
        >>> recording.save(file)
        >>> dtm.Recording.load(file) == recording
        True
        """
        from deadtime.recordings._saved import save_table

        save_table(path, self._columns(), self.units, self.source, self.sent)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Recording:
        """Read a recording that `save` has written.

        Raises
        ------
        RecordingError
            When the file cannot be read, or was not written by `save`.
        MissingExtraError
            When it is a Parquet file and pyarrow is not installed.
        """
        from deadtime.recordings._saved import load_table

        return cls(**load_table(path))

    def to_dataframe(self) -> Any:
        """Return the columns as a `pandas.DataFrame`, with source and units in its ``attrs``.

        Raises
        ------
        MissingExtraError
            When pandas is not installed.
        """
        from deadtime.recordings._saved import as_frame

        return as_frame(self._columns(), self.units, self.source)

    def to_xarray(self) -> Any:
        """Return the columns as an `xarray.Dataset` over time, with source and units as attributes.

        Raises
        ------
        MissingExtraError
            When xarray is not installed.
        """
        from deadtime.recordings._saved import as_dataset

        return as_dataset(self._columns(), self.units, self.source)

    def _columns(self) -> dict[str, NDArray[np.float64]]:
        columns = {"time": self.time, "reference": self.reference, "output": self.output}
        return columns if self.command is None else columns | {"command": self.command}


def _column(
    name: str, values: ArrayLike, fewest: int = MINIMUM_SAMPLES, may_miss: bool = False
) -> NDArray[np.float64]:
    try:
        given = np.asarray(unmasked(name, values))
        if given.dtype.kind == "c":
            raise TypeError("it is complex")
        array = np.array(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordingError(f"the {name} is not an array of numbers: {error}") from None
    if array.ndim != 1:
        raise RecordingError(f"the {name} has shape {array.shape}: give a one-dimensional array")
    if array.size < fewest:
        raise RecordingError(
            f"the {name} has {array.size} samples, but at least {fewest} are needed"
        )
    bad = np.flatnonzero(np.isinf(array) if may_miss else ~np.isfinite(array))
    if bad.size:
        raise RecordingError(
            f"the {name} is {array[bad[0]]} at row {bad[0]} ({bad.size} values are like this): "
            "leave these rows out, or choose a window without them"
        )
    far = np.flatnonzero(np.abs(array) > LARGEST)
    if far.size:
        raise RecordingError(
            f"the {name} reaches {array[far[0]]:g}, but values above {LARGEST:g} may overflow: "
            "use another unit"
        )
    array.flags.writeable = False
    return array


def _check_missing(columns: dict[str, NDArray[np.float64]]) -> None:
    """Refuse too few outputs."""
    known = int(np.count_nonzero(~np.isnan(columns["output"])))
    if known < MINIMUM_SAMPLES:
        raise RecordingError(
            f"the output is known in {known} of {columns['output'].size} rows, but at least "
            f"{MINIMUM_SAMPLES} rows are needed"
        )


def _sent(time: ArrayLike, values: ArrayLike) -> SentCommands:
    found = SentCommands(_column("time of the commands", time, 1), _column("commands", values, 1))
    if found.time.size != found.values.size:
        raise RecordingError(
            f"{found.values.size} commands were sent at {found.time.size} times: give one "
            "time for each command"
        )
    _check_time(found.time, "time of the commands")
    return found


def _last_sent(sent: SentCommands, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """The command that holds at each row."""
    if sent.time[0] > time[0]:
        raise RecordingError(
            f"the first command is sent at {sent.time[0]:g} s, after the first row at "
            f"{time[0]:g} s: begin the recording at a row after the first command"
        )
    found: NDArray[np.float64] = sent.values[np.searchsorted(sent.time, time, side="right") - 1]
    found.flags.writeable = False
    return found


def _check_time(time: NDArray[np.float64], name: str = "time") -> None:
    backward = np.flatnonzero(np.diff(time) <= 0)
    if backward.size:
        row = int(backward[0]) + 1
        what = "repeats" if time[row] == time[row - 1] else "goes back"
        raise RecordingError(
            f"at row {row} the {name} {what}: {time[row - 1]} is followed by {time[row]} "
            f"({backward.size} such rows). Sort the rows, and keep one row of each time stamp"
        )
