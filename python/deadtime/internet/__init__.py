"""An integrator controlled over the Internet: runs, estimates of the delay, replayed steps."""

from deadtime.internet._loop import GAINS as GAINS, run_internet_loop
from deadtime.internet._plots import LABELS as LABELS, plot_internet_loop as plot_internet_loop
from deadtime.internet._result import InternetLoop, InternetRun, Spread

__all__ = ["InternetLoop", "InternetRun", "Spread", "run_internet_loop"]
