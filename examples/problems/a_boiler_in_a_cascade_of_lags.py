"""
A boiler: many lags, and the rules of thumb
===========================================

The steam of a boiler answers its burner through four equal lags. No plant with a dead time is that
boiler, and an estimate has to say how far off it may be. Here a bump test is made, the plant is
estimated from it, and the gains are tried on the true boiler.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

s = dtm.s
boiler = 1.5 / (15.0 * s + 1.0) ** 4
time = np.arange(900.0)
burner = np.select([time < 100, time < 400, time < 650], [50.0, 55.0, 48.0], 52.0)
pressure = 70.0 + np.ravel(boiler.simulate(time, burner - 50.0).outputs)
pressure += np.random.default_rng(1).normal(0.0, 0.1, time.size)

fit = dtm.estimate_delay(dtm.Recording(time, None, pressure, burner))
print(fit.summary())
best = dtm.design(fit.loop(dtm.PI(1.0, 0.01)), controller=dtm.PI, delay=fit.ci())
print(best.summary())

true = dtm.ControlLoop(boiler, best.loop.controller, delay=0.0)
fig, ax = plt.subplots(layout="constrained")
for label, loop in (("estimated plant", best.loop), ("true boiler", true)):
    response = loop.simulate(np.linspace(0.0, 500.0, 501))
    ax.plot(response.time, response.outputs, label=label)
ax.set(xlabel="time (s)", ylabel="pressure", title="A step of the set point")
ax.legend()
