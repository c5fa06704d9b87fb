"""What is run on a loop to learn it: steps, square waves, PRBS, multisines, relay; and noise."""

from deadtime.experiments._experiment import Experiment
from deadtime.experiments._noise import DisturbanceModel, FlightNoise, Noise, NoiseModel
from deadtime.experiments._noise_in_loop import check_reads_samples as check_reads_samples
from deadtime.experiments._random_process import RandomProcess as RandomProcess

__all__ = ["DisturbanceModel", "Experiment", "FlightNoise", "Noise", "NoiseModel"]
