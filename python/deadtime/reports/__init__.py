"""Pages about one recording: its delay by several methods, and gains for it."""

from deadtime.reports._page import write_report
from deadtime.reports._study import DemoFlight, Study, demo_flight, study

__all__ = ["DemoFlight", "Study", "demo_flight", "study", "write_report"]
