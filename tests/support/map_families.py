"""Five families of gain maps from the literature of delayed control, for tests."""

import deadtime as dtm
import numpy as np
from deadtime import delay, s

Kp, Kv, Ki, Kd, K1, K2 = dtm.parameters("Kp Kv Ki Kd K1 K2")

#: Delay of the altitude loop, s, and its filtered derivative w^2 s / (s^2 + 2 z w s + w^2).
LAG = 0.36
OMEGA, ZETA = 38.0, 1.0
FILTER = s**2 + 2 * ZETA * OMEGA * s + OMEGA**2

FAMILIES = {
    "velocity": (s + (Kp + Kv * s) * delay(LAG), {"Kp": (0, 6), "Kv": (-1, 1)}),
    "filtered velocity": (
        s * FILTER + (Kp * FILTER + Kv * OMEGA**2 * s) * delay(LAG),
        {"Kp": (0, 6), "Kv": (-1, 1)},
    ),
    "pendulum": (s**2 - 1.0 + (Kp + Kd * s) * delay(0.3), {"Kp": (0, 8), "Kd": (0, 6)}),
    "PI on a lag": (
        s * (2.0 * s + 1) + 1.5 * (Kp * s + Ki) * delay(0.5),
        {"Kp": (-1, 8), "Ki": (0, 8)},
    ),
    "two delays": (s + K1 * delay(0.3) + K2 * delay(1.1), {"K1": (-6, 6), "K2": (-6, 6)}),
}


def assert_roots_on_the_axis(family, curves, stride, tolerance):
    """At every `stride`-th point of the curves the member has a root at j omega."""
    for curve in curves:
        for index in range(0, len(curve), stride):
            values = {key: float(value[index]) for key, value in curve.values.items()}
            h = family.at(**values)
            size = np.abs(h.coefficients).sum() * max(1.0, curve.omega[index]) ** h.degree
            assert abs(h(1j * curve.omega[index])) <= tolerance * size
