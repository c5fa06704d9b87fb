"""
Gain, phase and delay margin
============================

The margins follow from the exact frequency response. The delay margin is the largest delay, in
seconds, that can be added before the loop becomes unstable. Compare the delay margin with the
delay of the network or camera that you want to add.
"""

import matplotlib.pyplot as plt
from deadtime import delay, s

L = 2.0 / (s * (0.1 * s + 1)) * delay(0.25)
margin = L.margin()
print(
    f"gain margin {margin.gain_margin:.2f}, phase margin {margin.phase_margin:.1f} degrees, "
    f"delay margin {1e3 * margin.delay_margin:.0f} ms"
)

fig, axes = plt.subplots(2, sharex=True, layout="constrained")
L.bode(margins=True, ax=axes)
fig.suptitle("2 exp(-0.25 s) / (s (0.1 s + 1))")
