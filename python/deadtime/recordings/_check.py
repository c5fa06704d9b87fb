"""`Recording.check`: what a recording holds, before anything is fitted to it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime.loops import ControlLoop
from deadtime.recordings._check_clock import clock_findings, read_clock
from deadtime.recordings._check_command import Law, command_findings, read_command
from deadtime.recordings._check_excitation import excitation_findings
from deadtime.recordings._check_rows import Hole, read_rows, row_findings
from deadtime.recordings._findings import Columns, Finding, Severity, seconds

#: Severities, the gravest first.
ORDER: tuple[Severity, ...] = ("refused", "warning", "note")

_LAWS: dict[Law, str] = {
    "exact": "the command is what the controller computes",
    "late": "the command is what the controller computes, one row late",
    "early": "the command is what the controller computes, one row early",
    "approximate": "the command is nearly what the controller computes",
    "differs": "the command is not what the controller computes",
    "unknown": "it is unknown whether the command is what the controller computes",
}


@dataclass(frozen=True, eq=False, repr=False)
class RecordingCheck(ReadOnlyArrays):
    """What a recording holds, and what it would do to an estimate of the delay.

    Attributes
    ----------
    findings : tuple of Finding
        What was found, the gravest first.
    rows : int
        Number of rows; row numbers below count from the beginning of the window.
    row_time : float
        Time between two neighbouring rows, s: the median where no row is missing.
    jitter : float
        Standard deviation of that time, s.
    stamps : {"nominal", "even", "jittered"}
        Time stamps that are even to rounding, as planned ones are, even to 1 %, or less even.
    holes : tuple of Hole
        Where rows are missing: the row before, the row after, and the number of missing rows.
    repeated : ndarray of int
        Rows that repeat the row before in all signals while the output moves.
    repeated_share : float
        Their share of the rows in which the output moves.
    rate_ratio : int or None
        Whole number of samples of the controller a row; None if it is no whole number, or the
        loop has no `sample_time`.
    clock_ratio : float or None
        Time between rows over `rate_ratio` times `sample_time`; 1 within 0.1 %.
    sample_time_seen : float or None
        Time between rows, s, if the loop has no `sample_time` and the rows look like samples.
    law : {"exact", "late", "early", "approximate", "differs", "unknown"}
        Whether the logged command is that of the controller: on its row, computed from the row
        before or after it, but for noise, or not; unknown without a command, and for controllers
        other than P.
    command_slope : float or None
        Slope of the line from the command of the controller to the logged one, where it differs.
    limit_seen : float or None
        Size at which the command stops though the controller asks for more.
    saturated : float
        Share of the rows in which the command is at its limit.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1)
    >>> flight = dtm.Experiment.step(8.0).run(loop, noise=0.005)
    >>> flight.check(loop)
    <RecordingCheck: 124 rows, 1 note>
    """

    findings: tuple[Finding, ...]
    rows: int
    row_time: float
    jitter: float
    stamps: Literal["nominal", "even", "jittered"]
    holes: tuple[Hole, ...]
    repeated: NDArray[np.intp]
    repeated_share: float
    rate_ratio: int | None
    clock_ratio: float | None
    sample_time_seen: float | None
    law: Law
    command_slope: float | None
    limit_seen: float | None
    saturated: float

    @property
    def refused(self) -> bool:
        """Whether no estimate from this recording and loop would be right."""
        return any(finding.severity == "refused" for finding in self.findings)

    def summary(self, least: Severity = "note") -> str:
        """The findings as lines of text.

        Parameters
        ----------
        least : {"note", "warning", "refused"}
            Leave out what is less grave, and the first line, which describes the rows, unless it
            is ``"note"``.

        Returns
        -------
        str
        """
        shown = ORDER[: ORDER.index(least) + 1]
        lines = [str(finding) for finding in self.findings if finding.severity in shown]
        return "\n".join(([self._described()] if least == "note" else []) + lines)

    def _described(self) -> str:
        missing = sum(hole.missing for hole in self.holes)
        parts = [
            f"{self.rows} rows {seconds(self.row_time)} apart",
            f"{missing} missing" if missing else "none missing",
            _LAWS[self.law],
            f"the command is at its limit in {100.0 * self.saturated:.2g} % of the rows"
            if self.saturated
            else "",
        ]
        return ", ".join(part for part in parts if part)

    def to_dict(self) -> dict[str, Any]:
        """All that was found, as plain values for JSON."""
        found = {**self._shown(), "refused": self.refused}
        found["findings"] = [plain_fields(asdict(finding)) for finding in self.findings]
        found["holes"] = [hole._asdict() for hole in self.holes]
        found["repeated"] = self.repeated.tolist()
        return found

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        counts = []
        for severity in ORDER:
            number = sum(finding.severity == severity for finding in self.findings)
            if number:
                plural = "s" if number > 1 and severity != "refused" else ""
                counts.append(f"{number} {severity}{plural}")
        return f"<RecordingCheck: {self.rows} rows, {', '.join(counts) or 'nothing found'}>"


def check_columns(columns: Columns, loop: ControlLoop, *, in_motion: bool) -> RecordingCheck:
    """Check the columns of a recording; `in_motion` if rows come before them."""
    rows = read_rows(columns)
    command = read_command(columns, rows, loop)
    clock = read_clock(columns, rows, command, loop)
    findings = [
        *row_findings(columns, rows, loop),
        *clock_findings(columns, rows, command, loop, clock),
        *command_findings(columns, rows, command, loop),
        *excitation_findings(columns, command, loop, in_motion=in_motion),
    ]
    return RecordingCheck(
        findings=tuple(sorted(findings, key=lambda finding: ORDER.index(finding.severity))),
        rows=int(columns.time.size),
        row_time=rows.row_time,
        jitter=rows.jitter,
        stamps=rows.stamps,
        holes=rows.holes,
        repeated=rows.repeated,
        repeated_share=rows.repeated_share,
        rate_ratio=clock.rate_ratio,
        clock_ratio=clock.clock_ratio,
        sample_time_seen=clock.sample_time_seen,
        law=command.law,
        command_slope=None if command.line is None else command.line.slope,
        limit_seen=command.limit_seen,
        saturated=command.saturated,
    )
