"""
A drone: how long is the delay of its height loop?
==================================================

**Question.** A computer controls the height of a drone over Wi-Fi. How long is the delay of the
loop? Up to which gain is the loop stable? Which gains settle faster?

**Data.** The paper of S. Armah and S. Yi (2017) states the loop: Kp = 1.31, a command every 65
ms, at most 1 m/s, and an overshoot of 2.30 %. The paper has no record of the flight. The first
lines of the script simulate a similar record: time (s), reference (m) and height (m), with 0.36 s
of delay and 2 cm of noise.

**Answer.** From the overshoot alone, the formula of the paper gives a delay of 0.360 s. A
simulation with the limit of the speed gives 0.369 s. Neither number has an interval. The whole
record gives 0.358 s (95 %: 0.349 to 0.367 s), and the verdict is *reliable*. With a delay of
0.367 s, P control is stable up to a gain of 3.96. PV control (proportional plus velocity
feedback) with Kp = 1.84 and Kv = 0.227 settles in 1.5 s instead of 2.5 s.

**Next.** Fly the whole experiment on the emulated drone::

    deadtime fly --virtual-time --plant real --folder flight
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime import paper

loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), sample_time=0.065, limit=1.0)
time = np.arange(0.0, 12.0, 0.065)
reference = np.where(time < 1.0, 0.0, 1.0)
height = loop.replace(delay=0.36).simulate(time, reference).outputs
height = height + np.random.default_rng(1).normal(0.0, 0.02, time.size)

limited = loop.continuous()
print(f"formula of the paper: {paper.delay_by_dominant_root(1.31, 0.023):.3f} s")
print(f"with the limit: {paper.delay_by_simulation(limited, 0.023):.3f} s")
fit = dtm.estimate_delay(dtm.Recording(time, reference, height), loop)
low, high = fit.ci()
print(f"{fit.verdict}: {fit.delay:.3f} s (95 %: {low:.3f} to {high:.3f} s)")
print(f"stable up to Kp = {fit.loop.replace(delay=high).stable_range('Kp')[1]:.3g}")
best = dtm.design(
    fit.loop, controller=dtm.PV, delay=(low, high), objective="settling_time", gain_margin=2.5
)
print(best.summary())

fig, ax = plt.subplots(layout="constrained")
ax.plot(time - 1.0, height, ".", color="gray", label="record under P")
ax.plot(time - 1.0, fit.loop.simulate(time, reference).outputs, label="fitted loop")
for label, controller in (("P", dtm.P(1.31)), ("PV", best.loop.controller)):
    true = loop.replace(delay=0.36, controller=controller)
    step = true.step_response()
    print(f"{label} settles in {step.info()['settling_time']:.1f} s")
ax.plot(step.time, step.outputs, label="designed PV")
ax.set(xlabel="time (s)", ylabel="height (m)", title="A step by 1 m", xlim=(-1.0, 6.0))
ax.legend()
