"""
Every root of a region
======================

The characteristic function of a loop with a delay has infinitely many roots. ``roots`` finds all
roots in a rectangle. First ``roots`` proves the number of roots, and the sum of the found
multiplicities must equal this number. Far from the origin, the roots of this loop follow a law,
which ``chains`` gives.
"""

from deadtime import delay, s

h = s + 2.0 * delay(0.36)  # an integrator with gain 2 and a delay of 0.36 s
roots = h.roots(re=(-15, 2), im=(-200, 200))
print(f"{len(roots)} roots, {roots.counted} were proved to be there")
print(f"rightmost: {h.rightmost()[0]:.6f}")

ax = roots.plot(chains=h.chains())
ax.set_title("All roots of s + 2 exp(-0.36 s) in a rectangle")
