"""
How roots move as the delay grows
=================================

The picture is a root locus over the delay. Roots come from the far left, and one pair after the
other crosses the imaginary axis. ``crossings`` gives every delay at which a pair crosses, without
a grid.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime import delay, s

(T,) = dtm.parameters("T")
h = s + 2.0 * delay(T)
found = dtm.crossings(h, {"T": (0.05, 5.0)})
print("a pair becomes unstable at", np.round(found.values, 4), "s")

fig, ax = plt.subplots(layout="constrained")
for value in np.geomspace(0.05, 5.0, 150):
    roots = np.array(h.at(T=value).roots(re=(-6, 2), im=(0, 8)))
    points = ax.scatter(roots.real, roots.imag, 6, np.full(roots.size, value), vmin=0, vmax=5)
ax.plot(np.zeros(found.omega.size), found.omega, "kx", label="crossings")
ax.axvline(0.0, color="gray", linewidth=0.8)
ax.set(xlabel="Re s (1/s)", ylabel="Im s (rad/s)", title="Roots of s + 2 exp(-T s)")
ax.legend(loc="upper left")
fig.colorbar(points, label="delay T (s)")
