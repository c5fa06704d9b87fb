"""
The delay while flying
======================

The delay of a height loop in gusts jumps from 0.20 to 0.32 s. ``online`` shows the estimate after
each row, from this row and the rows before it. `OnlineEstimator` does the same while the loop
runs. The dotted line shows when the jump was found.
"""

import deadtime as dtm
import numpy as np
from deadtime.estimation import online
from deadtime.experiments import FlightNoise

wind = FlightNoise(white=0.005, air=0.05, air_time=1.0)
flights = []
for delay in (0.20, 0.32):
    loop = dtm.ControlLoop(
        dtm.Integrator(0.85, lag=0.15), dtm.P(1.2), delay=delay, sample_time=0.065, limit=1.0
    )
    flights.append(dtm.Experiment.prbs(40.0, 0.5, 0.8, seed=4).run(loop, noise=wind, seed=7))
first, second = flights
joined = dtm.Recording(
    np.r_[first.time, first.time[-1] + 0.065 + second.time],
    np.r_[first.reference, second.reference],
    np.r_[first.output, second.output - second.output[0] + first.output[-1]],
    np.r_[first.command, second.command],
)

track = online(joined, loop, noise=wind)
print(track.summary())
track.plot()
