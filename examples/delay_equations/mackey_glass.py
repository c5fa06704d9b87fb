"""
Chaos of Mackey and Glass
=========================

The number of blood cells depends on their number 17 days ago. ``solve_dde`` takes the right-hand
side as SciPy takes that of an equation without delays. ``dense_output`` gives the solution
between the steps.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np


def blood(t, y, z):
    """The rate of change: y now, z[0] 17 days ago."""
    return 0.2 * z[0] / (1 + z[0] ** 10) - 0.1 * y


found = dtm.solve_dde(
    blood, (0, 600), history=0.5, delays=[17.0], rtol=1e-9, vectorized=True, dense_output=True
)
print(f"{found.n_elements} polynomials, y(600) = {found.y[0, -1]:.6f}")

times = np.linspace(150.0, 600.0, 9001)
fig, ax = plt.subplots(layout="constrained")
ax.plot(found.sol(times)[0], found.sol(times - 17.0)[0], linewidth=0.8)
ax.set(xlabel="y(t)", ylabel="y(t - 17)", title="The attractor")
