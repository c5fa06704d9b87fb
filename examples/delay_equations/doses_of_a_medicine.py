"""
Doses, and a stop at a threshold
================================

A substance decays at a rate that depends on its level one hour ago. Every 8 hours a dose raises
the level at once, which the argument ``jumps`` describes. The run ends when the level has fallen
to a fifth. This event is marked as ``terminal``. The times of the doses and of the event are
exact.
"""

import deadtime as dtm
import matplotlib.pyplot as plt


def dose(t, y):
    """The level after the dose."""
    return y + 1.0


def low(t, y):
    """Zero where the level is a fifth."""
    return y[0] - 0.2


low.terminal, low.direction = True, -1

found = dtm.solve_dde(
    lambda t, y, z: -0.15 * z[0],
    (0, 60),
    history=1.0,
    delays=1.0,
    jumps=[(8, dose), (16, dose), (24, dose)],
    events=low,
)
print(f"a fifth is reached after {found.t_events[0][0]:.3f} h")

fig, ax = plt.subplots(layout="constrained")
ax.plot(found.t, found.y[0])
ax.axhline(0.2, color="gray", linestyle=":")
ax.set(xlabel="time (h)", ylabel="level", title="Three doses, and the end")
