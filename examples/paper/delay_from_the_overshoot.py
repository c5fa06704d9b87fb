"""
The delay from the overshoot
============================

The method of the paper has two steps. An overshoot gives a damping ratio. The damping ratio of
the dominant root of ``s + Kp exp(-s T)`` then gives the delay T, by Lambert W. The formula of the
first step is valid for a system of second order, but a loop with a delay is not such a system.
The exact overshoot shows the error of the formula.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

Kp = 1.31
products = np.linspace(0.4, 1.5, 60)  # Kp times the delay: all that the overshoot depends on
roots = dtm.dde_roots(0.0, -Kp, products / Kp)
damping = -roots.real / np.abs(roots)
formula = 100.0 * np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
exact = [
    dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), delay=value / Kp)
    .step_response()
    .info()["overshoot"]
    for value in products
]
for name, overshoot in (("formula", formula), ("exact", exact)):
    print(f"30 % mean a delay of {np.interp(30.0, overshoot, products) / Kp:.3f} s ({name})")

fig, ax = plt.subplots(layout="constrained")
ax.plot(products, exact, label="exact loop")
ax.plot(products, formula, "--", label="formula of second order")
ax.set(xlabel="Kp times the delay", ylabel="overshoot (%)")
ax.set_title("Overshoot of an integrator with a delay")
ax.legend()
