"""From a loop to gains: by a recording that is there already, or by flights made for it."""

from deadtime._experiment.flights import FlownSteps
from deadtime._experiment.fly import FlightPlan, fly_experiment
from deadtime._experiment.learn import FlightStudy
from deadtime._experiment.study import DemoFlight, Study, demo_flight, study

__all__ = [
    "DemoFlight",
    "FlightPlan",
    "FlightStudy",
    "FlownSteps",
    "Study",
    "demo_flight",
    "fly_experiment",
    "study",
]
