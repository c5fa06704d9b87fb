"""One self-contained page about one recording: what it says, and what to do."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from deadtime._estimation.compare import COLUMNS, LABELS, truth_row
from deadtime._experiment import Study
from deadtime._plots import (
    as_svg,
    new_figure,
    plot_fits,
    plot_responses,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["write_report"]

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.55 system-ui, sans-serif; color: #222; max-width: 52rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; }
h2 { font-size: 1.15rem; margin-top: 2rem; }
.verdict { background: #eef4fa; border-left: 4px solid #0b6fb8; padding: .8rem 1rem; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th, td { text-align: right; padding: .25rem .6rem; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
tr.truth td { font-weight: 600; background: #f5f5f0; }
figure { margin: 1rem 0; }
figcaption { color: #555; font-size: .9rem; }
svg { max-width: 100%; height: auto; }
"""


def write_report(study: Study, path: Path) -> Path:
    """Write the page to `path` and return it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(render(study), encoding="utf-8")
    return path


def render(study: Study) -> str:
    """The page as text."""
    title = f"The delay in {study.recording.source or 'a recorded loop'}"
    return "\n".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{_text(title)}</title><style>{STYLE}</style></head><body>",
            f"<h1>{_text(title)}</h1>",
            f"<p>{_text(_described(study))}</p>",
            f'<p class="verdict">{_text(study.verdict())}</p>',
            "<h2>The delay, by several methods</h2>",
            _estimates(study),
            *(f"<p>{_text(sentence)}</p>" for sentence in study.comparison.explanation()),
            _fits(study),
            "<h2>Which gains are stable</h2>",
            _map(study),
            "<h2>With the delay known, and without</h2>",
            _responses(study),
            "</body></html>\n",
        ]
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
    head = _row(COLUMNS, "th", width).replace("<th>", '<th scope="col">')
    body = [_row(row, "td", width) for row in study.comparison.rows()]
    if study.truth is not None:
        row = _row(truth_row(study.truth.numbers), "td", width)
        body.append(row.replace("<tr>", '<tr class="truth">'))
    return (
        f"<table>{head}{''.join(body)}</table>"
        "<p>In brackets: taken as given, not fitted. Sum: delay and lag, which one step determines "
        "better than either. “As flown”: with the hold and the limit.</p>"
    )


def _row(cells: Sequence[str], tag: str, width: int) -> str:
    span = width - len(cells) + 1
    opened = [f"<{tag}>"] * (len(cells) - 1)
    opened.append(f'<{tag} colspan="{span}">' if span > 1 else f"<{tag}>")
    inner = "".join(
        f"{open_}{_text(cell)}</{tag}>" for open_, cell in zip(opened, cells, strict=True)
    )
    return f"<tr>{inner}</tr>"


def _fits(study: Study) -> str:
    figure, axes = new_figure(7.5, 3.8)
    estimates = study.comparison.estimates
    fits = {
        f"{LABELS[name]}: {estimates[name].delay:.3f} s": estimates[name]
        for name in ("dominant", "waveform", "waveform with lag")
        if name in estimates
    }
    plot_fits(axes, study.fit.recording, fits)
    return _figure("fits", figure, "The recorded step and the loops that the methods make of it.")


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
        f" ({study.continuous_limit:.3f} if one forgets the hold)."
    )
    return _figure("map", figure, caption)


def _responses(study: Study) -> str:
    figure, axes = new_figure(7.5, 3.8)
    labelled = {}
    for (name, response), made in zip(
        study.responses.items(), (study.designed, study.naive), strict=True
    ):
        gains = ", ".join(f"{key} {value:.3g}" for key, value in made.gains.items())
        labelled[f"{name} ({gains})"] = response
    plot_responses(axes, labelled)
    caption = (
        f"A step of 1 m on {study.flown_on}, limit included: gains made for the delay beside "
        "gains made in the same way as if there were none."
    )
    return _figure("responses", figure, caption)


def _figure(name: str, figure: Figure, caption: str) -> str:
    drawing = as_svg(figure, name).replace(
        "<svg ", f'<svg role="img" aria-labelledby="{name}-caption" ', 1
    )
    return (
        f'<figure>{drawing}<figcaption id="{name}-caption">{_text(caption)}</figcaption></figure>'
    )


def _text(words: str) -> str:
    return html.escape(words)
