"""
Choose the filter of the derivative
===================================

Differences of a measured height give a velocity, but they amplify the noise. A filter removes
noise, but adds lag. ``design_filter`` finds the lowest corner frequency at which the decay rate
is at most a tenth smaller than without a filter.
"""

import deadtime as dtm
import matplotlib.pyplot as plt

loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.1), delay=0.36)
choice = dtm.design_filter(loop, fixed={"Kp": 2.0})
print(choice.summary())

fig, axes = plt.subplots(2, sharex=True, layout="constrained")
axes[0].semilogx(choice.omegas, -choice.values, ".-")
axes[0].axhline(-choice.ideal.value, color="gray", linestyle=":", label="without a filter")
axes[0].set(ylabel="decay rate (1/s)", title="The price of a filter")
axes[0].margins(y=0.15)
axes[0].legend(loc="lower right")
axes[1].loglog(choice.omegas, choice.noise_gains, ".-")
axes[1].set(
    xlabel="corner frequency (rad/s)", ylabel="noise of the command\nper noise of the height"
)
axes[1].set_yticks([2, 5, 10, 20], ["2", "5", "10", "20"])
axes[1].minorticks_off()
for ax in axes:
    ax.axvline(choice.omega, color="tab:red", linewidth=0.8)
