"""`write_report`: a self-contained HTML page about one recording and the gains for it."""

from __future__ import annotations

from pathlib import Path

from deadtime._base.drawing import Figure, new_figure
from deadtime._base.page import page, write_page
from deadtime.estimation import COLUMNS, plot_fits, truth_row
from deadtime.reports._study import Study
from deadtime.systems import plot_responses
from deadtime.tuning import live_design


def write_report(study: Study, path: Path) -> Path:
    """Write the page to `path` and return it."""
    return write_page(render(study), path)


def render(study: Study) -> str:
    """The page as text."""
    rows, kinds = study.comparison.rows(), []
    if study.truth is not None:
        kinds = [""] * len(rows) + ["truth"]
        rows = [*rows, truth_row(study.truth.numbers)]
    return page(
        "reports/page.html",
        title=f"The delay in {study.recording.source or 'a recorded loop'}",
        described=_described(study),
        verdict=study.headline(),
        heads=COLUMNS,
        rows=rows,
        kinds=kinds,
        sentences=[*study.comparison.explanation(), *study.comparison.limitations()],
        fits=_fits(study),
        map=_map(study),
        map_caption=_map_caption(study),
        responses=_responses(study),
        simulated=study.simulated_loop,
        explorer=live_design(study.designed),
    )


def _described(study: Study) -> str:
    recording, loop = study.recording, study.known
    words = (
        f"{len(recording)} samples over {recording.time[-1] - recording.time[0]:.1f} s, "
        f"{_controlled(study)}"
    )
    if loop.sample_time is not None:
        words += f", each command held for {1e3 * loop.sample_time:g} ms"
    if loop.limit is not None:
        words += f" and limited to ±{loop.limit:g}"
    if study.window is not None:
        words += f"; estimated from {study.window[0]:g} to {study.window[1]:g} s"
    return words + "."


def _controlled(study: Study) -> str:
    controller = study.known.controller
    gains = ", ".join(f"{name} = {value:g}" for name, value in controller.gains.items())
    return f"under {type(controller).__name__} control with {gains}"


def _fits(study: Study) -> Figure:
    figure, axes = new_figure(7.5, 3.8)
    plot_fits(axes, study.fit.recording, study.comparison.pictured())
    return figure


def _map(study: Study) -> Figure:
    figure, axes = new_figure(7.0, 4.4)
    design = study.designed
    design.charts[len(design.charts) // 2].plot(axes, design.gains)
    return figure


def _map_caption(study: Study) -> str:
    delays = study.designed.delays
    return (
        "Spectral abscissa of the fitted loop with its hold, at a delay of "
        f"{delays[len(delays) // 2]:.3f} s. Cells without colour are unstable. The star marks "
        "the designed gains, which are stable for all delays that were tried, "
        f"{min(delays):.3f} to {max(delays):.3f} s. Proportional control alone is stable up to "
        f"Kp = {study.held_limit:.3f} with the hold, and up to Kp = "
        f"{study.continuous_limit:.3f} without the hold in the model."
    )


def _responses(study: Study) -> Figure:
    figure, axes = new_figure(7.5, 3.8)
    labelled = {}
    for (name, response), designed in zip(
        study.responses.items(), (study.designed, study.naive), strict=True
    ):
        gains = ", ".join(f"{key} {value:.3g}" for key, value in designed.gains.items())
        labelled[f"{name} ({gains})"] = response
    plot_responses(axes, labelled)
    return figure
