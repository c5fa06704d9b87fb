"""Plots of gain schedules; matplotlib is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

from deadtime.tuning.adaptive._schedule import GainSchedule

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_schedule(ax: Axes, schedule: GainSchedule) -> None:
    """Draw each gain over the delays for which its set is the fastest that is permitted."""
    for name in schedule.robust.gains:
        delays, gains = [schedule.delays[0]], []
        for gain_set in schedule.sets:
            delays.append(gain_set.delays[1])
            gains.append(gain_set.gains[name])
        ax.stairs(gains, delays, baseline=None, label=name, lw=2.0)
    ax.set(
        xlabel="longest delay / s",
        ylabel="gain",
        title="Gains that follow the delay",
        ylim=(0, None),
    )
    ax.legend()
