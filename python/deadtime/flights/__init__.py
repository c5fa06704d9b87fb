"""The experiment with a vehicle: fly steps, estimate the delay, design gains, fly these."""

from deadtime.flights._fly import FlightPlan, fly_experiment
from deadtime.flights._learn import FlightStudy
from deadtime.flights._page import write_flight_page
from deadtime.flights._runs import FlownSteps

__all__ = ["FlightPlan", "FlightStudy", "FlownSteps", "fly_experiment", "write_flight_page"]
