"""The page about a flight experiment: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deadtime._base.digits import stated
from deadtime._base.drawing import new_figure
from deadtime._base.page import page, write_page
from deadtime.flights._adaptive import STEP_COLUMNS, AdaptiveStudy
from deadtime.flights._plots import plot_checked, plot_learned, plot_telemetry
from deadtime.flights._runs import read_telemetry
from deadtime.flights._study import COLUMNS, FlightStudy
from deadtime.tuning import live_design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = ("what", "time", "95 % interval")


def write_flight_page(
    studies: FlightStudy | Sequence[FlightStudy],
    path: Path,
    vehicle: str,
    adapted: Mapping[str, AdaptiveStudy] | None = None,
) -> Path:
    """Write the page to `path` and return it.

    Parameters
    ----------
    studies : FlightStudy or sequence of FlightStudy
        One for each axis.
    path : Path
        The file.
    vehicle : str
        Its name in words.
    adapted : mapping of str to AdaptiveStudy, optional
        Flights with gains that follow the delay, by axis.
    """
    several = [studies] if isinstance(studies, FlightStudy) else list(studies)
    return write_page(render(several, vehicle, adapted or {}), path)


def render(
    studies: Sequence[FlightStudy], vehicle: str, adapted: Mapping[str, AdaptiveStudy]
) -> str:
    """The page as text."""
    return page(
        "flights/page.html",
        title=f"Steps flown by {vehicle}",
        described=_described(studies, vehicle),
        verdict=_verdict(studies),
        axes=[_axis(study, len(studies) > 1, adapted) for study in studies],
        step_heads=STEP_COLUMNS,
        heads=COLUMNS,
        parts_heads=PARTS,
    )


def _verdict(studies: Sequence[FlightStudy]) -> str:
    """The outcomes; of several axes the warnings are in their sections."""
    if len(studies) == 1:
        return studies[0].headline()
    sentences = [study.outcome() for study in studies]
    doubtful = [study.axis.name for study in studies if study.learned.verdict != "reliable"]
    if doubtful:
        sentences.append(
            f"The estimates of these axes are only indications: {', '.join(doubtful)}. The "
            "reasons are below."
        )
    return " ".join(sentences)


def _axis(
    study: FlightStudy, several: bool, adapted: Mapping[str, AdaptiveStudy]
) -> dict[str, Any]:
    """What the page has of one axis."""
    designed, axis = study.learned.designed, study.axis
    following = adapted.get(axis.name)
    return {
        "name": axis.name,
        "of": f" of {axis.name}, the {axis.words}" if several else "",
        "warnings": study.learned.warnings() if several else [],
        "rows": study.rows(),
        "parts": study.parts(),
        "fitted": _fitted(study),
        "checked": _checked(study),
        "learned": _learned(study),
        "telemetry": _telemetry(study),
        "gains": designed.summary(),
        "explorer": live_design(designed),
        "following": None if following is None else "\n".join(following.lines()),
        "steps": [] if following is None else following.rows(),
    }


def _described(studies: Sequence[FlightStudy], vehicle: str) -> str:
    flown = []
    for study in studies:
        axis, plan = study.axis, study.plan
        gains = ", ".join(f"{flight.controller.gains['Kp']:g}" for flight in study.learned.flights)
        largest = plan.limits.largest(axis)
        flown.append(
            f"steps of the {axis.words} by {plan.step:g} {axis.unit} under P control with Kp = "
            f"{gains}, and commands of at most {largest:g} {axis.rate_unit}"
        )
    count = sum(len(study.flights) for study in studies)
    return (
        f"{count} flights of {vehicle}: {'; '.join(flown)}, and then flights with the gains "
        "that were designed from these."
    )


def _checked(study: FlightStudy) -> Figure:
    figure, axes = new_figure(7.5, 4.6, rows=2)
    plot_checked(axes, [study.before, *study.checked])
    return figure


def _fitted(study: FlightStudy) -> str:
    learned = study.learned
    fit = learned.fit
    small = study.axis.thousandth
    words = (
        f"The residuals of the fit to all flights have an rms of {1e3 * fit.rms:.1f} {small} "
        f"(gain {stated(fit.gain or 0.0, fit.stderr['gain'])}). "
        + (
            "They are no larger than noise of sensor and wind."
            if fit.verdict == "reliable"
            else "They are larger than noise, so the intervals are only an indication."
        )
    )
    if len(learned.tried) > 1:
        words += (
            f" These plants were tried: {'; '.join(case.line(small) for case in learned.tried)}."
        )
    ages = [flight.age for flight in learned.flights]
    if all(age is not None for age in ages):
        mean = sum(age for age in ages if age is not None) / len(ages)
        words += (
            " Each output has the time of the vehicle's clock. When a command was computed, "
            f"the output was on average {1e3 * mean:.0f} ms older than an output from a fast "
            "message. This age is part of the delay."
        )
    if learned.split is None:
        words += (
            " It is not known how much of the delay belongs to the link and how much to the "
            f"vehicle: {learned.unsplit}."
        )
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
    telemetry = None if study.learned.split is None else read_telemetry(flight)
    if telemetry is None:
        return None
    figure, axes = new_figure(7.5, 4.2, rows=2)
    plot_telemetry(axes, telemetry, flight)
    return figure
