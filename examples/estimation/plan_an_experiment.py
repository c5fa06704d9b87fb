"""
What an experiment will show
============================

The Cramér-Rao bound can be computed before an experiment. The bound is the smallest standard
error that any unbiased method can reach. In wind, a longer recording after one step adds no
information. With a pseudo-random square wave, every second adds information.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
from deadtime.experiments import FlightNoise

guess = dtm.ControlLoop(
    dtm.Integrator(1.0, lag=0.06), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0
)
wind = FlightNoise(white=0.01, air=0.1, air_time=1.0)
durations = (5.0, 10.0, 20.0, 40.0)
experiments = {
    "step": dtm.Experiment.step,
    "PRBS": lambda duration: dtm.Experiment.prbs(duration, 0.4, hold=0.4),
}

fig, ax = plt.subplots(layout="constrained")
for name, experiment in experiments.items():
    plans = [dtm.identifiability(guess, experiment(time), noise=wind) for time in durations]
    errors = [1e3 * plan.stderr["delay+lag"] for plan in plans]
    print(f"{name} of 20 s: {errors[2]:.1f} ms")
    ax.plot(durations, errors, "o-", label=name)
ax.set(xscale="log", yscale="log", xlabel="duration (s)", ylabel="bound on delay and lag (ms)")
ax.set_xticks(durations, [f"{time:g}" for time in durations])
ax.set_yticks([2, 5, 10, 20], ["2", "5", "10", "20"])
ax.minorticks_off()
ax.set_title("Smallest standard error in gusts")
ax.legend()
