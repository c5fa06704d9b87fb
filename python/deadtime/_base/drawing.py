"""Everything that is drawn. Matplotlib is imported when something is drawn, not before."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from deadtime._base.errors import MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from deadtime.estimation import DelayEstimate, Flight
    from deadtime.loops import ControlLoop
    from deadtime.recordings import Recording
    from deadtime.roots import Certificate, Chain, RootSet
    from deadtime.systems import Margins, Response, TransferFunction

__all__ = [
    "as_svg",
    "check_matplotlib",
    "empty_figure",
    "new_figure",
    "plot_bode",
    "plot_estimate",
    "plot_fits",
    "plot_nyquist",
    "plot_responses",
    "plot_root_set",
    "shown_axes",
    "shown_rows",
]

DATA: dict[str, Any] = {"color": "0.35", "lw": 0.9, "marker": ".", "ms": 3}
REFERENCE: dict[str, Any] = {"color": "0.6", "lw": 1.0, "ls": "--"}
CHAIN: dict[str, Any] = {"color": "#d1481f", "lw": 1.0, "ls": "--", "zorder": 3}
COLOURS = ("#0b6fb8", "#d1481f", "#2f8f4e", "#8a4fbf")


def check_matplotlib() -> None:
    """Refuse to draw where matplotlib is missing, with the line that installs it."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise MissingExtraError(
            "drawing needs matplotlib, which is not installed; this line installs it: "
            "pip install 'deadtime[plot]'"
        ) from error


def empty_figure(width: float, height: float) -> Figure:
    """A figure that belongs to nobody's window, without axes."""
    check_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def new_figure(
    width: float = 7.0, height: float = 4.0, rows: int = 1, columns: int = 1, even: bool = False
) -> tuple[Figure, Any]:
    """A figure that belongs to nobody's window, and its axes; rows share their x axis.

    The first row is the highest unless they are to be even.
    """
    figure = empty_figure(width, height)
    ratios = None if rows == 1 or even else [3.0, *([1.0] * (rows - 1))]
    axes = figure.subplots(rows, columns, sharex=rows > 1, height_ratios=ratios)
    for one in np.ravel(axes):
        one.spines[["top", "right"]].set_visible(False)
        one.grid(alpha=0.25)
    return figure, axes


def shown_axes(ax: Axes | None) -> Axes:
    """The given axes, or those of a new pyplot figure."""
    if ax is not None:
        return ax
    check_matplotlib()
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def shown_rows(axes: Sequence[Axes] | None, rows: int) -> Sequence[Axes]:
    """The given axes, or those of a new pyplot figure below one another."""
    if axes is not None:
        if len(axes) != rows:
            raise ValueError(f"axes has {len(axes)} of them: give {rows}")
        return axes
    check_matplotlib()
    from matplotlib import pyplot

    return list(pyplot.subplots(rows, 1, sharex=True, layout="constrained")[1])


def as_svg(figure: Figure, name: str) -> str:
    """A figure as an SVG element to be put into a page; the same picture gives the same text.

    Matplotlib names the parts of every picture alike; `name` before them tells the pictures of
    one page apart.
    """
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "deadtime", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    drawing = text.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    return re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", drawing)


def plot_fits(
    ax: Axes, recording: Recording, fits: Mapping[str, DelayEstimate], unit: str = "m"
) -> None:
    """Recorded output with the fitted ones over it."""
    ax.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    ax.plot(recording.time, recording.output, label="recorded", **DATA)
    for colour, (label, fit) in zip(COLOURS, fits.items(), strict=False):
        window = fit.recording
        ax.plot(window.time, window.output - fit.residuals, color=colour, lw=1.6, label=label)
    ax.set(xlabel="time / s", ylabel=f"output / {unit}")
    ax.legend(frameon=False, fontsize="small")


def plot_estimate(fit: DelayEstimate) -> Figure:
    """Fit over data, below it the residuals, beside it the profile of the delay if it has one."""
    flights = fit.flights
    profiled = fit.has_profile and "delay" in fit.stderr
    width = max(7.0, 3.5 * len(flights)) + 2.6 * profiled
    figure = empty_figure(width, 4.6)
    across = len(flights) + int(profiled)
    ratios = [2.2] * len(flights) + [1.5] * int(profiled)
    grid = figure.add_gridspec(2, across, height_ratios=[3.0, 1.0], width_ratios=ratios)
    for column, flight in enumerate(flights):
        upper = _bare(figure.add_subplot(grid[0, column]))
        lower = _bare(figure.add_subplot(grid[1, column], sharex=upper))
        _plot_flight(upper, lower, flight, f"{fit.method}, delay {fit.delay:.3f} s")
        if column == 0:
            upper.legend(frameon=False, fontsize="small")
        upper.tick_params(labelbottom=False)
        kind = "white" if fit.whiteness.white else "coloured"
        upper.set_ylabel("output" if column == 0 else "")
        lower.set_ylabel(f"residual\n({kind})" if column == 0 else "")
    if profiled:
        _plot_profile(_bare(figure.add_subplot(grid[:, -1])), fit)
    return figure


def _bare(ax: Axes) -> Axes:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25)
    return ax


def _plot_flight(upper: Axes, lower: Axes, flight: Flight, label: str) -> None:
    recording = flight.recording
    upper.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    upper.plot(recording.time, recording.output, label="recorded", **DATA)
    fitted = recording.output - flight.residuals
    upper.plot(recording.time, fitted, color=COLOURS[0], lw=1.6, label=label)
    lower.plot(recording.time, flight.residuals, **DATA)
    lower.axhline(0.0, color="0.6", lw=0.8)
    lower.set(xlabel="time / s")


def _plot_profile(ax: Axes, fit: DelayEstimate) -> None:
    """The t of every delay, with the 95 % interval where it crosses its level."""
    values, t = fit.profile("delay")
    ax.plot(values, t, color=COLOURS[0], lw=1.6)
    for end in fit.ci(0.95):
        ax.axvline(end, **REFERENCE)
    ax.axvline(fit.delay, color=COLOURS[1], lw=1.0)
    ax.axhline(1.96, color="0.6", lw=0.8, ls=":")
    ax.set(xlabel="delay / s", ylabel="t", ylim=(0.0, None), title="profile, and 95 % interval")
    ax.title.set_fontsize("small")


def plot_responses(ax: Axes, responses: Mapping[str, Response], unit: str = "m") -> None:
    """Several responses to the same reference."""
    for colour, (label, response) in zip(COLOURS, responses.items(), strict=False):
        ax.plot(response.time, response.outputs, color=colour, lw=1.6, label=label)
    ax.axhline(1.0, **REFERENCE)
    ax.set(xlabel="time / s", ylabel=f"output / {unit}")
    ax.legend(frameon=False, fontsize="small")


def plot_root_set(ax: Axes, roots: RootSet, chains: Sequence[Chain] = ()) -> None:
    """Characteristic roots in the complex plane, multiple ones with their multiplicity.

    The laws of `chains` are drawn as far up and down as there are roots.
    """
    values = np.asarray(roots.roots)
    ax.axvline(0.0, color="0.6", lw=0.8)
    size = 7.0 if values.size < 60 else 4.5
    ax.plot(values.real, values.imag, "x", color=COLOURS[0], ms=size, mew=size / 4, label="roots")
    for root, multiplicity in zip(values, roots.multiplicities, strict=True):
        if multiplicity > 1:
            ax.annotate(
                f"×{multiplicity}", (root.real, root.imag), (5, 5), textcoords="offset points"
            )
    if chains and values.size:
        top, bottom = float(values.imag.max()), float(values.imag.min())
        for number, chain in enumerate(chains):
            # The law says nothing about the first few roots: it begins where the bend has begun.
            foot = abs(chain.bend)
            for end in (top, bottom):
                if abs(end) > foot:
                    heights = np.sign(end) * np.geomspace(max(foot, 1e-3 * abs(end)), abs(end), 200)
                    label = "chains" if number == 0 and end == top else None
                    ax.plot(chain.real_part(heights), heights, label=label, **CHAIN)
        ax.legend(frameon=False, fontsize="small")
    ax.set(xlabel="Re s / (1/s)", ylabel="Im s / (rad/s)")


def plot_certificate(ax: Axes, proof: Certificate) -> None:
    """Contours of a proof in its segments, coloured by the argument of the function at each.

    Once around, the colours run through the circle as often as there are roots inside, but for the
    turns of the exponential that is taken out of the values, which are put back here.
    """
    from matplotlib.collections import LineCollection

    for contour in proof.contours:
        for mirrored in (False, True) if contour.symmetric else (False,):
            sign = -1.0 if mirrored else 1.0
            lines, turns = [], []
            for part in contour.segments:
                lines.append([(z.real, sign * z.imag) for z in (part.start, part.end)])
                turned = proof.delays[part.reference] * part.middle.imag
                turns.append(sign * np.angle(part.value * np.exp(-1j * turned)))
            colours = LineCollection(lines, cmap="twilight", lw=2.5, zorder=2)
            colours.set_array(np.asarray(turns))
            colours.set_clim(-np.pi, np.pi)
            ax.add_collection(colours)
            ends = np.array([line[0] for line in lines])
            ax.plot(ends[:, 0], ends[:, 1], ".", color="0.25", ms=2.5, zorder=3)
    if proof.contours:
        shown = ax.collections[-1]
        bar = ax.figure.colorbar(shown, ax=ax, ticks=[-np.pi, 0.0, np.pi], label="arg h / rad")
        bar.ax.set_yticklabels(["−π", "0", "π"])
    pieces = sum(len(contour.segments) for contour in proof.contours) + len(proof.real)
    plural = "" if proof.count == 1 else "s"
    ax.set(
        xlabel="Re s / (1/s)",
        ylabel="Im s / (rad/s)",
        title=f"{proof.count} root{plural}, proved on {pieces} segments",
    )
    ax.autoscale_view()


def plot_bode(
    axes: Sequence[Axes],
    G: TransferFunction | ControlLoop,
    omega: NDArray[np.float64],
    found: Margins | None,
) -> None:
    """Gain and phase over frequency; with the margins, where they are read off."""
    upper, lower = axes
    gain, phase = np.abs(G.frequency_response(omega)), np.degrees(G.phase(omega))
    upper.loglog(omega, gain, color=COLOURS[0], lw=1.6)
    lower.semilogx(omega, phase, color=COLOURS[0], lw=1.6)
    if found is not None:
        upper.axhline(1.0, **REFERENCE)
        lower.axhline(-180.0, **REFERENCE)
        if found.stable:
            _mark_bode_margins(upper, lower, G, found)
    # With a delay the phase falls without end; where the gain is gone it is of no interest.
    lowest = float(phase[gain > 1e-3 * gain.max()].min()) if gain.max() > 0.0 else phase.min()
    lowest, highest = max(phase.min(), min(lowest, -270.0), -1440.0), float(phase.max())
    step = 90.0 if highest - lowest <= 900.0 else 180.0
    lower.set_ylim(step * np.floor(lowest / step) - 15.0, step * np.ceil(highest / step) + 15.0)
    lower.yaxis.set_major_locator(_multiples(step))
    for ax in axes:
        ax.grid(alpha=0.25)
    upper.set(ylabel="gain")
    lower.set(xlabel="frequency / (rad/s)", ylabel="phase / °", xlim=(omega[0], omega[-1]))
    if found is not None:
        upper.set_title(_in_words(found), fontsize="medium")


def _multiples(step: float) -> Any:
    from matplotlib.ticker import MultipleLocator

    return MultipleLocator(step)


def _mark_bode_margins(
    upper: Axes, lower: Axes, G: TransferFunction | ControlLoop, found: Margins
) -> None:
    """Gain margin between 1 and the gain, phase margin between the phase and 180 degrees."""
    at = found.gain_margin_omega
    if np.isfinite(at) and at > 0.0:
        upper.plot([at, at], [1.0, 1.0 / found.gain_margin], color=COLOURS[1], marker="o", ms=4)
        lower.axvline(at, color=COLOURS[1], lw=0.8, ls=":")
    at = found.phase_margin_omega
    if np.isfinite(at):
        phase = float(np.degrees(G.phase(at)))
        line = 360.0 * np.round((phase + 180.0) / 360.0) - 180.0
        lower.plot([at, at], [phase, line], color=COLOURS[2], marker="o", ms=4)
        upper.axvline(at, color=COLOURS[2], lw=0.8, ls=":")


def _in_words(found: Margins) -> str:
    if not found.stable:
        return "closed loop not stable"
    return (
        f"gain margin {_number(found.gain_margin)}, phase margin "
        f"{_number(found.phase_margin, '°')}, delay margin {_number(found.delay_margin, ' s')}"
    )


def _number(value: float, unit: str = "") -> str:
    return "∞" if np.isinf(value) else f"{value:.3g}{unit}"


def plot_nyquist(
    ax: Axes, G: TransferFunction, omega: NDArray[np.float64], found: Margins | None
) -> None:
    """Frequency response in the complex plane around the critical point -1."""
    # Between the given frequencies a delay would turn through corners: draw enough points.
    longest = max(float(G.num.delays[-1]), float(G.den.delays[-1]))
    fine = np.unique(np.append(omega, _spread(omega, longest)))
    values = G.frequency_response(fine)
    ax.axhline(0.0, color="0.8", lw=0.8)
    ax.axvline(0.0, color="0.8", lw=0.8)
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 361))
    ax.plot(circle.real, circle.imag, color="0.6", lw=0.9, ls=":", label="gain 1")
    ax.plot(values.real, values.imag, color=COLOURS[0], lw=1.6, label="ω > 0")
    ax.plot(values.real, -values.imag, color=COLOURS[0], lw=1.0, ls="--", label="ω < 0")
    ax.plot(-1.0, 0.0, "+", color=COLOURS[1], ms=11, mew=2.2, label="-1")
    if found is not None and found.stable:
        for at, colour, name in (
            (found.gain_margin_omega, COLOURS[1], "gain margin"),
            (found.phase_margin_omega, COLOURS[2], "phase margin"),
        ):
            if np.isfinite(at):
                point = complex(G(1j * at))
                ax.plot(point.real, point.imag, "o", color=colour, ms=5, label=name)
    if found is not None:
        ax.set_title(_in_words(found), fontsize="medium")
    # What goes far out, to infinity with an integrator, would hide the critical point.
    farthest = float(np.abs(values[np.isfinite(values)]).max(initial=1.0))
    reach = 2.5 if farthest > 10.0 or np.isinf(G.dcgain()) else max(1.5, 1.1 * farthest)
    _arrow(ax, values, reach)
    ax.set(
        xlabel="Re G(jω)",
        ylabel="Im G(jω)",
        xlim=(-reach, reach),
        ylim=(-reach, reach),
        aspect="equal",
    )
    ax.legend(frameon=False, fontsize="small", loc="upper right")


def _spread(omega: NDArray[np.float64], longest: float) -> NDArray[np.float64]:
    """Frequencies so close that the longest delay turns by a twentieth of a radian, if not many."""
    number = min(int(20.0 * longest * (omega[-1] - omega[0])), 20_000)
    return np.linspace(omega[0], omega[-1], number)


def _arrow(ax: Axes, values: NDArray[np.complex128], reach: float) -> None:
    """Direction of rising frequency, where the curve is well inside the picture."""
    shown = np.flatnonzero((np.abs(values) < 0.8 * reach) & (np.abs(values) > 0.3 * reach))
    shown = shown[shown + 1 < values.size]
    if shown.size:
        walked = np.cumsum(np.abs(values[shown + 1] - values[shown]))
        i = int(shown[np.searchsorted(walked, 0.4 * walked[-1])])
        tip, tail = values[i + 1], values[i]
        ax.annotate(
            "",
            (tip.real, tip.imag),
            (tail.real, tail.imag),
            arrowprops={"arrowstyle": "-|>", "color": COLOURS[0], "mutation_scale": 16.0},
        )
