"""
A heater: which PI gains suit one step of it?
=============================================

**Question.** The heater of a Temperature Control Lab made a step from 0 to 50 %. What is its dead
time, and which PI gains are safe?

**Data.** :download:`tclab_step_test.csv` is from J. Kantor's course CBE30338 (MIT licence). The
file has 801 rows, 1 s apart: time (s), temperature T1 (°C) and heater Q1 (%).

**Answer.** The verdict is an *indication*, so no interval is claimed. Two lags and a dead time of
about 0.25 s explain the record best. But a single lag with a dead time of about 11.4 s is also
possible, because the record has only one step. The gains Kp = 9.51 %/°C and Ki = 0.119 %/(°C s)
are suitable for both plants, with a gain margin of at least 3.2.

**Next.** A second record decides between the two plants. Make steps of the heater up and down at
irregular times, and give the file to this command::

    deadtime tune next.csv --output T1 --command Q1
"""

from pathlib import Path

import deadtime as dtm
import matplotlib.pyplot as plt

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
record = dtm.read_recording(here / "tclab_step_test.csv", output="T1", command="Q1")
fits = [
    dtm.estimate_delay(record, at_rest=True, plant=plant, causes=False)
    for plant in ("lag", "two lags")
]
loops = [fit.loop(dtm.PI(Kp=1.0, Ki=0.01)) for fit in fits]
gains = dtm.design(loops[0], controller=dtm.PI, plants=loops[1:])

fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
left.plot(record.time, record.output, color="gray", label="recorded")
for fit, loop, label in zip(fits, loops, ("dead time, one lag", "two lags"), strict=True):
    print(f"{fit.verdict}, {label}: dead time about {fit.delay:.3g} s")
    left.plot(record.time, fit.fitted, lw=1, label=label)
    tuned = loop.replace(controller=gains.loop.controller)
    print(f"gain margin {tuned.margin().gain_margin:.2g}")
    step = tuned.simulate(record.time[:300], 1.0)
    right.plot(step.time, step.outputs, label=label)
named = ", ".join(f"{name} = {value:.3g}" for name, value in gains.gains.items())
print(f"PI for both: {named}")
left.set(xlabel="time (s)", ylabel="temperature (°C)", title="The record and both plants")
right.set(xlabel="time (s)", ylabel="temperature (°C)", title=f"A step of 1 °C under {named}")
for ax in (left, right):
    ax.legend()
