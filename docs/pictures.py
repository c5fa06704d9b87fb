"""Make the pictures of these pages: ``python docs/pictures.py``.

They are kept beside the pages, so that building the pages needs no run of the package.
"""

from pathlib import Path

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

IMAGES = Path(__file__).parent / "images"


def fixed_steps() -> None:
    """A filtered loop at a step of one sample, by six solvers, beside the exact response."""
    filtered = dtm.PV(Kp=2.0, Kv=0.19, filter=dtm.DerivativeFilter(omega=38.0))
    loop = dtm.ControlLoop(
        dtm.Integrator(), filtered, delay=0.36, limit=1.0, delay_path="measurement"
    )
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for solver in ("ode1", "ode2", "ode3", "ode4", "ode5", "ode8"):
        found = dtm.simulate_fixed_step(loop, 4.0, step=0.065, solver=solver)
        axes.plot(found.time, found.outputs, ".-", linewidth=0.8, markersize=3, label=solver)
    exact = loop.simulate(np.linspace(0.0, 4.0, 801))
    axes.plot(exact.time, exact.outputs, "k", linewidth=1.5, label="exact")
    axes.set(xlabel="time (s)", ylabel="height (m)", ylim=(-0.1, 1.4))
    axes.set_title("One loop, steps of 0.065 s, six solvers")
    axes.legend(ncols=2)
    figure.savefig(IMAGES / "fixed-steps.png", dpi=110)


def mackey_glass() -> None:
    """The chaotic attractor of Mackey and Glass, against its own past."""
    found = dtm.solve_dde(
        lambda t, y, z: 0.2 * z[0] / (1 + z[0] ** 10) - 0.1 * y,
        (0.0, 500.0),
        0.5,
        [17.0],
        rtol=1e-9,
        vectorized=True,
        dense_output=True,
    )
    times = np.linspace(150.0, 500.0, 7001)
    now, before = found.sol(times)[0], found.sol(times - 17.0)[0]
    figure, axes = plt.subplots(figsize=(5.0, 4.0), layout="constrained")
    axes.plot(now, before, linewidth=0.8)
    axes.set(xlabel="y(t)", ylabel="y(t - 17 s)")
    figure.savefig(IMAGES / "mackey-glass.png", dpi=100)


def designing() -> None:
    """A design for an interval of the delay, what the middle alone would do, and a filter."""
    vehicle = dtm.ControlLoop(
        dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.25, sample_time=0.065, limit=1.0
    )
    smooth = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
    interval = (0.2, 0.3)
    best = dtm.design(
        vehicle, controller=smooth, delay=interval, objective="settling_time", gain_margin=3.0
    )
    best.plot().savefig(IMAGES / "designing-plot.png", dpi=80)

    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    delays = np.linspace(0.15, 0.35, 81)
    middle = dtm.design(vehicle, controller=smooth)
    worst = dtm.design(vehicle, controller=smooth, delay=interval)
    for found, label in ((middle, "for 0.25 s alone"), (worst, "for 0.2 to 0.3 s")):
        gains = ", ".join(f"{name} {value:.3g}" for name, value in found.gains.items())
        abscissas = [found.loop.replace(delay=late).spectral_abscissa() for late in delays]
        axes.plot(delays, abscissas, linewidth=1.6, label=f"{label}: {gains}")
    axes.axvspan(*interval, color="0.92", zorder=0)
    axes.set(xlabel="delay (s)", ylabel="spectral abscissa (1/s)")
    axes.set_title("The most stable gains, for one delay and for the worst of an interval")
    axes.legend(frameon=False)
    figure.savefig(IMAGES / "designing-interval.png", dpi=100)

    paper = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
    choice = dtm.design_filter(paper, fixed={"Kp": 2.0})
    choice.plot().savefig(IMAGES / "designing-filter.png", dpi=80)
    for one in (best, middle, worst, choice):
        print(one.summary(), end="\n\n")


if __name__ == "__main__":
    designing()
    fixed_steps()
    mackey_glass()
