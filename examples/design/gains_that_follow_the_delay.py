"""
Gains that follow the delay
===========================

``adaptive_gains`` makes a list of sets of gains. Each set is for all delays up to a longest
delay. The list is proved stable while the delay changes and the gains change. ``follow`` chooses
a set from the interval of the delay. ``follow`` changes to a slower set at once, and to a faster
set after a waiting time.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime.tuning import adaptive_gains

vehicle = dtm.ControlLoop(dtm.Integrator(0.885), dtm.P(1.0), sample_time=0.1, limit=1.0)
schedule = adaptive_gains(vehicle, delays=(0.0, 0.6), gain=(0.85, 0.92))
print(schedule.summary())

time = np.arange(0.0, 120.0, 0.1)
delay = np.interp(time, (20.0, 50.0, 70.0, 100.0), (0.1, 0.5, 0.5, 0.1))
follower = schedule.follow()
choices = map(follower.update, time, delay - 0.02, delay + 0.02)
used = [schedule.sets[choice.number] for choice in choices]
longest = [one.delays[1] for one in used]
gains = [one.gains["Kp"] for one in used]

fig, axes = plt.subplots(2, sharex=True, layout="constrained")
axes[0].fill_between(time, delay - 0.02, delay + 0.02, alpha=0.4, label="interval of the delay")
axes[0].step(time, longest, where="post", label="longest delay of the set")
axes[0].set(ylabel="delay (s)", title="The fastest gains that the delay permits")
axes[0].legend(loc="lower right")
axes[1].step(time, gains, where="post")
axes[1].set(xlabel="time (s)", ylabel="Kp (1/s)", ylim=(0.0, None))
