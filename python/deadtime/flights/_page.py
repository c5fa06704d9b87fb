"""The page about a flight experiment: one self-contained HTML file."""

from __future__ import annotations

from pathlib import Path

from deadtime._base.digits import stated
from deadtime._base.drawing import new_figure
from deadtime._base.page import escaped, page, picture, table, table_row, write_page
from deadtime.flights._learn import COLUMNS, FlightStudy
from deadtime.flights._plots import plot_checked, plot_learned, plot_telemetry
from deadtime.flights._runs import read_telemetry
from deadtime.tuning._live import live_section

PARTS = ("what", "time", "95 % interval")


def write_flight_page(study: FlightStudy, path: Path, vehicle: str) -> Path:
    """Write the page to `path` and return it; `vehicle` is its name in words."""
    return write_page(render(study, vehicle), path)


def render(study: FlightStudy, vehicle: str) -> str:
    """The page as text."""
    learned = study.learned
    body = [
        f"<p>{escaped(_described(study, vehicle))}</p>",
        f'<p class="verdict">{escaped(study.verdict())}</p>',
        "<h2>Before and after</h2>",
        _checked(study),
        table(COLUMNS, [table_row(row, "td", len(COLUMNS)) for row in study.rows()]),
        "<p>Settled: the mean time until a step stays within 5 %, or within three times the noise "
        "of the height where that is more. The paper's delay is read from the overshoot, with a "
        "gain of 1 and no lag; where it does not determine one, there is none. Missed: samples "
        "that the control loop skipped.</p>",
        "<h2>What the delay consists of</h2>",
        table(PARTS, [table_row(row, "td", len(PARTS)) for row in study.parts()]),
        f"<p>{escaped(_fitted(study))}</p>",
        _learned(study),
        _telemetry(study),
        "<h2>The gains</h2>",
        f"<pre>{escaped(learned.designed.summary())}</pre>",
        *live_section(learned.designed),
    ]
    return page(f"Steps flown by {vehicle}", body)


def _described(study: FlightStudy, vehicle: str) -> str:
    learned = study.learned
    gains = ", ".join(f"{one.controller.gains['Kp']:g}" for one in learned.flights)
    return (
        f"{len(study.flights)} flights of {vehicle}: steps of {study.step:g} m under P control "
        f"with Kp = {gains}, commands limited to {study.max_climb:g} m/s; then under the gains "
        "that were designed from these."
    )


def _checked(study: FlightStudy) -> str:
    figure, axes = new_figure(7.5, 4.6, rows=2)
    plot_checked(axes, [study.before, *study.checked])
    return picture(
        "checked", figure, "The first step of each flight, with the heights as received."
    )


def _fitted(study: FlightStudy) -> str:
    learned = study.learned
    fit = learned.fit
    words = (
        f"The residuals of the fit of all flights together are {1e3 * fit.rms:.1f} mm (gain "
        f"{stated(fit.gain or 0.0, fit.stderr['gain'])}); "
        + (
            "they are white noise."
            if fit.adequate
            else "they are not white, so the intervals are an indication only."
        )
    )
    if learned.split is None:
        words += f" The delay is not divided between link and vehicle: {learned.unsplit}."
    return words


def _learned(study: FlightStudy) -> str:
    flights = study.learned.flights
    figure, axes = new_figure(7.5, 0.6 + 2.0 * len(flights), rows=len(flights), even=True)
    shown = [axes] if len(flights) == 1 else list(axes)
    plot_learned(shown, flights, study.learned.fit)
    return picture("learned", figure, "The flights from which the delay was estimated.")


def _telemetry(study: FlightStudy) -> str:
    flight = study.before
    if study.learned.split is None or flight.telemetry is None:
        return ""
    telemetry = read_telemetry(flight.telemetry, flight.recording)
    if telemetry is None:
        return ""
    figure, axes = new_figure(7.5, 4.2, rows=2)
    plot_telemetry(axes, telemetry, flight)
    caption = (
        "One step as reported by the vehicle: the link from the command to the echoed setpoint, "
        "the vehicle from there to its climb."
    )
    return picture("telemetry", figure, caption)
