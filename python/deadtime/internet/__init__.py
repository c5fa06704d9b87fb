"""An integrator controlled over the Internet: runs, estimates of the delay, replayed steps."""

from deadtime.internet._loop import run_internet_loop
from deadtime.internet._result import InternetLoop, InternetRun, Spread

__all__ = ["InternetLoop", "InternetRun", "Spread", "run_internet_loop"]
