"""Make the pictures of these pages: ``python docs/pictures.py``.

They are kept beside the pages, so that building the pages needs no run of the package.
"""

from pathlib import Path

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime import paper

IMAGES = Path(__file__).parent / "images"
NUMBERS = Path(__file__).parent / "reproduction-numbers.md"


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


def reproduction() -> None:
    """The figures of the reproduced paper, and the table of its numbers."""
    found = paper.reproduce()
    for name, figure in found.figures().items():
        figure.savefig(IMAGES / f"paper-{name}.png", dpi=75)
    lines = [found.summary(), ""]
    for name, part in found.parts.items():
        if part.comparisons:
            lines += [
                f"**{paper.TITLES[name]}**",
                "",
                "| where | what | printed | ours | verdict |",
            ]
            lines += ["|---|---|---|---|---|"]
            lines += [
                f"| {one.where} | {one.quantity} | {one.printed} | {one.shown} | {one.told} |"
                for one in part.comparisons
            ]
            lines += [""]
    NUMBERS.write_text("\n".join(lines).replace("<", "&lt;"), encoding="utf-8")


if __name__ == "__main__":
    fixed_steps()
    mackey_glass()
    reproduction()
