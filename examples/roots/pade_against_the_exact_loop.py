"""
What a Padé approximation gets wrong
====================================

A Padé approximation of order n replaces the delay by a rational function. The loop then has n + 1
poles instead of infinitely many. The poles close to the origin are right, but the others are
wrong. With the exact loop, no pole is missing.
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime import delay, s
from scipy.special import binom, factorial

gain, T, order = 2.0, 0.36, 3
exact = np.array(dtm.feedback(gain / s * delay(T)).poles(re=(-20, 2), im=(-80, 80)))

k = np.arange(order, -1, -1)  # descending powers of s T
below = binom(order, k) * factorial(2 * order - k) * T**k  # the denominator of Padé's approximation
above = below * (-1.0) ** k
rational = np.roots(np.append(below, 0.0) + np.append(0.0, gain * above))
worst = max(np.abs(exact - root).min() for root in rational)
print(
    f"{rational.size} poles of the approximation, the worst {worst:.1f} from any pole of the loop"
)

fig, ax = plt.subplots(layout="constrained")
ax.plot(exact.real, exact.imag, "o", fillstyle="none", label="exact")
ax.plot(rational.real, rational.imag, "x", label=f"Padé of order {order}")
ax.set(
    xlabel="Re s (1/s)", ylabel="Im s (rad/s)", title="Poles of an integrator with 0.36 s of delay"
)
ax.legend()
