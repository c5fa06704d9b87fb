"""
Which gains are stable
======================

The loop has a proportional gain, a velocity gain and a delay of 0.36 s. Every cell of the map is
proved, because all crossings of the imaginary axis are found along each row. Each boundary states
the frequency at which the loop oscillates on it. The best cell has the fastest decay.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
from deadtime import delay, s

Kp, Kv = dtm.parameters("Kp Kv")
family = s + (Kp + Kv * s) * delay(0.36)
chart = dtm.stability_map(family, {"Kp": (0.01, 6), "Kv": (-0.9, 0.9)}, shape=(301, 181))
best, abscissa = chart.best()
print(f"fastest decay: {-abscissa:.2f} per second at Kp = {best['Kp']:.2f}, Kv = {best['Kv']:.2f}")

fig, ax = plt.subplots(layout="constrained")
chart.plot(ax=ax, chosen=best)
ax.set(xlabel="Kp (1/s)", title="Stable gains with 0.36 s of delay")
