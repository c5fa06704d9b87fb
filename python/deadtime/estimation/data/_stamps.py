"""Times of rows whose time stamps scatter around samples of the controller.

A log is often stamped where it is written, some time after the sample was taken. The rows then are
regular and their stamps are not. Where each stamp is near a regular time, either may be true.
"""

from __future__ import annotations

from dataclasses import replace

from deadtime.estimation._native import regular_times
from deadtime.estimation.methods._method import Run


def on_regular_times(run: Run) -> Run | None:
    """The run with the regular times that its stamps scatter around; None where there are none."""
    check, loop = run.check, run.loop
    if check is None or check.stamps != "jittered" or loop.sample_time is None:
        return None
    if run.recording.sent is not None:
        return None
    between = loop.sample_time * (check.rate_ratio or 1)
    regular = regular_times(run.recording.time, between)
    if regular is None:
        return None
    return run._replace(recording=replace(run.recording, time=regular))
