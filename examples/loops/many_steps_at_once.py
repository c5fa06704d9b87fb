"""
Thousands of step responses
===========================

``sweep`` simulates a loop for every combination of two of its parameters, as exactly as a single
step response. ``sweep`` returns the metrics of the responses. The picture shows the overshoot
over gain and delay, with the line of 10 %.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.065, limit=1.0)
found = dtm.sweep(loop, {"Kp": (0.5, 3.0, 101), "delay": (0.1, 0.5, 101)}, 20.0)
overshoot = found["overshoot"]
low, high = overshoot.min(), overshoot.max()
print(f"{overshoot.size} steps, overshoot of {low:.0f} to {high:.0f} %")

fig, ax = plt.subplots(layout="constrained")
gains, delays = (np.ravel(found.values[name]) for name in ("Kp", "delay"))
colours = ax.pcolormesh(delays, gains, overshoot, shading="nearest", rasterized=True)
lines = ax.contour(delays, gains, overshoot, [10.0], colors="white")
ax.clabel(lines, fmt="%g %%")
ax.set(xlabel="delay (s)", ylabel="Kp (1/s)", title="Overshoot of a step")
fig.colorbar(colours, label="overshoot (%)")
