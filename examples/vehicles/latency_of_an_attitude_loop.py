"""
The latency of an attitude loop
===============================

``latency`` takes the log of an autopilot, or a recording. For each loop ``latency`` gives the
time from command to response, with an interval. In this example, the roll angle follows its
setpoint after a dead time of 47 ms and a lag of 80 ms. The time is the mean equivalent delay over
the frequencies at which the roll angle moves. This time is longer than the dead time, and shorter
than the sum of dead time and lag.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

time = np.arange(800) * 0.01
setpoint = np.where(time < 0.3, 0.0, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))))
vehicle = dtm.FactoredPlant([0.08]).transfer_function() * dtm.delay(0.047)
roll = np.ravel(vehicle.simulate(time, setpoint).outputs)
roll = roll + 0.003 * np.random.default_rng(1).standard_normal(time.size)

found = dtm.latency(dtm.Recording(time, setpoint, roll))
print(found.summary())

one = found.loops[0]
late = 0.047 + np.arctan(0.080 * one.frequencies) / one.frequencies
print(f"the truth: {1e3 * late @ one.weights:.2f} ms")

fig, ax = plt.subplots(layout="constrained")
ax.plot(time, np.degrees(roll), label="roll")
ax.plot(time, np.degrees(setpoint), label="setpoint")
ax.set(xlabel="time (s)", ylabel="angle (degrees)", xlim=(0, 4), title="Roll and its setpoint")
ax.legend()
