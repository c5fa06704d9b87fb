"""
A longer delay can stabilise
============================

A longer delay is not always worse. The oscillator of this example is stable for several separate
ranges of the delay. ``crossings`` lists the exact ends of the stable ranges. The spectral abscissa
between the ends confirms the ranges.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime import delay, s

(T,) = dtm.parameters("T")
h = s**2 + 0.3 * s + 4 + 0.9 * delay(T)
found = dtm.crossings(h, {"T": (0, 12)})
windows = found.stable_ranges
print("stable for", ", ".join(f"{low:.3f} to {high:.3f} s" for low, high in windows))

delays = np.linspace(0.0, 12.0, 241)
abscissae = [h.at(T=value).spectral_abscissa() for value in delays]
fig, ax = plt.subplots(layout="constrained")
for low, high in windows:
    ax.axvspan(low, high, color="tab:green", alpha=0.2, linewidth=0)
ax.plot(delays, abscissae)
ax.axhline(0.0, color="black", linewidth=0.8)
ax.set(xlabel="delay (s)", ylabel="spectral abscissa (1/s)")
ax.set_title("Stable where the abscissa is negative (shaded)")
