"""Pictures of designs: the map with the gains, the step, the Bode plot; the choice of a filter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from deadtime._base.drawing import COLOURS, REFERENCE, Axes, Figure, empty_figure

if TYPE_CHECKING:
    from deadtime.loops import ControlLoop
    from deadtime.systems import Response
    from deadtime.tuning._result import Design, FilterChoice

#: Points of a curve, and how far below and above the corner the controller is drawn.
_POINTS = 801
_BELOW = 0.02
_ABOVE = 30.0


def plot_design(design: Design) -> Figure:
    """Map, step response, and the Bode plot of the loop at the design's middle."""
    figure, panels = _panels()
    _map(panels["map"], design)
    _steps(panels["step"], design)
    _loop_bode((panels["gain"], panels["phase"]), design.loop)
    return figure


def plot_filter_choice(choice: FilterChoice) -> Figure:
    """The trade over the corner, controllers with and without filter, the loop with its margins."""
    figure, panels = _panels(choice=True)
    _trade(panels["map"], panels["step"], choice)
    _controllers((panels["size"], panels["turn"]), choice)
    _loop_bode((panels["gain"], panels["phase"]), choice.design.loop)
    return figure


def _panels(choice: bool = False) -> tuple[Figure, dict[str, Any]]:
    figure = empty_figure(13.5 if choice else 11.0, 7.0)
    layout: Any = [["map", "gain"], ["step", "phase"]]
    if choice:
        layout = [["map", "size", "gain"], ["step", "turn", "phase"]]
    panels = figure.subplot_mosaic(layout)
    for ax in panels.values():
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(alpha=0.25)
    return figure, panels


def _map(ax: Axes, design: Design) -> None:
    chart = design.charts[len(design.charts) // 2]
    late = design.loop.delay or 0.0
    chosen = {name: design.loop.parameters[name] for name in chart.names}
    chart.plot(ax, chosen)
    held = [
        f"{name} = {value:.3g}" for name, value in design.gains.items() if name not in chart.names
    ]
    if "delay" not in chart.names:
        held.append(f"delay {late:.3g} s")
    ax.set_title(", ".join(held), fontsize="medium")


def _steps(ax: Axes, design: Design) -> None:
    """The step at the middle, and at the ends of the delay's interval."""
    responses: dict[str, Response] = {}
    end = max(
        float(design.loop.replace(delay=late).step_response(amplitude=design.amplitude).time[-1])
        for late in design.delays
    )
    time = np.linspace(0.0, min(end, _settled(design, end)), _POINTS)
    for late in design.delays:
        loop = design.loop.replace(delay=late)
        responses[f"delay {late:.3g} s"] = loop.simulate(time, design.amplitude)
    for colour, (label, response) in zip(COLOURS, responses.items(), strict=False):
        ax.plot(response.time, response.outputs, color=colour, lw=1.6, label=label)
    middle = list(responses.values())[len(responses) // 2]
    ax.plot(middle.time, middle.inputs, color="0.5", lw=0.9, label="command")
    ax.axhline(design.amplitude, **REFERENCE)
    ax.set(xlabel="time / s", ylabel="output")
    ax.legend(frameon=False, fontsize="small")


def _settled(design: Design, end: float) -> float:
    """A time by which the step at the middle has settled, with some to spare."""
    settling = design.step_info["settling_time"]
    return 2.5 * settling if np.isfinite(settling) and settling > 0.0 else end


def _loop_bode(axes: tuple[Axes, Axes], loop: ControlLoop) -> None:
    loop.bode(ax=axes)
    axes[0].set_xlim(axes[1].get_xlim())
    axes[0].title.set_fontsize("small")
    axes[0].set_ylabel("loop gain")
    axes[1].set_ylabel("phase of the loop / °")


def _trade(upper: Axes, lower: Axes, choice: FilterChoice) -> None:
    """Objective and noise gain over the corner, with the chosen one and the ideal derivative."""
    name = choice.design.objective.replace("_", " ")
    panels = (
        (upper, choice.values, choice.value, choice.ideal.value, name, COLOURS[0]),
        (
            lower,
            choice.noise_gains,
            choice.noise_gain,
            choice.ideal_noise_gain,
            "noise of the command / noise of the measurement",
            COLOURS[2],
        ),
    )
    for ax, curve, chosen, ideal, label, colour in panels:
        ax.semilogx(choice.omegas, curve, ".-", color=colour, lw=1.6)
        ax.semilogx(choice.omega, chosen, "*", color=COLOURS[1], ms=14, mec="w", zorder=4)
        ax.axhline(ideal, label="ideal derivative", **REFERENCE)
        ax.set(ylabel=label)
        ax.legend(frameon=False, fontsize="small")
    lower.set_yscale("log")
    upper.set_title(f"chosen: {choice.omega:.3g} rad/s", fontsize="medium")
    lower.set_xlabel("corner of the filter / (rad/s)")


def _controllers(axes: tuple[Axes, Axes], choice: FilterChoice) -> None:
    """Frequency responses of the controller with the filter and without, each with its gains."""
    upper, lower = axes
    omega = np.geomspace(_BELOW * choice.omega, _ABOVE * choice.omega, _POINTS)
    both = (("with the filter", choice.design, COLOURS[0]), ("without", choice.ideal, COLOURS[1]))
    for label, design, colour in both:
        found = design.loop.controller.transfer_function()
        gains = ", ".join(f"{key} {value:.3g}" for key, value in design.gains.items())
        response = found.frequency_response(omega)
        upper.loglog(omega, np.abs(response), color=colour, lw=1.6, label=f"{label}: {gains}")
        lower.semilogx(omega, np.degrees(found.phase(omega)), color=colour, lw=1.6)
    for ax in axes:
        ax.axvline(choice.omega, color="0.5", lw=0.8, ls=":")
        if choice.design.loop.sample_time is not None:
            ax.axvline(np.pi / choice.design.loop.sample_time, color="0.5", lw=0.8, ls="-.")
    upper.set_title("controller (dotted: corner)", fontsize="medium")
    upper.set(ylabel="gain of the controller")
    lower.set(xlabel="frequency / (rad/s)", ylabel="phase of the controller / °")
    upper.legend(frameon=False, fontsize="small")
