"""`write_report`: a self-contained HTML page about one recording and the gains for it."""

from __future__ import annotations

from pathlib import Path

from deadtime._base.drawing import new_figure
from deadtime._base.page import escaped, page, picture, table, table_row, write_page
from deadtime.estimation._compare import COLUMNS, truth_row
from deadtime.estimation._plots import plot_fits
from deadtime.reports._study import Study
from deadtime.systems._plots import plot_responses
from deadtime.tuning._live import live_section


def write_report(study: Study, path: Path) -> Path:
    """Write the page to `path` and return it."""
    return write_page(render(study), path)


def render(study: Study) -> str:
    """The page as text."""
    title = f"The delay in {study.recording.source or 'a recorded loop'}"
    return page(
        title,
        [
            f"<p>{escaped(_described(study))}</p>",
            f'<p class="verdict">{escaped(study.verdict())}</p>',
            "<h2>The delay, by several methods</h2>",
            _estimates(study),
            *(f"<p>{escaped(sentence)}</p>" for sentence in study.comparison.explanation()),
            *(f"<p>{escaped(sentence)}</p>" for sentence in study.comparison.limitations()),
            _fits(study),
            "<h2>Which gains are stable</h2>",
            _map(study),
            "<h2>Designed with the delay, and without</h2>",
            _responses(study),
            *live_section(study.designed),
        ],
    )


def _described(study: Study) -> str:
    recording, loop = study.recording, study.known
    words = (
        f"{len(recording)} samples over {recording.time[-1] - recording.time[0]:.1f} s, "
        f"{_controlled(study)}"
    )
    if loop.sample_time is not None:
        words += f", the command held for {1e3 * loop.sample_time:g} ms"
    if loop.limit is not None:
        words += f" and limited to ±{loop.limit:g}"
    if study.window is not None:
        words += f"; the estimates are from {study.window[0]:g} to {study.window[1]:g} s"
    return words + "."


def _controlled(study: Study) -> str:
    controller = study.known.controller
    gains = ", ".join(f"{name} = {value:g}" for name, value in controller.gains.items())
    return f"under {type(controller).__name__} control with {gains}"


def _estimates(study: Study) -> str:
    width = len(COLUMNS)
    body = [table_row(row, "td", width) for row in study.comparison.rows()]
    if study.truth is not None:
        row = table_row(truth_row(study.truth.numbers), "td", width)
        body.append(row.replace("<tr>", '<tr class="truth">'))
    return (
        f"{table(COLUMNS, body)}"
        "<p>In brackets: taken as given, not fitted. Sum: delay and lag, which one step determines "
        "better than either. “Overshoot with limit”: with the hold too.</p>"
    )


def _fits(study: Study) -> str:
    figure, axes = new_figure(7.5, 3.8)
    plot_fits(axes, study.fit.recording, study.comparison.pictured())
    return picture("fits", figure, "The recorded step, and the fitted loops of the methods.")


def _map(study: Study) -> str:
    figure, axes = new_figure(7.0, 4.4)
    design = study.designed
    chart = design.charts[len(design.charts) // 2]
    chart.plot(axes, design.gains)
    caption = (
        f"Spectral abscissa of the fitted loop with its hold, at a delay of "
        f"{design.delays[len(design.delays) // 2]:.3f} s; white is unstable, the star is the "
        f"design, which is stable for every delay tried from {min(design.delays):.3f} to "
        f"{max(design.delays):.3f} s. Proportional control alone is stable up to Kp = "
        f"{study.held_limit:.3f} with the hold"
        f" ({study.continuous_limit:.3f} without the hold in the model)."
    )
    return picture("map", figure, caption)


def _responses(study: Study) -> str:
    figure, axes = new_figure(7.5, 3.8)
    labelled = {}
    for (name, response), designed in zip(
        study.responses.items(), (study.designed, study.naive), strict=True
    ):
        gains = ", ".join(f"{key} {value:.3g}" for key, value in designed.gains.items())
        labelled[f"{name} ({gains})"] = response
    plot_responses(axes, labelled)
    caption = (
        f"A step of 1 m on {study.simulated_loop}, with its limit: gains designed for the delay, "
        "and gains designed in the same way without it."
    )
    return picture("responses", figure, caption)
