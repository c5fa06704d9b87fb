"""Figures of the reproduced paper. Matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Iterable
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from deadtime._base.drawing import COLOURS, REFERENCE, Axes, Figure, new_figure
from deadtime.paper import (
    Figure2,
    Figure3,
    Figure6,
    Figure7,
    Figure8,
    Figure9,
    Figure10,
    Figure11,
    Gap,
    Table1,
    Table2,
)

if TYPE_CHECKING:
    from deadtime.systems import Response

THIN: dict[str, Any] = {"lw": 1.3}
PRINTED: dict[str, Any] = {"color": "0.25", "marker": "o", "ms": 5, "ls": "", "mfc": "none"}


@singledispatch
def draw(part: object) -> Figure | None:
    """Draw a part of the reproduction; None for a part without a figure."""
    return None


def _colours(count: int) -> list[Any]:
    """Ordered colours for many curves of one family."""
    from matplotlib import colormaps

    return [colormaps["viridis"](place) for place in np.linspace(0.0, 0.9, count)]


def _responses(
    ax: Axes, responses: Iterable[tuple[str, Response]], colours: Iterable[Any], **style: Any
) -> None:
    for (label, response), colour in zip(responses, colours, strict=False):
        ax.plot(response.time, response.outputs, color=colour, label=label, **(THIN | style))


def _step_axes(ax: Axes, title: str, unit: str = "") -> None:
    ax.axhline(1.0, **REFERENCE)
    _legend(ax, title, xlabel="time / s", ylabel=f"output{unit}")


def _legend(ax: Axes, title: str, **labels: str) -> None:
    ax.set(title=title, **labels)
    ax.title.set_fontsize("medium")
    ax.legend(frameon=False, fontsize="small")


@draw.register(Table1)
def _table1(part: Table1) -> Figure:
    """Delays over the gain, by the dominant root and exactly."""
    figure, ax = new_figure(6.0, 3.6)
    gains = [row.gain for row in part.rows]
    printed = [float(row.printed) for row in part.comparisons if row.quantity.endswith("Td (s)")]
    ax.plot(gains, printed, label="printed", **PRINTED)
    ax.plot(gains, [row.delay for row in part.rows], color=COLOURS[0], label="dominant root")
    ax.plot(gains, [row.exact_delay for row in part.rows], color=COLOURS[1], label="exact")
    _legend(ax, "Delay from the measured overshoot", xlabel="K / (1/s)", ylabel="delay / s")
    return figure


@draw.register(Figure2)
def _figure2(part: Figure2) -> Figure:
    """Responses, and the effect of a hold and a lag on the time scale and the fit of Table 1."""
    figure, (left, middle, right) = new_figure(12.0, 4.0, columns=3)
    colours = _colours(len(part.simulated))
    for (gain, response), colour in zip(part.simulated.items(), colours, strict=True):
        left.plot(response.time, response.outputs, color=colour, label=f"K = {gain:g}", **THIN)
        (trial,) = (case for case in part.trials if case.gain == gain and case.scenario.jitter)
        left.plot(trial.recording.time, trial.recording.output, color=colour, lw=0.7, ls="--")
    left.set_xlim(-0.1, 2.0)
    _step_axes(left, "Td = 0.1 s; dashed: network with jitter")
    for kind, colour in (("lag", COLOURS[1]), ("hold", COLOURS[0])):
        for ratio, style in (("period", {"marker": "o"}), ("peak", {"marker": "x", "ls": ":"})):
            shown = [(getattr(case, kind), case) for case in part.stretches if getattr(case, kind)]
            middle.plot(
                [1e3 * value for value, _ in shown],
                [getattr(case, f"{ratio}_ratio") for _, case in shown],
                color=colour,
                label=f"{'first peak' if ratio == 'peak' else 'period'}, {kind}",
                **({"ls": "", "ms": 4} | {"marker": style["marker"]}),
            )
    middle.axhline(1.0, **REFERENCE)
    _legend(
        middle,
        "Period and first peak at the same K and overshoot",
        xlabel="hold or lag / ms",
        ylabel="relative to a delay alone",
    )
    for fit, colour in zip(part.explanations, COLOURS, strict=False):
        right.plot(1e3 * fit.values, fit.misfits, color=colour, marker=".", label=fit.words)
    _legend(
        right,
        "One loop for all overshoots of Table 1",
        xlabel="hold or lag / ms",
        ylabel="error of the overshoot (rms) / % of the step",
    )
    return figure


@draw.register(Figure3)
def _figure3(part: Figure3) -> Figure:
    """Responses near the limit, the rightmost root, and the limit of coarse simulations."""
    figure, (left, middle, right) = new_figure(12.0, 4.0, columns=3)
    shown = [(f"K = {gain:g}", curve) for gain, curve in part.responses.items() if gain < 18.0]
    _responses(left, shown, COLOURS)
    left.set_ylim(-2.0, 4.0)
    _step_axes(left, "Exact responses")
    gains, roots = np.array(list(part.rightmost)), np.array(list(part.rightmost.values()))
    middle.plot(gains, roots.real, color=COLOURS[0], label="real part of the rightmost root")
    middle.axhline(0.0, **REFERENCE)
    middle.axvline(part.limit, color=COLOURS[1], lw=1.0, ls=":", label=f"K = {part.limit:.3f}")
    middle.set_ylim(-12.0, 3.0)
    _legend(middle, "Roots", xlabel="K / (1/s)", ylabel="1/s")
    steps = 1e3 * np.array(list(part.coarse_limits))
    right.plot(steps, list(part.coarse_limits.values()), color=COLOURS[0], marker="o", ms=4)
    right.axhline(part.limit, color=COLOURS[1], lw=1.0, ls=":", label="exact")
    right.axhspan(18.0, 19.0, color="0.85", label="printed: 18 to 19")
    _legend(
        right, "Limit of fixed-step simulations", xlabel="step / ms", ylabel="critical K / (1/s)"
    )
    return figure


@draw.register(Table2)
def _table2(part: Table2) -> Figure:
    """Overshoot over the delay: printed, coarse, exact, without the limit."""
    figure, ax = new_figure(6.0, 3.6)
    delays = [row.delay for row in part.rows]
    ax.plot(delays, [row.printed for row in part.rows], label="printed", **PRINTED)
    for name, label, colour in (
        ("coarse", "coarse steps", COLOURS[0]),
        ("exact", "exact", COLOURS[2]),
        ("unlimited", "exact, no limit", COLOURS[1]),
    ):
        ax.plot(delays, [getattr(row, name) for row in part.rows], color=colour, label=label)
    _legend(ax, "Overshoot of the altitude loop", xlabel="delay / s", ylabel="overshoot / %")
    return figure


@draw.register(Gap)
def _gap(part: Gap) -> Figure:
    """The contributions to the difference of the estimates."""
    figure, ax = new_figure(6.5, 2.8)
    start = part.dominant
    for row, (name, added) in enumerate(part.parts.items()):
        place = 3.0 - row
        colour = COLOURS[1] if added > 0.0 else COLOURS[0]
        ax.barh(place, added, left=start, height=0.55, color=colour)
        ax.annotate(
            f"{name} {1e3 * added:+.2f} ms",
            (max(start, start + added), place),
            (6, 0),
            textcoords="offset points",
            va="center",
            fontsize="small",
        )
        start += added
    for value, words in ((part.dominant, "Lambert W"), (part.simulation, "simulation")):
        ax.axvline(value, color="0.4", lw=1.0, ls="--")
        ax.annotate(f"{words} {value:.4f} s", (value, 3.75), ha="center", fontsize="small")
    ax.set(yticks=[], ylim=(0.5, 4.2), xlim=(0.357, 0.3745), xlabel="delay / s")
    return figure


@draw.register(Figure6)
def _figure6(part: Figure6) -> Figure:
    """Responses of Table 2 and their peaks."""
    figure, (left, right) = new_figure(10.0, 4.0, columns=2)
    colours = _colours(len(part.exact))
    labels = [(f"N = {samples:g}", curve) for samples, curve in part.exact.items()]
    for ax in (left, right):
        _responses(ax, labels, colours)
    right.set_prop_cycle(None)
    for (samples, response), colour in zip(part.coarse.items(), colours, strict=True):
        # The coarse model steps half a second later.
        late = float(response.breaks[0])
        label = "coarse steps" if samples == next(iter(part.coarse)) else None
        right.plot(response.time - late, response.outputs, ".", color=colour, ms=3, label=label)
    left.set_xlim(0.0, 5.0)
    _step_axes(left, "Exact", " / m")
    _step_axes(right, "The peaks", " / m")
    right.set(xlim=(1.5, 4.0), ylim=(0.985, 1.028))
    right.legend(frameon=False, fontsize="x-small", ncols=2)
    return figure


@draw.register(Figure7)
def _figure7(part: Figure7) -> Figure:
    """Delays from the overshoots of the flights, and the corresponding response."""
    figure, (left, right) = new_figure(10.0, 3.8, columns=2)
    _responses(left, [("2.3 % overshoot", part.response)], COLOURS)
    _step_axes(left, "The loop with the delay of the flights", " / m")
    flights = np.arange(1, len(part.flights) + 1)
    for name, label, marker, colour in (
        ("saturated", "exact, limit 1 m/s", "o", COLOURS[1]),
        ("dominant", "dominant root", "s", COLOURS[0]),
        ("linear", "exact, no limit", "x", COLOURS[2]),
    ):
        delays = [getattr(flight, name) for flight in part.flights]
        right.plot(flights, delays, marker, color=colour, label=label, ms=6)
    right.set_xticks(flights, [f"{flight.overshoot:g} %" for flight in part.flights])
    _legend(
        right,
        "Delay from the overshoot of each flight",
        xlabel="overshoot of the flight",
        ylabel="delay / s",
    )
    return figure


@draw.register(Figure8)
def _figure8(part: Figure8) -> Figure:
    """Responses at Kp = 4 and 5."""
    figure, ax = new_figure(6.5, 3.8)
    _responses(ax, [(f"Kp = {gain:g}", curve) for gain, curve in part.responses.items()], COLOURS)
    ax.set_ylim(-4.0, 6.0)
    _step_axes(ax, f"Td = 0.36 s, stable up to Kp = {part.limit:.3f}", " / m")
    return figure


@draw.register(Figure9)
def _figure9(part: Figure9) -> Figure:
    """Roots at Kp = 4 and 5."""
    figure, ax = new_figure(6.5, 4.2)
    ax.axvline(0.0, color="0.6", lw=0.8)
    for (gain, roots), marker, colour in zip(part.roots.items(), "xo", COLOURS, strict=False):
        ax.plot(
            roots.real, roots.imag, marker, mfc="none", color=colour, ms=7, label=f"Kp = {gain:g}"
        )
    _legend(ax, "Roots at Td = 0.36 s", xlabel="Re s / (1/s)", ylabel="Im s / (rad/s)")
    return figure


@draw.register(Figure10)
def _figure10(part: Figure10) -> Figure:
    """The rightmost root over Kv, with and without the filter."""
    figure, ax = new_figure(7.5, 4.4)
    for curve, label, colour in (
        (part.ideal, "ideal derivative", COLOURS[0]),
        (part.filtered, "filtered, 38 rad/s", COLOURS[1]),
    ):
        ax.plot(curve.gains, curve.abscissas, color=colour, label=label)
        points = np.array([(gain, root.real) for gain, root in curve.roots.items()])
        ax.plot(points[:, 0], points[:, 1], "o", color=colour, ms=4)
        ax.plot(curve.best, curve.best_abscissa, "*", color=colour, ms=13, mec="white")
        ax.annotate(
            f"{curve.best:.4f}: {curve.best_abscissa:.3f}",
            (curve.best, curve.best_abscissa),
            (8, -12),
            textcoords="offset points",
            fontsize="small",
            color=colour,
        )
    gains = part.ideal.gains
    ax.plot(
        gains,
        np.log(gains) / part.delay,
        color="0.6",
        ls=":",
        lw=1.0,
        label="chain, ln(Kv)/Td",
    )
    ax.axhline(0.0, **REFERENCE)
    ax.set_ylim(-4.2, 0.8)
    _legend(
        ax,
        "Kp = 2, Td = 0.36 s; dots are the gains of the figure, stars the best gains",
        xlabel="Kv",
        ylabel="real part of the rightmost root / (1/s)",
    )
    return figure


@draw.register(Figure11)
def _figure11(part: Figure11) -> Figure:
    """Responses of the model of the flights, with their settling times."""
    figure, (left, right) = new_figure(10.0, 3.8, columns=2)
    labels = [(f"Kv = {gain:g}", curve) for gain, curve in part.responses.items()]
    for ax in (left, right):
        _responses(ax, labels, COLOURS)
        ax.axhspan(0.98, 1.02, color="0.9", zorder=0, label="± 2 %")
    _responses(left, [("Kv = 0.3, without the limit", part.unlimited)], COLOURS[2:], ls="--")
    left.set_xlim(0.0, 6.0)
    _step_axes(left, "Model of the flights", " / m")
    for settling, colour in zip(part.settling, COLOURS, strict=False):
        right.axvline(settling.from_step, color=colour, lw=1.0, ls=":")
    _step_axes(right, "Where they settle", " / m")
    right.set(xlim=(1.0, 6.0), ylim=(0.93, 1.03))
    return figure
