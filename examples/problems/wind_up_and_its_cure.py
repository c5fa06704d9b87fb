"""
A valve at its limit: what cures wind-up?
=========================================

**Question.** A controller requests more than its valve can give, and the level overshoots by more
than half. Which remedy removes the overshoot?

**Data.** The script needs no data, because the loop is known. The valve moves the level by 0.02
%/s for each per cent, and is limited to ± 20 % from rest. The dead time is 7 to 9 s.

**Answer.** The results are exact for each dead time, so their range replaces an interval. With a
plain PI controller, the integral grows while the valve is at its limit, and the level overshoots
by 58 to 60 %. With back-calculation the overshoot is 11 to 12 % for a tracking time of 100 s, and
0 % for 30 s. With conditional integration, the overshoot is 2 %, and the level settles first, in
217 to 224 s. While the valve is not at its limit, all four loops are the same and proved stable.

**Next.** Move the gains and the dead time of this loop by hand::

    deadtime explore --kp 2 --ki 0.02 --gain 0.02 --delay 8 --limit 20
"""

from dataclasses import replace

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

tank = dtm.Integrator(gain=0.02)
plain = dtm.PI(Kp=2.0, Ki=0.02)
conditional = dtm.loops.ConditionalIntegration()
time = np.linspace(0.0, 900.0, 1801)
fig, (level, valve) = plt.subplots(2, 1, sharex=True, layout="constrained")
for label, controller in (
    ("no cure", plain),
    ("back-calculation, 100 s", replace(plain, anti_windup=100.0)),
    ("back-calculation, 30 s", replace(plain, anti_windup=30.0)),
    ("conditional integration", replace(plain, anti_windup=conditional)),
):
    found = []
    for dead_time in (7.0, 9.0, 8.0):
        loop = dtm.ControlLoop(tank, controller, delay=dead_time, limit=(-20.0, 20.0))
        response = loop.simulate(time, 60.0)
        found.append([response.info()[name] for name in ("overshoot", "settling_time")])
    (low, early), (high, late) = np.min(found, axis=0), np.max(found, axis=0)
    stable = "proved stable" if loop.replace(limit=None).is_stable() else "unstable"
    print(f"{label}: overshoot {low:.0f} to {high:.0f} %, settles in {early:.0f} to {late:.0f} s")
    print(f"  away from the limit: {stable}")
    level.plot(time, response.outputs, label=label)
    valve.plot(time, response.inputs, label=label)
level.axhline(60.0, color="gray", lw=0.5)
level.set(ylabel="level (%)", title="A level moves by 60 %, at 8 s of dead time")
valve.set(xlabel="time (s)", ylabel="valve (%)")
level.legend()
