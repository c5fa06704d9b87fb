"""What is run on a loop to learn it: steps, square waves, PRBS, multisines, relay; and noise."""

from deadtime.experiments._experiment import Experiment
from deadtime.experiments._noise import Noise, NoiseModel, WhiteNoise

__all__ = ["Experiment", "Noise", "NoiseModel", "WhiteNoise"]
