"""
A lag that is taken for delay
=============================

The vehicle has a lag of 0.1 s. If the model has no lag, the estimated delay includes the lag, and
the estimate is an indication, because the residuals are not white. If the lag is fitted, too,
delay and lag are both right, and their sum is the most accurate.
"""

import deadtime as dtm
import matplotlib.pyplot as plt

truth = dtm.ControlLoop(
    dtm.Integrator(0.9, lag=0.1), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
)
flight = dtm.Experiment.step(8.0, rest=1.04).run(truth, noise=0.002, seed=2)
known = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), sample_time=0.065, limit=1.0)

fig, ax = plt.subplots(layout="constrained")
for free in (("delay", "gain"), ("delay", "gain", "lag")):
    fit = dtm.estimate_delay(flight, known, free=free)
    low, high = fit.ci(0.95)
    print(
        f"free {', '.join(free)}: delay {fit.delay:.3f} s ({low:.3f} to {high:.3f}), {fit.verdict}"
    )
    ax.plot(flight.time, 1e3 * fit.residuals, ".-", label=f"{', '.join(free)}: {fit.verdict}")
ax.set(
    xlabel="time (s)",
    ylabel="residual (mm)",
    title="Residuals of two models, the true delay is 0.3 s",
)
ax.legend()
