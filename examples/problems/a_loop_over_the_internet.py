r"""
An Internet loop: can one step measure a delay that varies?
===========================================================

**Question.** Packets between plant and controller take 50 ± 10 ms in each direction. Does the
step response show the mean delay of the loop?

**Data.** The script simulates each step packet by packet: time (s), reference and output, 601
rows, 10 ms apart, with noise of 0.01. The packets contain their times, so the true delay is
measured.

**Answer.** Without a buffer, the step response does not show the mean delay. The steps give
delays from 90 to 103 ms. All intervals (95 %) but one do not contain the mean of 94 to 97 ms. The
verdict, *reliable* or *indication*, applies only to the few packets of the step. A buffer applies
each command 160 ms after its measurement, so that the delay is constant. With the buffer, every
verdict is *reliable*, and the intervals lie within 159.5 to 160.3 ms.

**Next.** Choose the age at which the buffer applies a command. The age must be long enough for
almost all packets of your network, but no longer. Compare the buffer with other policies::

    deadtime internet-loop --virtual-time --gain 6 --delays normal --jitter 0.01 \
        --policy jitter-buffer --policy-number 0.16
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime.links import virtual_time
from deadtime.links.udp import JitterBuffer, Network, Normal, Trial, run_trial

way = Network(delay=Normal(0.05, 0.01))
model = dtm.ControlLoop(dtm.Integrator(), dtm.P(6.0), sample_time=0.01, limit=20.0)
fig, ax = plt.subplots(layout="constrained")
for label, options in (("as they come", {}), ("buffer", {"policy": JitterBuffer(0.16)})):
    for seed in range(1, 7):
        trial = Trial(gain=6.0, forward_path=way, return_path=way, seed=seed, **options)
        plant = virtual_time.run(run_trial(trial)).plant
        run = plant.recording
        noise = np.random.default_rng(seed).normal(0.0, 0.01, run.time.size)
        fit = dtm.estimate_delay(dtm.Recording(run.time, run.reference, run.output + noise), model)
        low, high = (1e3 * end for end in fit.ci())
        true = 1e3 * plant.age - 5.0  # the hold is in the model, and not in its delay
        print(
            f"{label}, {fit.verdict}: {1e3 * fit.delay:.1f} ms ({low:.1f} to {high:.1f} ms), "
            f"mean {true:.1f} ms"
        )
        row, color = (seed, "C0") if label == "buffer" else (seed + 7, "C1")
        ax.plot([low, high], [row, row], color, lw=5, solid_capstyle="butt")
        ax.plot(true, row, "k|", ms=12)
ax.plot([], [], "C1", lw=5, label="interval of one step, packets as they come")
ax.plot([], [], "C0", lw=5, label="interval of one step, with the buffer")
ax.plot([], [], "k|", ms=12, label="mean delay by the packets' times")
ax.set(xlabel="delay (ms)", yticks=[], title="Twelve steps over a network with jitter")
ax.legend(loc="center")
