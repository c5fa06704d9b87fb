"""The experiment with a vehicle: fly steps, estimate the delay, design gains, fly these."""

from deadtime.flights._adaptive import AdaptivePlan, AdaptiveStudy, fly_adaptive
from deadtime.flights._fly import fly_axes, fly_experiment
from deadtime.flights._moving_delay import MovingDelay
from deadtime.flights._page import PARTS as PARTS, write_flight_page
from deadtime.flights._plan import USUAL as USUAL, FlightPlan
from deadtime.flights._report import FlightReport, fly_and_report
from deadtime.flights._runs import FlownSteps
from deadtime.flights._study import COLUMNS as COLUMNS, FlightStudy
from deadtime.flights._vehicles import FlownVehicle

__all__ = [
    "AdaptivePlan",
    "AdaptiveStudy",
    "FlightPlan",
    "FlightReport",
    "FlightStudy",
    "FlownSteps",
    "FlownVehicle",
    "MovingDelay",
    "fly_adaptive",
    "fly_and_report",
    "fly_axes",
    "fly_experiment",
    "write_flight_page",
]
