"""An integrator controlled over the Internet: runs, estimates of the delay, replayed steps."""

from deadtime.internet._loop import GAINS as GAINS, run_internet_loop
from deadtime.internet._plots import plot_internet_loop as plot_internet_loop
from deadtime.internet._result import (
    COLUMNS as COLUMNS,
    InternetLoop,
    InternetRun,
    in_ms as in_ms,
)
from deadtime.internet._spread import Spread

__all__ = ["InternetLoop", "InternetRun", "Spread", "run_internet_loop"]
