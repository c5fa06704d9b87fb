"""Plot of an Internet loop: its steps, and its delay by every method beside the measured one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from deadtime._base.drawing import COLOURS, REFERENCE, Axes
from deadtime.internet._result import NAMES, InternetLoop

#: Name, marker and colour of each method.
LABELS = {
    "dominant": (NAMES["dominant"], "o", COLOURS[1]),
    "exact": (NAMES["exact"], "s", COLOURS[3]),
    "waveform": (NAMES["waveform"], "D", COLOURS[0]),
    "output_error": (NAMES["output_error"], "^", COLOURS[2]),
}


def plot_internet_loop(
    found: InternetLoop, printed: Mapping[float, float], axes: Sequence[Axes]
) -> Sequence[Axes]:
    """Draw the steps of all runs, and beside them the delays over the gain.

    Parameters
    ----------
    found : InternetLoop
        The runs.
    printed : mapping of float to float
        Delays of the paper's Table 1 by gain, s.
    axes : sequence of two matplotlib.axes.Axes
        For the steps, and for the delays.

    Returns
    -------
    sequence of matplotlib.axes.Axes
    """
    left, right = axes
    _steps(left, found)
    _delays(right, found, printed)
    return axes


def _steps(ax: Axes, found: InternetLoop) -> None:
    from matplotlib import colormaps

    shades = colormaps["viridis"]
    recorded = [run for run in found.runs if "plant" in run.recordings]
    for index, run in enumerate(recorded):
        data = run.recordings["plant"]
        if index == 0:
            ax.step(data.time, data.reference, where="post", label="reference", **REFERENCE)
        shade = shades(0.9 * index / max(1, len(recorded) - 1))
        ax.plot(data.time, data.output, color=shade, lw=1.2, label=f"K = {run.trial.gain:g}")
    ax.set(xlabel="time / s", ylabel="output")
    if recorded:
        ax.legend(frameon=False, fontsize="small")


def _delays(ax: Axes, found: InternetLoop, printed: Mapping[float, float]) -> None:
    gains = [run.trial.gain for run in found.runs]
    trips = [run.round_trip for run in found.runs]
    ax.fill_between(
        gains,
        [1e3 * round_trip["p50"] for round_trip in trips],
        [1e3 * round_trip["p95"] for round_trip in trips],
        color="0.85",
        label="round trip, median to 95 %",
    )
    ax.plot(gains, [1e3 * run.age for run in found.runs], "k-", lw=1.4, label="measured age")
    width = max(gains) - min(gains)
    for index, (method, (label, marker, colour)) in enumerate(LABELS.items()):
        runs = [run for run in found.runs if method in run.estimates]
        if not runs:
            continue
        shift = 0.012 * width * (index - 1.5)
        ax.plot(
            [run.trial.gain + shift for run in runs],
            [1e3 * run.delay(method) for run in runs],
            marker,
            color=colour,
            ms=5,
            label=label,
        )
    shown = {gain: delay for gain, delay in printed.items() if gain in gains}
    if shown:
        ax.plot(
            list(shown),
            [1e3 * delay for delay in shown.values()],
            "x",
            color="0.3",
            label="Table 1",
        )
    ax.set(xlabel="K / (1/s)", ylabel="delay / ms")
    ax.legend(frameon=False, fontsize="small")
