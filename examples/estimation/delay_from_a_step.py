"""
The delay from a recorded step
==============================

The script simulates a step of a height loop with noise of 5 mm. The script then estimates the
delay by maximum likelihood, with an interval. The verdict states whether the model explains the
recording. If the verdict is an indication, the interval may not contain the true value.
"""

import deadtime as dtm

truth = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(2.4), delay=0.3, sample_time=0.065, limit=1.0)
flight = dtm.Experiment.step(8.0, rest=1.04).run(truth, noise=0.005, seed=3)

known = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.4), sample_time=0.065, limit=1.0)
fit = dtm.estimate_delay(flight, known, free=("delay", "gain"))
low, high = fit.ci(0.95)
print(f"{fit.verdict}: delay {fit.delay:.4f} s, 95 %: {low:.4f} to {high:.4f} s")
fit.plot()
