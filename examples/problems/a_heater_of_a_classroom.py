"""
A heater of a classroom: one lag or two?
========================================

The Temperature Control Lab is a board with a heater and a sensor. Its heater stepped from 0 to
50 %, and the temperature was recorded for 800 s. Which dead time does it have, and which PI
controller suits it?

One step does not tell a dead time from a second lag: both explain this record. The answer is an
indication that says so. Each plant alone gives gains; those of the plant with the dead time are the
slower ones, and safe for both.

The record is ``tclab_step_test.csv`` of J. Kantor's course CBE30338 (MIT licence), columns Time, T1
and Q1.
"""

from pathlib import Path

import deadtime as dtm
import matplotlib.pyplot as plt

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
record = dtm.read_recording(here / "tclab_step_test.csv", output="T1", command="Q1")
print(dtm.estimate_delay(record, at_rest=True).summary())

fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
left.plot(record.time, record.output, color="gray", label="recorded")
for plant in ("lag", "two lags"):
    fit = dtm.estimate_delay(record, at_rest=True, plant=plant, causes=False)
    left.plot(record.time, fit.fitted, label=fit.best.in_words(), lw=1)
    best = dtm.design(fit.loop(dtm.PI(1.0, 0.01)), controller=dtm.PI, allow_indication=True)
    gains = ", ".join(f"{name} = {value:.3g}" for name, value in best.gains.items())
    print(f"{plant}: {gains}")
    step = best.loop.step_response()
    right.plot(step.time, step.outputs, label=f"{plant}: {gains}")
left.set(xlabel="time (s)", ylabel="temperature (°C)", title="The record and both plants")
right.set(xlabel="time (s)", title="Steps under the gains of each")
for ax in (left, right):
    ax.legend(fontsize="small")
