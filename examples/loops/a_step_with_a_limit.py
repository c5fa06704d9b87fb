"""
A step with a limit on the command
==================================

A height loop has 0.36 s of delay. The command of the loop is held for 65 ms and limited to 1 m/s.
Velocity feedback removes the overshoot. The simulation is exact to rounding, because the command
is limited at the exact time when it reaches its limit.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

plain = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065, limit=1.0)
damped = plain.replace(controller=dtm.PV(Kp=2.0, Kv=0.3))
time = np.linspace(0.0, 6.0, 601)

fig, axes = plt.subplots(2, sharex=True, layout="constrained")
for label, loop in (("P, Kp = 2", plain), ("PV, Kp = 2, Kv = 0.3", damped)):
    response = loop.simulate(time, 1.0)
    info = response.info()
    print(f"{label}: overshoot {info['overshoot']:.1f} %, settles in {info['settling_time']:.2f} s")
    axes[0].plot(time, response.outputs, label=label)
    axes[1].plot(time, response.inputs)
axes[0].set(ylabel="height (m)", title="A step of 1 m")
axes[0].legend()
axes[1].set(xlabel="time (s)", ylabel="command (m/s)")
