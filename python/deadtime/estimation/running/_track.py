"""`online`: the delay over a whole recording, as it would have been known at each row."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime._base.digits import between
from deadtime._base.drawing import Axes, shown_axes
from deadtime._base.errors import RecordingError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import OpenRange
from deadtime._base.verdicts import claimed
from deadtime.estimation.running._bank import OnlineEstimate
from deadtime.estimation.running._estimator import OnlineEstimator
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: What a track takes over from its estimates.
NAMES = ("time", "delay", "lag", "delay_plus_lag", "gain", "known", "informed", "changed")


@dataclass(frozen=True, eq=False)
class DelayTrack(ReadOnlyArrays):
    """The delay of a loop over time, at each row from that row and those before.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Of the rows, s.
    delay, low, high : ndarray, shape (n,)
        Posterior mean of the delay and the ends of its interval, s.
    lag, delay_plus_lag : ndarray, shape (n,)
        Posterior means, s.
    gain : ndarray, shape (n,)
        Posterior mean.
    known, informed, changed : ndarray of bool, shape (n,)
        As of `OnlineEstimate`.
    reliable : ndarray of bool, shape (n,)
        Whether the verdict is ``"reliable"``.
    last : OnlineEstimate
        That of the last row.
    """

    time: Array
    delay: Array
    low: Array
    high: Array
    lag: Array
    delay_plus_lag: Array
    gain: Array
    known: Mask
    informed: Mask
    changed: Mask
    reliable: Mask
    last: OnlineEstimate

    @classmethod
    def of(cls, estimates: Sequence[OnlineEstimate]) -> DelayTrack:
        """Join estimates of one estimator.

        Parameters
        ----------
        estimates : sequence of OnlineEstimate
            At least one, in the order of time.

        Returns
        -------
        DelayTrack

        Raises
        ------
        ValueError
            If there is none.
        """
        if not estimates:
            raise ValueError("there are no estimates: give one or more")

        ends = np.array([estimate.ci for estimate in estimates])
        columns: dict[str, Any] = {
            name: np.array([getattr(estimate, name) for estimate in estimates]) for name in NAMES
        }
        columns["reliable"] = np.array([estimate.verdict == "reliable" for estimate in estimates])
        return cls(low=ends[:, 0], high=ends[:, 1], last=estimates[-1], **columns)

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def changes(self) -> Array:
        """When changes of the delay were found, s."""
        return self.time[self.changed]

    def summary(self) -> str:
        """The track as a few lines of text."""
        last, known = self.last, self.known
        span = self.time[-1] - self.time[0]
        lines = [f"{last.verdict} at the end; delay over {span:.1f} s, {len(self)} rows"]
        if np.any(known):
            first = float(self.time[known][0])
            lines.append(
                f"  delay known from {first:.2f} s on, in {np.mean(known):.0%} of the rows"
            )
            low, high = float(np.min(self.delay[known])), float(np.max(self.delay[known]))
            lines.append(f"  delays between {low:.3f} and {high:.3f} s")
        if last.known:
            value = claimed(last.verdict, last.delay, last.stderr, "s")
            ends = f", interval {between(*last.ci, last.stderr, 's')}"
            lines.append(f"  at the end {value}{ends if last.verdict == 'reliable' else ''}")
        found = ", ".join(f"{time:.2f} s" for time in self.changes)
        lines.append(f"  changes found: {found or 'none'}")
        lines.append(f"  informative command in {np.mean(self.informed):.0%} of the rows")
        lines.append(f"  reliable delay in {np.mean(self.reliable):.0%} of the rows")
        if last.message:
            lines.append(f"  {last.message}")
        return "\n".join(lines)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw delay and interval over time; rows without an estimate are left out.

        Needs matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default that of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        ax = shown_axes(ax)
        shown = np.where(self.known, self.delay, np.nan)
        ax.fill_between(
            self.time, self.low, self.high, where=self.known.tolist(), alpha=0.25, linewidth=0.0
        )
        ax.plot(self.time, shown, label="delay")
        for place, time in enumerate(self.changes):
            ax.axvline(time, color="0.4", linestyle=":", label=None if place else "change found")
        doubted = np.where(self.known & ~self.reliable, self.delay, np.nan)
        if np.any(np.isfinite(doubted)):
            ax.plot(self.time, doubted, ".", label="indication")
        ax.set_xlabel("time (s)")
        ax.set_ylabel("delay (s)")
        ax.legend()
        return ax

    def to_dict(self) -> dict[str, Any]:
        """The arrays as lists, the times of changes, and the last estimate, for JSON."""
        names = [field.name for field in fields(self) if field.name != "last"]
        found: dict[str, Any] = {name: getattr(self, name).tolist() for name in names}
        return found | {"changes": self.changes.tolist(), "last": self.last.to_dict()}

    def __repr__(self) -> str:
        return f"<DelayTrack {len(self)} rows, {self.last}>"


def online(
    recording: Recording, loop: ControlLoop, *, window: OpenRange | None = None, **options: Any
) -> DelayTrack:
    """The delay over a recording, as it would have been known at each row.

    Parameters
    ----------
    recording : Recording
        With the command.
    loop : ControlLoop
        What is known of the plant.
    window : (low, high), optional
        The part to use, s, None for an open end.
    **options
        As of `OnlineEstimator`.

    Returns
    -------
    DelayTrack

    Raises
    ------
    RecordingError
        If the recording has no command.
    ValueError
        As of `OnlineEstimator`.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime.estimation import online
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(0.85), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
    ... )
    >>> flight = dtm.Experiment.prbs(20.0, 0.5, 0.8, seed=2).run(loop, noise=0.005, seed=1)
    >>> track = online(flight, loop, noise=0.005)
    >>> bool(track.low[-1] < 0.3 < track.high[-1]), track.changes.size
    (True, 0)
    """
    estimator = OnlineEstimator(loop, **options)
    return track_of(estimator, recording, window)


def track_of(
    estimator: OnlineEstimator, recording: Recording, window: OpenRange | None = None
) -> DelayTrack:
    """Give an estimator the rows and commands of a recording."""
    part = recording if window is None else recording.window(*window)
    if part.sent is not None:
        time, values = part.sent
    elif part.command is not None:
        time, values = part.time, part.command
    else:
        raise RecordingError(
            "the recording has no command, but the online estimate is the "
            "delay from the command to the output: record the command too"
        )
    found, commands = [], deque(zip(time.tolist(), values.tolist(), strict=True))
    for row, output in zip(part.time.tolist(), part.output.tolist(), strict=True):
        while commands and commands[0][0] < row:
            estimator.command(*commands.popleft())
        if not math.isnan(output):
            found.append(estimator.update(row, output))
    return DelayTrack.of(found)
