"""Plots of flights: the steps with the fits, and the parts of the delay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from deadtime._base.drawing import COLOURS, DATA, REFERENCE
from deadtime.flights._runs import FlownSteps, Telemetry

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from deadtime.estimation import DelayEstimate

#: Plotted time before and after a step, s.
BEFORE, AFTER = 0.5, 4.5


def plot_learned(
    axes: Sequence[Axes], flights: Sequence[FlownSteps], fit: DelayEstimate
) -> Sequence[Axes]:
    """Draw each of the first flights, with the fit to its commands."""
    for ax, flight, fitted in zip(axes, flights, fit.runs, strict=True):
        shown, window = flight.measured, fitted.recording
        ax.step(shown.time, shown.reference, where="post", label="reference", **REFERENCE)
        ax.plot(shown.time, shown.output, label=flight.axis.output, **DATA)
        explained = window.output - fitted.residuals
        ax.plot(window.time, explained, color=COLOURS[0], lw=1.6, label="fit to its commands")
        ax.set(title=flight.name, ylabel=_output(flight))
        ax.title.set_fontsize("small")
    axes[0].legend(frameon=False, fontsize="small")
    axes[-1].set_xlabel("time / s")
    return axes


def plot_telemetry(
    axes: Sequence[Axes], telemetry: Telemetry, flight: FlownSteps
) -> Sequence[Axes]:
    """Draw the command, the echoed setpoint and the speed around the first step."""
    upper, lower = axes
    at = flight.recording.steps()[0].time
    low, high = at - BEFORE, at + 2.0
    sent = (telemetry.command_time >= low) & (telemetry.command_time <= high)
    received = (telemetry.time >= low) & (telemetry.time <= high)
    upper.step(
        telemetry.command_time[sent] - at,
        telemetry.command[sent],
        where="post",
        color="0.35",
        lw=1.2,
        label="command sent",
    )
    time = telemetry.time[received] - at
    upper.step(
        time,
        telemetry.setpoint[received],
        where="post",
        color=COLOURS[1],
        lw=1.6,
        label="echoed setpoint",
    )
    upper.plot(time, telemetry.rate[received], color=COLOURS[0], lw=1.0, label="reported speed")
    upper.set(ylabel=f"speed / ({flight.axis.rate_unit})")
    upper.legend(frameon=False, fontsize="small")
    lower.plot(time, telemetry.output[received], color="0.35", lw=1.2)
    lower.set(xlabel="time after the step / s", ylabel=_output(flight))
    return axes


def plot_checked(axes: Sequence[Axes], flights: Sequence[FlownSteps]) -> Sequence[Axes]:
    """Draw the first step of several flights, and their commands below."""
    upper, lower = axes
    for colour, flight in zip(COLOURS, flights, strict=False):
        step = flight.recording.steps()[0]
        time = flight.recording.time - step.time
        rows = (time >= -BEFORE) & (time <= AFTER)
        name = f"{flight.name}: {flight.overshoot:.0f} % overshoot, " + (
            f"settled in {flight.settling_time:.1f} s"
            if np.isfinite(flight.settling_time)
            else "not settled"
        )
        output = flight.recording.output[rows]
        upper.plot(time[rows], output, color=colour, lw=1.6, label=name)
        if flight.recording.command is not None:
            command = flight.recording.command[rows]
            lower.step(time[rows], command, where="post", color=colour, lw=1.1)
    reference = flights[0].recording.steps()[0]
    upper.step(
        [-BEFORE, 0.0, AFTER],
        [reference.before, reference.after, reference.after],
        where="post",
        **REFERENCE,
    )
    upper.set(ylabel=_output(flights[0]))
    upper.legend(frameon=False, fontsize="small", loc="lower right")
    unit = flights[0].axis.rate_unit
    lower.set(xlabel="time after the step / s", ylabel=f"command / ({unit})")
    return axes


def _output(flight: FlownSteps) -> str:
    return f"{flight.axis.output} / {flight.axis.unit}"
