"""
Jitter, and a buffer against it
===============================

An integrator is controlled over a simulated network whose packets take 50 ± 10 ms each way.
Applied as they come, commands have every age; a buffer applies each when it is 160 ms old. Then
the delay is one number that a design can rely on, but a longer one: at the same gain the step
overshoots more. The clock is virtual, so that 6 s take a moment.
"""

import matplotlib.pyplot as plt
from deadtime.links import virtual_time
from deadtime.links.udp import JitterBuffer, Network, Normal, Trial, run_trial

way = Network(delay=Normal(0.05, 0.01))
fig, ax = plt.subplots(layout="constrained")
for label, options in (("as they come", {}), ("buffer", {"policy": JitterBuffer(0.16)})):
    trial = Trial(gain=6.0, forward_path=way, return_path=way, seed=1, **options)
    plant = virtual_time.run(run_trial(trial)).plant
    age = plant.age_when_applied
    print(
        f"{label}: half of the commands are older than {1e3 * age.p50:.0f} ms, "
        f"the oldest {1e3 * age.largest:.0f} ms"
    )
    ax.plot(plant.recording.time, plant.recording.output, label=label)
ax.plot(plant.recording.time, plant.recording.reference, color="gray", label="reference")
ax.set(xlabel="time (s)", ylabel="output", title="A step over a network")
ax.legend()
