"""Times of rows whose time stamps scatter around samples of the controller.

A log is often stamped where it is written, some time after the sample was taken. The rows then are
regular and their stamps are not. Where each stamp is near a regular time, either may be true.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deadtime.estimation.methods._method import Run

#: Farthest stamp from its regular time, in rows.
FARTHEST = 0.45

#: Largest relative difference of the clocks of log and controller.
CLOCKS = 5e-3

#: Difference of the two, in its deviations, below which they are one clock.
SAME_CLOCK = 3.0


def on_regular_times(run: Run) -> Run | None:
    """The run with the regular times that its stamps scatter around; None where there are none."""
    check, loop = run.check, run.loop
    if check is None or check.stamps != "jittered" or loop.sample_time is None:
        return None
    if run.recording.sent is not None:
        return None
    time = run.recording.time
    between = loop.sample_time * (check.rate_ratio or 1)
    number = np.concatenate([[0.0], np.cumsum(np.maximum(1.0, np.rint(np.diff(time) / between)))])
    (spacing, start), cov = np.polyfit(number, time, 1, cov=True)
    if abs(spacing / between - 1.0) > CLOCKS:
        return None
    if abs(spacing - between) < SAME_CLOCK * np.sqrt(cov[0, 0]):
        spacing = between
    regular = start + spacing * number
    if np.max(np.abs(time - regular)) > FARTHEST * between:
        return None
    return run._replace(recording=replace(run.recording, time=regular))
