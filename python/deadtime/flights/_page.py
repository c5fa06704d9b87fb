"""The page about a flight experiment: one self-contained HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from deadtime._base.digits import stated
from deadtime._base.drawing import new_figure
from deadtime._base.page import page, write_page
from deadtime.flights._learn import COLUMNS, FlightStudy
from deadtime.flights._plots import plot_checked, plot_learned, plot_telemetry
from deadtime.flights._runs import read_telemetry
from deadtime.tuning._live import live_design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = ("what", "time", "95 % interval")


def write_flight_page(study: FlightStudy, path: Path, vehicle: str) -> Path:
    """Write the page to `path` and return it; `vehicle` is its name in words."""
    return write_page(render(study, vehicle), path)


def render(study: FlightStudy, vehicle: str) -> str:
    """The page as text."""
    designed = study.learned.designed
    return page(
        "flights/page.html",
        title=f"Steps flown by {vehicle}",
        described=_described(study, vehicle),
        verdict=study.verdict(),
        heads=COLUMNS,
        rows=study.rows(),
        parts_heads=PARTS,
        parts=study.parts(),
        fitted=_fitted(study),
        checked=_checked(study),
        learned=_learned(study),
        telemetry=_telemetry(study),
        gains=designed.summary(),
        explorer=live_design(designed),
    )


def _described(study: FlightStudy, vehicle: str) -> str:
    learned = study.learned
    gains = ", ".join(f"{one.controller.gains['Kp']:g}" for one in learned.flights)
    return (
        f"{len(study.flights)} flights of {vehicle}: steps of {study.step:g} m under P control "
        f"with Kp = {gains}, commands limited to {study.max_climb:g} m/s; then under the gains "
        "that were designed from these."
    )


def _checked(study: FlightStudy) -> Figure:
    figure, axes = new_figure(7.5, 4.6, rows=2)
    plot_checked(axes, [study.before, *study.checked])
    return figure


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


def _learned(study: FlightStudy) -> Figure:
    flights = study.learned.flights
    figure, axes = new_figure(7.5, 0.6 + 2.0 * len(flights), rows=len(flights), even=True)
    shown = [axes] if len(flights) == 1 else list(axes)
    plot_learned(shown, flights, study.learned.fit)
    return figure


def _telemetry(study: FlightStudy) -> Figure | None:
    """What the vehicle reported of a step, if the delay was divided by that."""
    flight = study.before
    if study.learned.split is None or flight.telemetry is None:
        return None
    telemetry = read_telemetry(flight.telemetry, flight.recording)
    if telemetry is None:
        return None
    figure, axes = new_figure(7.5, 4.2, rows=2)
    plot_telemetry(axes, telemetry, flight)
    return figure
