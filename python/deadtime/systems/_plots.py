"""Drawings of responses over frequency and time. Matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from deadtime._base.drawing import COLOURS, REFERENCE, Axes
from deadtime.systems._margins import Margins
from deadtime.systems._response import Response
from deadtime.systems._transfer import TransferFunction

if TYPE_CHECKING:
    from numpy.typing import NDArray


class HasFrequencyResponse(Protocol):
    """What has a gain and a phase at each frequency."""

    def frequency_response(self, omega: Any, /) -> NDArray[np.complex128]: ...

    def phase(self, omega: Any, /) -> Any: ...


def plot_responses(ax: Axes, responses: Mapping[str, Response], unit: str = "m") -> None:
    """Several responses to the same reference."""
    for colour, (label, response) in zip(COLOURS, responses.items(), strict=False):
        ax.plot(response.time, response.outputs, color=colour, lw=1.6, label=label)
    ax.axhline(1.0, **REFERENCE)
    ax.set(xlabel="time / s", ylabel=f"output / {unit}")
    ax.legend(frameon=False, fontsize="small")


def plot_bode(
    axes: Sequence[Axes],
    G: HasFrequencyResponse,
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
    # With a delay the phase falls without bound; show it where the gain is not negligible.
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


def _mark_bode_margins(upper: Axes, lower: Axes, G: HasFrequencyResponse, found: Margins) -> None:
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
    # Large values, which an integrator has at low frequencies, would hide the critical point.
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
