"""The integrator that is controlled over the Internet: run, replay, estimate."""

from deadtime.internet._loop import run_internet_loop
from deadtime.internet._result import InternetLoop, InternetRun, Spread

__all__ = ["InternetLoop", "InternetRun", "Spread", "run_internet_loop"]
