"""
Gains for every delay of an interval
====================================

The delay of a real loop is only known to lie in an interval. For each cell, ``robust_map`` proves
that the loop is stable for all delays of the interval, or that it is unstable for some of them.
``largest_stable_box`` finds a rectangle in which all gains are stable.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
from deadtime import delay, s

Kp, Kv, T = dtm.parameters("Kp Kv T")
h = s + (Kp + Kv * s) * delay(T)
ranges, interval = {"Kp": (0.1, 6.0), "Kv": (-0.9, 0.9)}, (0.3, 0.45)
chart = dtm.robust_map(h, ranges, over={"T": interval}, shape=(120, 90))
box = dtm.largest_stable_box(
    h, {**ranges, "T": interval}, around={"Kp": 1.5, "Kv": 0.1, "T": 0.4}, tol=0.01
)
print({name: (round(low, 2), round(high, 2)) for name, (low, high) in box.items()})

fig, ax = plt.subplots(layout="constrained")
chart.plot(ax=ax)
ax.set_xlabel("Kp (1/s)")
(left, right), (bottom, top) = box["Kp"], box["Kv"]
ax.add_patch(plt.Rectangle((left, bottom), right - left, top - bottom, fill=False, linewidth=2))
fig.suptitle("Gains for all delays from 0.3 to 0.45 s, and a box of them")
