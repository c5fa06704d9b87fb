"""
What the hold of a sampled loop costs
=====================================

A controller that runs every ``sample_time`` seconds and holds its command is not a continuous
controller. The largest stable gain of a sampled loop becomes smaller with a longer sample time.
As a rule of thumb, the hold has the effect of half a sample of further delay. A model without the
hold gives a limit that is too high at every sample time, which is unsafe.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
times = np.linspace(0.005, 0.5, 100)
limits = np.array([loop.replace(sample_time=time).stable_range("Kp")[1] for time in times])
continuous = loop.stable_range("Kp")[1]
print(f"without the hold {continuous:.3f}, at 65 ms {np.interp(0.065, times, limits):.3f}")

fig, ax = plt.subplots(layout="constrained")
ax.plot(times, limits, label="sampled loop, exact")
ax.plot(times, np.pi / 2 / (0.36 + times / 2), "--", label="half a sample of further delay")
ax.axhline(continuous, color="gray", linestyle=":", label="hold left out")
ax.set(xlabel="sample time (s)", ylabel="largest stable Kp (1/s)", ylim=(0, 5))
ax.set_title("An integrator with 0.36 s of delay")
ax.legend(loc="lower left")
