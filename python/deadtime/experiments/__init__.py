"""What is run on a loop to learn it: steps, square waves, PRBS, multisines, relay; and noise."""

from deadtime.experiments._experiment import Experiment

__all__ = ["Experiment"]
