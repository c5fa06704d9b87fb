"""
Wind-up and its cure
====================

A valve opens from 0 to 100 %, and the controller asks for more. While the valve is at its limit the
integral of a PI controller grows, and the level overshoots until it has shrunk again. With
back-calculation the integral follows the valve, and the overshoot is gone.
"""

from dataclasses import replace

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

tank = dtm.Integrator(gain=0.02)
plain = dtm.PI(Kp=2.0, Ki=0.02)
fig, (level, valve) = plt.subplots(2, 1, sharex=True, layout="constrained")
time = np.linspace(0.0, 600.0, 1201)
for label, controller in (
    ("without", plain),
    ("back-calculation", replace(plain, anti_windup=100.0)),
    ("conditional integration", replace(plain, anti_windup=dtm.loops.ConditionalIntegration())),
):
    loop = dtm.ControlLoop(tank, controller, delay=8.0, limit=(-20.0, 20.0))
    response = loop.simulate(time, 60.0)
    print(f"{label}: {response.info()['overshoot']:.0f} % overshoot")
    level.plot(time, response.outputs, label=label)
    valve.plot(time, response.inputs, label=label)
level.set(ylabel="level (%)", title="A level moves by 60 %")
valve.set(xlabel="time (s)", ylabel="valve (%)")
level.legend()
