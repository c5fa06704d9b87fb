"""What is run on a loop to learn it: steps, square waves, PRBS, multisines, relay; and noise."""

from deadtime.experiments._experiment import Experiment
from deadtime.experiments._noise import DisturbanceModel, FlightNoise, Noise, NoiseModel

__all__ = ["DisturbanceModel", "Experiment", "FlightNoise", "Noise", "NoiseModel"]
