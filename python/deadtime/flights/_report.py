"""`fly_and_report`: the experiment on several axes, gains that follow the delay, and the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deadtime._base.page import check_pages
from deadtime._base.plain import json_text
from deadtime._base.progress import Stages, stage_report
from deadtime.flights._adaptive import AdaptivePlan, AdaptiveStudy, fly_adaptive
from deadtime.flights._fly import fly_axes
from deadtime.flights._page import write_flight_page
from deadtime.flights._plan import FlightPlan
from deadtime.flights._study import FlightStudy
from deadtime.flights._vehicles import FlownVehicle


@dataclass(frozen=True)
class FlightReport:
    """Results of the experiment on all axes, and where they are written.

    Attributes
    ----------
    vehicle : str
        What was flown, in words.
    studies : tuple of FlightStudy
        The experiment on each axis.
    folder : Path
        Folder of the recordings, the page and the numbers.
    adapted : mapping of str to AdaptiveStudy
        Flights with gains that follow the delay, by axis.
    round_trip : float or None
        Median round trip of the link, s, where it is measured.
    """

    vehicle: str
    studies: tuple[FlightStudy, ...]
    folder: Path
    adapted: Mapping[str, AdaptiveStudy] = field(default_factory=dict)
    round_trip: float | None = None

    @property
    def page(self) -> Path:
        """The page with tables and pictures."""
        return self.folder / "report.html"

    def to_dict(self) -> dict[str, Any]:
        """All results but the recordings, as plain values for JSON."""
        return {
            "flown_on": self.vehicle,
            "axes": {study.axis.name: study.to_dict() for study in self.studies},
            "adaptive": {name: study.to_dict() for name, study in self.adapted.items()},
            "round_trip": self.round_trip,
            "report": self.page,
            "folder": self.folder,
        }

    def write(self) -> None:
        """Write the numbers, ``result.json``, and the page into the folder."""
        text = json_text("flight", self.to_dict())
        (self.folder / "result.json").write_text(text + "\n", encoding="utf-8")
        write_flight_page(self.studies, self.page, self.vehicle, self.adapted)


def fly_and_report(
    vehicle: FlownVehicle,
    plans: Sequence[FlightPlan],
    folder: Path,
    adapt: AdaptivePlan | None = None,
    progress: Stages = False,
    warn: Callable[[str], None] = lambda warning: None,
) -> FlightReport:
    """Fly the plans of several axes, learn, fly the designed gains, and write the page about it.

    This is the whole of ``deadtime fly``: `fly_axes`, then `fly_adaptive` on each axis where that
    is asked for, then `write_flight_page`.

    Parameters
    ----------
    vehicle : FlownVehicle
        The vehicle, such as ``FlownVehicle.emulated()``.
    plans : sequence of FlightPlan
        One for each axis.
    folder : Path
        Folder for recordings, page and numbers. It may hold no recordings of flights yet.
    adapt : AdaptivePlan, optional
        What is flown afterwards, on each axis, with gains that follow the delay.
    progress : bool or callable
        Called with the name of each stage as it begins, or True to print the names on stderr.
    warn : callable
        Called with each warning before the designed gains are flown.

    Returns
    -------
    FlightReport

    Raises
    ------
    ValueError
        If the folder holds recordings, and as `fly_axes`.
    MissingExtraError
        If what the page needs is not installed; nothing is flown then.
    OSError, FlightAbortedError, LinkError, NotIdentifiableError, NotProvedError
        As `fly_axes` and `fly_adaptive`. A note on the error names the recordings that are kept.

    Examples
    --------
    >>> from pathlib import Path
    >>> from deadtime.flights import FlightPlan, FlownVehicle, fly_and_report
    >>> found = fly_and_report(FlownVehicle.emulated(), [FlightPlan()], Path("flight"))
    ... # doctest: +SKIP
    >>> print(found.studies[0].headline(), found.page)  # doctest: +SKIP
    """
    check_pages()
    if any(folder.glob("flight-*.csv")):
        raise ValueError(f"{folder} contains recordings already: give another folder")
    report = stage_report(progress)
    connect, run, moving = vehicle.connect, vehicle.run, vehicle.moving
    try:
        studies = fly_axes(connect, plans, folder, report, run, warn)
        adapted: dict[str, AdaptiveStudy] = {
            study.axis.name: fly_adaptive(connect, study, adapt, folder, report, run, moving)
            for study in studies
            if adapt is not None
        }
    except BaseException as error:
        if kept := sorted(path.name for path in folder.glob("flight-*.csv")):
            error.add_note(f"kept in {folder}: {', '.join(kept)}")
        raise
    found = FlightReport(vehicle.name, tuple(studies), folder, adapted, vehicle.round_trip())
    found.write()
    return found
