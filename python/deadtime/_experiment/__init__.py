"""From a loop to gains: a recording that is there already, or one that is flown for it.

`study` works on a recording; `fly`, imported by its own name because it needs links, makes its own.
"""

from deadtime._experiment.study import DemoFlight, Study, demo_flight, study

__all__ = ["DemoFlight", "Study", "demo_flight", "study"]
