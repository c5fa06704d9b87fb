"""
Choose gains for an interval of the delay
=========================================

``design`` finds the gains with the shortest settling time in the worst case over an interval of
the delay. The gain margin is at least 2.5 for every delay of the interval. The summary states how
much each requirement worsens the settling time.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

vehicle = dtm.ControlLoop(dtm.Integrator(0.85, 0.1), dtm.P(1.0), sample_time=0.065, limit=1.0)
best = dtm.design(
    vehicle, controller=dtm.PV, delay=(0.2, 0.3), objective="settling_time", gain_margin=2.5
)
print(best.summary())

time = np.linspace(0.0, 4.0, 401)
fig, ax = plt.subplots(layout="constrained")
for value in (0.2, 0.25, 0.3):
    response = best.loop.replace(delay=value).simulate(time, 1.0)
    ax.plot(time, response.outputs, label=f"delay {value:.2f} s")
ax.axhspan(0.98, 1.02, color="gray", alpha=0.2, label="within 2 %")
ax.set(xlabel="time (s)", ylabel="height (m)")
ax.set_title(", ".join(f"{name} = {value:.2f}" for name, value in best.gains.items()))
ax.legend(loc="lower right")
